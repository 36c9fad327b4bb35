"""Is it chance alone that decides what follows a visit, or something that an episode keeps and does not show?

Where observations hide nothing, what follows a visit to (s, a) is a draw of its own: that of the last visit in the same episode
says nothing about it. Where a number drawn at reset decides for the whole episode, or anything hidden lasts, visits of one
episode are more alike than those of two. So episodes are split into halves, even and odd, and in one half

    x(s, a)   sum over visits that the episode made before, of 1[the same follows as the last time] - p(what followed then)

where p is the share in the *other* half: given that half, each visit adds a martingale difference, whatever policy acts, and
however visits and ends depend on what follows. For rewards the products (r - mean)(last r - mean) take its place. Freedman's
inequality (1975), P(x >= t) <= exp(-t^2 / (2 (v + b t / 3))), with the variance v of both halves and b the largest single
difference, bounds what chance does; for the sum over all pairs, and for each pair by itself (Bonferroni).

It sees what lasts from one visit of a pair to the next in one episode. Episodes that never come back show nothing here.
Axes: n visits, m lines (a pair and what followed), p pairs.
"""

from dataclasses import dataclass

import numpy as np

POWERS = np.array([0, 1, 2, 0, 1, 1, 2])
"""Of the reward, in the sums of a half: visits, reward, its square; of repeated ones: visits, last reward, reward, product."""
ROUNDING = 1e-12
"""Variance, in units of the range's square, that is none."""
FOUND = 1e-6
"""Probability, of what was seen where nothing is hidden, below which state counts as hidden."""


@dataclass(frozen=True)
class Repeats:
    """What repeated visits of a pair (s, a) within an episode say about hidden state."""

    compared: int
    """Visits that their episode had made before, of pairs that both halves of the episodes have made."""
    alike: int
    """Of these, those after which the same followed as the last time."""
    expected: float
    """How many that would be if it was chance."""
    of: str
    """What tells most: "successors" or "rewards"."""
    row: int
    """The pair that tells most, s * A + a."""
    p_value: float
    """Bound on the probability of this or more where nothing is hidden."""

    @property
    def hidden(self) -> bool:
        """Is something hidden?"""
        return self.p_value < FOUND

    def __str__(self) -> str:
        if not self.compared:
            return "not looked for: too few visits that an episode made twice"
        p = f"p {'<' if self.hidden else '='} {max(self.p_value, FOUND):.2g}"
        told = f"{self.compared:,} repeated visits in an episode, "
        if self.of == "successors":
            told += f"after {self.alike:,} of which the same follows as the last time, {self.expected:,.0f} by chance"
        else:
            told += "whose rewards are alike, more or less than chance makes them"
        return f"{'found' if self.hidden else 'none seen'}: {told}; {p}"


class Visits:
    """Sums over visits, read a block of whole episodes at a time."""

    def __init__(self) -> None:
        self.lines: dict[tuple[int, int], np.ndarray] = {}
        self.pays: dict[tuple[int, int], np.ndarray] = {}
        self._range, self._offset = np.array([np.inf, -np.inf]), 0.0

    def add(self, pairs: np.ndarray, arrivals: np.ndarray, rewards: np.ndarray, episodes: np.ndarray) -> None:
        """Add visits (n,) in the order in which they were made: pair, what followed, reward, number of the episode."""
        if not rewards.size:
            return
        if not self.pays:
            self._offset = float(rewards[0])
        low, high = self._range
        self._range = np.array([min(low, rewards.min()), max(high, rewards.max())])
        order = np.lexsort((np.arange(pairs.size), pairs, episodes))
        pairs, arrivals, paid, episodes = (one[order] for one in (pairs, arrivals, rewards - self._offset, episodes))
        again = np.flatnonzero((np.diff(pairs) == 0) & (np.diff(episodes) == 0)) + 1
        half = np.zeros((pairs.size, 2))
        half[np.arange(pairs.size), episodes % 2] = 1.0
        none, before = np.zeros((pairs.size, 4)), half[again]
        same = before * (arrivals[again] == arrivals[again - 1])[:, None]
        _add(self.lines, pairs, arrivals, np.column_stack([half, none]))
        _add(self.lines, pairs[again], arrivals[again - 1], np.column_stack([np.zeros_like(before), before, same]))
        now, last = paid[again], paid[again - 1]
        products = np.zeros((pairs.size, 4))
        products[again] = np.column_stack([np.ones(again.size), last, now, now * last])
        columns = np.column_stack([np.ones(pairs.size), paid, paid**2, products])
        _add(self.pays, pairs, np.zeros_like(pairs), np.column_stack([half[:, :1] * columns, half[:, 1:] * columns]))

    def result(self) -> Repeats:
        """What they say."""
        lines = np.array(list(self.lines.values())).reshape(-1, 6)
        pays = np.array(list(self.pays.values())).reshape(-1, 14)
        own = np.array([key[0] for key in self.pays], dtype=np.int64)
        place = {pair: i for i, pair in enumerate(own.tolist())}
        pair = np.array([place[key[0]] for key in self.lines], dtype=np.int64)
        scale = np.diff(self._range)[0] if self.pays else 1.0
        pays = pays / np.tile((scale or 1.0) ** POWERS, 2)
        c = lines[:, 0:2]
        met = np.column_stack([np.bincount(pair, weights=c[:, other], minlength=own.size)[pair] > 0 for other in (1, 0)])
        n, same = lines[:, 2:4] * met, lines[:, 4:6] * met  # where the other half knows the pair
        found, expected = [], 0.0
        for other, half in ((0, 1), (1, 0)):
            x, v, b, by_chance = _successors(pair, own.size, c[:, other], c[:, half], n[:, half], same[:, half])
            expected += by_chance
            found.append((*_least(x, v, b), "successors"))
            halves = pays[:, 7 * other :][:, :7], pays[:, 7 * half :][:, :7]
            found.append((*_least(*_rewards(*halves)), "rewards"))
        least, row, of = min(found, key=lambda one: one[0])
        telling = int(own[row]) if own.size else 0
        return Repeats(int(n.sum()), int(same.sum()), expected, of, telling, min(1.0, len(found) * least))


