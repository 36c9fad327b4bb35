"""Drawing successors from a table, for one environment or for thousands at once.

Row i of P, cumulated, is kept at i + P(. | i).cumsum(): one increasing array for the whole table, in which the successor of
row i with a uniform draw u is found by one binary search for i + u.
"""

import numpy as np

from irl_gym._typing import Matrix
from irl_gym.errors import InvalidMDP
from irl_gym.mdp.tabular_mdp import TransitionTable


class Successors:
    """Samples s' from P(. | s, a) and first states from d0, vectorised.

    Args:
        table: where the probabilities come from.

    Raises:
        InvalidMDP: an episode would begin in a terminal state.
    """

    def __init__(self, table: TransitionTable):
        P = table.P
        rows = np.repeat(np.arange(P.shape[0]), np.diff(P.indptr))
        total = np.cumsum(P.data)
        before = np.concatenate([[0.0], total])[P.indptr[:-1]]
        within = total - before[rows]
        self._cumulated = rows + within
        self._indices = P.indices.astype(np.int64)
        self._first, self._last = P.indptr[:-1].astype(np.int64), P.indptr[1:].astype(np.int64) - 1
        self._certain = bool((np.diff(P.indptr) <= 1).all())
        self._n_actions = table.n_actions
        starts = np.flatnonzero(table.d0)
        ended = starts[table.terminal[starts]]
        if ended.size:
            raise InvalidMDP(
                f"d0[s={ended[0]}] is {table.d0[ended[0]]:.3g}, but state {ended[0]} is terminal: an episode cannot begin at "
                "its end. Give the probability to states that act."
            )
        self._starts, self._start_cumulated = starts, np.cumsum(table.d0[starts])

    def entries(self, states: np.ndarray, actions: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Positions (N,) in P.data and P.indices of the transitions drawn; terminal states must not be passed."""
        rows = states * self._n_actions + actions
        if self._certain:
            return self._first[rows]
        found = np.searchsorted(self._cumulated, rows + rng.random(rows.size), side="right")
        return np.clip(found, self._first[rows], self._last[rows])  # rounding cannot leave the row

    def draw(self, states: np.ndarray, actions: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Successors (N,) of states (N,) under actions (N,); terminal states have none and must not be passed."""
        return self._indices[self.entries(states, actions, rng)]

    def start(self, n: int, rng: np.random.Generator) -> np.ndarray:
        """First states (n,) from d0."""
        if self._starts.size == 1:
            return np.full(n, self._starts[0])
        found = np.searchsorted(self._start_cumulated, rng.random(n), side="right")
        return self._starts[np.minimum(found, self._starts.size - 1)]


def walks(
    table: TransitionTable, policy: Matrix, n: int, most: int, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Walks of a policy, all at once, each until it ends or has `most` steps.

    Args:
        table: P and d0.
        policy: (S, A) probabilities.
        n: how many.
        most: steps of the longest.
        rng: of what is drawn.

    Returns:
        (n, most + 1) states; (n, most) actions, and positions of the transitions in P.data; and (n,) steps of each walk, beyond
        which nothing is meant.
    """
    cumulated, successors = policy.cumsum(axis=1), Successors(table)
    rows = np.full((n, most + 1), -1, dtype=np.int64)
    actions, entries = np.zeros((2, n, most), dtype=np.int64)
    length = np.zeros(n, dtype=np.int64)
    rows[:, 0] = successors.start(n, rng)
    going = np.arange(n)
    for t in range(most):
        if not going.size:
            break
        here = rows[going, t]
        draws = rng.random((going.size, 1))
        actions[going, t] = np.minimum((draws >= cumulated[here]).sum(axis=1), table.n_actions - 1)
        entries[going, t] = successors.entries(here, actions[going, t], rng)
        rows[going, t + 1] = table.P.indices[entries[going, t]]
        length[going] = t + 1
        going = going[~table.terminal[rows[going, t + 1]]]
    return rows, actions, entries, length
