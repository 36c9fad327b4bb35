"""The words of an experiment that a command line offers, apart from what they stand for: reading them imports nothing large."""

import json
from collections.abc import Mapping, Sequence
from typing import Any, Literal

from irl_gym.errors import InvalidParameter

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


def parse_keywords(parts: Sequence[str], what: str = "env-kwargs") -> dict[str, Any]:
    """Arguments of an environment given as text: `name=value` pairs, each value json or plain text; or one json object.

    `Infinity` and `NaN` are floats, as in Python's json: a bound may be infinite.

    Raises:
        InvalidParameter: neither, or a name twice.
    """
    if len(parts) == 1 and parts[0].lstrip().startswith("{"):
        try:
            return json.loads(parts[0])
        except (ValueError, RecursionError) as error:
            raise InvalidParameter(f"{what} is {parts[0]!r:.200}, not json ({error}): expected an object.") from error
    found: dict[str, Any] = {}
    for part in parts:
        name, equals, text = part.partition("=")
        if not equals or not name.isidentifier():
            raise InvalidParameter(f"{what} has {part!r}: expected name=value, such as map_name=8x8.")
        if name in found:
            raise InvalidParameter(f"{what} has {part!r} after {name}={found[name]!r}: expected each name once. Leave one out.")
        try:
            found[name] = json.loads(text)
        except ValueError:
            found[name] = text
        except RecursionError as error:
            raise InvalidParameter(f"{what} has {part!r:.40}, nested too deeply: expected plain json, or text.") from error
    return found
