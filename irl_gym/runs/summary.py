"""What a run found, in one record: what `recover_and_retrain` returns."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from irl_gym.records import Record


@dataclass(frozen=True, eq=False)
class Report(Record):
    """What a run found, as it stands in the run's folder."""

    out: Path
    """The folder."""
    metrics: Mapping[str, Any]
    """The content of metrics.json: policies, score_reason (None where there is a score), expert_value (its 95 % interval),
    reward, training, demonstrations, and table, None where there is none."""
    certificate: Mapping[str, Any]
    """The content of certificate.json."""
    stages: Mapping[str, Mapping[str, Any]]
    """The record of each stage: wall seconds in the run that finished it, environment steps, what the solver did."""
    config: Mapping[str, Any]
    """The content of config.json: the experiment."""
    shown: Mapping[str, int]
    """Hidden integers that the observation was made to show, with their numbers of values."""
    whose: str | None = None
    """Of a run that was finished before, what was computed again of it, and that all else is its record (`Run.whose`)."""

    @property
    def page(self) -> Path:
        """The page that shows it all."""
        return self.out / "report.html"
