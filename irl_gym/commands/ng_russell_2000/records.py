"""A number of the paper beside ours, and whether it is as near as it should be."""

from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

Progress = Callable[[float], None]
"""Called with the share of an experiment that is done."""


@dataclass(frozen=True)
class Check:
    """One number: the paper's, ours, and the verdict."""

    what: str
    """What is measured, in words."""
    paper: float | str
    """What the paper prints, or says."""
    ours: float
    """What was measured."""
    bar: str
    """When the verdict is good, in words; "reported" where nothing is asked."""
    deviation: float | None = None
    """ours - paper, where the paper prints a number."""
    verdict: bool | None = None
    """Is the bar met? None where nothing is asked."""

    def to_json(self) -> dict[str, Any]:
        """As json holds it: NaN becomes None."""
        return {name: None if value != value else value for name, value in asdict(self).items()}


def near(what: str, paper: float, ours: float, within: float) -> Check:
    """Ours may differ from the paper's number by `within`."""
    deviation = float(ours) - paper
    return Check(what, paper, float(ours), f"within {within:.2g}", deviation, bool(abs(deviation) <= within))


def at_most(what: str, paper: float | str, ours: float, most: float) -> Check:
    """Ours may be at most this."""
    return Check(what, paper, float(ours), f"at most {most:g}", _deviation(paper, ours), bool(ours <= most))


def at_least(what: str, paper: float | str, ours: float, least: float) -> Check:
    """Ours has to be at least this."""
    return Check(what, paper, float(ours), f"at least {least:g}", _deviation(paper, ours), bool(ours >= least))


def reported(what: str, paper: float | str, ours: float) -> Check:
    """Nothing is asked of ours."""
    return Check(what, paper, float(ours), "reported", _deviation(paper, ours))


def _deviation(paper: float | str, ours: float) -> float | None:
    return None if isinstance(paper, str) else float(ours) - paper
