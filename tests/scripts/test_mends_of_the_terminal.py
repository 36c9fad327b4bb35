"""The mends that the terminal names where it tells of a recovered reward are executed by the script itself, and serve."""

import pytest

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
