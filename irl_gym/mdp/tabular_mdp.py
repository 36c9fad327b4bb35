"""Finite Markov decision processes without a reward.

A `TransitionTable` is what an environment does: P(s' | s, a) and the distribution of the first state. A `TabularMDP` is a
table with a discount, which no environment carries and which is never guessed.

    P        (S*A, S) CSR, row s * A + a is P(. | s, a)
    d0       (S,) distribution of the first state
    visits   (S, A) steps that each row of P was estimated from; None where P is exact
A state is *terminal* when its A rows are zero: the episode ends on arrival, so nothing comes after. This is the only place
that says so. Where every episode ends within H steps, whatever is done, a table has a `horizon`, and gamma may be 1; any table
is made one by `irl_gym.mdp.time_expanded`. Axes: S states, A actions.
"""

from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import breadth_first_order

from irl_gym._typing import Indices, Sparse, StateMask, Vector
from irl_gym.checks import SUM_TOLERANCE, any_array, checked_number, float_array, of_single_precision, shown_sum, sparse_copy
from irl_gym.errors import InvalidDiscount, InvalidMDP, a_type
from irl_gym.mdp.longest_episode import longest_episode
from irl_gym.mdp.policies import as_distribution, policy_array

AS_GOOD_AS_EXACT = 10**9
"""Visits of an exact row in a table of which other rows were counted."""


