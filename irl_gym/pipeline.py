"""The closed loop in one call: environment -> expert -> Minari -> LP-IRL -> reward -> SB3 -> how good it is."""

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from irl_gym.experiment import Experiment
from irl_gym.loop import STAGES, Loop, OnProgress


@dataclass(frozen=True, eq=False)
class Report:
    """What a run found, as it stands in the run's folder."""

    out: Path
    """The folder."""
    metrics: Mapping[str, Any]
    """The content of metrics.json: policies, reward, training, demonstrations, and table, None where there is none."""
    certificate: Mapping[str, Any]
    """The content of certificate.json."""
    stages: Mapping[str, Mapping[str, Any]]
    """The record of each stage: wall seconds in the run that finished it, environment steps, what the solver did."""


def recover_and_retrain(experiment: Experiment, out: str | os.PathLike, on_progress: OnProgress | None = None) -> Report:
    """Recover a reward from an expert, retrain an agent on it, and judge the agent under the true reward.

    Leaves under `out`: config.json, expert.npz, dataset/ (Minari), reward.npz, certificate.json, agent.zip,
    agent_policy.npz, learning_curve.csv, metrics.json, figures/. Where there is no table the expert is an expert.zip and there
    is no agent_policy.npz; a dataset that was given is not copied. A run that was killed continues after its last stage.

    Args:
        experiment: what to do.
        out: a new or empty folder, or one that holds this same experiment.
        on_progress: called with a stage and the share of it that is done.

    Raises:
        UnknownEnvironment, NotTabular, NotDiscrete, TableMismatch: no table can be made, and the learner needs one.
        DatasetMissing, DatasetMismatch: no such dataset, or one of another environment.
        DegenerateExpert: no reward prefers the expert's actions.
        SolverTimeout, SolverFailed: a linear program without an answer.
        RunConflict: the folder holds another run.
    """
    loop = Loop(experiment, out, on_progress)
    stages = {"table": {"seconds": loop.table_seconds}} | {name: loop.stage(name) for name in STAGES}
    return Report(loop.folder.path, loop.folder_metrics, loop.certificate, stages)
