"""A run whose environment is stepped, broken off in the agent's training: it goes on there, and says so wherever it is read."""

import io

import gymnasium as gym
import pytest
from rich.console import Console

from irl_gym.agents.planners import SB3
from irl_gym.learners.linear_programs.trajectory import TrajectoryLP
from irl_gym.loop.learning_curve import Glances
from irl_gym.loop.pipeline import recover_and_retrain
from irl_gym.reports.terminal_report import print_report
from irl_gym.runs.experiment import Experiment
from irl_gym.runs.named_parts import features_named
from irl_gym.runs.run import read_run

SHORT = SB3(total_timesteps=64, hyperparameters={"n_steps": 8, "batch_size": 64})
TOTAL = 1_280
ASKED = Experiment(
    "CartPole-v1", 0.99, {"max_episode_steps": 30}, expert=SHORT, episodes=5, eval_episodes=5, inner=SHORT,
    learner=TrajectoryLP(features_named("radial", gym.make("CartPole-v1"), size=2), max_rounds=1, trajectories=20),
    retrain=SB3(total_timesteps=TOTAL, hyperparameters={"n_steps": 8, "batch_size": 64, "n_epochs": 1}),
)  # fmt: skip


def broken_off(path, monkeypatch, *, at):
    """Begin the run, and break it off as Ctrl-C does, once the agent has made so many steps; what was told of its stage."""
    see, told = Glances.see, []

    def stopping(self, steps, policy):
        see(self, steps, policy)
        if steps >= at:
            raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(Glances, "see", stopping)
        with pytest.raises(KeyboardInterrupt):
            recover_and_retrain(ASKED, path, lambda stage, share, known: told.append((stage, share, known)))
    return [one for one in told if one[0] == "agent"]


@pytest.fixture(scope="module")
def resumed(tmp_path_factory):
    path = tmp_path_factory.mktemp("resumed") / "run"
    told = []
    with pytest.MonkeyPatch.context() as patch:
        told.append(broken_off(path, patch, at=700))
    assert (path / ".agent.tmp.npz").exists()
    report = recover_and_retrain(ASKED, path, lambda stage, share, known: told.append((stage, share, known)))
    return report, told


def test_a_tenth_of_the_training_is_repeated_at_most(resumed):
    report, told = resumed
    (went_on,) = report.metrics["training"]["resumed_at"]
    assert told[0][-1][1] - went_on / TOTAL <= 0.1 and went_on <= told[0][-1][1] * TOTAL
    again = [share for stage, share, known in told[1:] if stage == "agent" and known.endswith(f"went on at step {went_on}")]
    assert min(again) > went_on / TOTAL


def test_the_steps_and_the_curve_are_those_of_the_whole_training(resumed):
    run = read_run(resumed[0].out)
    assert run.metrics["training"]["environment_steps"] == TOTAL
    assert run.curve.steps.tolist() == [*range(8, TOTAL, 16), TOTAL]


def test_nothing_is_left_of_the_checkpoint(resumed):
    assert list(resumed[0].out.glob(".*.tmp.npz")) == []


def test_page_and_terminal_say_that_it_is_not_as_in_one_go(resumed):
    report, _ = resumed
    (step,) = report.metrics["training"]["resumed_at"]
    told = f"resumed at step {step}: its result may be another than that of training in one go"
    said = io.StringIO()
    print_report(report, Console(file=said, width=400))
    assert told in " ".join(said.getvalue().split()) and told in (report.page).read_text()
