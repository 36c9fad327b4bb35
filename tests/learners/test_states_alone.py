"""What learners make of demonstrations of states alone: nobody is taught an action that nobody took."""

from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest
from demonstrations.test_inferred import FORK, states_of
from own_learners import Copycat

from irl_gym.agents.planners import ValueIteration
from irl_gym.agents.simulator import Simulator
from irl_gym.demonstrations.inferred import without_actions
from irl_gym.errors import InvalidDemonstrations, InvalidParameter
from irl_gym.features.feature_maps import OneHot
from irl_gym.judging.metrics import policy_value
from irl_gym.learners.cloning.clone import Clone
from irl_gym.learners.cloning.softmax import SoftmaxClone
from irl_gym.learners.linear_programs.feature import FeatureLP
from irl_gym.learners.linear_programs.finite import FiniteLP
from irl_gym.learners.linear_programs.trajectory import TrajectoryLP
from irl_gym.learners.needs import Needs
from irl_gym.learners.problem import Problem
from irl_gym.learners.registry import learner_of
from irl_gym.mdp.episodes import collect_from_table
from irl_gym.mdp.planning.dynamic_programming import policy_iteration
from irl_gym.mdp.tabular_mdp import TabularMDP


@pytest.fixture(scope="module")
def lake(toy_text):
    """The table of the slippery lake 4x4, the expert's value, and 300 of its episodes."""
    table = toy_text("FrozenLake 4x4 slippery")
    best = policy_iteration(table.mdp, table.reward)
    drawn = collect_from_table(table.mdp, table.payments.entries, table.states, best.policy, 300, seed=1, max_episode_steps=100)
    return table, policy_value(table.mdp, table.reward, best.policy), list(drawn)


def alone(lake, learner):
    """What is learned from the states alone."""
    return learner.learn(Problem.of(lake[0], demonstrations=without_actions(lake[2])), np.random.default_rng(0))


@pytest.mark.parametrize("learner", [FiniteLP(slack=1.0), FeatureLP(OneHot(16), margin_cap="auto")], ids=["finite", "feature"])
def test_a_linear_program_recovers_the_reward_from_states_alone(lake, learner):
    table, value, _ = lake
    found = alone(lake, learner)
    acting = policy_iteration(table.mdp, found.reward.tabular(table.states)).policy
    assert policy_value(table.mdp, table.reward, acting) > 0.99 * value
    assert found.facts()[1].label == "actions inferred"


@pytest.mark.parametrize("learner", [Clone(), SoftmaxClone(OneHot(16))], ids=["counts", "softmax"])
def test_a_clone_of_states_alone_goes_where_the_expert_went(lake, learner):
    table, value, _ = lake
    found = alone(lake, learner)
    assert policy_value(table.mdp, table.reward, found.policy) > 0.95 * value
    assert found.inferred is not None and found.proved()["facts"][1]["label"] == "actions inferred"


def test_a_clone_says_how_many_steps_it_was_shown(lake):
    assert " steps, in " in next(one.sentence for one in alone(lake, Clone()).facts() if one.label == "learned from")


def test_trajectories_need_no_actions(lake):
    table, _, episodes = lake
    world = Simulator(gym.make("FrozenLake-v1"), ValueIteration(), 0.99, table)
    learner = TrajectoryLP(OneHot(16), trajectories=20, horizon=20, max_rounds=2)
    both = [learner.fit(world, given).reward.alpha for given in (episodes, without_actions(episodes))]
    np.testing.assert_array_equal(*both)


def test_recorded_actions_are_not_called_inferred(lake):
    found = Clone().learn(Problem.of(lake[0], demonstrations=lake[2]))
    assert found.inferred is None and found.facts()[1].label == "learned from"


def test_a_state_that_was_visited_is_not_avoided_even_if_its_action_is_undecided():
    known = Problem.of(TabularMDP(FORK.P, 0.9, FORK.d0), demonstrations=states_of([0, 1, 0, 1], [0, 1, 0]))
    found = FiniteLP(slack=1.0).learn(known)
    assert found.inferred.undecided.tolist() == [1]
    assert found.reward.values[1] > -1 == found.reward.values[2]


# --- what cannot do without ---


def chosen(name):
    return Copycat() if name == "own" else learner_of(name, {})


@pytest.mark.parametrize("name", ["neural-clone", "own"])
def test_a_learner_that_needs_actions_says_whose_are_missing(lake, name):
    mixed = [lake[2][0], *without_actions(lake[2][1:3])]
    with pytest.raises(InvalidDemonstrations, match=r"needs actions, and episode 1 has only states: .*Record the actions too"):
        chosen(name).needs.of(Problem.of(lake[0], demonstrations=mixed), chosen(name))


@pytest.mark.parametrize("learner", [Clone(), SoftmaxClone(OneHot(16))], ids=["counts", "softmax"])
def test_nothing_is_inferred_without_a_table(lake, learner):
    table = Problem.of(lake[0], demonstrations=without_actions(lake[2][:2]))
    with pytest.raises(InvalidDemonstrations, match="Clone needs actions, and episode 0 has only states"):
        learner.learn(replace(table, dynamics=None))


def test_episodes_with_and_without_actions_are_not_mixed(lake):
    mixed = [*lake[2][:2], *without_actions(lake[2][2:3])]
    with pytest.raises(InvalidDemonstrations, match="episode 2 has only states, and 2 of the 3 episodes have actions"):
        FiniteLP().learn(Problem.of(lake[0], demonstrations=mixed))


def test_a_reward_on_steps_asks_for_the_actions_that_states_do_not_tell_apart():
    known = Problem.of(TabularMDP(FORK.P, 0.9, FORK.d0), demonstrations=states_of([0, 1, 0]))
    with pytest.raises(InvalidDemonstrations, match=r"in state 0 the actions \[0, 1\] lead to the same"):
        FiniteLP(reward_on="state-action").learn(known)


def test_an_expert_that_is_known_needs_no_episodes(lake):
    table, _, episodes = lake
    expert = policy_iteration(table.mdp, table.reward).policy
    found = FiniteLP().learn(Problem.of(table, demonstrations=without_actions(episodes), expert=expert))
    assert found.inferred is None


def test_needs_say_what_becomes_of_missing_actions(unchecked):
    with pytest.raises(InvalidParameter, match="actions are 'guessed'"):
        Needs(("demonstrations",), actions="guessed")
