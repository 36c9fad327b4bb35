"""The loop where time is short: a limit that is shown, and a learner of so many steps."""

import gymnasium as gym
import pytest
from gymnasium.wrappers import TimeAwareObservation

from irl_gym.agents.planners import ValueIteration
from irl_gym.learners.linear_programs.finite import FiniteLP
from irl_gym.loop.pipeline import recover_and_retrain
from irl_gym.runs.experiment import Experiment
from irl_gym.runs.run import read_run

SHORT = {"episodes": 5, "eval_episodes": 12, "retrain": ValueIteration()}


@pytest.fixture
def timed():
    """A lake of eight steps that shows how many are taken."""

    def made(**kwargs):
        return TimeAwareObservation(gym.make("FrozenLake-v1", is_slippery=False, max_episode_steps=8), flatten=False)

    gym.register("TimedLake-v0", entry_point=made)
    yield "TimedLake-v0"
    gym.registry.pop("TimedLake-v0")


def test_an_agent_finds_the_goal_within_a_limit_that_is_shown_and_the_run_is_read_again(timed, tmp_path):
    report = recover_and_retrain(Experiment(timed, 0.99, **SHORT), tmp_path / "run")
    row = report.metrics["policies"]["retrained"]
    assert (row["expected_return"], row["mean_return"]) == (1.0, 1.0) and report.metrics["table"]["limit"] == 8
    again = read_run(tmp_path / "run")
    assert again.table.mdp.horizon == 8 and again.metrics["policies"]["retrained"]["expected_return"] == 1.0


def test_a_learner_of_so_many_steps_tells_in_its_certificate_that_the_expert_is_the_best_at_each_time(tmp_path):
    asked = Experiment("FrozenLake-v1", 0.99, env_kwargs={"is_slippery": False}, learner=FiniteLP(horizon=8), **SHORT)
    terms = recover_and_retrain(asked, tmp_path / "run").certificate["proof"]["terms"]
    assert (terms["horizon"], terms["optimal_within"]) == (8, True)
    assert read_run(tmp_path / "run").certificate["proof"]["terms"]["optimal_within"] is True
