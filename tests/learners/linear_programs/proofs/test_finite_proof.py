"""What FiniteLP proves of its program, for any reward and any multipliers: the objective, and the bound above every one."""

import math
from dataclasses import replace

import models
import numpy as np
import pytest
import reference
from hypothesis import given
from hypothesis import strategies as st

from irl_gym.learners.linear_programs.finite import FiniteLP
from irl_gym.learners.linear_programs.proofs.finite_proof import prove
from irl_gym.mdp.margins import comparable
from irl_gym.mdp.optimality_rows import compare
from irl_gym.mdp.rewards import TabularReward
from irl_gym.mdp.tabular_mdp import TabularMDP


def proved(mdp, expert, R, *, counted=None, r_max=1.0, **terms):
    """The proof of a reward on the reachable part, of all rows that it can move or of those that are counted."""
    rows = np.flatnonzero(mdp.reachable)
    part, reward = mdp.restrict(rows), TabularReward(R).of_rows(rows)
    c = compare(part, expert[rows])
    return prove(part, c, reward, comparable(c, reward) if counted is None else counted, r_max=r_max, **terms)


@given(model=models.models(), seed=st.integers(0, 10**6), l1=st.sampled_from([0.0, 0.3]), cap=st.sampled_from([None, 0.2]))
def test_proof_bounds_the_objective_for_any_duals(model, seed, l1, cap):
    n = compare(model.mdp, model.expert).states.size
    y = np.random.default_rng(seed).exponential(size=n) * np.random.default_rng(seed + 1).integers(0, 2, n)
    assert proved(model.mdp, model.expert, model.R, l1=l1, margin_cap=cap, y=y).duality_gap >= -1e-7


@given(model=models.models(), seed=st.integers(0, 10**6), cap=st.sampled_from([None, 0.2]))
def test_proof_bounds_the_objective_of_a_reward_on_steps_for_any_duals(model, seed, cap):
    y = np.random.default_rng(seed).exponential(size=compare(model.mdp, model.expert).states.size)
    assert proved(model.mdp, model.expert, model.step_reward, l1=0.1, margin_cap=cap, y=y).duality_gap >= -1e-7


@given(model=models.models(kinds=("walls",)), cap=st.sampled_from([0.05, 1.0]))
def test_proof_bound_ignores_duals_of_trivial_rows(model, cap):
    trivial = compare(model.mdp, model.expert).trivial
    without = proved(model.mdp, model.expert, model.R, margin_cap=cap, y=np.zeros(trivial.size)).dual_bound
    priced = proved(model.mdp, model.expert, model.R, margin_cap=cap, y=100.0 * trivial).dual_bound
    assert priced == pytest.approx(without)


@pytest.mark.parametrize(("cap", "most"), [(None, 2 * 3.0 / (1 - 0.9)), (0.2, 0.2)])
def test_proof_bound_without_multipliers_is_the_largest_margin_in_each_state(cap, most):
    model = models.random_model(0)
    assert proved(model.mdp, model.expert, model.R, r_max=3.0, margin_cap=cap, y=np.zeros(14)).dual_bound == pytest.approx(
        7 * most
    )


def test_proof_bound_is_nan_when_no_duals_are_given():
    model = models.random_model(0)
    assert math.isnan(proved(model.mdp, model.expert, model.R).dual_bound)


def test_proof_objective_is_margins_less_the_price_of_the_reward():
    model = models.random_model(0)
    expected = reference.margins(model.P, 0.9, model.expert, model.R).sum() - 0.3 * np.abs(model.R).sum()
    assert proved(model.mdp, model.expert, model.R, l1=0.3).objective == pytest.approx(expected)


def test_proof_objective_counts_margins_up_to_the_cap():
    model = models.random_model(0)
    expected = np.minimum(reference.margins(model.P, 0.9, model.expert, model.R), 0.05).sum()
    assert proved(model.mdp, model.expert, model.R, margin_cap=0.05).objective == pytest.approx(expected)


def test_the_objective_sums_the_margins_of_the_rows_that_count():
    P = np.zeros((4, 2, 4))  # state 0 is never reached, and has no row
    P[0], P[1] = [[0, 0, 1, 0]] * 2, [[0, 0, 1, 0], [0, 0, 0, 1]]
    mdp = TabularMDP.from_dense(P, 0.9, [0, 1.0, 0, 0])
    R, expert = np.array([0, 0, 1.0, 0]), np.zeros(4, dtype=int)
    objectives = [proved(mdp, expert, R, margin_cap=5.0, counted=np.array([c])).objective for c in (True, False)]
    assert objectives == [1.0, 0.0]


@pytest.mark.parametrize(
    ("settings", "told"),
    [
        ({"margin_cap": None}, "none: Ng & Russell's own program, which may leave ties that a cap breaks"),
        ({}, "the least with these margins"),
        ({"report_lambda_0": True}, "from which on R is 0"),
        ({"slack": 3.0}, "a violation of (4) costs 3, where a margin is worth 1"),
    ],
    ids=str,
)
def test_proof_tells_the_terms_of_its_program(settings, told):
    model = models.random_model(0)
    assert told in str(FiniteLP(**settings).fit(model.mdp, model.expert).proof)


@pytest.mark.parametrize(
    ("gap", "told"),
    [(0.0, "to rounding the best possible"), (1e-15, "to rounding the best possible"), (1e-3, "at most 1.0e-03 below the best"),
     (float("nan"), "without a bound")],
)  # fmt: skip
def test_a_gap_of_nothing_is_none(gap, told):
    model = models.random_model(0)
    proof = proved(model.mdp, model.expert, model.R)
    assert told in replace(proof, objective=1.0, dual_bound=1.0 + gap).facts()[0].sentence
