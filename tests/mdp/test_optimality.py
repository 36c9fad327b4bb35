"""What a reward says of an expert, whoever made it: against dense arithmetic, and in sentences that are true."""

import inspect
import json

import models
import numpy as np
import pytest
import reference
from hypothesis import given

from irl_gym.errors import InvalidParameter, InvalidPolicy, InvalidReward
from irl_gym.learners.linear_programs.feature import FeatureLP
from irl_gym.mdp.optimality import certify
from irl_gym.mdp.rewards import TabularReward
from irl_gym.mdp.tabular_mdp import TabularMDP


def of_true_reward(model, **kwargs):
    return certify(model.mdp, model.expert, TabularReward(model.R), **kwargs)


@given(model=models.models())
def test_certify_says_optimal_for_the_reward_the_expert_maximises(model):
    assert of_true_reward(model).expert_optimal


@given(model=models.models())
def test_certify_says_not_optimal_for_the_negated_reward(model):
    margins = reference.margins(model.P, model.mdp.gamma, model.expert, model.R)
    found = certify(model.mdp, model.expert, TabularReward(-model.R))
    assert found.expert_optimal == bool((margins < 1e-7).all())


@given(model=models.models(kinds=("dense", "sparse")))
def test_certify_margins_equal_the_dense_ones(model):
    expected = reference.margins(model.P, model.mdp.gamma, model.expert, model.R)
    np.testing.assert_allclose(of_true_reward(model).margin, expected, atol=1e-9)


@given(model=models.models(kinds=("dense", "sparse")))
def test_certify_names_the_largest_violation(model):
    S, A = model.mdp.n_states, model.mdp.n_actions
    other = (model.expert + 1) % A
    V = np.linalg.solve(np.eye(S) - model.mdp.gamma * model.P[np.arange(S), other], model.R)
    following = model.P @ V
    expected = (following - following[np.arange(S), other][:, None]).max()
    found = certify(model.mdp, other, TabularReward(model.R)).worst_violation
    assert found == pytest.approx(max(expected, 0), abs=1e-9)


@pytest.mark.parametrize("shape", [(7,), (7, 3)])
@pytest.mark.parametrize(("value", "zero"), [(0.0, True), (0.5, False)])
def test_certify_calls_a_constant_reward_degenerate(shape, value, zero):
    model = models.random_model(0)
    found = certify(model.mdp, model.expert, TabularReward(np.full(shape, value)))
    assert (found.constant, found.zero, found.degenerate) == (True, zero, True)


def test_certify_does_not_call_a_price_of_steps_degenerate_where_episodes_end():
    P = np.zeros((3, 2, 3))
    P[0, 0, 1] = P[0, 1, 0] = P[1, 0, 2] = P[1, 1, 0] = 1  # 2 is terminal: action 0 is the shortest way
    mdp = TabularMDP.from_dense(P, 0.9, np.eye(3)[0])
    found = certify(mdp, np.zeros(3, dtype=int), TabularReward(-np.ones(3)))
    assert found.constant and found.expert_optimal and found.margin[:2].min() > 0.1
    assert not found.degenerate and "degenerate" not in str(found)
    features = FeatureLP(np.ones((3, 1))).fit(mdp, np.zeros(3, dtype=int))
    assert (
        features.reward.alpha.tolist() == [-1]
        and not certify(mdp, np.zeros(3, dtype=int), features.reward.tabular(3)).degenerate
    )


def test_certify_calls_a_reward_degenerate_that_ties_all_actions_though_it_is_not_constant():
    P = np.zeros((4, 2, 4))
    P[:, 0, :] = np.eye(4)[[1, 3, 3, 0]]
    P[:, 1, :] = np.eye(4)[[2, 3, 3, 0]]  # 1 and 2 are alike
    mdp = TabularMDP.from_dense(P, 0.9, np.eye(4)[0])
    found = certify(mdp, np.array([[1.0, 0.0], [0.5, 0.5], [0.5, 0.5], [0.5, 0.5]]), TabularReward(np.array([0.0, 1, 1, 3])))
    assert not found.constant and found.degenerate and "ties the expert with every action" in str(found)


