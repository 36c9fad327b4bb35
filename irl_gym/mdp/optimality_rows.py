"""The rows of equation (4): the expert's action against each other action (Ng & Russell 2000, section 3.1).

    (4)  (P_pi(s) - P_a(s)) V >= 0    for each state s and each action a that the expert does not take
Actions that the expert *does* take, when there are several, have to be equally good: their rows are equalities, or pi
would not be optimal. A row whose action has the same successors as the expert's is 0 >= 0: *trivial*, whatever the reward.
Terminal states have no rows. Axes: S states, A actions, n rows.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp

from irl_gym._typing import Indices, Matrix, Sparse
from irl_gym.checks import any_array
from irl_gym.errors import InvalidParameter
from irl_gym.mdp.policies import as_distribution
from irl_gym.mdp.sampling_error import SamplingError, sampling_error
from irl_gym.mdp.tabular_mdp import TabularMDP, TransitionTable, entry_rows

ROUNDING = 1e-14
SAME_SUCCESSORS = 1e-12  # largest difference between two rows of P that are the same but for rounding


@dataclass(frozen=True, eq=False)
class Comparisons:
    """The expert's successors minus another action's, one row for each state and action compared."""

    rows: Sparse
    """(n, S) P_pi(s) - P_a(s); 0 where that is rounding, or sampling noise."""
    states: np.ndarray
    """(n,) state of each row, increasing."""
    actions: np.ndarray
    """(n,) action of each row."""
    equal: np.ndarray
    """(n,) the expert takes this action too: the row is an equality."""
    distribution: Matrix
    """(S, A) the expert."""
    sampling: SamplingError | None = None
    """What the counts tell of the rows; None where the table is exact."""

    @cached_property
    def trivial(self) -> np.ndarray:
        """(n,) the two actions have the same successors: no reward on states can tell them apart."""
        difference = abs(self.rows)
        return np.asarray(difference.max(axis=1).todense()).ravel() <= SAME_SUCCESSORS

    def pairs(self, rows: Indices, which: np.ndarray) -> np.ndarray:
        """(k, 2) state and action of some rows, where `rows` (S,) says which state of a whole table each state is."""
        return np.stack([rows[self.states[which]], self.actions[which]], axis=1).astype(np.int64)

    @property
    def caveat(self) -> str:
        """What a sentence that no row tells anything has to add on a counted table; nothing on an exact one."""
        if self.sampling is None or not self.sampling.same.any():
            return ""
        count = int(self.sampling.same.sum())
        return f" The table is counted: of {count} actions the counts do not tell that they lead elsewhere; more steps may."


def compare(table: TransitionTable, expert: Any, among: np.ndarray | None = None) -> Comparisons:
    """The rows of (4) for an expert given as (S,) actions, (S, A) probabilities or an (S, A) set of optimal actions.

    Args:
        table: P.
        expert: the policy.
        among: (m,) increasing states whose rows are wanted; None for all.

    Raises:
        InvalidPolicy: wrong shape or content.
    """
    distribution = as_distribution(expert, table.n_states, table.n_actions)
    among = np.arange(table.n_states) if among is None else among
    taken = distribution[among] > 0
    several = taken.sum(axis=1) > 1
    positions, actions = np.nonzero(~table.terminal[among, None] & (~taken | several[:, None]))
    states = among[positions]
    P_pi = sp.csr_array(table.mixing(distribution)[among] @ table.P)
    rows = sp.csr_array(P_pi[positions] - table.P[states * table.n_actions + actions])
    rows.data[np.abs(rows.data) <= ROUNDING] = 0.0  # what both actions share cancels, but for rounding
    sampling = None if table.visits is None else sampling_error(table, distribution, states, actions)
    if sampling is not None:
        rows.data[sampling.same[entry_rows(rows)]] = 0.0
    rows.eliminate_zeros()
    return Comparisons(rows, states, actions, taken[positions, actions], distribution, sampling)


def as_compared(mdp: TabularMDP, comparisons: Comparisons, on_states: bool) -> TabularMDP:
    """The MDP in which actions that the counts do not tell from the expert's lead where its own do: the table itself if exact.

    Args:
        mdp: of which the rows are.
        comparisons: the rows of (4).
        on_states: is a reward on states judged? One on steps may tell such actions apart.
    """
    if comparisons.sampling is None or not on_states or not comparisons.trivial.any():
        return mdp
    same = comparisons.trivial
    pairs = comparisons.states[same] * mdp.n_actions + comparisons.actions[same]
    kept = np.ones(mdp.P.shape[0])
    kept[pairs] = 0.0
    own = sp.csr_array(mdp.mixing(comparisons.distribution)[comparisons.states[same]])
    place = sp.csr_array((np.ones(pairs.size), (pairs, np.arange(pairs.size))), shape=(mdp.P.shape[0], pairs.size))
    P = sp.csr_array((sp.diags_array(kept) + place @ own) @ mdp.P)
    return TabularMDP(P, mdp.gamma, mdp.d0, mdp.visits, mdp.horizon)


def left_out(mdp: TabularMDP, rows: Indices, c: Comparisons, unbreakable: Any) -> np.ndarray:
    """(n,) which rows of (4) are among those given as unbreakable."""
    given = () if unbreakable is None else unbreakable
    pairs = any_array("unbreakable", given, "(u, 2) states and actions", InvalidParameter)
    if pairs.size == 0:
        return np.zeros(c.states.size, dtype=bool)
    shape = np.array([mdp.n_states, mdp.n_actions])
    if pairs.ndim != 2 or pairs.shape[1] != 2 or pairs.dtype.kind not in "iu" or not ((pairs >= 0) & (pairs < shape)).all():
        told = f"{mdp.n_states} states and {mdp.n_actions} actions"
        raise InvalidParameter(f"unbreakable is {pairs.tolist()!r:.60}: expected (u, 2) whole numbers, of {told}.")
    return np.isin(rows[c.states] * mdp.n_actions + c.actions, pairs @ np.array([mdp.n_actions, 1]))
