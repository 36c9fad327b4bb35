"""The words of an experiment that a command line offers, apart from what they stand for: reading them imports nothing."""

from collections.abc import Mapping, Sequence
from typing import Any, Literal

PROGRAM = ["irl-gym", "run"]
"""How a run's command begins, unless another program started it: this works wherever irl_gym is installed."""
PlannerName = Literal["value-iteration", "ppo", "dqn", "a2c"]
FeatureName = Literal["auto", "one-hot", "radial", "fourier", "polynomial"]
Reveals = Mapping[str, int | Sequence[Any]] | Literal["known"]
KNOWN: Literal["known"] = "known"
TAKEN: Mapping[str, tuple[str, ...]] = {
    "finite-lp": ("l1", "margin_cap", "slack", "reward_on", "horizon", "time_limit"),
    "feature-lp": ("l1", "margin_cap", "features", "size", "coordinates", "sample", "time_limit"),
    "trajectory-lp": ("l1", "features", "size", "coordinates", "rounds", "gap_cap", "inner", "time_limit"),
}
"""The options that each learner has; another is refused, not ignored."""
