"""What a run on a table that is an estimate says of its values: by the table, within what, and by episodes of the environment.

Planning takes the best of several noisy values, so what a table promises is too high on average. Episodes of the environment
itself do not flatter: their mean discounted return stands beside the table's value, with its interval.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from irl_gym.demonstrations import Episode
from irl_gym.intervals import as_interval, mean_interval
from irl_gym.tabulation import Evidence


def by_episodes(episodes: Sequence[Episode], gamma: float) -> dict[str, Any]:
    """The mean discounted return of episodes as json holds it, with its 95 % interval and their number."""
    mean = mean_interval(np.array([gamma ** np.arange(len(one)) @ one.rewards for one in episodes]))
    low, high = mean.ends
    return {"value": mean.estimate, "low": low, "high": high, "episodes": len(episodes)}


def told_by_episodes(policies: Mapping[str, Mapping[str, Any]]) -> str:
    """The values that episodes confirm, or do not, in a sentence; empty where none were compared with a table."""
    parts = []
    for name, row in policies.items():
        found = row.get("by_episodes")
        if found is None:
            continue
        mean = as_interval(found["value"], found["low"], found["high"])
        away = mean.known and not mean.low <= row["value"] <= mean.high
        says = f"{row['value']:.3f} by the table{', outside' if away else ''}"
        parts.append(f"{name} {mean}, {says}")
    if not parts:
        return ""
    return f"Mean discounted return of episodes of the environment, with its 95 % interval: {'; '.join(parts)}."


def evidence_told(evidence: Evidence) -> dict[str, Any]:
    """The errors of a table, hidden state and the check, in numbers and in words, as json holds them, errors in their order."""
    return {
        "error": evidence.error, "reward_error": evidence.reward_error, "value_error": evidence.value_error,
        "errors": [] if evidence.exact else [list(one) for one in evidence.errors().items()],
        "hidden_state": None if evidence.repeats is None else str(evidence.repeats),
        "check": None if evidence.check is None else dict(vars(evidence.check)),
        "checked": None if evidence.check is None else str(evidence.check),
    }  # fmt: skip


def errors_told(table: Mapping[str, Any]) -> dict[str, str]:
    """The errors of a table in words, from metrics.json; those of runs of earlier versions too."""
    told, off = table.get("errors"), table.get("error")
    if told is not None:
        return dict(told)
    if table.get("exact", True):
        return {}
    sure = "with 95 % confidence, if observations hide no state"
    return {"probabilities": "not exact" if off is None else f"within {off:.2g} for sampling noise, {sure}"}
