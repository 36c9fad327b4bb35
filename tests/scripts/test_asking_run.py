"""A learner that asks, from the command line to every report: who answers is the run's own expert."""

import shutil

import pytest

from irl_gym.demonstrations.datasets import load_minari
from irl_gym.files.run_folder import read_json
from irl_gym.learners.problem import Oracle
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


def files(folder):
    """What a run left, but for the seconds that its stages took and what is made of them."""
    left = {one.relative_to(folder).as_posix(): one for one in folder.rglob("*") if one.is_file()}
    return {name: one.read_bytes() for name, one in left.items() if not name.startswith((".stages/", "report.html"))}


def test_a_run_that_was_killed_between_answers_goes_on_there_and_leaves_the_same_bytes(run, tmp_path, monkeypatch):
    """And the set of all rounds is a Minari dataset."""
    options = ("--options", "rounds=3", "episodes=4", "beta=exponential")
    assert run(*options, out="whole").returncode == 0
    ask, asked = Oracle.ask, []

    def tired(self, *question, **more):
        if len(asked) == 60:
            raise KeyboardInterrupt
        asked.append(question)
        return ask(self, *question, **more)

    with monkeypatch.context() as patched:
        patched.setattr(Oracle, "ask", tired)
        run(*options, out="parts")
    kept = tmp_path / "parts/.reward.tmp/answers.txt"
    assert len(kept.read_text().splitlines()) == 60
    assert run(*options, out="parts").returncode == 0 and not kept.parent.exists()
    assert files(tmp_path / "parts").keys() == files(tmp_path / "whole").keys()
    different = {name for name, one in files(tmp_path / "parts").items() if one != files(tmp_path / "whole")[name]}
    assert different <= {"run.json"}  # which has the command, and its --out
    name = read_json(tmp_path / "parts/.stages/reward.json")["labels_id"]
    assert name == "irl_gym/frozenlake-v1-labels-v0"
    episodes = list(load_minari(name, root=tmp_path / "parts/labels").iterate_episodes())
    assert len(episodes) == 12 and {int(one.infos["round"][0]) for one in episodes} == {1, 2, 3}
