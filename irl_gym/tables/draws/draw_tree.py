"""The tree of a call's random outcomes, walked depth first, one path at a time.

    a path      the draws of one run of the call, from its beginning on
    a draw      how many outcomes, how probable, which one the path takes, which are left to try
    a script    the outcome that each draw takes, by number

Draws with a single outcome are no draws. An outcome that would make the path less probable than rounding errors is left out,
and its siblings share what it had; where that leaves none, the path is cut.
"""

from collections.abc import Sequence
from typing import NoReturn

from irl_gym.errors import NotEnumerable

ROUNDING = 1e-13
"""Outcomes of a smaller probability are what rounding leaves, as at the end of a cumulated sum."""
LOST = 1e-12
"""The probability of all that is left out, at most."""


class Cut(BaseException):
    """Leaves a run that has become less probable than rounding. No Exception, so that environments do not catch it."""


class _Draw:
    """A draw on the path, and what is left to try of it."""

    __slots__ = ("at", "count", "method", "open", "reach", "weights")

    def __init__(self, method: str, count: int, weights: list[float] | None, before: float):
        self.method, self.count, self.weights, self.at = method, count, weights, 0
        self.open: Sequence[int] = range(count)
        self.reach = [before / count] * count if weights is None else [before * weight for weight in weights]
        if min(self.reach) < ROUNDING:
            left_out = sum(reach for reach in self.reach if reach < ROUNDING)
            if left_out <= LOST:  # else they matter together
                self.open = [k for k in range(count) if self.reach[k] >= ROUNDING]
                self.reach = [self.reach[k] * before / (before - left_out) for k in self.open]


class Path:
    """The draws of a call from its beginning to where it is now: a branch of the tree of its outcomes."""

    number = runs = depth = 0
    lost = 0.0
    cut = False
    refusal: NotEnumerable | None = None

    def __init__(self, most: int):
        self.most = most
        self.draws: list[_Draw] = []

    def begin(self) -> None:
        """Start a run from the call's beginning."""
        self.runs += 1
        self.number, self.depth, self.cut, self.refusal = self.runs, 0, False, None
        if self.runs > self.most:
            names = ", ".join(dict.fromkeys(f"{draw.method}()" for draw in self.draws))
            self.refuse(
                f"the draws of one call, {names}, have more than {self.most:,} outcomes: expected at most {self.most:,}. "
                "Raise the limit, or count samples."
            )

    def choose(self, method: str, count: int, weights: list[float] | None = None) -> int:
        """One of `count` outcomes: what the script says, or the first beyond it."""
        if count == 1:
            return 0
        if self.depth == len(self.draws):
            self._extend(method, count, weights)
        draw = self.draws[self.depth]
        if draw.count != count or draw.weights != weights or draw.method != method:
            self._refuse_change(f"now {method}() with {count}, and {draw.method}() with {draw.count} outcomes before")
        self.depth += 1
        return draw.open[draw.at]

    def _extend(self, method: str, count: int, weights: list[float] | None) -> None:
        if count > self.most:
            self.refuse_many(method, count)
        before = self.probability
        draw = _Draw(method, count, weights, before)
        if not draw.open:
            self.cut = True
            raise Cut
        self.draws.append(draw)

    @property
    def probability(self) -> float:
        """Of the path so far."""
        return self.draws[-1].reach[self.draws[-1].at] if self.draws else 1.0

    @property
    def script(self) -> tuple[int, ...]:
        """The outcome taken at each draw."""
        return tuple([draw.open[draw.at] for draw in self.draws])

    def end(self) -> None:
        """Check a run that has come to its end."""
        if self.refusal is not None:
            raise self.refusal  # the environment caught it
        if self.depth < len(self.draws) and not self.cut:
            self._refuse_change(f"now {self.depth}, and at least {len(self.draws)} draws before")
        if self.cut:
            self.lost += self.probability

    def advance(self) -> bool:
        """Turn to the next outcome of the last draw that has one; False when all have been tried."""
        draws = self.draws
        while draws:
            draws[-1].at += 1
            if draws[-1].at < len(draws[-1].open):
                return True
            draws.pop()
        if self.lost > LOST:
            self.refuse(f"the outcomes of one call that are too rare to follow have probability {self.lost:.1g} together")
        return False

    def refuse(self, message: str) -> NoReturn:
        """Raise NotEnumerable; also at the end of the run, should the environment catch it."""
        self.refusal = NotEnumerable(message)
        raise self.refusal

    def refuse_many(self, method: str, count: int) -> NoReturn:
        """Raise NotEnumerable: a draw has too many outcomes."""
        shown = f"{count:,}" if count < 10**12 else "more than 10**12"
        self.refuse(
            f"{method}() has {shown} outcomes: expected at most {self.most:,} of one call. Raise the limit, or count samples."
        )

    def _refuse_change(self, difference: str) -> NoReturn:
        self.refuse(
            f"draw {self.depth + 1} of a call differs when it is repeated, {difference}: expected a call that is a function of "
            "its generator's draws. Something else changes: the global np.random or random, a clock, or state that was not "
            "restored."
        )


class Script(Path):
    """A path that is given."""

    def __init__(self, most: int, script: tuple[int, ...]):
        super().__init__(most)
        self.given = script

    def choose(self, method: str, count: int, weights: list[float] | None = None) -> int:
        """What the script says."""
        if count == 1:
            return 0
        self.depth += 1
        if self.depth > len(self.given) or not 0 <= self.given[self.depth - 1] < count:
            self._differs()
        return self.given[self.depth - 1]

    def end(self) -> None:
        """Check that the script has been used up."""
        if self.refusal is not None:
            raise self.refusal
        if self.depth != len(self.given):
            self._differs()

    def _differs(self) -> NoReturn:
        self.refuse(
            f"the call does not follow the script {self.given} at its draw {self.depth}: expected the call that the script is "
            "of, from the same state."
        )
