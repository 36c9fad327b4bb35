"""The closed loop in one call: environment -> expert -> Minari -> LP-IRL -> reward -> SB3 -> how good it is."""

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from irl_gym.experiment import Experiment
from irl_gym.loop import STAGES, Loop, OnProgress
from irl_gym.run_folder import read_json


@dataclass(frozen=True, eq=False)
class Report:
    """What a run found, as it stands in the run's folder."""

    out: Path
    """The folder."""
    metrics: Mapping[str, Any]
    """The content of metrics.json: policies, reward, training, table."""
    certificate: Mapping[str, Any]
    """The content of certificate.json."""
    stages: Mapping[str, Mapping[str, Any]]
    """The record of each stage: wall seconds in the run that finished it, environment steps, what the solver did."""


def recover_and_retrain(experiment: Experiment, out: str | os.PathLike, on_progress: OnProgress | None = None) -> Report:
    """Recover a reward from an expert, retrain an agent on it, and judge the agent under the true reward.

    Leaves under `out`: config.json, expert.npz, dataset/ (Minari), reward.npz, certificate.json, agent.zip,
    agent_policy.npz, learning_curve.csv, metrics.json, figures/. A run that was killed continues after its last stage.

    Args:
        experiment: what to do.
        out: a new or empty folder, or one that holds this same experiment.
        on_progress: called with a stage and the share of it that is done.

    Raises:
        UnknownEnvironment, NotTabular, NotDiscrete, TableMismatch: no table can be made.
        DegenerateExpert: no reward prefers the expert's actions.
        SolverTimeout, SolverFailed: a linear program without an answer.
        RunConflict: the folder holds another run.
    """
    loop = Loop(experiment, out, on_progress)
    stages = {"table": {"seconds": loop.table_seconds}} | {name: loop.stage(name) for name in STAGES}
    content = loop.folder.load("metrics.json", read_json)
    return Report(loop.folder.path, content, loop.certificate, stages)
