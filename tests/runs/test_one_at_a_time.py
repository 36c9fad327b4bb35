"""Who runs a loop holds its folder from its claim to its end; what happens to the folder meanwhile is said in one sentence."""

import errno
import os
import re
import shutil
import signal
from pathlib import Path

import pytest
from stopped import run_until

from irl_gym.agents.planners import ValueIteration
from irl_gym.commands.door import main
from irl_gym.errors import RunConflict, RunIncomplete, UnknownEnvironment, WriteFailed
from irl_gym.files import own_files
from irl_gym.files.run_folder import read_json
from irl_gym.loop.pipeline import recover_and_retrain
from irl_gym.runs.experiment import Experiment
from irl_gym.runs.run import read_run

SCRIPT = Path(__file__).parents[2] / "scripts" / "recover_and_retrain.py"
LAKE = {"env_kwargs": {"is_slippery": False}, "episodes": 5, "eval_episodes": 5, "num_envs": 8, "retrain": ValueIteration()}


def asked(**changes):
    return Experiment("FrozenLake-v1", 0.99, **{**LAKE, **changes})


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    return recover_and_retrain(asked(), tmp_path_factory.mktemp("whole") / "run").out


@pytest.mark.parametrize(("moment", "other"), [(("table", 0.0), {}), (("table", 1.0), {"seed": 2}), (("report", 1.0), {})])
def test_nobody_else_works_in_a_folder_from_its_claim_to_its_end(finished, tmp_path, moment, other):
    said = []

    def meanwhile(*now):
        if now[:2] == moment and not said:
            with pytest.raises(RunConflict, match="another process works in") as told:
                recover_and_retrain(asked(**other), tmp_path / "run")
            said.append(told)

    recover_and_retrain(asked(), tmp_path / "run", meanwhile)
    assert said and same(finished, tmp_path / "run")


def same(one, other):
    names = ["config.json", "table.npz", "expert.npz", "reward.npz", "certificate.json", "metrics.json", "ambiguity.npz"]
    return all((one / name).read_bytes() == (other / name).read_bytes() for name in names)


def test_an_experiment_that_cannot_begin_leaves_no_folder(tmp_path):
    with pytest.raises(UnknownEnvironment):
        recover_and_retrain(Experiment("FrozenLaek-v1", 0.99), tmp_path / "runs" / "run")
    assert not list(tmp_path.iterdir())


def test_a_folder_of_other_things_is_refused_and_left_as_it_was(tmp_path):
    (tmp_path / "thesis.tex").write_text("")
    (tmp_path / ".thesis.tex.tmp").write_text("")
    with pytest.raises(RunConflict, match="holds no run"):
        recover_and_retrain(asked(), tmp_path)
    assert sorted(one.name for one in tmp_path.iterdir()) == [".thesis.tex.tmp", "thesis.tex"]


def test_a_run_with_a_link_out_of_it_is_neither_read_nor_continued(finished, tmp_path):
    out = shutil.copytree(finished, tmp_path / "run")
    shutil.move(out / "reward.npz", tmp_path / "reward.npz")
    (out / "reward.npz").symlink_to(tmp_path / "reward.npz")
    for use in (read_run, lambda path: recover_and_retrain(asked(), path)):
        with pytest.raises(
            RunConflict, match=r"reward\.npz is a link to .*: expected a file of its own\. Copy what it leads to"
        ):
            use(out)
    (out / "reward.npz").unlink()
    shutil.move(tmp_path / "reward.npz", out / "reward.npz")  # as the error says
    assert read_run(out).learned.values.shape == (16,)


@pytest.mark.parametrize("name", ["tensorboard", ".stages", "figures", ".irl_gym-0123456789abcdef.tmp"])
def test_nothing_is_written_through_a_link_in_a_run(tmp_path, name):
    (tmp_path / "outside").mkdir()
    out = tmp_path / "run"
    out.mkdir()
    (out / name).symlink_to(tmp_path / "outside")
    with pytest.raises(RunConflict, match="is a link to"):
        recover_and_retrain(asked(), out)
    assert not list((tmp_path / "outside").iterdir())


