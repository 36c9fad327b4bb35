"""A stranger's run is read by report, doctor and compare without making, importing or calling anything that it names."""

import json
import shutil
import sys
from pathlib import Path

import pytest
from forgetting import without_digests

SCRIPTS = Path(__file__).parents[2] / "scripts"
NAMED = {
    "an environment of a module": {"env_id": "evil_names:Theirs-v0"},
    "a dataset": {"env_id": None, "dataset": "their/data-v0", "dataset_root": "datasets"},
    "cells": {"env_id": "evil_names:Theirs-v0", "bins": 5},
    "trust": {"env_id": None, "dataset": "their/data-v0", "dataset_root": "datasets", "trust_dataset": True},
}
SPEC = {"id": "Theirs-v0", "entry_point": "evil_names:call", "kwargs": {}, "additional_wrappers": []}


@pytest.fixture
def evil(tmp_path, monkeypatch):
    """A module that leaves a mark where it is imported; the mark."""
    mark = tmp_path / "mark"
    (tmp_path / "evil_names.py").write_text(f"open({str(mark)!r}, 'a').write('imported')\ndef call(**named): pass\n")
    monkeypatch.syspath_prepend(tmp_path)
    yield mark
    sys.modules.pop("evil_names", None)


@pytest.fixture
def stranger(planned, tmp_path, evil):
    """Folders of two runs that name things, and a dataset that does."""
    metadata = next((planned / "plain" / "dataset").rglob("metadata.json"))
    theirs = tmp_path / "datasets" / "their" / "data-v0"
    shutil.copytree(metadata.parents[1], theirs)
    content = json.loads((theirs / "data" / "metadata.json").read_text()) | {"env_spec": json.dumps(SPEC)}
    (theirs / "data" / "metadata.json").write_text(json.dumps(content))

    def make(changes, without=()):
        for name in "ab":
            folder = without_digests(shutil.copytree(planned / "plain", tmp_path / name))  # a forger writes others
            config = json.loads((folder / "config.json").read_text()) | changes
            (folder / "config.json").write_text(json.dumps(config))
            agreeing(folder, config)
            for one in without:
                (folder / one).unlink()
        return tmp_path

    return make


def agreeing(folder, config):
    """Have a run's other files say what its config.json says, else the run is refused for that."""
    metrics = json.loads((folder / "metrics.json").read_text())
    if config["env_id"] is None:
        metrics["demonstrations"] |= {"given": True, "episodes_only": True}
        metrics["policies"]["expert"]["how"] = f"known by {metrics['demonstrations']['episodes']} episodes of the dataset"
    else:
        environment = json.loads((folder / "environment.json").read_text())
        (folder / "environment.json").write_text(json.dumps(environment | {"id": config["env_id"]}))
    (folder / "metrics.json").write_text(json.dumps(metrics))


COMMANDS = {"report": ("--run", "a"), "doctor": ("--run", "a"), "compare": ("a", "b")}


@pytest.mark.parametrize("named", NAMED)
@pytest.mark.parametrize("program", COMMANDS)
def test_reading_a_run_makes_nothing_that_it_names(called, stranger, evil, program, named):
    cwd = stranger(NAMED[named])
    done = called(SCRIPTS / f"{program}.py", *COMMANDS[program], cwd=cwd)
    assert done.returncode == 0, done.stderr
    assert not evil.exists()


@pytest.mark.parametrize("without", ["environment.json", "table.npz"])
@pytest.mark.parametrize("program", COMMANDS)
def test_a_run_that_does_not_say_enough_is_refused_in_a_sentence_and_nothing_is_made(called, stranger, evil, program, without):
    cwd = stranger(NAMED["cells"], without=[without])
    done = called(SCRIPTS / f"{program}.py", *COMMANDS[program], cwd=cwd)
    assert done.returncode == 2 and not evil.exists()
    assert done.stderr.startswith("RunIncomplete: ") and "no environment is made to read a run" in done.stderr


def test_a_command_that_is_not_ours_is_said_to_be_anothers(called, stranger):
    cwd = stranger({})
    told = json.loads((cwd / "a" / "run.json").read_text()) | {"command": ["rm", "-rf", "all"]}
    (cwd / "a" / "run.json").write_text(json.dumps(told))
    (cwd / "a" / "reward.npz").unlink()
    done = called(SCRIPTS / "report.py", "--run", "a", cwd=cwd)
    assert "A command of another program, it says, continues it: rm -rf all --out a" in done.stderr


@pytest.mark.parametrize("program", COMMANDS)
def test_no_zip_of_a_run_is_opened(called, stranger, program):
    cwd = stranger({})
    for folder in "ab":
        for name in ("expert.zip", "agent.zip"):  # to open one would fail
            (cwd / folder / name).mkdir()
    assert called(SCRIPTS / f"{program}.py", *COMMANDS[program], cwd=cwd).returncode == 0