def test_certify_does_not_call_a_tie_with_one_action_of_two_degenerate():
    P = np.zeros((3, 3, 3))
    P[:, 0, 1] = P[:, 1, 1] = P[:, 2, 2] = 1
    mdp = TabularMDP.from_dense(P, 0.9, np.eye(3)[0])
    assert not certify(mdp, np.zeros(3, dtype=int), TabularReward(np.array([0.0, 1.0, 0.0]))).degenerate


def test_certify_does_not_call_the_true_reward_degenerate():
    assert not of_true_reward(models.random_model(0)).degenerate


def corridor():
    """States 0-3 in a row; in 1 both actions go right; 2 has two ways to 3; 3 is terminal; 4 is not reachable."""
    P = np.zeros((5, 2, 5))
    P[0, 0, 1] = P[0, 1, 0] = 1
    P[1, :, 2] = 1
    P[2, 0, 3] = P[2, 1, 0] = 1
    P[4, :, 0] = 1
    return TabularMDP.from_dense(P, 0.9, np.eye(5)[0])


def test_certify_lists_states_outside_any_constraint():
    found = certify(corridor(), np.zeros(5, dtype=int), TabularReward(np.eye(5)[3]))
    assert found.unconstrained.tolist() == [1]


def test_certify_lists_states_that_no_state_reward_separates():
    found = certify(corridor(), np.zeros(5, dtype=int), TabularReward(np.eye(5)[3]))
    assert found.inseparable.tolist() == [1]


def test_certify_lists_states_without_a_margin():
    found = certify(corridor(), np.zeros(5, dtype=int), TabularReward(np.full(5, 0.1) - np.eye(5)[3]))
    assert 2 in found.marginless.tolist()


def test_certify_has_no_margin_in_states_it_does_not_judge():
    found = certify(corridor(), np.zeros(5, dtype=int), TabularReward(np.eye(5)[3]))
    assert np.isnan(found.margin).tolist() == [False, True, False, True, True]


def test_certify_demands_equality_among_the_actions_of_a_set():
    model = models.random_model(0)
    both = np.eye(3, dtype=bool)[model.expert] | np.eye(3, dtype=bool)[(model.expert + 1) % 3]
    found = certify(model.mdp, both, TabularReward(model.R))
    assert not found.expert_optimal


def test_certify_measures_inequality_among_the_actions_of_an_expert_both_ways():
    model = models.random_model(0, A=2)
    expert = np.tile([0.9, 0.1], (7, 1))
    found = [certify(model.mdp, expert, TabularReward(sign * model.R)).worst_violation for sign in (1, -1)]
    assert found[0] == pytest.approx(found[1]) and found[0] > 0


def test_certify_is_json_without_nan():
    text = json.dumps(of_true_reward(models.random_model(0, kind="walls")).to_json(), allow_nan=False)
    assert json.loads(text)["margin"][-1] is None


def test_str_tells_by_how_much_the_expert_is_not_optimal():
    model = models.random_model(0)
    found = certify(model.mdp, model.expert, TabularReward(-model.R))
    assert f"by at most {found.worst_violation:.3g}" in str(found)


def test_str_counts_inseparable_states():
    found = certify(corridor(), np.zeros(5, dtype=int), TabularReward(np.eye(5)[3]))
    assert "in 1 state an action leads where the expert's own does: no reward on states tells them apart" in str(found)


@pytest.mark.parametrize("shape", [(6,), (7, 2)])
def test_certify_refuses_a_reward_of_another_shape(shape):
    model = models.random_model(0)
    with pytest.raises(InvalidReward, match=rf"shape \({shape[0]},"):
        certify(model.mdp, model.expert, TabularReward(np.zeros(shape)))


def test_certify_refuses_a_policy_of_another_shape():
    with pytest.raises(InvalidPolicy, match=r"shape \(5,\)"):
        certify(models.random_model(0).mdp, np.zeros(5, dtype=int), TabularReward(np.zeros(7)))


# --- facts ---


def crossing():
    """From 0 and 1 action 0 leads to 2 and action 1 to 3; from 4 both lead there, and action 2 to 5; 2, 3, 5 are ends."""
    P = np.zeros((6, 3, 6))
    P[0, [0, 1, 2], [2, 3, 2]] = P[1, [0, 1, 2], [2, 3, 3]] = P[4, [0, 1, 2], [2, 3, 5]] = 1
    return TabularMDP.from_dense(P, 0.9, np.array([0.4, 0.3, 0, 0, 0.3, 0]))


