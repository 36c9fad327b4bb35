"""What a run that did not finish left in its folder, as far as a doctor can use it.

A learner that finds no reward stops the run after the expert: then the table and the expert are there, and say why.
"""

from pathlib import Path
from typing import Any

import numpy as np

from irl_gym.demonstrations.datasets import read_minari
from irl_gym.demonstrations.shown import shown
from irl_gym.errors import IrlGymError
from irl_gym.features.linear_reward import load_reward
from irl_gym.files.own_files import check_links
from irl_gym.files.run_folder import START, changed, checked_record, read_json, read_record
from irl_gym.files.run_schema import Config, EnvironmentFile
from irl_gym.judging.diagnoses.case import Case
from irl_gym.mdp.policies import load_actions
from irl_gym.programs.status import Status
from irl_gym.runs.certificates import claims_in, read_certificate
from irl_gym.runs.identity import ENVIRONMENT, FIRST
from irl_gym.spaces.space_json import told_space
from irl_gym.tables.table_files import TABLE, load_table
from irl_gym.tables.tabulation import Tabulation


def left_behind(path: Path) -> Case | None:
    """The case that a folder's files make; None where they are not enough, cannot be read, or are not those that a run left."""
    try:
        check_links(path)
        if any(changed(path, read_record(path, stage) or {}) for stage in (START, *FIRST)):
            return None
        config = read_json(path / "config.json", Config)
        space = told_space("observations", read_json(path / ENVIRONMENT, EnvironmentFile)["observations"])
        table = load_table(path / TABLE, space)
        record = read_record(path, "reward") or {}
        learned = load_reward(path / "reward.npz") if record else None
        expert = _expert(path, config, table)
        claims = claims_in(read_certificate(path / "certificate.json")) if record else {}
    except (OSError, IrlGymError):
        return None
    reward = None if learned is None else learned.tabular(table.states)
    return Case(
        table.mdp, expert, reward, claims, Status(record["status"]) if record else None, record.get("stats", {}), table.reward,
        bool(config.get("shaping")), weights=None if learned is None else learned.alpha,
    )  # fmt: skip


def _expert(path: Path, config: dict[str, Any], table: Tabulation) -> np.ndarray:
    if config.get("epsilon"):
        return seen_with_noise(path, table)
    return load_actions(path / "expert.npz")


def seen_with_noise(path: Path, table: Tabulation) -> np.ndarray:
    """(S, A) what a learner knows of an expert with noise: its most frequent actions, NaN where it was never seen.

    Raises:
        DatasetMissing: the run's demonstrations are gone.
        OSError, DamagedFile: so is the record of them, or it is none.
    """
    record = checked_record(path, "demonstrations")
    episodes = list(read_minari(record["dataset_id"], root=path / "dataset"))
    return shown(episodes, table.states, table.mdp.n_actions, table.mdp).policy
