"""The figures of a run's policies in long form, for other people's tools: policy, metric, value.

pandas.read_csv("metrics.csv").pivot(index="policy", columns="metric", values="value")
"""

import csv
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

COLUMNS = ("policy", "metric", "value")


def write_metrics_csv(metrics: Mapping[str, Any], path: Path) -> None:
    """Write the numbers of metrics.json's policies; what is not known is left empty.

    Args:
        metrics: the content of metrics.json.
        path: the csv.
    """
    rows = [(policy, name, value) for policy, told in metrics["policies"].items() for name, value in _numbers(told)]
    with path.open("w", newline="") as file:
        csv.writer(file).writerows([COLUMNS, *rows])


def _numbers(told: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, float | None]]:
    """Numbers by their dotted names; lists are left out."""
    for name, value in told.items():
        if isinstance(value, Mapping):
            yield from _numbers(value, f"{prefix}{name}.")
        elif value is None or isinstance(value, int | float):
            yield f"{prefix}{name}", value
