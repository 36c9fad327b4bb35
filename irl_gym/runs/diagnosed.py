"""The doctor on a run's folder, finished or not: what lies there becomes the case that `judging.diagnoses` examines."""

import os
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from irl_gym.errors import IrlGymError
from irl_gym.features.linear_reward import LinearReward
from irl_gym.judging.diagnoses.case import Case
from irl_gym.judging.diagnoses.doctor import as_tabular, diagnose
from irl_gym.judging.diagnoses.findings import NO_REWARD
from irl_gym.judging.diagnoses.findings import Diagnosis as Diagnosis
from irl_gym.judging.diagnoses.findings import Finding as Finding
from irl_gym.mdp.rewards import TabularReward
from irl_gym.programs.status import Status
from irl_gym.runs.certificates import claims_in
from irl_gym.runs.reading.unfinished import left_behind, seen_with_noise
from irl_gym.tables.tabulation import Tabulation


def diagnose_run(
    path: Path, config: Mapping[str, Any], stages: Mapping[str, Mapping[str, Any]], certificate: Mapping[str, Any],
    metrics: Mapping[str, Any], table: Tabulation | None, expert: np.ndarray | None,
    learned: TabularReward | LinearReward | None,
) -> Diagnosis:  # fmt: skip
    """The same of what lies in a finished run's folder: `supplied(diagnose_run, read_run(folder))`.

    Raises:
        InvalidReward, InvalidPolicy: files that do not belong together.
    """
    if learned is None:
        return NO_REWARD
    reward, claims = stages["reward"], claims_in(certificate)
    known = {"claims": claims, "status": Status(reward["status"]), "stats": reward["stats"], "judged": metrics}
    without = Case(**known, weights=learned.alpha)
    if table is None:
        return diagnose(without)
    gone = None
    if config.get("epsilon"):
        try:
            expert = seen_with_noise(path, table)
        except (IrlGymError, OSError) as error:
            expert, gone = None, f"what the expert was seen to do cannot be read any more ({error})"
    case = replace(
        without, mdp=table.mdp, expert=expert, reward=as_tabular(learned, table.mdp, table.states), true=table.reward,
        shaped=bool(config.get("shaping")), gone=gone,
    )  # fmt: skip
    return diagnose(case)


def diagnose_unfinished(path: str | os.PathLike) -> Diagnosis | None:
    """The same of the folder of a run that did not finish: from its table and expert, and its reward if there is one.

    None where the folder does not hold enough.
    """
    case = left_behind(Path(path))
    return None if case is None else diagnose(case)