class TransitionTable:
    """What an environment does: P(s' | s, a) and the first state's distribution. Immutable, picklable.

    Args:
        P: (S*A, S), sparse or dense; row s * A + a sums to 1, or to 0 in a terminal state. Duplicates are added up.
        d0: (S,), the distribution of the first state.
        visits: (S, A) steps that each row of P is the mean of, 0 where a rule made it up; None where P is exact. What the rows
            cannot tell for that is in `irl_gym.mdp.sampling_error`.

    Raises:
        InvalidMDP: naming the first offending state and action.
    """

    def __init__(self, P: Any, d0: Any, visits: Any = None):
        self.P: Sparse = _frozen_csr(P)
        start = float_array("d0", d0, "(S,) probabilities", InvalidMDP)
        if start.ndim == 1:
            start = of_single_precision(start, np.zeros(start.size, dtype=np.int64), 1)[0]
        self.d0: Vector = _frozen(start)
        self.n_states: int = self.P.shape[1]
        _check_start(self.d0, self.n_states)
        if 0 in self.P.shape or self.P.shape[0] % self.n_states:
            raise InvalidMDP(
                f"P has shape {self.P.shape}: expected (S*A, S), {self.n_states} states times the number of actions rows."
            )
        self.n_actions: int = self.P.shape[0] // self.n_states
        self.terminal: StateMask = _frozen(_check_rows(self.P, self.n_states, self.n_actions))
        self.visits: np.ndarray | None = None if visits is None else _checked_visits(visits, (self.n_states, self.n_actions))
        self._complete = True

    def __setattr__(self, name: str, value: Any) -> None:
        if "_complete" in self.__dict__:
            raise AttributeError(f"{type(self).__name__}.{name} cannot be set: tables are immutable. Make a new one.")
        super().__setattr__(name, value)

    @classmethod
    def from_dense(cls, P: Any, *args: Any, **kwargs: Any):
        """Make a table from a dense array of shape (S, A, S); the other arguments are the constructor's."""
        array = float_array("P", P, "(S, A, S) probabilities", InvalidMDP)
        if array.ndim != 3 or array.shape[0] != array.shape[2] or 0 in array.shape:
            raise InvalidMDP(f"P has shape {array.shape}: expected (S, A, S), at least one state and one action.")
        return cls(array.reshape(-1, array.shape[2]), *args, **kwargs)

    def __reduce__(self) -> tuple:
        return type(self), (self.P, self.d0, self.visits)

    def __repr__(self) -> str:
        counts = f"{self.n_states} states, {self.n_actions} actions, {int(self.terminal.sum())} terminal"
        return f"{type(self).__name__}({counts}, {self.P.nnz} transitions)"

    @cached_property
    def reachable(self) -> StateMask:
        """(S,) the states that some policy reaches from d0 with positive probability."""
        starts = np.flatnonzero(self.d0)
        coo = self.P.tocoo()
        rows = np.concatenate([coo.row // self.n_actions, np.full(starts.size, self.n_states)])
        columns = np.concatenate([coo.col, starts])
        size = self.n_states + 1  # one more node that leads to every start
        graph = sp.csr_array((np.ones(rows.size), (rows, columns)), shape=(size, size))
        order = breadth_first_order(graph, self.n_states, return_predecessors=False)
        mask = np.zeros(size, dtype=bool)
        mask[order] = True
        return _frozen(mask[:-1])

    def P_a(self, a: int) -> Sparse:
        """(S, S) transitions under one action everywhere.

        Raises:
            InvalidMDP: an action outside the table.
        """
        if not 0 <= a < self.n_actions:
            raise InvalidMDP(f"action {a}: expected 0 to {self.n_actions - 1}.")
        return sp.csr_array(self.P[a :: self.n_actions])

    def P_pi(self, policy: Any) -> Sparse:
        """(S, S) transitions under a policy: (S,) actions, (S, A) probabilities or (S, A) set (taken uniformly).

        Raises:
            InvalidPolicy: wrong shape or content.
        """
        return sp.csr_array(self.mixing(policy) @ self.P)

    def mixing(self, policy: Any) -> Sparse:
        """(S, S*A) sparse matrix M with M[s, s * A + a] = policy(a | s): M @ P is P_pi, M @ R.ravel() is R_pi."""
        array = policy_array(policy)
        if array.dtype.kind in "iu" and array.shape == (self.n_states,) and self.n_states:
            if array.min() >= 0 and array.max() < self.n_actions:  # the common case, without an (S, A) array
                columns = np.arange(self.n_states) * self.n_actions + array
                data, pointers = np.ones(self.n_states), np.arange(self.n_states + 1)
                return sp.csr_array((data, columns, pointers), shape=(self.n_states, self.P.shape[0]))
        probabilities = as_distribution(policy, self.n_states, self.n_actions)
        s, a = np.nonzero(probabilities)
        shape = (self.n_states, self.P.shape[0])
        return sp.csr_array((probabilities[s, a], (s, s * self.n_actions + a)), shape=shape)


class TabularMDP(TransitionTable):
    """A finite MDP without reward: a transition table and a discount. Immutable, picklable.

    Args:
        P: (S*A, S), sparse or dense; row s * A + a sums to 1, or to 0 in a terminal state.
        gamma: discount, strictly between 0 and 1; or 1, where there is a horizon.
        d0: (S,), the distribution of the first state.
        visits: (S, A) steps that each row of P is the mean of; None where P is exact.
        horizon: H, steps within which every episode ends in P itself, which is checked; None for no such bound. An episode that
            is cut from outside after H steps is one of another table: `irl_gym.mdp.time_expanded.time_expanded(table, H)`.

    Raises:
        InvalidMDP: naming the first offending state and action; or an episode can be longer than the horizon.
        InvalidDiscount: gamma outside (0, 1), or 1 without a horizon.
        InvalidParameter: a horizon that is no whole number of at least 1.
    """

    def __init__(self, P: Any, gamma: float, d0: Any, visits: Any = None, horizon: int | None = None):
        self.horizon: int | None = None if horizon is None else checked_horizon(horizon)
        self.gamma: float = check_discount(gamma, horizon, takes_horizon=True)
        super().__init__(P, d0, visits)
        if self.horizon is not None:
            self._check_ends(self.horizon)
            return
        most = float(self.P.sum(axis=1).max(initial=0.0))
        if self.gamma * most >= 1:
            raise InvalidMDP(
                f"gamma is {gamma} and a row of P sums to {most:.12g}: values would have no bound. Normalise the rows."
            )

    def __reduce__(self) -> tuple:
        return type(self), (self.P, self.gamma, self.d0, self.visits, self.horizon)

    def _check_ends(self, horizon: int) -> None:
        longest = longest_episode(self.P, self.n_actions)
        if longest is None or longest > horizon:
            found = "one can go on for ever" if longest is None else f"the longest has {longest} steps"
            raise InvalidMDP(
                f"horizon is {horizon}, and of the episodes of P {found}: expected P in which all end by then. Put the time in "
                "the states, with `irl_gym.mdp.time_expanded.time_expanded(TransitionTable(P, d0), horizon)`."
            )

    @property
    def effective_horizon(self) -> float:
        """Discounted states of an episode at most, the first among them: 1/(1 - gamma), or 1 + gamma + ... + gamma^H."""
        if self.horizon is None:
            return 1 / (1 - self.gamma)
        return -np.expm1((self.horizon + 1) * np.log(self.gamma)) / (1 - self.gamma) if self.gamma < 1 else self.horizon + 1.0

    def restrict(self, rows: Indices) -> "TabularMDP":
        """The MDP of some states only, renumbered in the order given.

        Raises:
            InvalidMDP: the states are not closed (some action leaves them), or hold no probability of a start.
        """
        stacked = (rows[:, None] * self.n_actions + np.arange(self.n_actions)).ravel()
        P = self.P[stacked][:, rows]
        start = self.d0[rows]
        if abs(P.sum() - self.P[stacked].sum()) > 1e-6 or abs(start.sum() - 1) > 1e-6:
            raise InvalidMDP(f"the {rows.size} states are not closed: an action or a start leads out of them.")
        return TabularMDP(P, self.gamma, start, None if self.visits is None else self.visits[rows], self.horizon)


def checked_mdp(mdp: Any) -> TabularMDP:
    """Return a TabularMDP as it is.

    Raises:
        InvalidMDP: anything else, such as an environment or a whole Tabulation.
    """
    if isinstance(mdp, TabularMDP):
        return mdp
    mend = "Give its `mdp`." if hasattr(mdp, "mdp") else "The mdp comes first, then the expert." if np.ndim(mdp) else ""
    raise InvalidMDP(f"mdp is {a_type(mdp)}: expected a TabularMDP, such as `tabulate(env, gamma=...).mdp`. {mend}".strip())


def check_discount(gamma: float, horizon: int | None = None, *, takes_horizon: bool = False) -> float:
    """Return gamma, a float strictly between 0 and 1; or 1, where there is a horizon. Who takes one has the error say so.

    Raises:
        InvalidDiscount: anything else.
    """
    below = 1 if horizon is None else np.nextafter(1, 2)
    within = "strictly between 0 and 1, such as 0.99" if horizon is None else "above 0, and at most 1"
    within += "; or 1 with a horizon" if horizon is None and takes_horizon else ""
    return checked_number("gamma", gamma, f"a discount {within}", above=0, below=below, error=InvalidDiscount)


def checked_horizon(horizon: Any) -> int:
    """Return H, a whole number of at least 1.

    Raises:
        InvalidParameter: anything else.
    """
    return int(checked_number("horizon", horizon, "a whole number of steps of at least 1", least=1, whole=True))


def _frozen(array: np.ndarray) -> np.ndarray:
    array.setflags(write=False)
    return array


def _frozen_csr(P: Any) -> Sparse:
    if not sp.issparse(P):
        P = float_array("P", P, "(S*A, S) probabilities", InvalidMDP)
        if P.ndim != 2:
            raise InvalidMDP(f"P has shape {P.shape}: expected (S*A, S). For an (S, A, S) array use `from_dense`.")
    csr: Any = sparse_copy("P", P, InvalidMDP) if sp.issparse(P) else sp.csr_array(P)
    csr.data = of_single_precision(csr.data, entry_rows(csr), csr.shape[0])[0]
    csr.sum_duplicates()
    csr.eliminate_zeros()
    for part in (csr.data, csr.indices, csr.indptr):
        part.setflags(write=False)
    return csr


def _check_start(d0: np.ndarray, n_states: int) -> None:
    if d0.shape != (n_states,):
        raise InvalidMDP(f"d0 has shape {d0.shape}: expected ({n_states},), one probability for each column of P.")
    wrong = np.flatnonzero(~(d0 >= 0))
    if wrong.size:
        raise InvalidMDP(f"d0[s={wrong[0]}] is {d0[wrong[0]]}: a probability is at least 0.")
    if not abs(d0.sum() - 1) <= SUM_TOLERANCE:
        raise InvalidMDP(
            f"d0 sums to {shown_sum(d0.sum())}: the distribution of the first state must sum to 1. Divide it by that."
        )


def _check_rows(P: Sparse, n_states: int, n_actions: int) -> np.ndarray:
    """Check the rows of P; return the mask of terminal states."""
    wrong = np.flatnonzero(~(P.data >= 0))
    if wrong.size:
        row = np.searchsorted(P.indptr, wrong[0], side="right") - 1
        s, a = divmod(int(row), n_actions)
        successor, value = P.indices[wrong[0]], P.data[wrong[0]]
        raise InvalidMDP(f"P[s={s}, a={a}, s'={successor}] is {value}: a probability is a number of at least 0.")
    sums = P.sum(axis=1).reshape(n_states, n_actions)
    wrong = np.argwhere((np.abs(sums - 1) > SUM_TOLERANCE) & (sums != 0))
    if wrong.size:
        s, a = wrong[0]
        mend = " Divide it by its sum." if abs(sums[s, a] - 1) < 1e-3 else ""
        raise InvalidMDP(
            f"P[s={s}, a={a}] sums to {shown_sum(sums[s, a])}: each row must sum to 1, or to 0 in a terminal state.{mend}"
        )
    empty = sums == 0
    mixed = np.flatnonzero(empty.any(axis=1) & ~empty.all(axis=1))
    if mixed.size:
        s = mixed[0]
        raise InvalidMDP(
            f"P[s={s}] has zero rows for actions {np.flatnonzero(empty[s]).tolist()} only: in a terminal state every row "
            "is zero, elsewhere none. Give an action that is not available the rows of one that is."
        )
    return empty.all(axis=1)


def _checked_visits(visits: Any, shape: tuple[int, int]) -> np.ndarray:
    array = any_array("visits", visits, f"{shape} whole numbers", InvalidMDP)
    if array.shape != shape or array.dtype.kind not in "iu" or (array < 0).any():
        raise InvalidMDP(
            f"visits has shape {array.shape} and dtype {array.dtype}: expected {shape} whole numbers of at least 0, the steps "
            "that each row of P was estimated from."
        )
    return _frozen(array.astype(np.int64))


def entry_rows(P: Sparse) -> np.ndarray:
    """(nnz,) the row of each entry of P, in the order of P.data."""
    return np.repeat(np.arange(P.shape[0]), np.diff(P.indptr))


def entry_positions(P: Sparse, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """(N,) positions in P.data of the entries (row, column), all of which P has."""
    stored = entry_rows(P) * P.shape[1] + P.indices  # increasing, since a table's P is canonical
    return np.searchsorted(stored, rows * P.shape[1] + columns)
