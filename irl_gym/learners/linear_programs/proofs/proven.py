"""What every learner's proof says of its program's optimum."""

from collections.abc import Iterator
from typing import Any, ClassVar

from irl_gym.facts import Fact, aligned, plain
from irl_gym.records import Record

ROUNDING = 1e-7
"""A gap below this share of the objective is none."""


class Proven(Record):
    """What every proof says of the program's optimum."""

    known: ClassVar[bool] = True
    """Are the entries of `to_json` those that the library reads by name?"""
    objective: float
    dual_bound: float

    @property
    def duality_gap(self) -> float:
        """dual_bound - objective: how far the reward can be from the optimum."""
        return self.dual_bound - self.objective

    @property
    def optimum(self) -> Fact:
        """The same in a sentence."""
        gap = self.duality_gap
        short = f"at most {gap:.1e} below the best possible"
        short = "to rounding the best possible" if gap <= ROUNDING * max(1.0, abs(self.objective)) else short
        return Fact("objective of the program", f"{self.objective:.6g}, {short if gap == gap else 'without a bound'}")

    def facts(self) -> tuple[Fact, ...]:
        """What the proof says, in sentences."""
        return tuple(self._facts())

    def _facts(self) -> Iterator[Fact]:
        yield self.optimum

    def __str__(self) -> str:
        """The facts, line by line."""
        return aligned(self.facts())

    def to_json(self) -> dict[str, Any]:
        """As json holds it: NaN and infinity become None."""
        return plain(self, "duality_gap")


def cap_told(cap: float | None) -> Fact:
    """The cap on margins; a program without one may leave ties."""
    without = "none: Ng & Russell's own program, which may leave ties that a cap breaks (margin_cap='auto', --margin-cap auto)"
    return Fact("margin cap", without if cap is None else f"{cap:.4g}")
