"""The figures of a run in long form, for other people's tools.

    env, env_kwargs, gamma, seed, learner, retrain     which run it is
    policy, metric, value                              of what, which number

pandas.read_csv("metrics.csv").pivot(index="policy", columns="metric", values="value")

The first six columns tell runs apart when several are stacked; arguments, learner and planner are json with sorted keys, as
config.json has them. The reward has rows of its own, as the policy "reward".
"""

import csv
import io
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from irl_gym.files.own_files import write_bytes

COLUMNS = ("env", "env_kwargs", "gamma", "seed", "learner", "retrain", "policy", "metric", "value")
REWARD = "reward"
"""Stands for a policy's name in the rows of the reward's numbers."""


def write_metrics_csv(metrics: Mapping[str, Any], path: Path, *, env: str | None, config: Mapping[str, Any]) -> None:
    """Write the numbers of metrics.json's policies and reward; what is not known is left empty.

    Args:
        metrics: the content of metrics.json.
        path: the csv.
        env: the environment's id; empty where it has none.
        config: the content of config.json.
    """
    parts = {**metrics["policies"], REWARD: metrics["reward"]}
    made, learner, retrain = (json.dumps(config[name], sort_keys=True) for name in ("env_kwargs", "learner", "retrain"))
    which = (env, made, config["gamma"], config["seed"], learner, retrain)
    rows = [(*which, part, name, value) for part, told in parts.items() for name, value in _numbers(told)]
    text = io.StringIO(newline="")
    csv.writer(text).writerows([COLUMNS, *rows])
    write_bytes(path, text.getvalue().encode())


def _numbers(told: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, float | None]]:
    """Numbers by their dotted names; lists are left out."""
    for name, value in told.items():
        if isinstance(value, Mapping):
            yield from _numbers(value, f"{prefix}{name}.")
        elif value is None or isinstance(value, int | float):
            yield f"{prefix}{name}", int(value) if isinstance(value, bool) else value
