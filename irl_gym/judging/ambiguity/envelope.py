"""The upper envelope of lines that an optimiser hands out one price at a time, and how far it can be from the truth.

    f(price) = max over all points of (total - price * norm),   norm >= 0, with the point (0, 0) among them
f is convex, falls, and ends at 0. Each solve at a price gives a line that touches f there, and a bound above f(price).
Two neighbouring lines are followed to where they cross: if nothing is better there, the crossing is a breakpoint of f;
otherwise the better line comes between them (Eisner & Severance 1976). So k lines take about 2 k solves. In between, f lies
below the chord of the bounds and above the lines, which says how far f can be off wherever the search stops. Where all lines
are wanted, the search goes deep before wide, since an optimum is found fast from a near one; where only some are, the crossings
that are open the widest come first.
"""

from bisect import bisect_left
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

SETTLED = 1e-12
"""Nothing is sought where f is known to this, relative to f(0)."""
GAIN = 1e-10
"""A line is better if it is so by more than this, relative to f(0): less is the solver's rounding."""
SAME = 1e-9
"""Lines whose norms differ by less, relative to the largest, are one; so are breakpoints, relative to the last one."""


@dataclass(frozen=True, eq=False)
class Line:
    """A point, worth total - price * norm."""

    total: float
    norm: float
    R: np.ndarray
    """The reward it is of."""
    margins: np.ndarray
    """Its margins."""
    violation: float = 0.0
    """By how much it violates a constraint, relative to what a margin can be: where this is large it is no point."""

    def at(self, price: float) -> float:
        """What it is worth at a price."""
        return self.total - price * self.norm


Solve = Callable[[float], tuple[Line, float]]
"""An optimal line at a price, and a bound above f there."""


@dataclass(frozen=True, eq=False)
class Envelope:
    """The lines of f and where they meet."""

    lines: tuple[Line, ...]
    """k lines, the norms falling; without (0, 0)."""
    breakpoints: np.ndarray
    """(k+1,) from 0 to where f becomes 0."""
    gaps: np.ndarray
    """(k+1,) how far f can be above the lines at each breakpoint."""
    gap: float
    """The largest distance between the lines and the bounds above f, at any price."""
    exact: bool
    """Was each crossing followed? What that proves, `gap` and `violation` say."""
    violation: float
    """The largest of the lines."""
    solves: int
    """How often the optimiser was asked."""


def envelope(solve: Solve, most: int | None = None, nothing: float = 0.0) -> Envelope | None:
    """All lines of f, or the `most` that matter first; None where f(0) is 0.

    Args:
        solve: the optimiser; asked the same, it has to answer the same.
        most: lines at most, at least 2; None for all.
        nothing: an f(0) that is rounding.
    """
    search = _Search(solve)
    first = search.ask(0.0)
    if not (first.total > nothing and first.norm > 0):
        return None
    search.largest = first
    lines, exact = _refined(search, first, _last(search, first), most)
    kept, breakpoints = _cleaned(lines, SAME * search.prices[-1])
    lower = np.array([line.at(price) for line, price in zip(kept, breakpoints, strict=False)] + [0.0])
    prices, bounds = np.array(search.prices), np.array(search.bounds)
    gaps = np.maximum(np.interp(breakpoints, prices, bounds) - lower, 0.0)
    between = bounds - np.interp(prices, breakpoints, lower)
    gap, violation = float(max(gaps.max(), between.max())), max(line.violation for line in kept)
    return Envelope(tuple(kept), breakpoints, gaps, gap, exact, violation, len(prices))


