"""The mend that an error of a learner that asks names is executed, and serves."""

import gymnasium as gym
import numpy as np
import pytest

from irl_gym.agents.planners import ValueIteration
from irl_gym.agents.simulator import Simulator
from irl_gym.errors import InvalidParameter
from irl_gym.learners.interactive.dagger import DAgger
from irl_gym.learners.problem import Oracle, Problem, Spaces


def test_episodes_are_asked_for_where_there_is_no_table():
    lake = gym.make("FrozenLake-v1")
    world = Simulator(lake, ValueIteration(), 0.9)
    problem = Problem(Spaces(lake.observation_space, lake.action_space), oracle=Oracle(lambda seen, info: 1), environment=world)
    with pytest.raises(InvalidParameter, match="Give `episodes`, such as 20"):
        DAgger(rounds=2).learn(problem, np.random.default_rng(0))
    assert DAgger(rounds=2, episodes=20).learn(problem, np.random.default_rng(0)).proof.queries > 0