def told(found):
    """Sentences by label."""
    return {one.label: one.sentence for one in found.facts()}


def test_a_state_with_a_better_action_is_never_called_tied():
    R = np.array([0, 0, 0.5, 1.0, 0, 0.5])  # in 0 and 1 action 1 is better, in 4 too; 2 and 5 are as good
    found = certify(crossing(), np.array([0, 0, 0, 0, 1, 0]), R)
    assert found.marginless.tolist() == [0, 1] and found.violated.tolist() == [0, 1] and found.tied.tolist() == []
    assert told(found)["violated"] == "in 2 states another action is better under it: 3 rows of (4), by at most 0.5"
    assert "tied" not in told(found) and "tied" not in str(found)


def test_a_state_without_a_better_action_is_called_tied():
    found = certify(crossing(), np.array([0, 1, 0, 0, 0, 0]), np.array([0, 0, 0.5, 0.2, 0, 0.5]))
    assert found.violated.tolist() == [1] and found.tied.tolist() == [4]
    assert told(found)["tied"] == "in 1 state another action is as good as the expert's to rounding, and none better"


def test_a_zero_reward_is_degenerate_and_no_list_of_ties():
    found = certify(crossing(), np.array([0, 1, 0, 0, 0, 0]), np.zeros(6))
    assert told(found)["degenerate"] == "R is zero" and "tied" not in told(found)


@pytest.mark.parametrize(("sign", "mood"), [(1, "good"), (-1, "bad"), (0, "plain")])
def test_whether_the_expert_is_optimal_has_its_mood(sign, mood):
    model = models.random_model(0)
    assert certify(model.mdp, model.expert, sign * model.R).facts()[0].mood == mood


def test_an_expert_that_errs_is_judged_by_the_best_continuation():
    mdp, R = crossing(), np.array([0, 0, 0.5, 1.0, 0, 0.5])
    both = np.array([[0.5, 0.5, 0], [1, 0, 0], [1, 0, 0], [1, 0, 0], [0, 1, 0], [1, 0, 0]])
    strict, mild = (certify(mdp, both, R, errs=errs) for errs in (False, True))
    assert strict.violated_rows.tolist() == [[0, 0], [0, 1], [1, 1], [1, 2]]  # actions that it takes have to be as good
    assert mild.violated_rows.tolist() == [[0, 1], [1, 1], [1, 2]] and "where one acts best afterwards" in str(mild)


def test_margins_leave_out_rows_that_are_given_as_unbreakable():
    R = np.array([0, 0, 1.0, 0.2, 0, 0.5])
    whole, part = (certify(crossing(), np.zeros(6, dtype=int), R, unbreakable=rows) for rows in (None, [[4, 2]]))
    assert (whole.margin[4], part.margin[4]) == pytest.approx((0.5, 0.8)) and part.margin[1] == whole.margin[1]


def test_facts_say_how_many_rows_are_left_out_on_the_word_of_who_gave_them():
    whole, part = (certify(crossing(), np.zeros(6, dtype=int), np.eye(6)[2], unbreakable=rows) for rows in (None, [[4, 2]]))
    assert (whole.left_out, part.left_out) == (0, 1) and "given as unbreakable" not in str(whole)
    assert told(part)["margins"].endswith("; 1 row of (4) given as unbreakable left out")


@pytest.mark.parametrize("errs", ["no", 0, None, np.array([True])])
def test_errs_is_true_or_false(errs):
    with pytest.raises(InvalidParameter, match=r"errs is .*: expected True or False"):
        inspect.unwrap(certify)(crossing(), np.zeros(6, dtype=int), np.zeros(6), errs=errs)


@pytest.mark.parametrize("rows", [[[6, 0]], [[0, 3]], [[-1, 0]], [[0.5, 0]], [0, 1], [[0], [1, 2]], "all"])
def test_rows_that_the_table_does_not_have_are_refused(rows):
    with pytest.raises(InvalidParameter, match=r"unbreakable is .*: expected \(u, 2\)"):
        certify(crossing(), np.zeros(6, dtype=int), np.zeros(6), unbreakable=rows)