class _Search:
    """What is known of f so far: the prices that were asked, increasing, and what was found there."""

    def __init__(self, solve: Solve):
        self.solve = solve
        self.prices: list[float] = []
        self.bounds: list[float] = []
        """Above f at each price."""
        self.found: list[Line] = []
        self.largest = Line(0.0, 0.0, np.zeros(0), np.zeros(0))
        """The line at price 0."""

    def ask(self, price: float) -> Line:
        """An optimal line; what was found before where the price, but for rounding, was asked before."""
        near = SAME * (self.prices[-1] if self.prices else 0.0)
        at = bisect_left(self.prices, price - near)
        if at < len(self.prices) and self.prices[at] <= price + near:
            return self.found[at]
        at = bisect_left(self.prices, price)
        line, bound = self.solve(price)
        self.prices.insert(at, price)
        self.bounds.insert(at, bound)
        self.found.insert(at, line)
        return line

    def above(self, price: float) -> float:
        """A bound above f(price): the chord of its neighbours' bounds; f falls, so the last bound holds beyond it."""
        return float(np.interp(price, self.prices, self.bounds))

    def same(self, one: Line, other: Line) -> bool:
        return abs(one.norm - other.norm) <= SAME * self.largest.norm

    def none(self, line: Line) -> bool:
        """Is it (0, 0), but for rounding?"""
        return line.norm <= SAME * self.largest.norm

    def better(self, line: Line, price: float, worth: float) -> bool:
        return line.at(price) - worth > GAIN * self.largest.total


def _last(search: _Search, line: Line) -> Line:
    """The line that f leaves for 0: each one's zero is a price at which a better one is sought (Dinkelbach 1967)."""
    while True:
        price = line.total / line.norm
        found = search.ask(price)
        if search.same(found, line) or search.none(found) or not search.better(found, price, 0.0):
            return line
        line = found


@dataclass(frozen=True, eq=False)
class _Open:
    """Two neighbouring lines, where they cross, and how far f can be above them there."""

    left: Line
    right: Line
    price: float
    by: float


def _refined(search: _Search, first: Line, last: Line, most: int | None) -> tuple[list[Line], bool]:
    """The lines from the first to the last, the norms falling, and whether these are all."""
    if search.same(first, last):
        return [first], True
    lines, waiting = [first, last], []

    def push(left: Line, right: Line) -> None:
        price = crossing(left, right)
        by = search.above(price) - left.at(price)
        if by > SETTLED * search.largest.total:
            waiting.append(_Open(left, right, price, by))

    push(first, last)
    while waiting:
        for one in [waiting.pop()] if most is None else _widest(waiting):
            found = search.ask(one.price)
            known = search.none(found) or any(search.same(found, line) for line in lines)
            if not known and search.better(found, one.price, one.left.at(one.price)):
                if most is not None and len(lines) >= most:
                    return _falling(lines), False
                lines.append(found)
                push(one.left, found)
                push(found, one.right)
    return _falling(lines), True


def _widest(waiting: list[_Open]) -> list[_Open]:
    """Take those out that are open by at least a quarter of the largest, by price: near prices are solved fast in a row."""
    least = max(one.by for one in waiting) / 4
    chosen = sorted((one for one in waiting if one.by >= least), key=lambda one: one.price)
    waiting[:] = [one for one in waiting if one.by < least]
    return chosen


def _falling(lines: list[Line]) -> list[Line]:
    return sorted(lines, key=lambda line: -line.norm)


def crossing(left: Line, right: Line) -> float:
    """The price at which two lines are worth the same."""
    return (left.total - right.total) / (left.norm - right.norm)


def _cleaned(lines: list[Line], narrow: float) -> tuple[list[Line], np.ndarray]:
    """The lines that are best over more than a point, and the k+1 prices where they begin, the last being where 0 does.

    A line found where two others cross may touch f in that point alone.
    """
    zero = Line(0.0, 0.0, np.zeros(0), np.zeros(0))
    kept: list[Line] = []
    starts: list[float] = []
    for line in [*lines, zero]:
        while kept and crossing(kept[-1], line) <= starts[-1] + narrow:
            kept.pop()
            starts.pop()
        starts.append(crossing(kept[-1], line) if kept else 0.0)
        kept.append(line)
    return kept[:-1], np.array(starts)
