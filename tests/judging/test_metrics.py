import itertools

import models
import numpy as np
import pytest
import reference
from hypothesis import given

from irl_gym.errors import InvalidParameter
from irl_gym.judging.metrics import (
    Agreement,
    agreement,
    best_tie,
    expected_value_difference,
    normalised_score,
    occupancy_distance,
    optimal_actions,
    policy_value,
    random_value,
    regret,
    tie_aware_agreement,
    worst_tie,
)
from irl_gym.mdp.planning.dynamic_programming import occupancy, policy_evaluation, policy_iteration
from irl_gym.mdp.rewards import TabularReward
from irl_gym.mdp.tabular_mdp import TabularMDP

FLAT = np.zeros(3)
ZEROS = np.zeros(3, dtype=np.int64)


def dense_value(model, policy):
    """d0 . V of a deterministic policy under the model's reward, by the explicit inverse."""
    rows = np.arange(model.mdp.n_states)
    inverse = np.linalg.inv(np.eye(rows.size) - model.mdp.gamma * model.P[rows, policy])
    return model.mdp.d0 @ inverse @ model.step_reward[rows, policy]


@given(model=models.models())
def test_policy_value_equals_the_explicit_inverse(model):
    found = policy_value(model.mdp, TabularReward(model.R), model.expert)
    assert found == pytest.approx(dense_value(model, model.expert))


@pytest.mark.parametrize("horizon", [1, 2, 7])
def test_policy_value_of_some_steps_equals_the_sum_over_them(horizon):
    model = models.random_model(1, kind="terminal")
    P_pi = model.P[np.arange(7), model.expert]
    powers = [np.linalg.matrix_power(0.9 * P_pi, t) for t in range(horizon)]
    expected = model.mdp.d0 @ sum(powers) @ model.step_reward[np.arange(7), model.expert]
    assert policy_value(model.mdp, TabularReward(model.R), model.expert, horizon) == pytest.approx(expected)


def test_policy_value_of_many_steps_is_that_of_all():
    model = models.random_model(2)
    reward = TabularReward(model.R)
    assert policy_value(model.mdp, reward, model.expert, 400) == pytest.approx(policy_value(model.mdp, reward, model.expert))


@given(model=models.models())
def test_random_value_is_at_most_the_expert_s(model):
    reward = TabularReward(model.R)
    assert random_value(model.mdp, reward) <= policy_value(model.mdp, reward, model.expert) + 1e-9


@given(model=models.models())
def test_optimal_actions_hold_the_expert_s(model):
    found = optimal_actions(model.mdp, TabularReward(model.R))
    assert found[np.arange(model.mdp.n_states), model.expert].all()


def greedy_policies(model, R):
    """All policies that are greedy under a reward on states: from a dense Q."""
    steps = model.P @ R
    Q = reference.action_values(model.P, 0.9, steps, reference.values(model.P, 0.9, steps))
    return map(np.array, itertools.product(*(np.flatnonzero(row >= row.max() - 1e-6) for row in Q)))


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("kind", ["deterministic", "terminal"])
def test_worst_tie_is_the_worst_of_all_greedy_policies(seed, kind):
    model = models.random_model(seed, S=5, A=3, kind=kind)
    learned = TabularReward(np.round(np.random.default_rng(seed).uniform(-1, 1, 5)))  # three levels: many ties
    found = worst_tie(model.mdp, learned, TabularReward(model.R))
    assert found.value == pytest.approx(min(dense_value(model, policy) for policy in greedy_policies(model, learned.values)))


def test_worst_tie_is_the_worst_policy_when_the_learned_reward_says_nothing():
    model = models.random_model(0, S=5)
    found = worst_tie(model.mdp, TabularReward(np.zeros(5)), TabularReward(model.R))
    assert found.value == pytest.approx(
        min(dense_value(model, np.array(policy)) for policy in itertools.product(range(3), repeat=5))
    )


def test_worst_tie_is_the_optimum_when_the_learned_reward_is_the_true_one():
    model = models.random_model(0)
    reward = TabularReward(model.R)
    assert worst_tie(model.mdp, reward, reward).value == pytest.approx(policy_value(model.mdp, reward, model.expert))


