"""What docs/security.md says of code: the library has no call that unpickles, and what is said to run code does."""

import base64
import json
import os
import re
import zipfile
from pathlib import Path

import cloudpickle
import gymnasium as gym
import pytest
from stable_baselines3 import PPO

from irl_gym.agents.planners import load_agent

ROOT = Path(__file__).parents[1]
CALLS = re.compile(
    r"\bpickle\.loads?\(|cloudpickle|joblib|VecNormalize\.load|torch\.load|allow_pickle=True|\beval\(|\bexec\(|os\.system|__import__"
)


@pytest.mark.parametrize("folder", ["irl_gym", "scripts", "envs"])
def test_no_source_unpickles_or_evaluates_what_it_reads(folder):
    found = [
        f"{path.relative_to(ROOT)}: {match[0]}"
        for path in sorted((ROOT / folder).rglob("*.py"))
        for match in CALLS.finditer(path.read_text(encoding="utf-8"))
    ]
    assert not found


def test_every_archive_is_read_by_the_one_reader_that_unpickles_nothing():
    for path in sorted((ROOT / "irl_gym").rglob("*.py")):
        assert not re.search(r"\bnp\.load\(|read_array\(|mmap_mode", path.read_text(encoding="utf-8")), path


class Bomb:
    def __init__(self, mark):
        self.mark = mark

    def __reduce__(self):
        return os.mkdir, (self.mark,)


def armed(path, mark):
    """An agent's zip as a stranger makes it."""
    PPO("MlpPolicy", gym.make("FrozenLake-v1"), n_steps=8, batch_size=8).save(path)
    with zipfile.ZipFile(path) as archive:
        parts = {name: archive.read(name) for name in archive.namelist()}
    bomb = base64.b64encode(cloudpickle.dumps(Bomb(str(mark)))).decode()
    parts["data"] = json.dumps(json.loads(parts["data"]) | {"theirs": {":type:": "x", ":serialized:": bomb}}).encode()
    with zipfile.ZipFile(path, "w") as archive:
        for name, content in parts.items():
            archive.writestr(name, content)


def test_an_agents_zip_runs_code_when_it_is_loaded_as_the_page_says(tmp_path):
    armed(tmp_path / "agent.zip", tmp_path / "mark")
    assert not (tmp_path / "mark").exists()
    load_agent(tmp_path / "agent.zip", "PPO")
    assert (tmp_path / "mark").exists()
