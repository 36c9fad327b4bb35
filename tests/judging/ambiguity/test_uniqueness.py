"""The face of all optima of FiniteLP's programs, against the programs written out and solved by SciPy."""

import json

import models
import numpy as np
import pytest
import reference
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog

from irl_gym.commands.ng_russell_2000.experiment_1 import PRINTED, PRINTED_OBJECTIVE, RESOLUTION
from irl_gym.errors import DegenerateExpert, InvalidParameter, InvalidPolicy
from irl_gym.judging.ambiguity.uniqueness import optimal_face
from irl_gym.learners.linear_programs.finite import FiniteLP

NEAR = 1e-7
"""How far below the optimum the oracle lets the objective be."""


def face_of_the_paper(P, gamma, expert, l1):
    """(2, S) least and largest R of section 3.2 with the explicit inverse, whose objective is within NEAR of the optimum.

    Unknowns: t, R+, R- (S each), as in `reference.paper_lp`.
    """
    S, A, _ = P.shape
    optimum, _ = reference.paper_lp(P, gamma, expert, l1=l1)
    P_pi = P[np.arange(S), expert]
    inverse = np.linalg.inv(np.eye(S) - gamma * P_pi)
    upper, right = [np.concatenate([-np.ones(S), np.full(2 * S, l1)])], [-optimum + NEAR]
    for s in range(S):
        for a in set(range(A)) - {expert[s]}:
            margin = (P_pi[s] - P[s, a]) @ inverse
            for t in (np.eye(S)[s], np.zeros(S)):
                upper.append(np.concatenate([t, -margin, margin]))
                right.append(0.0)
    bounds = [(None, None)] * S + [(0, 1)] * (2 * S)
    found = np.zeros((2, S))
    for s in range(S):
        cost = np.concatenate([np.zeros(S), np.eye(S)[s], -np.eye(S)[s]])
        for side, sign in enumerate((1, -1)):
            solved = linprog(sign * cost, np.array(upper), right, bounds=bounds, method="highs")
            found[side, s] = sign * solved.fun
    return found


@settings(max_examples=15)
@given(models.models(("dense", "sparse", "terminal")), st.sampled_from([0.0, 0.1]))
def test_face_of_the_papers_program_agrees_with_it_written_out(model, l1):
    found = optimal_face(model.mdp, model.expert, FiniteLP(margin_cap=None, l1=l1))
    low, high = face_of_the_paper(model.P, model.mdp.gamma, model.expert, l1)
    assert (found.low >= low - 1e-6).all() and (found.high <= high + 1e-6).all()  # optima are optima by the oracle
    assert np.allclose(found.width, high - low, atol=1e-3)  # which allows a little more than optima


@pytest.mark.parametrize("l1", [0.0, 1.05])
def test_first_experiment_of_the_paper_has_one_optimum(l1):
    model = models.paper_grid()
    found = optimal_face(model.mdp, model.expert, FiniteLP(margin_cap=None, l1=l1))
    learned = FiniteLP(margin_cap=None, l1=l1).fit(model.mdp, model.expert)
    assert found.unique and found.width.max() <= 1e-6
    assert np.allclose(found.low, learned.reward.values, atol=1e-6)
    assert found.objective == pytest.approx(learned.proof.objective, abs=1e-6)


def test_only_optimum_is_the_printed_figure():
    model = models.paper_grid()
    found = optimal_face(model.mdp, model.expert, FiniteLP(margin_cap=None))
    assert np.abs(found.low.reshape(5, 5) - PRINTED).max() <= RESOLUTION
    assert found.objective == pytest.approx(PRINTED_OBJECTIVE, abs=5e-5)


def twins(expert=(0, 0, 0, 0)):
    """From 0 to 1 or to 2; 1 and 3 follow each other, and no action tells them apart."""
    mdp = models.ring([[1, 2], [3, 3], [2, 2], [1, 1]])
    return mdp, np.array(expert)


def test_states_that_can_share_a_reward_have_no_one_optimum():
    mdp, expert = twins()
    found = optimal_face(mdp, expert, FiniteLP(margin_cap=0.5))
    assert not found.unique
    assert found.differing.tolist() == [0, 1, 2, 3]
    assert "not unique" in str(found) and "4 states (0, 1, 2, 3)" in str(found)


def test_price_on_the_norm_chooses_one_of_these():
    mdp, expert = twins()
    found = optimal_face(mdp, expert, FiniteLP(margin_cap=0.5, l1=0.01))
    assert found.unique and "unique" in str(found)


def test_states_without_a_say_differ_in_the_papers_program():
    mdp, expert = twins()
    found = optimal_face(mdp, expert, FiniteLP(margin_cap=None))
    assert found.differing.tolist() == [0]  # it moves no margin; the others are at the bounds
    assert (found.low[0], found.high[0]) == pytest.approx((-1, 1))