@given(model=models.models())
def test_worst_tie_policy_earns_its_value(model):
    learned, true = TabularReward(np.round(model.R)), TabularReward(model.R)
    found = worst_tie(model.mdp, learned, true)
    assert policy_value(model.mdp, true, found.policy) == pytest.approx(found.value, abs=1e-6)


@pytest.mark.parametrize(("value", "score"), [(-100.0, 0.0), (0.0, 1.0), (-50.0, 0.5), (50.0, 1.5)])
def test_normalised_score_is_0_for_random_and_1_for_the_expert(value, score):
    assert normalised_score(value, -100.0, 0.0) == score


def test_normalised_score_is_nan_when_random_is_as_good_as_the_expert():
    assert np.isnan(normalised_score(1.0, 2.0, 2.0))


def test_agreement_counts_states_in_which_an_action_of_the_set_is_taken():
    model = models.random_model(0, kind="dense")
    policy = model.expert.copy()
    policy[:2] = (policy[:2] + 1) % 3
    assert agreement(model.mdp, policy, np.eye(3, dtype=bool)[model.expert]) == pytest.approx(5 / 7)


def test_agreement_counts_a_stochastic_policy_by_its_probability():
    model = models.random_model(0)
    good = np.eye(3, dtype=bool)[model.expert]
    assert agreement(model.mdp, np.full((7, 3), 1 / 3), good) == pytest.approx(1 / 3)


def test_agreement_does_not_count_terminal_states():
    model = models.random_model(0, kind="terminal")
    good = np.eye(3, dtype=bool)[model.expert]
    good[model.mdp.terminal] = False
    assert agreement(model.mdp, model.expert, good) == 1


@pytest.mark.parametrize("seed", range(5))
def test_best_tie_is_the_best_of_all_greedy_policies(seed):
    model = models.random_model(seed, S=5, A=3, kind="terminal")
    learned = TabularReward(np.round(np.random.default_rng(seed).uniform(-1, 1, 5)))
    found = best_tie(model.mdp, learned, TabularReward(model.R))
    assert found.value == pytest.approx(max(dense_value(model, policy) for policy in greedy_policies(model, learned.values)))


@given(model=models.models())
def test_regret_is_the_optimal_value_less_the_policy_s_in_each_state(model):
    policy = np.zeros(model.mdp.n_states, dtype=np.int64)
    found = regret(model.mdp, TabularReward(model.R), policy)
    everything = [
        policy_evaluation(model.mdp, TabularReward(model.R), one)
        for one in (policy_iteration(model.mdp, model.step_reward).policy, policy)
    ]
    assert found.per_state == pytest.approx(everything[0] - everything[1], abs=1e-9)


@given(model=models.models())
def test_regret_from_the_start_is_that_of_the_states_weighed_by_d0(model):
    found = regret(model.mdp, TabularReward(model.R), np.zeros(model.mdp.n_states, dtype=np.int64))
    assert found.value == pytest.approx(model.mdp.d0 @ found.per_state)


@given(model=models.models())
def test_regret_of_the_expert_is_zero(model):
    assert regret(model.mdp, TabularReward(model.R), model.expert).per_state == pytest.approx(0.0, abs=1e-7)


@given(model=models.models())
def test_expected_value_difference_lies_between_the_best_and_the_worst_tie_s(model):
    true, learned = TabularReward(model.R), TabularReward(np.round(model.R))
    value = policy_value(model.mdp, true, model.expert)
    found = expected_value_difference(model.mdp, true, learned)
    best, worst = (tie(model.mdp, learned, true).value for tie in (best_tie, worst_tie))
    assert value - best - 1e-7 <= found <= value - worst + 1e-7


@given(model=models.models())
def test_expected_value_difference_of_the_true_reward_shaped_is_zero(model):
    potential = np.where(model.mdp.terminal, 0.0, np.arange(model.mdp.n_states) / 3)
    steps = model.mdp.gamma * (model.mdp.P @ potential).reshape(model.mdp.n_states, -1) - potential[:, None]
    shaped = TabularReward(3 * (model.step_reward + steps))
    assert expected_value_difference(model.mdp, TabularReward(model.R), shaped) == pytest.approx(0.0, abs=1e-6)


def test_expected_value_difference_is_negative_when_the_expert_errs_and_the_reward_is_right():
    model = models.random_model(3)
    true = TabularReward(model.R)
    bad = np.full((model.mdp.n_states, model.mdp.n_actions), 1 / model.mdp.n_actions)
    assert expected_value_difference(model.mdp, true, true, bad) < -1e-3


