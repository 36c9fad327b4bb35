import itertools

import models
import numpy as np
import pytest
from hypothesis import given

from irl_gym.metrics import (
    agreement,
    mean_interval,
    normalised_score,
    optimal_actions,
    policy_value,
    random_value,
    worst_tie,
)
from irl_gym.rewards import TabularReward


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


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("kind", ["deterministic", "terminal"])
def test_worst_tie_is_the_worst_of_all_greedy_policies(seed, kind):
    model = models.random_model(seed, S=5, A=3, kind=kind)
    learned = TabularReward(np.round(np.random.default_rng(seed).uniform(-1, 1, 5)))  # three levels: many ties
    found = worst_tie(model.mdp, learned, TabularReward(model.R))
    greedy_policies = itertools.product(*(np.flatnonzero(row) for row in found.tied))
    assert found.value == pytest.approx(min(dense_value(model, np.array(policy)) for policy in greedy_policies))


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


def test_mean_interval_holds_the_true_mean_about_as_often_as_it_says():
    rng = np.random.default_rng(0)
    intervals = [mean_interval(rng.normal(3, 1, size=60), rng=rng, resamples=500) for _ in range(200)]
    covered = np.mean([low <= 3 <= high for _, low, high in intervals])
    assert 0.88 <= covered <= 0.99


def test_mean_interval_is_a_point_when_all_values_are_equal():
    assert mean_interval(np.full(10, 2.5), rng=np.random.default_rng(0)) == (2.5, 2.5, 2.5)
