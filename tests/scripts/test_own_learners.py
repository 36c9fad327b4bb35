"""A learner of a user's own, of rewards or of policies, from the command line to every report; nothing of irl_gym is edited."""

import shutil
from pathlib import Path

import pytest

from irl_gym.files.run_folder import read_json
from irl_gym.loop import loop

FEW = ("--episodes", "10", "--total-timesteps", "2000")


@pytest.fixture
def run(script, monkeypatch, tmp_path):
    """A run of a learner, without its figures, which take the time."""
    monkeypatch.setitem(loop.MAKERS, "figures", ())
    monkeypatch.syspath_prepend(Path(__file__).parents[1])

    def made(name, *more):
        return script("recover_and_retrain", "--learner", name, *FEW, *more, "--out", "run", cwd=tmp_path)

    return made


@pytest.mark.parametrize(
    ("name", "policy", "told", "code"),
    [
        ("own_learners:Dice", "retrained", "thrown with 6 sides", 1),
        ("own_learners:Copycat", "learned", "Not examined: the learner gives a policy", 3),
        ("clone", "learned", "without demonstrations", 3),
        ("softmax-clone", "learned", "above the least of its class", 3),
        ("neural-clone", "learned", "its action is another in", 3),
    ],
)
def test_a_learner_of_ones_own_goes_through_the_loop_and_its_reports(run, script, tmp_path, name, policy, told, code):
    done = run(name)
    assert done.returncode == 0 and policy in done.stdout and told in " ".join(done.stdout.split()), done.stderr
    assert policy in read_json(tmp_path / "run/metrics.json")["policies"]
    assert (
        read_json(tmp_path / "run/certificate.json")["proof"]["own"].get("states", "all") == "all"
    )  # no name of the library's
    assert script("report", "--run", "run", cwd=tmp_path).returncode == 0
    assert script("doctor", "--run", "run", cwd=tmp_path).returncode == code
    shutil.copytree(tmp_path / "run", tmp_path / "again")
    assert script("compare", "run", "again", cwd=tmp_path).returncode == 0


def test_options_reach_a_clone(run):
    done = run("clone", "--options", "unseen=near")
    assert done.returncode == 2 and "unseen is 'near': expected 'uniform', 'nearest' or 'refuse'" in done.stderr


def test_a_clone_of_numbered_states_is_refused_before_anything_is_trained_where_there_are_none(run):
    done = run("clone", "--env-id", "CartPole-v1")
    assert done.returncode == 2 and "NotDiscrete: no table of CartPole-v1" in " ".join(done.stderr.split())


def test_options_reach_a_learner_of_ones_own(run):
    done = run("own_learners:Dice", "--options", "sides=20", "--retrain", "value-iteration")
    assert done.returncode == 0 and "thrown with 20 sides" in done.stdout


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (("own_learners:Copycat", "--margin-cap", "0.1"), "--margin-cap is 0.1, but the learner is own_learners:Copycat"),
        (("trajectory-lp", "--reward-on", "state-action"), "which has no such option: expected finite-lp with it"),
        (("finite-lp", "--options", "sides=3"), "expected module:Class of your own with it"),
    ],
)
def test_an_option_of_another_learner_is_refused(run, arguments, told):
    done = run(*arguments)
    assert done.returncode == 2 and told in " ".join(done.stderr.split())


@pytest.mark.parametrize(("what", "told"), [("stats", "ndarray is not JSON serializable"), ("facts", "has the label 'xxx")])
def test_what_no_file_can_hold_is_refused_before_it_is_written(run, tmp_path, what, told):
    done = run("own_learners:Careless", "--options", f"what={what}")
    said = " ".join(done.stderr.split())
    assert done.returncode == 2 and "Careless proves or notes cannot be kept" in said and told in said
    assert not (tmp_path / "run" / "certificate.json").exists()
