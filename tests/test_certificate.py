import json
import math

import models
import numpy as np
import pytest
import reference
from hypothesis import given
from hypothesis import strategies as st

from irl_gym.certificate import certify
from irl_gym.comparisons import compare
from irl_gym.errors import InvalidPolicy, InvalidReward
from irl_gym.learners.feature import FeatureLP
from irl_gym.mdp import TabularMDP
from irl_gym.rewards import TabularReward


def true_certificate(model, **kwargs):
    return certify(model.mdp, model.expert, TabularReward(model.R), **kwargs)


@given(model=models.models())
def test_certificate_says_optimal_for_the_reward_the_expert_maximises(model):
    assert true_certificate(model).expert_optimal


@given(model=models.models())
def test_certificate_says_not_optimal_for_the_negated_reward(model):
    margins = reference.margins(model.P, model.mdp.gamma, model.expert, model.R)
    certificate = certify(model.mdp, model.expert, TabularReward(-model.R))
    assert certificate.expert_optimal == bool((margins < 1e-7).all())


@given(model=models.models(kinds=("dense", "sparse")))
def test_certificate_margins_equal_the_dense_ones(model):
    expected = reference.margins(model.P, model.mdp.gamma, model.expert, model.R)
    np.testing.assert_allclose(true_certificate(model).margin, expected, atol=1e-9)


@given(model=models.models(kinds=("dense", "sparse")))
def test_certificate_names_the_largest_violation(model):
    S, A = model.mdp.n_states, model.mdp.n_actions
    other = (model.expert + 1) % A
    V = np.linalg.solve(np.eye(S) - model.mdp.gamma * model.P[np.arange(S), other], model.R)
    following = model.P @ V
    expected = (following - following[np.arange(S), other][:, None]).max()
    found = certify(model.mdp, other, TabularReward(model.R)).worst_violation
    assert found == pytest.approx(max(expected, 0), abs=1e-9)


@given(model=models.models(), seed=st.integers(0, 10**6), l1=st.sampled_from([0.0, 0.3]), cap=st.sampled_from([None, 0.2]))
def test_certificate_bounds_the_objective_for_any_duals(model, seed, l1, cap):
    n = compare(model.mdp, model.expert).states.size
    y = np.random.default_rng(seed).exponential(size=n) * np.random.default_rng(seed + 1).integers(0, 2, n)
    assert true_certificate(model, l1=l1, margin_cap=cap, y=y).duality_gap >= -1e-7


@given(model=models.models(), seed=st.integers(0, 10**6), cap=st.sampled_from([None, 0.2]))
def test_certificate_bounds_the_objective_of_a_reward_on_steps_for_any_duals(model, seed, cap):
    y = np.random.default_rng(seed).exponential(size=compare(model.mdp, model.expert).states.size)
    certificate = certify(model.mdp, model.expert, TabularReward(model.step_reward), l1=0.1, margin_cap=cap, y=y)
    assert certificate.duality_gap >= -1e-7


@given(model=models.models(kinds=("walls",)), cap=st.sampled_from([0.05, 1.0]))
def test_certificate_bound_ignores_duals_of_trivial_rows(model, cap):
    trivial = compare(model.mdp, model.expert).trivial
    without = true_certificate(model, margin_cap=cap, y=np.zeros(trivial.size)).dual_bound
    assert true_certificate(model, margin_cap=cap, y=100.0 * trivial).dual_bound == pytest.approx(without)


@pytest.mark.parametrize(("cap", "most"), [(None, 2 * 3.0 / (1 - 0.9)), (0.2, 0.2)])
def test_certificate_bound_without_multipliers_is_the_largest_margin_in_each_state(cap, most):
    model = models.random_model(0)
    assert true_certificate(model, r_max=3.0, margin_cap=cap, y=np.zeros(14)).dual_bound == pytest.approx(7 * most)


def test_certificate_bound_is_nan_when_no_duals_are_given():
    assert math.isnan(true_certificate(models.random_model(0)).dual_bound)


def test_certificate_objective_is_margins_less_the_price_of_the_reward():
    model = models.random_model(0)
    expected = reference.margins(model.P, 0.9, model.expert, model.R).sum() - 0.3 * np.abs(model.R).sum()
    assert true_certificate(model, l1=0.3).objective == pytest.approx(expected)


def test_certificate_objective_counts_margins_up_to_the_cap():
    model = models.random_model(0)
    expected = np.minimum(reference.margins(model.P, 0.9, model.expert, model.R), 0.05).sum()
    assert true_certificate(model, margin_cap=0.05).objective == pytest.approx(expected)


@pytest.mark.parametrize("shape", [(7,), (7, 3)])
@pytest.mark.parametrize(("value", "zero"), [(0.0, True), (0.5, False)])
def test_certificate_calls_a_constant_reward_degenerate(shape, value, zero):
    model = models.random_model(0)
    certificate = certify(model.mdp, model.expert, TabularReward(np.full(shape, value)))
    assert (certificate.constant, certificate.zero, certificate.degenerate) == (True, zero, True)


def test_certificate_does_not_call_a_price_of_steps_degenerate_where_episodes_end():
    P = np.zeros((3, 2, 3))
    P[0, 0, 1] = P[0, 1, 0] = P[1, 0, 2] = P[1, 1, 0] = 1  # 2 is terminal: action 0 is the shortest way
    mdp = TabularMDP.from_dense(P, 0.9, np.eye(3)[0])
    certificate = certify(mdp, np.zeros(3, dtype=int), TabularReward(-np.ones(3)))
    assert certificate.constant and certificate.expert_optimal and certificate.margin[:2].min() > 0.1
    assert not certificate.degenerate and "degenerate" not in str(certificate)
    features = FeatureLP(np.ones((3, 1))).fit(mdp, np.zeros(3, dtype=int))
    assert features.reward.alpha.tolist() == [-1] and not features.certificate.degenerate


