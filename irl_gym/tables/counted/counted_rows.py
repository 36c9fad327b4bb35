"""Rows of a counted table: the entries of P while it is made, and the counts that remain.

`Entries` grows from the steps seen by those that a prior allows and by rows for pairs never visited. `Counts` is what remains
of the data once P is made, and says how well they settle each row. Axes: S states, A actions, M entries.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.special import betaincinv

from irl_gym._typing import Matrix, Sparse
from irl_gym.checks import checked_number
from irl_gym.mdp.tabular_mdp import entry_rows
from irl_gym.spaces.listed_states import ListedStates
from irl_gym.tables.counted.step_counts import Tally
from irl_gym.tables.selfcheck import Payments
from irl_gym.tables.tabulation import moments


@dataclass(frozen=True, eq=False)
class Entries:
    """Entries of P, in the order of their row and successor."""

    rows: np.ndarray
    """(M,) s * A + a."""
    following: np.ndarray
    """(M,) rows of the states entered."""
    counts: np.ndarray
    """(M,) int64."""
    weight: np.ndarray
    """(M,) proportional to the probability, within a row."""
    mean: np.ndarray
    """(M,) what the step pays on average."""
    square: np.ndarray
    """(M,) the mean of its square."""
    n_actions: int
    """A."""
    certain: bool
    """Did each step always pay the same?"""
    largest: float
    """The largest |reward| seen."""

    def joined(
        self, rows: np.ndarray, following: np.ndarray, weight: np.ndarray, mean: np.ndarray, square: np.ndarray
    ) -> "Entries":
        """These and others that were never seen, in order."""
        added = {
            "rows": rows, "following": following, "counts": np.zeros(rows.size, dtype=np.int64), "weight": weight,
            "mean": mean, "square": square,
        }  # fmt: skip
        arrays = {name: np.concatenate([getattr(self, name), array]) for name, array in added.items()}
        order = np.lexsort((arrays["following"], arrays["rows"]))
        return replace(self, **{name: array[order] for name, array in arrays.items()})

    def matrices(self, visits: np.ndarray) -> tuple[Any, Any]:
        """P and the counts, (S*A, S) with the same entries."""
        shape = (visits.size, visits.shape[0])
        total = np.bincount(self.rows, weights=self.weight, minlength=shape[0])
        pointers = np.append(0, np.cumsum(np.bincount(self.rows, minlength=shape[0])))
        P = sp.csr_array((self.weight / total[self.rows], self.following, pointers), shape=shape)
        return P, sp.csr_array((self.counts, self.following, pointers), shape=shape)

    def payments(self, p: np.ndarray, shape: tuple[int, int]) -> Payments:
        """What steps pay, in expectation under P."""
        mean, deviation = moments(self.rows, p, self.mean, self.square, shape)
        return Payments(mean, deviation, self.mean if self.certain else None, self.largest)


def seen_entries(seen: Tally, states: ListedStates, n_actions: int) -> tuple[Entries, np.ndarray]:
    """The entries of P that were seen, and (S, A) visits."""
    size = states.n_states
    ends = np.arange(len(seen.numbers))
    ends[list(states.terminal_copies)] = list(states.terminal_copies.values())
    following = np.where(seen.terminated, ends[seen.following], seen.following)
    order = np.lexsort((following, seen.pairs))
    rows, following, counts = seen.pairs[order], following[order], seen.counts[order]
    total, squares, least, most = seen.paid[order].T
    same = most - least <= 1e-9 * np.maximum(np.abs(most), np.abs(least)) + 1e-12
    mean = np.where(same, least, total / counts)
    square = np.where(same, least**2, squares / counts)
    visits = np.bincount(rows, weights=counts, minlength=size * n_actions).astype(np.int64).reshape(size, n_actions)
    largest = float(np.abs(seen.paid[:, 2:]).max())
    entries = Entries(rows, following, counts, counts.astype(float), mean, square, n_actions, bool(same.all()), largest)
    return entries, visits


def supported(entries: Entries, visits: np.ndarray, prior: float) -> Entries:
    """The entries with the prior: a line for each visited pair and each successor of its state under any action."""
    size, n_actions = visits.shape
    codes = entries.rows // n_actions * size + entries.following
    pairs, place = np.unique(codes, return_inverse=True)  # (s, s'), in order
    weight = np.bincount(place, weights=entries.counts)
    mean = np.bincount(place, weights=entries.counts * entries.mean) / weight
    square = np.bincount(place, weights=entries.counts * entries.square) / weight
    tried = np.flatnonzero(visits)
    begin, end = (np.searchsorted(pairs, tried // n_actions * size + edge) for edge in (0, size))
    lengths = end - begin
    chosen = np.arange(lengths.sum()) - np.repeat(np.cumsum(lengths) - lengths - begin, lengths)
    rows, following = np.repeat(tried, lengths), pairs[chosen] % size
    fresh = ~np.isin(rows * size + following, entries.rows * size + entries.following)
    chosen, rows, following = chosen[fresh], rows[fresh], following[fresh]
    weight = np.full(rows.size, float(prior))
    return replace(entries, weight=entries.weight + prior).joined(rows, following, weight, mean[chosen], square[chosen])


@dataclass(frozen=True, eq=False)
class Counts:
    """How often each step was seen, and how well that settles P."""

    visits: np.ndarray
    """(S, A) int64, how often each pair was seen."""
    successors: Sparse
    """(S*A, S) int64 CSR, how often each step was seen. It has P's entries in P's order; those that only the prior or the rule
    for unvisited pairs put there are stored zeros."""
    prior: float
    """Dirichlet's concentration that P was made with."""

    @property
    def invented(self) -> np.ndarray:
        """(S, A) bool: pairs never visited, in states that are not terminal; their rows of P hold no data."""
        return (self.visits == 0) & (np.diff(self.successors.indptr) > 0).reshape(self.visits.shape)

    def interval(self, level: float = 0.95) -> tuple[np.ndarray, np.ndarray]:
        """Credible intervals of single probabilities, equal-tailed: the marginal Beta of a Dirichlet posterior.

        A successor seen c times in N visits has Beta(c + a, N - c + b). With a prior, a is the prior and b that of the row's
        other successors, at least one. Without, a = b = 1/2: Jeffreys' prior of "this successor or another". As is usual
        (Brown, Cai & DasGupta, 2001) the interval reaches 0 where c = 0, and 1 where c = N.

        Args:
            level: probability that one interval holds the truth.

        Returns:
            low and high, (nnz,) each, in the order of `P.data`; NaN where the row was invented.

        Raises:
            InvalidParameter: a level outside (0, 1).
        """
        level = _checked_level(level)
        rows = entry_rows(self.successors)
        c, visits = self.successors.data, self.visits.ravel()[rows]
        others = np.maximum(np.diff(self.successors.indptr)[rows] - 1, 1)
        a, b = (self.prior, self.prior * others) if self.prior else (0.5, 0.5)
        low, high = (betaincinv(c + a, visits - c + b, q) for q in ((1 - level) / 2, (1 + level) / 2))
        low, high = np.where(c == 0, 0.0, low), np.where(c == visits, 1.0, high)
        return np.where(visits, low, np.nan), np.where(visits, high, np.nan)

    def row_error(self, level: float = 0.95, most_successors: int | None = None) -> Matrix:
        """(S, A) bound on sum_s' |P - truth| of each row, which holds for one row with this probability.

        Weissman et al. (2003): with N visits and K possible successors the frequencies are off by no more than
        sqrt(2 (ln(2^K - 2) - ln(1 - level)) / N). What the prior moved is added. At most 2, which any two rows fulfil; 0 in
        terminal states, which have no row.

        Args:
            level: probability.
            most_successors: K, where it is known that no pair has more; None for all S, always right and often loose.

        Raises:
            InvalidParameter: a level outside (0, 1), or fewer than 1 successors.
        """
        level = _checked_level(level)
        if most_successors is not None:
            checked_number("most_successors", most_successors, "a whole number of at least 1", least=1, whole=True)
        K = max(most_successors or self.successors.shape[1], 2)
        logarithm = K * np.log(2) + np.log1p(-(2.0 ** (1 - K))) - np.log1p(-level)
        N, rows = self.visits.ravel(), entry_rows(self.successors)
        moved = np.bincount(rows, weights=self._moved(rows), minlength=N.size)
        bound = np.sqrt(2 * logarithm / np.maximum(N, 1)) + moved
        bound = np.where(N == 0, 2.0, np.minimum(bound, 2.0))
        return np.where(np.diff(self.successors.indptr) == 0, 0.0, bound).reshape(self.visits.shape)

    def largest_error(self, level: float = 0.95) -> float:
        """Bound on |P - truth| that holds for all entries at once with this probability; 1 where a row was invented.

        Hoeffding's inequality for S*A rows of S entries, and what the prior moved. The pair least visited decides.

        Raises:
            InvalidParameter: a level outside (0, 1).
        """
        level = _checked_level(level)
        if self.invented.any():
            return 1.0
        rows = entry_rows(self.successors)
        N = self.visits.ravel()[rows]
        logarithm = np.log(2.0 * self.successors.shape[0] * self.successors.shape[1]) - np.log1p(-level)
        return min(1.0, float((np.sqrt(logarithm / (2 * N)) + self._moved(rows)).max()))

    def _moved(self, rows: np.ndarray) -> np.ndarray:
        """(nnz,) how far the prior moved each entry of P from its frequency."""
        c, n = self.successors.data, np.maximum(self.visits.ravel(), 1)[rows]
        support = np.diff(self.successors.indptr)[rows]
        return np.abs((c + self.prior) / (n + self.prior * support) - c / n)


def _checked_level(level: float) -> float:
    return checked_number("level", level, "a probability strictly between 0 and 1, such as 0.95", above=0, below=1)
