"""What mistakes cost, and classes that must err choose the cheap ones (AggreVaTe)."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from models import random_model

from irl_gym.errors import InvalidParameter
from irl_gym.features.feature_maps import OneHot
from irl_gym.learners.cloning.clone import Clone
from irl_gym.learners.cloning.softmax import SoftmaxClone
from irl_gym.learners.interactive.dagger import DAgger
from irl_gym.learners.interactive.prices import prices
from irl_gym.learners.problem import Oracle, Problem
from irl_gym.mdp.planning.dynamic_programming import occupancy, policy_evaluation
from irl_gym.mdp.policies import TabularPolicy, as_distribution
from irl_gym.mdp.rewards import TabularReward
from irl_gym.mdp.tabular_mdp import TabularMDP
from irl_gym.spaces.states import StateIndex

CELLS = [0, 0, 0, 1, 1, 2, 2]


def oracle(mdp, actions):
    states = StateIndex(Problem.of(mdp).spaces.observations)
    return Oracle(TabularPolicy(as_distribution(actions, mdp.n_states, mdp.n_actions), states))


def problem(model):
    return Problem.of(model.mdp, oracle=oracle(model.mdp, model.expert), reward=TabularReward(model.R))


@given(st.integers(0, 50))
@settings(max_examples=10)
def test_what_a_policy_loses_is_what_its_actions_cost_where_it_comes_to(seed):
    model, drawn = random_model(seed), np.random.default_rng(seed)
    mdp, reward = model.mdp, TabularReward(model.R)
    teacher, policy = drawn.dirichlet(np.ones(3), size=(2, 7))  # also of an expert that errs
    costs = prices(oracle(mdp, teacher), mdp, reward)
    V, V_pi = (policy_evaluation(mdp, reward, one) for one in (teacher, policy))
    assert (occupancy(mdp, policy) * costs).sum() == pytest.approx(mdp.d0 @ (V - V_pi), abs=1e-9)


def urn():
    """Three situations that end after one step, told apart by nobody: the rarest costs the most."""
    P = np.zeros((4, 2, 4))
    P[:3, :, 3] = 1
    mdp = TabularMDP.from_dense(P, 0.9, np.array([0.45, 0.45, 0.1, 0.0]))
    paid = np.array([[1.0, 0.0], [1.0, 0.0], [0.0, 50.0], [0.0, 0.0]])
    return Problem.of(mdp, oracle=oracle(mdp, [0, 0, 1, 0]), reward=TabularReward(paid))


@pytest.mark.parametrize("episodes", [None, 400], ids=["exactly", "by episodes"])
@pytest.mark.parametrize(
    ("learner", "apart"),
    [(Clone(cells=[0] * 4), False), (SoftmaxClone(np.ones((4, 1))), False), (SoftmaxClone(OneHot(4)), True)],
    ids=["a cell", "a feature", "features of all states"],
)
def test_a_class_that_must_err_makes_the_cheap_mistakes(learner, apart, episodes):
    def chosen(cost):
        told = DAgger(rounds=2, learner=learner, episodes=episodes, cost=cost)
        return told.learn(urn(), np.random.default_rng(0)).policy.argmax(axis=1)[:3].tolist()

    assert chosen("mistakes") == ([0, 0, 1] if apart else [0, 0, 0])
    assert chosen("advantage") == ([0, 0, 1] if apart else [1, 1, 1])


@given(st.integers(0, 30))
@settings(max_examples=8)
def test_a_clone_of_cells_costs_the_least_of_all_policies_of_its_cells(seed):
    model = random_model(seed)
    costs, weights = prices(oracle(model.mdp, model.expert), model.mdp, TabularReward(model.R)), np.arange(1.0, 8)
    found = Clone(cells=CELLS).fit_costs(weights[:, None] * costs, weights > 0).policy
    of_cells = [np.eye(3)[np.array(one)[CELLS]] for one in np.ndindex(3, 3, 3)]
    each = [(weights[:, None] * costs * one).sum() for one in of_cells]
    assert (weights[:, None] * costs * found).sum() == pytest.approx(min(each))


@pytest.mark.parametrize("episodes", [None, 30])
def test_a_full_table_is_worth_what_the_oracle_is(episodes):
    model = random_model(1)
    found = DAgger(rounds=4, cost="advantage", episodes=episodes, max_episode_steps=30)
    outcome = found.learn(problem(model), np.random.default_rng(0))
    best = model.mdp.d0 @ policy_evaluation(model.mdp, TabularReward(model.R), model.expert)
    assert outcome.proof.value == pytest.approx(best) and "AggreVaTe" in found.how


def test_a_state_in_which_all_costs_the_same_was_visited_too():
    found = Clone(unseen="refuse").fit_costs(np.zeros((2, 3)), np.array([True, True]))
    np.testing.assert_array_equal(found.policy, np.eye(3)[[0, 0]])


@pytest.mark.parametrize("lacks", ["no reward", "an oracle that is a function"])
def test_prices_of_what_is_not_known_are_refused(lacks):
    model = random_model(1)
    told = {"oracle": Oracle(lambda row, info: 0), "reward": TabularReward(model.R)}
    if lacks == "no reward":
        told = {"oracle": oracle(model.mdp, model.expert)}
    with pytest.raises(InvalidParameter, match=f"cost is 'advantage', and there is {lacks}"):
        DAgger(cost="advantage").learn(Problem.of(model.mdp, **told), np.random.default_rng(0))
