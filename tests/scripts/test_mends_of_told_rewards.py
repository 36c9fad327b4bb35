"""The mends that the terminal names where it tells of a recovered reward are executed by the script itself, and serve."""

import pytest

from irl_gym import figures

CUT, OPEN, SHORT = 'desc=["SFF","HFG"]', 'desc=["SFF","FFG"]', 'desc=["SFG"]'
PROGRAM = ("--margin-cap", "auto", "--l1", "0")
SAMPLED, DQN = ("--table", "sample", "--steps"), ("--retrain", "dqn", "--total-timesteps")
LINEAR = ("--learner", "feature-lp", "--features", "radial", "--size")
CASES = [
    ("the expert has no margin there.", "Try --margin-cap auto --l1 0.", (CUT, "--margin-cap", "none"), (CUT, *PROGRAM)),
    ("the expert has no margin there.", "Try --margin-cap auto --l1 0.", (CUT, "--l1", "auto"), (CUT, *PROGRAM)),
    ("the expert has no margin there.", "Try --reward-on state-action.",
     (CUT, "--margin-cap", "0.5"), (CUT, "--margin-cap", "0.5", "--reward-on", "state-action")),
    ("there an action has the expert's successors.", "Try --reward-on state-action.",
     (OPEN, "--margin-cap", "none"), (OPEN, "--margin-cap", "none", "--reward-on", "state-action")),
    ("may be noise.", "Try more steps to count.", (SHORT, *SAMPLED, "100"), (SHORT, *SAMPLED, "1000")),
    ("Every policy that is best under the reward has a score of at least", "try more --total-timesteps, or --retrain value-"
     "iteration.", (CUT, *DQN, "64"), (CUT, *DQN, "4000"), (CUT, "--retrain", "value-iteration")),
    ("no reward in the span of the features makes the expert optimal.", "Try more --features", (*LINEAR, "2"), (*LINEAR, "3")),
]  # fmt: skip


@pytest.fixture
def told(script, monkeypatch, tmp_path):
    """What the terminal says of a run, on one line; its figures are not drawn, which take the time."""
    monkeypatch.setenv("COLUMNS", "250")
    monkeypatch.setattr(figures, "draw", lambda *_, **__: None, raising=False)

    def run(*arguments):
        where = () if arguments[0].startswith("--") else ("--env-kwargs",)
        few = () if "--retrain" in arguments else ("--retrain", "value-iteration")
        done = script("recover_and_retrain", *where, *arguments, "--episodes", "5", *few, cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        return " ".join(done.stdout.replace("│", " ").split())

    return run


@pytest.mark.parametrize(("complaint", "mend", "ill", "mended"), [(*one[:3], one[3:]) for one in CASES])
def test_a_mend_that_the_terminal_names_serves(told, complaint, mend, ill, mended):
    assert mend in told(*ill).partition(complaint)[2][: len(mend) + 8]
    assert [each for each in mended if complaint in told(*each)] == []