def _successors(
    pair: np.ndarray, size: int, other: np.ndarray, own: np.ndarray, again: np.ndarray, same: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """x, v and b (p,) of what follows, and how many alike are expected; lines (m,) with the counts of both halves."""

    def total(values: np.ndarray) -> np.ndarray:
        return np.bincount(pair, weights=values, minlength=size)

    N = total(other)
    share, pooled = other / np.maximum(N, 1.0)[pair], (other + own) / (N + total(own))[pair]
    N = np.maximum(N, 1.0)
    own_noise = total(again * pooled * (1 - pooled))
    noise_of_share = np.maximum(total(again**2 * pooled) - total(again * pooled) ** 2, 0.0) / N
    largest = np.zeros(size)
    np.maximum.at(largest, pair, again)
    return total(same - again * share), own_noise + noise_of_share, np.maximum(1.0, largest / N), float((again * share).sum())


def _rewards(other: np.ndarray, own: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """x, v and b (p,) of what is paid, where all rewards are within 1 of each other; (p, 7) sums of both halves."""
    N, m = np.maximum(other[:, 0], 1.0), np.where(other[:, 0] > 0, own[:, 3], 0.0)
    n = np.maximum(other[:, 0] + own[:, 0], 1.0)
    mean = other[:, 1] / N
    variance = np.maximum((other[:, 2] + own[:, 2]) / n - ((other[:, 1] + own[:, 1]) / n) ** 2, 0.0)
    last = own[:, 4] - m * mean
    x = own[:, 6] - mean * (own[:, 4] + own[:, 5]) + m * mean**2 - m * variance / N
    x = np.where((m > 0) & (variance > ROUNDING), x, 0.0)
    return x, m * variance**2 + last**2 * variance / N, np.maximum(1.0, np.abs(last) / N)


def _least(x: np.ndarray, v: np.ndarray, b: np.ndarray) -> tuple[float, int]:
    """The least bound on the probability of sums so far from 0: of all pairs together, and of each by itself."""
    if not x.size:
        return 1.0, 0
    alone = _tail(x, v, b)
    (together,) = _tail(x.sum(keepdims=True), v.sum(keepdims=True), b.max(keepdims=True, where=v > 0, initial=1.0))
    row = int(np.argmin(alone))
    return 2 * min(float(together), x.size * float(alone[row])), row


def _tail(x: np.ndarray, v: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Freedman's bound, for both signs."""
    with np.errstate(divide="ignore", invalid="ignore"):
        exponent = np.where(x == 0, 0.0, x**2 / (2 * (v + b * np.abs(x) / 3)))
    return 2 * np.exp(-exponent)


def _add(sums: dict[tuple[int, int], np.ndarray], first: np.ndarray, second: np.ndarray, columns: np.ndarray) -> None:
    """Add rows of columns (n, k) to the sums of their keys."""
    if not first.size:
        return
    order = np.lexsort((second, first))
    first, second = first[order], second[order]
    begin = np.flatnonzero(np.append(True, (np.diff(first) != 0) | (np.diff(second) != 0)))
    totals = np.add.reduceat(columns[order], begin, axis=0)
    for key, total in zip(zip(first[begin].tolist(), second[begin].tolist(), strict=True), totals, strict=True):
        old = sums.get(key)
        sums[key] = total if old is None else old + total