def test_certificate_calls_a_reward_degenerate_that_ties_all_actions_though_it_is_not_constant():
    P = np.zeros((4, 2, 4))
    P[:, 0, :] = np.eye(4)[[1, 3, 3, 0]]
    P[:, 1, :] = np.eye(4)[[2, 3, 3, 0]]  # 1 and 2 are alike
    mdp = TabularMDP.from_dense(P, 0.9, np.eye(4)[0])
    certificate = certify(
        mdp, np.array([[1.0, 0.0], [0.5, 0.5], [0.5, 0.5], [0.5, 0.5]]), TabularReward(np.array([0.0, 1, 1, 3]))
    )
    assert not certificate.constant and certificate.degenerate and "ties the expert with every action" in str(certificate)


def test_certificate_does_not_call_a_tie_with_one_action_of_two_degenerate():
    P = np.zeros((3, 3, 3))
    P[:, 0, 1] = P[:, 1, 1] = P[:, 2, 2] = 1
    mdp = TabularMDP.from_dense(P, 0.9, np.eye(3)[0])
    assert not certify(mdp, np.zeros(3, dtype=int), TabularReward(np.array([0.0, 1.0, 0.0]))).degenerate


def test_certificate_does_not_call_the_true_reward_degenerate():
    assert not true_certificate(models.random_model(0)).degenerate


def corridor():
    """States 0-3 in a row; in 1 both actions go right; 2 has two ways to 3; 3 is terminal; 4 is not reachable."""
    P = np.zeros((5, 2, 5))
    P[0, 0, 1] = P[0, 1, 0] = 1
    P[1, :, 2] = 1
    P[2, 0, 3] = P[2, 1, 0] = 1
    P[4, :, 0] = 1
    return TabularMDP.from_dense(P, 0.9, np.eye(5)[0])


def test_certificate_lists_states_outside_any_constraint():
    certificate = certify(corridor(), np.zeros(5, dtype=int), TabularReward(np.eye(5)[3]))
    assert certificate.unconstrained.tolist() == [1]


def test_certificate_lists_states_that_no_state_reward_separates():
    certificate = certify(corridor(), np.zeros(5, dtype=int), TabularReward(np.eye(5)[3]))
    assert certificate.inseparable.tolist() == [1]


def test_certificate_lists_states_without_a_margin():
    certificate = certify(corridor(), np.zeros(5, dtype=int), TabularReward(np.full(5, 0.1) - np.eye(5)[3]))
    assert 2 in certificate.marginless.tolist()


def test_certificate_has_no_margin_in_states_it_does_not_judge():
    certificate = certify(corridor(), np.zeros(5, dtype=int), TabularReward(np.eye(5)[3]))
    assert np.isnan(certificate.margin).tolist() == [False, True, False, True, True]


def test_certificate_demands_equality_among_the_actions_of_a_set():
    model = models.random_model(0)
    both = np.eye(3, dtype=bool)[model.expert] | np.eye(3, dtype=bool)[(model.expert + 1) % 3]
    certificate = certify(model.mdp, both, TabularReward(model.R))
    assert not certificate.expert_optimal


def test_certificate_measures_inequality_among_the_actions_of_an_expert_both_ways():
    model = models.random_model(0, A=2)
    expert = np.tile([0.9, 0.1], (7, 1))
    found = [certify(model.mdp, expert, TabularReward(sign * model.R)).worst_violation for sign in (1, -1)]
    assert found[0] == pytest.approx(found[1]) and found[0] > 0


def test_certificate_is_json_without_nan():
    text = json.dumps(true_certificate(models.random_model(0, kind="walls")).to_json(), allow_nan=False)
    assert json.loads(text)["margin"][-1] is None


def test_str_tells_by_how_much_the_expert_is_not_optimal():
    model = models.random_model(0)
    certificate = certify(model.mdp, model.expert, TabularReward(-model.R))
    assert f"{certificate.worst_violation:.2e}" in str(certificate)


def test_str_counts_inseparable_states():
    certificate = certify(corridor(), np.zeros(5, dtype=int), TabularReward(np.eye(5)[3]))
    assert "in 1 states an action that no state reward tells apart" in str(certificate)


@pytest.mark.parametrize("shape", [(6,), (7, 2)])
def test_certify_refuses_a_reward_of_another_shape(shape):
    model = models.random_model(0)
    with pytest.raises(InvalidReward, match=rf"shape \({shape[0]},"):
        certify(model.mdp, model.expert, TabularReward(np.zeros(shape)))


def test_certify_refuses_a_policy_of_another_shape():
    with pytest.raises(InvalidPolicy, match=r"shape \(5,\)"):
        certify(models.random_model(0).mdp, np.zeros(5, dtype=int), TabularReward(np.zeros(7)))


def test_the_objective_sums_the_margins_of_the_rows_that_count():
    P = np.zeros((4, 2, 4))  # state 0 is never reached, and has no row
    P[0], P[1] = [[0, 0, 1, 0]] * 2, [[0, 0, 1, 0], [0, 0, 0, 1]]
    mdp = TabularMDP.from_dense(P, 0.9, [0, 1.0, 0, 0])
    reward, expert = TabularReward(np.array([0, 0, 1.0, 0])), np.zeros(4, dtype=int)
    objectives = [certify(mdp, expert, reward, margin_cap=5.0, counted=np.array([c])).objective for c in (True, False)]
    assert objectives == [1.0, 0.0]
