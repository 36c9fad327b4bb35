"""What is read of a run's folder: by who reports, compares, examines or continues it, and by who continues an export."""

import contextlib
import hashlib
import io
import json
import shutil
from pathlib import Path
from unittest import mock

import gymnasium as gym
import numpy as np
from forgetting import without_digests
from fuzz.sound import sound_episode, sound_reward, sound_table
from numbered import Numbered
from rich.console import Console

from irl_gym.agents.planners import ValueIteration
from irl_gym.demonstrations import export
from irl_gym.demonstrations.datasets import described, read_minari
from irl_gym.files.run_folder import RunFolder, read_record
from irl_gym.loop.pipeline import recover_and_retrain
from irl_gym.mdp.policies import as_distribution
from irl_gym.reports.comparison.comparison_page import write_comparison
from irl_gym.reports.page.report import write_report
from irl_gym.reports.terminal_report import print_report
from irl_gym.runs.diagnosed import diagnose_run, diagnose_unfinished
from irl_gym.runs.experiment import Experiment
from irl_gym.runs.identity import claim
from irl_gym.runs.reading.unfinished import left_behind
from irl_gym.runs.run import read_run
from irl_gym.runs.supply import supplied
from irl_gym.tables.table_files import kept_table

ASKED = Experiment("FrozenLake-v1", 0.9, retrain=ValueIteration(), episodes=3, eval_episodes=3, num_envs=2)
LAKE = gym.make("FrozenLake-v1")


def sound_run(folder):
    """A run that vouches for its files has those that were recorded."""
    run = read_run(folder)
    sound_table(run.table)
    sound_reward(run.learned)
    for policy in (run.expert, run.agent):
        as_distribution(policy, run.table.mdp.n_states, run.table.mdp.n_actions)
    assert all(one.shape == (16,) for one in run.widths.values()) and run.curve.value.dtype.kind == "f"
    for record in (*run.stages.values(), read_record(folder, "start")) if run.vouched else ():
        for name, recorded in record.get("sha256", {}).items():  # a stage of whose files none was read may have lost it
            assert hashlib.sha256((folder / name).read_bytes()).hexdigest() == recorded


def write_page(folder):
    """A second run beside, to compare with; the first as a stranger wrote it, who writes digests of anything."""
    shutil.copytree(folder, folder.parent / "clean")
    without_digests(folder)


def read_page(folder):
    write_report(read_run(folder), folder.parent / "page.html")


def read_comparison(folder):
    write_comparison([read_run(folder.parent / "clean"), read_run(folder)], folder.parent / "page.html")


def read_diagnosis(folder):
    diagnose_unfinished(folder)
    found = supplied(diagnose_run, read_run(folder))
    assert found.examined and all(one.sentence and one.mend for one in found.findings)


def read_folder(folder):
    config = json.loads((folder.parent / "config.json").read_text())
    claim(folder, config)
    run = RunFolder(folder, config)
    for stage in ("table", "reward", "agent"):
        run.done(stage)
    if (table := kept_table(folder, LAKE.observation_space)) is not None:
        sound_table(table)
    left_behind(folder)


def write_unfinished(folder):
    for stage in ("metrics", "ambiguity"):
        (folder / ".stages" / f"{stage}.json").unlink()
    without_digests(folder)


@contextlib.contextmanager
def copied(folder):
    """A copy that is written into, and gone afterwards."""
    try:
        yield Path(shutil.copytree(folder, folder.parent / "copy"))
    finally:
        shutil.rmtree(folder.parent / "copy")


def read_unfinished(folder):
    """And the report on the terminal, which is rendered there."""
    with copied(folder) as copy:
        print_report(recover_and_retrain(ASKED, copy), Console(file=io.StringIO()))


def exported(root, demonstrator):
    about = described("lake-v0", LAKE, None, None, "hdf5", {"algorithm_name": "numbers"})
    with mock.patch.object(export, "SHARD_BYTES", 1):
        return export.export_dataset(lambda folder: demonstrator, about, export.Amount(episodes=7), {"seed": 0}, root=root)


def write_export(folder):
    with contextlib.suppress(KeyboardInterrupt):
        exported(folder, Numbered(breaks_at=4))


def read_export(folder):
    with copied(folder) as copy:
        made = exported(copy, Numbered())
        found = list(read_minari(made))
        assert len(found) == made.total_episodes >= 7 and np.isfinite([one.total_reward for one in found]).all()
    for one in found:
        sound_episode(one)
