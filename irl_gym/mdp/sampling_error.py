"""What a counted table can tell of the rows of (4), and what is sampling noise (Ng & Russell 2000, section 3.1).

Row (s, a) of P is then the mean of n(s, a) steps. Two actions with the same successors are counted differently, and a program
that looks for margins finds them in the difference. So each row of (4) has

    a limit      chi^2, for all rows of a table at once with 95 % confidence
    G            twice the log likelihood ratio of "two distributions" against "one": with counts c, c' of n, n' steps
                 G = 2 (sum c ln c + sum c' ln c' - sum (c + c') ln (c + c') - n ln n - n' ln n' + (n + n') ln (n + n'))
    an error     of its margin at any V, also one that was chosen by these counts: z sqrt(sum_b c_b^2 Var_b(V) / n_b), and
                 z^2 / 6 sum_b |c_b| / n_b times the range of V (Bernstein's term), where z^2 is the limit and the row of (4)
                 is sum_b c_b P_b

An action is the *same* as the expert's where G is within the limit; such rows are 0 in `optimality_rows`, as those of equal
successors are. Where even samples without a successor in common would be within it, there are too *few* to tell. Then a
row decides alone: the action is the same unless less than 1 % of equal ones are as far apart, or 10 % where the samples share
no successor; and pairs never visited are left as the rule for such pairs made them. Margins there are within their errors.

The limit is Scheffe's (1953), which holds for all V at once. It has 3 (K - 1) / 2 + 1/2 degrees of freedom for K successors,
where K - 1 would do for many counts of each: of two successors that are two, whose tail exp(-G / 2) holds for any counts
(Chernoff), and of more the tail was never seen above chi^2's (`tests/mdp/test_sampling_error.py`). V is held as computed: that
the counts leave it uncertain as well is not in the error of a margin, but in `value_error`.
Axes: S states, A actions, n rows of (4).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.special import xlogy
from scipy.stats import chi2

from irl_gym._typing import Actions, Matrix, Sparse, Vector
from irl_gym.mdp.tabular_mdp import TransitionTable

CONFIDENCE = 0.95
"""That no row of (4) with the same successors is told apart, and that all errors hold."""
ALONE = {"shared": 0.01, "disjoint": 0.1}
"""Share of rows with the same successors that are told apart where too few steps were seen to decide for all at once."""


@dataclass(frozen=True, eq=False)
class SamplingError:
    """What counts tell of some rows of (4)."""

    table: TransitionTable
    """P and its visits."""
    weights: Sparse
    """(n, S*A) c: row i of (4) is c_i P."""
    limit: np.ndarray
    """(n,) z^2."""
    few: np.ndarray
    """(n,) too few steps to tell any two actions apart."""
    same: np.ndarray
    """(n,) both actions have the same successors, as far as the counts tell."""

    def of_margins(self, V: Vector) -> np.ndarray:
        """(n,) the errors of the margins c P V, all at once; of pairs never visited all that V can make of them."""
        n = np.maximum(_visits(self.table), 1)
        centred = V - V.mean()
        size = sp.csr_array(abs(self.weights))
        spread = np.sqrt(size.power(2) @ (spread_of(self.table, centred) ** 2 / n))
        reach = np.repeat(_ranges(self.table, centred), self.table.n_actions)  # of the state, whichever action leads there
        errors = np.sqrt(self.limit) * spread + self.limit / 6 * (size @ (reach / n))
        return np.where(self.unvisited, size.sum(axis=1) * np.ptp(V), errors)

    @property
    def unvisited(self) -> np.ndarray:
        """(n,) a pair (s, a) of the row was never visited."""
        return abs(self.weights) @ (_visits(self.table) == 0) > 0

    def unsettled(self, margins: np.ndarray, V: Vector, among: np.ndarray, none: np.ndarray) -> tuple[float, np.ndarray]:
        """The largest error of some margins of visited pairs, and (n,) which of them are within their error but above rounding.

        Args:
            margins: (n,) c P V.
            V: (S,).
            among: (n,) rows in question.
            none: (n,) a margin up to this is none.
        """
        errors = self.of_margins(V)
        largest = float(errors[among & ~self.unvisited].max(initial=0.0))
        return largest, among & (margins > none) & (margins <= errors)


ESTIMATED = "a table that is an estimate, with errors unknown"
"""What is judged on a table that is neither exact nor counted."""


def counted_table(error: float | None) -> str:
    """What is judged on a counted table; with the error of its margins where that is known."""
    return "a counted table" + (
        "" if error is None else f", margins within {error:.2g} with 95 % confidence if later values are right"
    )


def estimated_table(table: Mapping[str, Any], reward: Mapping[str, Any]) -> str:
    """What is judged in a run on a table that is not exact, by its records in metrics.json."""
    return counted_table(reward.get("sampling_error")) if table.get("counted") else ESTIMATED


def sampling_error(table: TransitionTable, distribution: Matrix, states: np.ndarray, actions: np.ndarray) -> SamplingError:
    """Compare what an expert does in some states (n,) with an action (n,) each, by the counts of a counted table.

    Args:
        table: with visits.
        distribution: (S, A) the expert; an action that it takes too is compared with its other ones.
        states: (n,) increasing.
        actions: (n,) not the only one that the expert takes there.
    """
    pairs, shape = states * table.n_actions + actions, (states.size, table.P.shape[0])
    taken = sp.csr_array(table.mixing(distribution)[states])
    own = sp.csr_array((np.ones(states.size), pairs, np.arange(states.size + 1)), shape=shape)
    weights = sp.csr_array(taken - own)
    others = sp.csr_array(taken - taken.multiply(own))
    others.eliminate_zeros()
    others = sp.csr_array(sp.diags_array(1 / others.sum(axis=1)) @ others)
    n = _visits(table)
    with np.errstate(divide="ignore"):
        one = sp.csr_array((others.data / n[others.indices], others.indices, others.indptr), shape=shape)
    theirs = 1 / np.asarray(one.max(axis=1).todense()).ravel()  # a mixture is at least as sure as so many steps of it
    mine = n[pairs]
    first = sp.csr_array(sp.diags_array(theirs) @ (others @ table.P))
    second = sp.csr_array(sp.diags_array(mine) @ table.P[pairs])
    both = sp.csr_array(first + second)
    totals = xlogy(theirs + mine, theirs + mine) - xlogy(theirs, theirs) - xlogy(mine, mine)
    G = 2 * (_entropies(first) + _entropies(second) - _entropies(both) + totals)
    cells = np.maximum(np.diff(both.indptr) - 1, 1)
    limit = chi2.isf((1 - CONFIDENCE) / table.P.shape[0], 1.5 * cells + 0.5)
    few = 2 * totals <= limit
    share = np.where(G >= (1 - 1e-9) * 2 * totals, ALONE["disjoint"], ALONE["shared"])
    alone = (chi2.sf(G, cells) >= share) & (theirs > 0) & (mine > 0)
    return SamplingError(table, weights, limit, few, np.where(few, alone, limit >= G))


def not_told(table: TransitionTable, policy: Actions, worth: Vector) -> Matrix:
    """(S, A) how much better than a policy's action (S,) another of the same successors may be, by the counts; else 0.

    Args:
        table: with visits.
        policy: its actions.
        worth: (S,) what arriving in each state is worth.
    """
    found = np.zeros((table.n_states, table.n_actions))
    states, actions = np.nonzero(~table.terminal[:, None] & (np.arange(table.n_actions) != policy[:, None]))
    compared = sampling_error(table, np.eye(table.n_actions)[policy], states, actions)
    found[states, actions] = np.where(compared.same, compared.of_margins(worth), 0.0)
    return found


def spread_of(table: TransitionTable, worth: Vector) -> np.ndarray:
    """(S*A,) standard deviation of what a step of each row arrives at, given what each state is worth (S,)."""
    return np.sqrt(np.maximum(table.P @ worth**2 - (table.P @ worth) ** 2, 0.0))


def _visits(table: TransitionTable) -> np.ndarray:
    """(S*A,) steps of each row."""
    assert table.visits is not None
    return table.visits.ravel().astype(np.float64)


def _entropies(counts: Sparse) -> np.ndarray:
    """(n,) sum c ln c of each row."""
    return sp.csr_array((xlogy(counts.data, counts.data), counts.indices, counts.indptr), shape=counts.shape).sum(axis=1)


def _ranges(table: TransitionTable, V: Vector) -> Vector:
    """(S,) largest less smallest V among the successors of each state; 0 where it has none."""
    bounds = table.P.indptr[:: table.n_actions]
    acting = np.flatnonzero(np.diff(bounds))
    found = np.zeros(table.n_states)
    if acting.size:
        following, begins = V[table.P.indices], bounds[acting]
        found[acting] = np.maximum.reduceat(following, begins) - np.minimum.reduceat(following, begins)
    return found
