"""The mends that the terminal names where it tells of a recovered reward are executed by the script itself, and serve."""

from pathlib import Path

import pytest
from forgetting import without_digests

from irl_gym.files.run_folder import read_json, write_json
from irl_gym.loop import loop

CUT, OPEN, SHORT = 'desc=["SFF","HFG"]', 'desc=["SFF","FFG"]', 'desc=["SFG"]'
PROGRAM = ("--margin-cap", "auto", "--l1", "0")
SAMPLED, DQN = ("--table", "sample", "--steps"), ("--retrain", "dqn", "--total-timesteps")
LINEAR = ("--learner", "feature-lp", "--features", "radial", "--size")
CASES = [
    ("another action is as good as the expert's to rounding", "a cap breaks (margin_cap='auto', --margin-cap auto)",
     (CUT, "--margin-cap", "none"), (CUT, *PROGRAM)),
    ("an action leads where the expert's own does", "one on states and actions can",
     (OPEN, "--margin-cap", "none"), (OPEN, "--margin-cap", "none", "--reward-on", "state-action")),
    ("may be noise", "more steps to count tell", (SHORT, *SAMPLED, "100"), (SHORT, *SAMPLED, "1000")),
    ("Every policy that is best under the reward has a score of at least", "try more --total-timesteps, or --retrain value-"
     "iteration.", (CUT, *DQN, "64"), (CUT, *DQN, "4000"), (CUT, "--retrain", "value-iteration")),
    ("no reward in the span of the features makes the expert optimal", "More or other features (--features) may",
     (*LINEAR, "2"), (*LINEAR, "3")),
]  # fmt: skip


@pytest.fixture
def told(script, monkeypatch, tmp_path):
    """What the terminal says of a run, on one line; its figures are not drawn, which take the time."""
    monkeypatch.setenv("COLUMNS", "250")
    monkeypatch.setitem(loop.MAKERS, "figures", ())

    def run(*arguments):
        where = () if arguments[0].startswith("--") else ("--env-kwargs",)
        few = () if "--retrain" in arguments else ("--retrain", "value-iteration")
        done = script("recover_and_retrain", *where, *arguments, "--episodes", "5", *few, cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        return " ".join(done.stdout.replace("│", " ").split())

    return run


@pytest.mark.parametrize(("complaint", "mend", "ill", "mended"), [(*one[:3], one[3:]) for one in CASES])
def test_a_mend_that_the_terminal_names_serves(told, complaint, mend, ill, mended):
    said = told(*ill)
    assert complaint in said and mend in said
    assert [each for each in mended if complaint in told(*each)] == []


def test_a_certificate_that_is_of_a_reward_where_none_was_learned_is_made_again(script, monkeypatch, tmp_path):
    monkeypatch.syspath_prepend(Path(__file__).parents[1])
    learn = "recover_and_retrain", "--learner", "own_learners:Copycat", "--episodes", "5", "--out", "run"
    assert script(*learn, cwd=tmp_path).returncode == 0
    out = without_digests(tmp_path / "run")
    held = read_json(out / "certificate.json")
    write_json(out / "certificate.json", held | {"optimality": {"expert_optimal": True, "facts": []}})
    mend = "delete certificate.json and metrics.json, and they are made again"
    assert mend in script("report", "--run", "run", cwd=tmp_path).stderr
    for name in ("certificate.json", "metrics.json"):
        (out / name).unlink()
    assert script(*learn, cwd=tmp_path).returncode == 0 and script("report", "--run", "run", cwd=tmp_path).returncode == 0
