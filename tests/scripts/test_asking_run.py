"""A learner that asks, from the command line to every report: who answers is the run's own expert."""

import shutil

import pytest

from irl_gym.files.run_folder import read_json
from irl_gym.loop import loop


@pytest.fixture
def run(script, monkeypatch, tmp_path):
    """A run of DAgger, without its figures, which take the time."""
    monkeypatch.setitem(loop.MAKERS, "figures", ())

    def made(*more, out="run"):
        learner = more if "--learner" in more else ("--learner", "dagger", *more)
        return script("recover_and_retrain", *learner, "--episodes", "10", "--out", out, cwd=tmp_path)

    return made


def test_a_learner_that_asks_goes_through_the_loop_and_its_reports(run, script, tmp_path):
    done = run()
    told = " ".join(done.stdout.replace("│", "").split())
    assert done.returncode == 0 and "asked 110 times, in 11 states, over 10 rounds" in told, done.stderr
    policies = read_json(tmp_path / "run/metrics.json")["policies"]
    assert policies["learned"]["value"] == policies["expert"]["value"]
    assert policies["clone"]["how"].startswith("cloned from ") and policies["clone"]["how"].endswith(
        "; the learner could ask the expert"
    )
    assert script("report", "--run", "run", cwd=tmp_path).returncode == 0
    assert script("doctor", "--run", "run", cwd=tmp_path).returncode == 3  # no reward to examine
    shutil.copytree(tmp_path / "run", tmp_path / "again")
    assert script("compare", "run", "again", cwd=tmp_path).returncode == 0


def test_the_oracle_of_a_run_makes_the_mistakes_that_the_runs_expert_makes(run):
    done = run("--epsilon", "0.3", "--options", "rounds=3", "episodes=20")
    assert done.returncode == 0 and "it did not always answer the same" in " ".join(done.stdout.replace("│", "").split())


def test_episodes_without_their_expert_answer_nothing(run):
    assert run("--learner", "clone").returncode == 0
    done = run("--dataset", "irl_gym/frozenlake-v1-expert-v0", "--dataset-root", "run/dataset", out="next")
    assert done.returncode == 2
    assert "DAgger needs oracle, and the expert is known by its episodes only" in " ".join(done.stderr.split())
