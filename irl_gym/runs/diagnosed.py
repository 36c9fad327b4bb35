"""The doctor on a run's folder, finished or not: what lies there becomes the case that `judging.diagnoses` examines."""

import os
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from irl_gym.errors import IrlGymError
from irl_gym.judging.diagnoses.case import Case
from irl_gym.judging.diagnoses.doctor import as_tabular, diagnose, weights_of
from irl_gym.judging.diagnoses.findings import NO_REWARD
from irl_gym.judging.diagnoses.findings import Diagnosis as Diagnosis
from irl_gym.judging.diagnoses.findings import Finding as Finding
from irl_gym.programs.status import Status
from irl_gym.runs.certificates import claims_in
from irl_gym.runs.reading.unfinished import left_behind, seen_with_noise

if TYPE_CHECKING:
    from irl_gym.runs.run import Run


def diagnose_run(run: "Run") -> Diagnosis:
    """The same of a run's folder, as `irl_gym.runs.run.read_run` reads it.

    Raises:
        InvalidReward, InvalidPolicy: files that do not belong together.
    """
    if run.learned is None:
        return NO_REWARD
    reward, table, claims = run.stages["reward"], run.table, claims_in(run.certificate)
    known = {"claims": claims, "status": Status(reward["status"]), "stats": reward["stats"], "judged": run.metrics}
    without = Case(**known, weights=weights_of(run.learned))
    if table is None:
        return diagnose(without)
    expert, gone = run.expert, None
    if run.config.get("epsilon"):
        try:
            expert = seen_with_noise(run.path, table)
        except (IrlGymError, OSError) as error:
            expert, gone = None, f"what the expert was seen to do cannot be read any more ({error})"
    case = replace(
        without, mdp=table.mdp, expert=expert, reward=as_tabular(run.learned, table.mdp, table.states), true=table.reward,
        shaped=bool(run.config.get("shaping")), gone=gone,
    )  # fmt: skip
    return diagnose(case)


def diagnose_unfinished(path: str | os.PathLike) -> Diagnosis | None:
    """The same of the folder of a run that did not finish: from its table and expert, and its reward if there is one.

    None where the folder does not hold enough.
    """
    case = left_behind(Path(path))
    return None if case is None else diagnose(case)
