"""Membership of the feasible set, against exact planning, and rewards made from values and advantages."""

import json

import models
import numpy as np
import pytest
import reference
from hypothesis import given
from hypothesis import strategies as st

from irl_gym.errors import InvalidMDP, InvalidParameter, InvalidPolicy, InvalidReward
from irl_gym.judging.ambiguity.feasible import feasible_reward, membership, sample_feasible
from irl_gym.learners.linear_programs.finite import FiniteLP
from irl_gym.mdp.optimality import certify
from irl_gym.mdp.planning.dynamic_programming import policy_evaluation, policy_iteration
from irl_gym.mdp.tabular_mdp import TabularMDP

seeds = st.integers(0, 2**32 - 1)


def perturbed(model, seed, states):
    """The optimal policy with another action in some states."""
    rng = np.random.default_rng(seed)
    expert = model.expert.copy()
    expert[rng.choice(expert.size, states, replace=False)] = rng.integers(model.mdp.n_actions, size=states)
    return expert


def optimal_by_planning(mdp, expert, reward):
    """Does exact planning find nothing better than the expert?"""
    found = policy_iteration(mdp, reward)
    best = found.V
    return bool(np.abs(best - policy_evaluation(mdp, reward, expert)).max() <= 1e-8)


@given(models.models(), seeds, st.integers(0, 2))
def test_membership_agrees_with_planning_for_rewards_on_states(model, seed, states):
    expert = perturbed(model, seed, states)
    on_steps = np.where(model.mdp.terminal[:, None], 0.0, model.step_reward)
    assert membership(model.mdp, expert, model.R).member == optimal_by_planning(model.mdp, expert, on_steps)


@given(models.models(), seeds, st.integers(0, 2))
def test_membership_agrees_with_planning_for_rewards_on_steps(model, seed, states):
    expert = perturbed(model, seed, states)
    R = np.random.default_rng(seed).uniform(-1, 1, (model.mdp.n_states, model.mdp.n_actions))
    R = np.where(model.mdp.terminal[:, None], 0.0, R)
    best = policy_iteration(model.mdp, R).policy
    assert membership(model.mdp, best, R).member
    assert membership(model.mdp, expert, R).member == optimal_by_planning(model.mdp, expert, R)


@given(models.models())
def test_margins_are_those_of_the_paper(model):
    found = membership(model.mdp, model.expert, model.R)
    expected = reference.margins(model.P, model.mdp.gamma, model.expert, model.R, skip_equal=True)
    acting = np.isfinite(expected) & ~model.mdp.terminal
    assert np.allclose(found.margin[acting], expected[acting], atol=1e-9)
    assert np.isnan(found.margin[~acting]).all()


@given(models.models(), seeds)
def test_decomposition_gives_the_reward_back(model, seed):
    R = np.random.default_rng(seed).uniform(-1, 1, (model.mdp.n_states, model.mdp.n_actions))
    R = np.where(model.mdp.terminal[:, None], 0.0, R)
    expert = policy_iteration(model.mdp, R).policy
    found = membership(model.mdp, expert, R)
    again = feasible_reward(model.mdp, expert, found.V, np.maximum(found.advantages, 0.0))
    assert np.allclose(again.values, R, atol=1e-9 / (1 - model.mdp.gamma))


@given(models.models(), seeds)
def test_drawn_rewards_are_members_and_optimal_by_planning(model, seed):
    drawn = sample_feasible(model.mdp, model.expert, rng=np.random.default_rng(seed), r_max=3.0)
    assert membership(model.mdp, model.expert, drawn).member
    assert optimal_by_planning(model.mdp, model.expert, drawn.values)
    assert np.abs(drawn.values).max() == pytest.approx(3.0)


@given(models.models(), seeds)
def test_drawn_rewards_are_members_when_the_expert_is_known_in_part(model, seed):
    rng = np.random.default_rng(seed)
    seen = np.eye(model.mdp.n_actions)[model.expert]
    seen[rng.choice(model.mdp.n_states, 2, replace=False)] = np.nan
    drawn = sample_feasible(model.mdp, seen, rng=rng)
    assert membership(model.mdp, seen, drawn).member


def test_drawn_rewards_of_a_seed_are_the_same():
    model = models.random_model(3)
    first, second = (sample_feasible(model.mdp, model.expert, rng=np.random.default_rng(5)).values for _ in range(2))
    assert np.array_equal(first, second)


@given(models.models(), seeds)
def test_part_of_an_expert_asks_less(model, seed):
    rng = np.random.default_rng(seed)
    seen = np.eye(model.mdp.n_actions)[perturbed(model, seed, 1)]
    whole = membership(model.mdp, seen, model.R)
    unseen = rng.choice(model.mdp.n_states, 2, replace=False)
    seen[unseen] = np.nan
    part = membership(model.mdp, seen, model.R)
    assert np.isnan(part.margin[unseen]).all()
    assert part.member or not whole.member


def test_unknown_state_is_worth_acting_best():
    mdp = models.ring([[1, 2], [1, 0], [2, 0]])  # from 0 to 1, or to 2
    seen = np.array([[1.0, 0.0], [np.nan, np.nan], [1.0, 0.0]])
    found = membership(mdp, seen, np.array([0.0, 0.5, 1.0]))
    assert found.V[1] == pytest.approx(0.5 / (1 - 0.9))  # staying for ever
    assert not found.member and found.violated_rows.tolist() == [[0, 1]]