def test_tie_aware_agreement_counts_ties_broken_otherwise():
    model = models.random_model(0)
    flat = TabularReward(np.zeros(model.mdp.n_states))
    assert tie_aware_agreement(model.mdp, flat, model.expert) == Agreement(1.0, 0.0)


def test_tie_aware_agreement_is_zero_for_the_opposite_reward():
    opposite = np.array([0.0, -1.0, 1.0])
    assert tie_aware_agreement(two_ways(), opposite, ZEROS) == Agreement(0.0, 0.0)
    assert tie_aware_agreement(two_ways(), -opposite, ZEROS) == Agreement(1.0, 0.0)


@pytest.mark.parametrize("scale", [1e-9, 1e9])
def test_optimal_actions_are_those_of_the_reward_in_other_units(scale):
    for model in (models.random_model(seed, kind="deterministic") for seed in range(5)):
        ties = optimal_actions(model.mdp, model.R)
        assert (optimal_actions(model.mdp, scale * model.R) == ties).all()


@pytest.mark.parametrize("number", [1e9, -1e9])
def test_ties_do_not_depend_on_rows_that_no_episode_reads(number):
    model = models.random_model(0, kind="terminal")
    R = model.step_reward.copy()
    R[model.mdp.terminal] = number
    assert (optimal_actions(model.mdp, R) == optimal_actions(model.mdp, model.step_reward)).all()
    P = np.zeros((8, 3, 8))
    P[:7, :, :7] = model.P
    P[7, :, 7] = 1.0  # a state that nothing leads to
    larger = TabularMDP.from_dense(P, 0.9, np.append(model.mdp.d0, 0.0))
    ties = optimal_actions(larger, np.append(model.R, number))
    assert (ties[:7] == optimal_actions(model.mdp, model.R)).all()


def two_ways():
    """A start with two ways to ends of their own."""
    P = np.zeros((3, 2, 3))
    P[0, 0, 1] = P[0, 1, 2] = 1.0
    return TabularMDP.from_dense(P, 0.9, [1.0, 0.0, 0.0])


@pytest.mark.parametrize(("on", "expected"), [("state", 0.0), ("state-action", 1.0)])
def test_occupancy_distance_of_two_ways_depends_on_what_is_compared(on, expected):
    assert occupancy_distance(two_ways(), np.array([0, 0, 0]), np.array([1, 0, 0]), on=on) == expected


@given(model=models.models())
def test_occupancy_distance_is_a_pseudometric(model):
    S, A = model.mdp.n_states, model.mdp.n_actions
    policies = [np.full(S, a % A) for a in range(2)] + [np.full((S, A), 1 / A)]
    d = np.array([[occupancy_distance(model.mdp, one, other) for other in policies] for one in policies])
    assert np.diag(d) == pytest.approx(0.0) and d == pytest.approx(d.T)
    assert d[0, 2] <= d[0, 1] + d[1, 2] + 1e-12 and d.max() <= 1.0


@given(model=models.models())
def test_occupancy_distance_bounds_the_difference_of_values(model):
    rewards = model.step_reward / max(1e-12, np.abs(model.step_reward).max())
    policies = (model.expert, np.full((model.mdp.n_states, model.mdp.n_actions), 1 / model.mdp.n_actions))
    mus = [occupancy(model.mdp, policy) for policy in policies]
    means = [(mu * rewards).sum() / mu.sum() for mu in mus]
    assert abs(means[0] - means[1]) <= 2 * occupancy_distance(model.mdp, *policies) + 1e-9


@pytest.mark.usefixtures("unchecked")
def test_occupancy_distance_refuses_to_compare_something_else():
    with pytest.raises(InvalidParameter, match="on is 'action': expected 'state'"):
        occupancy_distance(two_ways(), np.zeros(3, dtype=int), np.zeros(3, dtype=int), on="action")


def test_agreement_is_nan_where_every_episode_starts_at_its_end():
    ended = TabularMDP.from_dense(np.zeros((3, 2, 3)), 0.9, [1.0, 0.0, 0.0])
    assert np.isnan(agreement(ended, ZEROS, np.ones((3, 2), bool)))
