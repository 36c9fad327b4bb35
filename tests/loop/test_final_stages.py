"""The last stages of a run: killed at any of them it continues, and the same seed leaves the same bytes."""

import os
import re
import shutil
import signal
import subprocess
import sys

import models
import numpy as np
import pytest
from own_learners import Dice
from stopped import HANG

from irl_gym.agents.planners import SB3
from irl_gym.errors import RunIncomplete
from irl_gym.judging.curves import read_curve
from irl_gym.learners.linear_programs.finite import FiniteLP
from irl_gym.loop import filming, final_stages, loop
from irl_gym.loop.pipeline import recover_and_retrain
from irl_gym.runs.experiment import Experiment
from irl_gym.runs.run import read_run

ASKED = {"env_kwargs": {"is_slippery": False}, "episodes": 5, "eval_episodes": 5, "num_envs": 8}
COMMAND = ("irl-gym", "run", "--out", "run")
LATE = ("record", "ambiguity", "report")
TIMED = re.compile(r"agent\.zip|tensorboard/.*|\.stages/.*")
"""Files that hold the time."""
KILLED = """
import os, signal, sys
from irl_gym import Experiment, SB3, recover_and_retrain
from irl_gym.loop import final_stages
setattr(final_stages, sys.argv[1], lambda *given, **more: os.kill(os.getpid(), signal.SIGKILL))
recover_and_retrain(Experiment("FrozenLake-v1", 0.99, retrain=SB3(total_timesteps=2_048), **{asked}), sys.argv[2])
""".replace("{asked}", repr(ASKED))


def run(out, **changes):
    return recover_and_retrain(
        Experiment("FrozenLake-v1", 0.99, **{"retrain": SB3(total_timesteps=2_048), **ASKED, **changes}), out, command=COMMAND
    )


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    return run(tmp_path_factory.mktemp("late") / "run").out


def content(out):
    """Every file's bytes, those of the page without the seconds of its table of stages."""
    files = {one.relative_to(out).as_posix(): one.read_bytes() for one in out.rglob("*") if one.is_file()}
    files["report.html"] = re.sub(rb"<td>[\d.]+\xc2\xa0s</td>", b"", files["report.html"])
    return {name: held for name, held in files.items() if not TIMED.fullmatch(name)}


def differing(one, other):
    first, second = content(one), content(other)
    return [name for name in sorted({*first, *second}) if first.get(name) != second.get(name)]


def test_the_same_seed_and_command_leave_the_same_bytes_but_for_the_time(finished, tmp_path):
    again = run(tmp_path / "again").out
    assert differing(finished, again) == [] and len(content(finished)) > 20


@pytest.mark.parametrize(
    ("stage", "dies_in"), [("record", "write_metrics_csv"), ("ambiguity", "lambda_path"), ("report", "write_report")]
)
def test_a_run_killed_in_a_late_stage_continues_with_it(finished, tmp_path, stage, dies_in):
    out, left = shutil.copytree(finished, tmp_path / "run"), LATE[LATE.index(stage) :]
    for name in left:
        (out / ".stages" / f"{name}.json").unlink()
    made = subprocess.run([sys.executable, "-c", KILLED, dies_in, str(out)], capture_output=True, text=True, timeout=HANG)
    assert made.returncode == -signal.SIGKILL and any(one.is_dir() for one in out.glob(".irl_gym-*.tmp")), made.stderr
    if stage != "report":  # the page is not needed to read a run
        with pytest.raises(RunIncomplete, match=f"the stage '{stage}' was not finished"):
            read_run(out)
    stages = run(out).stages
    assert [name for name in stages if not stages[name].get("kept")] == ["table", *left]
    assert differing(finished, out) == []


def test_the_feasible_set_of_a_learner_is_not_worked_out_when_there_is_no_table(tmp_path):
    told = final_stages.feasible_set(tmp_path, FiniteLP(), None, None, {})
    assert told == {"no_ambiguity": "there is no table to work it out on"}


def test_a_path_with_more_pieces_than_are_kept_is_shown_and_says_so(tmp_path, monkeypatch):
    monkeypatch.setattr("irl_gym.loop.final_stages.MOST_PIECES", 3)
    out = run(tmp_path).out
    path = read_run(out).lambda_path
    assert len(path["rewards"]) <= 3 and not path["exact"] and path["gap"] > 0
    assert "There are more pieces than were worked out: between these the objective can be" in (out / "report.html").read_text()


def test_widths_of_steps_are_kept_by_state_and_action(tmp_path):
    out = run(tmp_path, learner=FiniteLP(reward_on="state-action")).out
    widths = read_run(out).widths
    assert widths["width"].shape == (16, 4) and (np.isfinite(widths["width"]).all(axis=1)).sum() == 11


def test_drawing_sets_no_variable_that_the_user_has_set_and_leaves_none_behind(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "offscreen")
    monkeypatch.delenv("SDL_AUDIODRIVER", raising=False)
    with filming._quietly():
        seen = [os.environ["SDL_VIDEODRIVER"], os.environ["SDL_AUDIODRIVER"]]
    assert seen == ["offscreen", "dummy"] and "SDL_AUDIODRIVER" not in os.environ


@pytest.mark.parametrize("lacking", ["r_max", "reward_on"])
def test_a_learner_without_what_its_feasible_set_takes_is_not_examined(tmp_path, lacking):
    mdp = models.random_model(0).mdp
    has = {name: one for name, one in (("r_max", 1.0), ("reward_on", "state")) if name != lacking}
    learner = type("Bold", (Dice,), {"of_feasible_set": True, **has})()
    told = final_stages.feasible_set(tmp_path, learner, mdp, np.zeros(7, dtype=int), {"proof": {"terms": {}}})
    assert f"is one of the feasible set, and has no {lacking}," in told["no_ambiguity"]


def test_a_run_whose_records_lost_their_digests_goes_on_with_its_agent(unvouched, monkeypatch):
    monkeypatch.setitem(loop.MAKERS, "figures", ())
    (unvouched / ".stages" / "agent.json").unlink()
    assert run(unvouched).metrics["training"]["environment_steps"] >= 2_048


def test_an_agent_that_is_warmed_begins_as_a_clone_of_the_demonstrations(tmp_path):
    report = run(tmp_path / "run", warm_start="clone", retrain=SB3(total_timesteps=512))
    curve, told = read_curve(tmp_path / "run/learning_curve.csv"), report.metrics["policies"]
    assert curve.value[0] == pytest.approx(told["expert"]["value"])
    assert told["retrained"]["how"] == "trained by PPO, from a clone of the demonstrations"
