"""The words of an experiment that a command line offers, apart from what they stand for: reading them imports nothing."""

from collections.abc import Mapping, Sequence
from typing import Any, Literal

PlannerName = Literal["value-iteration", "ppo", "dqn", "a2c"]
FeatureName = Literal["auto", "one-hot", "radial", "fourier", "polynomial"]
Reveals = Mapping[str, int | Sequence[Any]] | Literal["known"]
KNOWN: Literal["known"] = "known"