@pytest.mark.parametrize("l1", [1e-8, 5e-8, 1e-6, 1e-3])
def test_a_small_price_on_the_norm_chooses_too(l1):
    model = models.paper_grid()
    found = optimal_face(model.mdp, model.expert, FiniteLP(margin_cap=0.1, l1=l1))
    sparsest = optimal_face(model.mdp, model.expert, FiniteLP(margin_cap=0.1, l1=0.01))
    assert found.unique
    np.testing.assert_allclose(found.low, sparsest.low, atol=1e-6)


@settings(max_examples=15)
@given(models.models(), st.sampled_from([{}, {"l1": 0.05}, {"l1": "auto"}, {"margin_cap": 0.05}, {"margin_cap": None}]))
def test_learned_reward_lies_on_the_face(model, options):
    learner = FiniteLP(**options)
    try:
        learned = learner.fit(model.mdp, model.expert)
    except DegenerateExpert:
        return
    found = optimal_face(model.mdp, model.expert, learner)
    slack = 1e-4  # an interior point's answer is within its gap of the optimum, not on it
    assert (found.low <= learned.reward.values + slack).all() and (learned.reward.values <= found.high + slack).all()
    proof = learned.proof
    assert found.objective == pytest.approx(proof.l1_norm if found.sparsest else proof.objective, abs=1e-5)


def test_sparsest_program_is_that_of_the_limit():
    model = models.paper_grid()
    found = optimal_face(model.mdp, model.expert)
    assert found.sparsest and found.l1 == 0
    assert found.objective == pytest.approx(FiniteLP().fit(model.mdp, model.expert).proof.l1_norm, abs=1e-6)


def test_face_of_rewards_on_steps():
    model = models.random_model(8, S=5)
    learner = FiniteLP(reward_on="state-action", margin_cap=None, l1=0.3)
    found, learned = optimal_face(model.mdp, model.expert, learner), learner.fit(model.mdp, model.expert)
    assert found.low.shape == (5, 3)
    assert found.objective == pytest.approx(learned.proof.objective, abs=1e-6)
    assert (found.low <= learned.reward.values + 1e-5).all() and (learned.reward.values <= found.high + 1e-5).all()


def test_steps_of_terminal_states_are_left_out():
    model = models.paper_grid()
    found = optimal_face(model.mdp, model.expert, FiniteLP(reward_on="state-action"))
    assert np.isnan(found.low[4]).all() and np.isfinite(np.delete(found.low, 4, axis=0)).all()


def test_face_scales_with_r_max():
    mdp, expert = twins()
    one, ten = (optimal_face(mdp, expert, FiniteLP(r_max=r, margin_cap=r / 2)) for r in (1.0, 10.0))
    assert np.allclose(ten.low, 10 * one.low, atol=1e-6) and np.allclose(ten.high, 10 * one.high, atol=1e-6)
    assert ten.objective == pytest.approx(10 * one.objective)


def test_record_is_json():
    mdp, expert = twins()
    found = json.loads(json.dumps(optimal_face(mdp, expert).to_json(), allow_nan=False))
    assert len(found["width"]) == 4 and found["sparsest"]


def test_record_is_json_when_the_learner_was_given_numpy_s_numbers(unchecked):
    mdp, expert = twins()
    found = optimal_face(mdp, expert, FiniteLP(r_max=np.int64(2), margin_cap=np.float32(0.1)))
    assert json.loads(json.dumps(found.to_json()))["r_max"] == 2.0


@pytest.mark.parametrize("options, message", [
    ({"learner": FiniteLP(slack=10.0)}, "slack is 10"),
    ({"learner": "FiniteLP"}, "learner is a str"),
    ({"tolerance": 0.0}, "tolerance is 0"),
    ({"workers": 0}, "workers is 0"),
    ({"learner": FiniteLP(margin_cap=0.1, l1=1e-9)}, "l1 is 1e-09: expected 0 or at least 1e-08"),
    ({"expert": np.array([[1, 0], [1, 0], [np.nan, np.nan], [1, 0]])}, "in 1 reachable states, such as 2"),
])  # fmt: skip
def test_bad_options_are_named(unchecked, options, message):
    mdp, expert = twins()
    with pytest.raises(InvalidParameter, match=message):
        optimal_face(**({"mdp": mdp, "expert": expert} | options))


def test_expert_of_another_table_is_named():
    mdp, _ = twins()
    with pytest.raises(InvalidPolicy):
        optimal_face(mdp, np.zeros(3, dtype=int))


def test_nothing_to_compare_is_said():
    with pytest.raises(DegenerateExpert):
        optimal_face(models.ring([[1, 1], [0, 0]]), np.array([0, 0]))
