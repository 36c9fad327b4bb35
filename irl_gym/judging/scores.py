"""The scale of scores: random actions earn 0 and the expert 1; and when there is no such scale.

A score divides by what the expert has over random actions. That must be more than rounding, and known. An expert that is known
by N episodes only has a value with a 95 % interval, of Student's t. If the interval holds the value of random actions, or its
half is more than a quarter of the difference, a score could be anything, and none is given.

Returns that happen to be equal do not make the interval narrow: below 11 episodes it is taken as unbounded. Of 11 that agree,
another outcome still has a chance of up to a quarter, 1 - 0.05^(1/11), with 95 % confidence. One exception: where the world has
no chance and all episodes are the same, they are all that the expert does, and their value is exact.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import t

from irl_gym._typing import Vector
from irl_gym.facts import counted
from irl_gym.intervals import LEVEL
from irl_gym.judging.metrics import normalised_score

EXPERT, RANDOM = REFERENCES = ("expert", "random")
"""The judged policies whose scores are 1 and 0 by definition: what all others are measured by."""
RETRAINED = "retrained"
"""The agent that was retrained on the recovered reward alone: what a run of the loop is about."""
LEARNED = "learned"
"""The policy that the learner gave, where it gives one."""
CLONE = "clone"
"""What copies the demonstrations: judged as the others are, and set beside them."""
FEWEST = 11
"""Episodes below which their spread is not believed."""
BLUR = 0.25
"""Share of the scale; a half-width above it leaves no score."""


@dataclass(frozen=True)
class Scale:
    """What a score is measured by."""

    random: float
    """Value of random actions."""
    expert: float
    """Value of the expert; the mean of its episodes where it is known by them only."""
    rounding: float = 0.0
    """A difference of values up to this is none."""
    half: float = 0.0
    """Half the width of the interval of the expert's value: 0 where that is exact, infinite where it is anybody's guess."""
    episodes: int | None = None
    """N that were given; None where the expert itself is at hand."""
    gamma: float = float("nan")
    """Discount, named where it is to blame."""

    @property
    def few(self) -> bool:
        """Do too few episodes tell the expert's value?"""
        apart = abs(self.expert - self.random)
        return self.half > 0 and (self.half >= apart or self.half > BLUR * apart)

    @property
    def reason(self) -> str | None:
        """Why there is no score, in words that follow a colon; None where there is one."""
        if self.few:
            known = "" if np.isinf(self.half) else f", give or take {self.half:.2g}"
            return (
                f"the expert's value, {self.expert:.4g}{known}, is the mean of {counted(self.episodes or 0, 'episode')}, too "
                f"few to set it apart from random actions, {self.random:.4g}"
            )
        if self.rounding and abs(self.expert - self.random) <= self.rounding:
            return (
                f"at gamma {self.gamma} the values of the expert, {self.expert:.3g}, and of random actions, "
                f"{self.random:.3g}, are the same but for rounding; a larger gamma may tell them apart"
            )
        return None if self.expert > self.random else "the expert earns no more than random actions"

    @property
    def interval(self) -> tuple[float | None, float | None]:
        """The ends of the interval of the expert's value; None where it has no end."""
        return (None, None) if np.isinf(self.half) else (self.expert - self.half, self.expert + self.half)

    @property
    def needed(self) -> int | None:
        """About how many episodes would do; None where that is not known."""
        if self.episodes is None or np.isinf(self.half) or not self.expert > self.random:
            return None
        return int(np.ceil(self.episodes * (self.half / (BLUR * (self.expert - self.random))) ** 2))

    def score(self, value: float) -> float | None:
        """Random = 0, expert = 1; None where there is no score."""
        return None if self.reason is not None else normalised_score(value, self.random, self.expert)

    def share(self, lost: float) -> float | None:
        """A loss in units of the scale; None where there is none."""
        return None if self.reason is not None else lost / (self.expert - self.random)


def others(policies: Iterable[str]) -> list[str]:
    """The judged policies that a run is about, by their names: neither a reference nor the clone."""
    return [name for name in policies if name not in (*REFERENCES, CLONE)]


def scored(policies: Iterable[str]) -> list[str]:
    """The same and then the clone, where there is one: those that have a score which is not one by definition."""
    return sorted((name for name in policies if name not in REFERENCES), key=lambda name: name == CLONE)


def in_order(policies: Mapping[str, Any]) -> dict[str, Any]:
    """The rows of judged policies as they are shown: expert, random actions, the clone, and then what the run is about."""
    return {name: policies[name] for name in (*REFERENCES, CLONE, *others(policies)) if name in policies}


def agent_of(policies: Iterable[str]) -> str:
    """The one that is spoken of where there is room for one: the retrained agent, without it the learner's policy, or else the
    first that is no reference.

    Raises:
        KeyError: there are references only.
    """
    found = others(policies)
    if not found:
        raise KeyError(RETRAINED)
    return next((name for name in (RETRAINED, LEARNED) if name in found), found[0])


def who(policies: Iterable[str]) -> str:
    """What the one that is spoken of is."""
    return "agent" if agent_of(policies) == RETRAINED else "policy"


CALLED = {RETRAINED: "retrained agent", LEARNED: "learner's policy", CLONE: "clone"}


def called(name: str) -> str:
    """What a judged policy is called in a table."""
    return CALLED.get(name, name)


def the(name: str) -> str:
    """What it is called in a sentence."""
    return f"the {CALLED[name]}" if name in CALLED else f"the policy {name}"


def several(name: str) -> str:
    """What such policies of several runs are called."""
    return {RETRAINED: "retrained agents", LEARNED: "learner's policies", CLONE: "clones"}.get(name, name)


def score_of(score: float | None) -> str:
    """A score with three decimals, which says 1.000 only of what is 1."""
    if score is None or not np.isfinite(score):
        return "none" if score is None else "not known"
    return "above 0.999" if 0.9995 <= score < 1 - 1e-6 else f"{score:.3f}".replace("-0.000", "0.000")


def half_width(returns: Vector, exact: bool) -> float:
    """Half of the 95 % interval of the mean of returns (N,); 0 if they are known to be all that can be, see above."""
    if exact:
        return 0.0
    if returns.size < FEWEST:
        return float("inf")
    return float(t.ppf((1 + LEVEL) / 2, returns.size - 1) * returns.std(ddof=1) / np.sqrt(returns.size))