def test_several_actions_have_to_be_equally_good():
    mdp = models.ring([[1, 2], [1, 1], [2, 2]])
    both = np.array([[True, True], [True, True], [True, True]])
    assert membership(mdp, both, np.array([0.0, 1.0, 1.0])).member
    apart = membership(mdp, both, np.array([0.0, 1.0, 0.5]))
    assert not apart.member
    assert apart.worst_violation == pytest.approx(0.5 * 0.5 / (1 - 0.9))  # the mean of both is half way


def test_violation_names_the_row_and_the_size():
    mdp = models.ring([[1, 0], [1, 1]])
    found = membership(mdp, np.array([1, 0]), np.array([0.0, 1.0]))  # stays in 0, though 1 pays
    assert found.violated_rows.tolist() == [[0, 0]]
    assert found.violations[0] == pytest.approx(1 / (1 - 0.9))
    assert found.advantages[0, 0] == pytest.approx(-0.9 / (1 - 0.9))
    assert "action 0 in state 0" in str(found)


def test_tolerance_forgives_a_violation():
    mdp = models.ring([[1, 0], [1, 1]])
    R = np.array([0.0, 1e-3])
    assert not membership(mdp, np.array([1, 0]), R).member
    assert membership(mdp, np.array([1, 0]), R, tolerance=0.1).member


def test_zero_is_a_member_with_ties():
    model = models.paper_grid()
    found = membership(model.mdp, model.expert, np.zeros(25))
    assert found.member and "24 of 24 states" in str(found)


@pytest.mark.parametrize("sign", [1, -1])
def test_what_drowns_in_rounding_near_gamma_1_is_undecided_and_no_tie(sign):
    model = models.random_model(0)
    mdp = TabularMDP(model.mdp.P, 1 - 1e-6, model.mdp.d0)
    found = membership(mdp, model.expert, 1 + sign * 1e-9 * model.R)
    assert found.member is None and found.undecided and not found.ties and "rounding hides" in str(found)


def test_membership_agrees_with_the_certificate():
    model = models.paper_grid()
    learned = FiniteLP().fit(model.mdp, model.expert)
    found, proof = membership(model.mdp, model.expert, learned.reward), certify(model.mdp, model.expert, learned.reward)
    assert found.member and np.allclose(found.margin, proof.margin, equal_nan=True)


def test_states_never_reached_are_not_judged():
    mdp = models.ring([[1, 0], [1, 1], [0, 2]])
    mdp = type(mdp)(mdp.P, 0.9, np.array([1.0, 0, 0]))
    found = membership(mdp, np.array([0, 0, 1]), np.array([0.0, 1.0, -1.0]))
    assert found.member
    assert np.isnan(found.V[2]) and np.isnan(found.advantages[2]).all()


def test_record_is_json():
    model = models.paper_grid()
    found = json.loads(json.dumps(membership(model.mdp, model.expert, model.R).to_json(), allow_nan=False))
    assert found["member"] and found["margin"][4] is None


@pytest.mark.parametrize("V, zeta, message", [
    (np.zeros(3), np.zeros((2, 2)), r"V has shape \(3,\)"),
    (np.array([0, np.nan]), np.zeros((2, 2)), r"V\[1\] is nan"),
    (np.zeros(2), np.array([[0, -1.0], [0, 0]]), r"advantages\[s=0, a=1\] is -1"),
    (np.zeros(2), np.zeros(2), r"advantages has shape \(2,\)"),
    ("abc", np.zeros((2, 2)), "V is a str"),
])  # fmt: skip
def test_parts_of_a_reward_are_checked(unchecked, V, zeta, message):
    with pytest.raises(InvalidParameter, match=message):
        feasible_reward(models.ring([[1, 0], [1, 1]]), np.array([0, 0]), V, zeta)


def test_terminal_state_has_no_value():
    model = models.random_model(0, kind="terminal")
    with pytest.raises(InvalidParameter, match=r"V\[s=5\] is 1: expected 0 in a terminal state"):
        feasible_reward(model.mdp, model.expert, np.ones(7), np.zeros((7, 3)))


@pytest.mark.parametrize("change, error", [
    ({"reward": np.zeros(3)}, InvalidReward),
    ({"reward": np.zeros((7, 2))}, InvalidReward),
    ({"reward": np.full(7, np.nan)}, InvalidReward),
    ({"expert": np.zeros(3, dtype=int)}, InvalidPolicy),
    ({"expert": np.full((7, 3), np.nan)}, InvalidPolicy),
    ({"mdp": "a table"}, InvalidMDP),
    ({"tolerance": -1.0}, InvalidParameter),
])  # fmt: skip
def test_bad_input_is_named(unchecked, change, error):
    model = models.random_model(0)
    given = {"mdp": model.mdp, "expert": model.expert, "reward": model.R} | change
    with pytest.raises(error):
        membership(**given)


def test_bound_of_drawn_rewards_is_checked():
    model = models.random_model(0)
    with pytest.raises(InvalidParameter, match="r_max is 0"):
        sample_feasible(model.mdp, model.expert, rng=np.random.default_rng(0), r_max=0)


def test_a_seed_is_no_generator(unchecked):
    model = models.random_model(0)
    with pytest.raises(InvalidParameter, match="rng is 0: expected a generator"):
        sample_feasible(model.mdp, model.expert, rng=0)


def test_rewards_are_drawn_of_a_table_only(unchecked):
    with pytest.raises(InvalidMDP, match="expected a TabularMDP"):
        sample_feasible("a table", np.zeros(3, dtype=int), rng=np.random.default_rng(0))
