"""The mends that errors about episodes without actions name are executed, and serve."""

import re

import gymnasium as gym
import numpy as np
import pytest
from demonstrations.test_inferred import FORK, THREE, states_of
from mended import named

from irl_gym.agents.planners import ValueIteration
from irl_gym.agents.simulator import Simulator
from irl_gym.demonstrations.inferred import infer, without_actions
from irl_gym.environments.tabular_env import TabularEnv
from irl_gym.errors import IrlGymError
from irl_gym.features.feature_maps import OneHot
from irl_gym.learners.cloning.clone import Clone
from irl_gym.learners.linear_programs.feature import FeatureLP
from irl_gym.learners.linear_programs.finite import FiniteLP
from irl_gym.learners.linear_programs.trajectory import TrajectoryLP
from irl_gym.learners.problem import Problem
from irl_gym.mdp.episodes import WITHOUT_ACTIONS, Episode, empirical_policy
from irl_gym.mdp.rewards import TabularReward
from irl_gym.mdp.tabular_mdp import TabularMDP
from irl_gym.tables.counted.counting import Counting

MDP = TabularMDP(FORK.P, 0.9, FORK.d0)
ALONE, ALIKE = states_of([0, 2, 0], [0, 2, 2]), states_of([0, 1, 0])
ACTED = [Episode(one.observations, np.array(taken), one.rewards, False, True)
         for one, taken in zip(ALONE, ([2, 0], [2, 1]), strict=True)]  # fmt: skip
STEPS = FiniteLP(reward_on="state-action")


def on_table(learner, episodes=ALONE):
    return learner.learn(Problem.of(MDP, demonstrations=episodes))


def by_trajectories():
    env = gym.wrappers.TimeLimit(TabularEnv(MDP, TabularReward(np.zeros(3))), 5)
    learner = TrajectoryLP(OneHot(3), trajectories=3, horizon=2, max_rounds=1)
    return learner.fit(Simulator(env, ValueIteration(), 0.9), ALONE)


CASES = [
    ("Record the actions too;", lambda: empirical_policy(ALONE, THREE, 3), lambda: empirical_policy(ACTED, THREE, 3)),
    ("or learn from states alone, where the table is known with FiniteLP, FeatureLP or Clone,",
     lambda: Counting().count(ALONE, THREE.space, 3, gamma=0.9),
     lambda: [on_table(one) for one in (FiniteLP(slack=1.0), FeatureLP(OneHot(3)), Clone())]),
    ("else with TrajectoryLP.", lambda: Clone().learn(Problem(Problem.of(MDP).spaces, ALONE)), by_trajectories),
    ("Record the actions too,", lambda: on_table(STEPS, ALIKE), lambda: on_table(STEPS, ACTED)),
    ('or use reward_on="state" (--reward-on state).',
     lambda: on_table(STEPS, ALIKE), lambda: on_table(FiniteLP(slack=1.0), ALIKE)),
    ("Give the table of the environment in which the episodes were recorded.",
     lambda: infer(states_of([0, 0]), THREE, FORK), lambda: infer(states_of([0, 1]), THREE, FORK)),
    ("Leave the others out,",
     lambda: on_table(Clone(), [ACTED[0], ALONE[1]]), lambda: on_table(Clone(), [ALONE[1]])),
    ("or take the states of all, with `irl_gym.demonstrations.inferred.without_actions(episodes)`.",
     lambda: on_table(Clone(), [ACTED[0], ALONE[1]]), lambda: on_table(Clone(), without_actions([ACTED[0], ALONE[1]]))),
]  # fmt: skip


@pytest.mark.parametrize(("says", "breaks", "mended"), CASES, ids=[one[0] for one in CASES])
def test_a_mend_that_an_error_about_missing_actions_names_serves(says, breaks, mended):
    with pytest.raises(IrlGymError, match=re.escape(says)):
        breaks()
    assert mended() is not None


def test_every_mend_that_an_error_about_missing_actions_names_is_executed():
    said = " ".join(one[0] for one in CASES)
    assert WITHOUT_ACTIONS in said
    assert not [one for one in named("demonstrations/inferred.py", "demonstrations/shown.py") if not re.search(one, said)]