def test_a_run_whose_folder_is_a_link_is_continued(finished, tmp_path):
    shutil.copytree(finished, tmp_path / "real")
    (tmp_path / "link").symlink_to(tmp_path / "real")
    assert recover_and_retrain(asked(), tmp_path / "link").stages["agent"]["kept"]


STAGES = ("expert", "demonstrations", "reward", "agent", "clone", "metrics", "figures", "record", "ambiguity", "report")


@pytest.mark.parametrize("stage", ["expert", "agent", "record", "report"])
def test_a_folder_that_is_deleted_in_a_stage_is_said_to_be_gone(finished, tmp_path, stage):
    out = shutil.copytree(finished, tmp_path / "run")
    for name in STAGES[STAGES.index(stage) :]:
        (out / ".stages" / f"{name}.json").unlink()

    def meanwhile(*now):
        if now[:2] == (stage, 0.0):
            shutil.rmtree(out)

    with pytest.raises(WriteFailed, match=r"\.lock is gone.*Was the folder moved or deleted\?"):
        recover_and_retrain(asked(), out, meanwhile)
    assert not out.exists()


def test_a_full_disk_is_one_clear_error_wherever_it_comes_and_nothing_is_lost(finished, tmp_path, monkeypatch):
    """The files whose numbers are 1, 3, 6, 10 and so on find no room; the run is continued each time."""
    plain, out, calls = os.replace, tmp_path / "run", []
    refused = {n * (n + 1) // 2 for n in range(1, 20)}

    def full(source, target):
        calls.append(target)
        if len(calls) in refused:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(source))
        plain(source, target)

    monkeypatch.setattr(own_files.os, "replace", full)
    errors = 0
    while errors < 60:
        try:
            recover_and_retrain(asked(), out)
            break
        except WriteFailed as error:
            assert "make room, and the same command continues" in str(error)
            errors += 1
    assert errors >= 5 and same(finished, out)
    assert not list(out.glob(".*.tmp"))


@pytest.mark.parametrize("kilobytes", [1, 20])
def test_the_script_tells_of_a_full_disk_in_one_line(tmp_path, kilobytes):
    import resource
    import subprocess
    import sys

    command = [sys.executable, str(SCRIPT), "--out", "run", "--episodes", "5", "--retrain", "value-iteration"]
    limit = (kilobytes << 10, resource.RLIM_INFINITY)
    made = subprocess.run(
        command,
        cwd=tmp_path,
        capture_output=True,
        text=True,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, limit),
    )
    *stages, last = made.stderr.splitlines()
    assert made.returncode == 2 and last.startswith("WriteFailed: "), made.stderr
    assert all(re.match(r"\w+: (begun|done in )", line) for line in stages), made.stderr
    assert not list((tmp_path / "run").glob(".*.tmp"))


def test_what_a_killed_run_left_beside_its_files_goes_when_it_is_continued(tmp_path, monkeypatch, capsys, unchecked):
    arguments = ("--out", "run", "--episodes", "5", "--retrain", "value-iteration")
    made = run_until(SCRIPT, *arguments, where="irl_gym.loop.final_stages:write_metrics_csv", sent=signal.SIGKILL, cwd=tmp_path)
    assert made.returncode == -signal.SIGKILL and list((tmp_path / "run").glob(".irl_gym-*.tmp")), made.stderr
    with pytest.raises(RunIncomplete):
        read_run(tmp_path / "run")
    monkeypatch.chdir(tmp_path)
    assert main(["run", *arguments]) == 0, capsys.readouterr().err
    assert sorted(one.name for one in (tmp_path / "run").glob(".*")) == [".stages"]
    assert read_json(tmp_path / "run" / "metrics.json")
