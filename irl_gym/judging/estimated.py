"""What a run on a table that is an estimate says of it: its errors, hidden state and the check, for terminal and page."""

from collections.abc import Mapping
from typing import Any

from irl_gym.tables.tabulation import Evidence


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
