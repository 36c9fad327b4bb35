"""A solver at its limit."""

from dataclasses import replace

import pytest
from models import KINDS, paper_grid, random_model
from patients import finding, names

from irl_gym.learners.linear_programs.finite import FiniteLP
from irl_gym.programs.solvers import Status

GRID = paper_grid()
RESULT = FiniteLP().fit(GRID.mdp, GRID.expert)


def solved(**noted):
    programs = {"reward": {**RESULT.stats["programs"]["reward"], "solver": "clarabel", **noted}}
    return replace(RESULT, stats={"programs": programs})


def test_an_inaccurate_answer_is_told_with_the_other_solver():
    said = finding("solver-inaccurate", solved(status=Status.INACCURATE.value), GRID.mdp, GRID.expert)
    assert 'solver="highs"' in said.mend


def test_a_second_attempt_is_told_with_the_solver_that_answered():
    assert 'solver="clarabel"' in finding("solver-retried", solved(attempts=2), GRID.mdp, GRID.expert).mend


def test_a_wide_duality_gap_is_told():
    wide = replace(RESULT, proof=replace(RESULT.proof, dual_bound=RESULT.proof.objective * 2))
    assert names(wide, GRID.mdp, GRID.expert) == ("far-from-optimal",)


def test_a_norm_that_could_be_smaller_is_told():
    large = replace(RESULT, proof=replace(RESULT.proof, least_l1_norm=RESULT.proof.l1_norm / 2))
    assert "least with these margins" in finding("far-from-optimal", large, GRID.mdp, GRID.expert).sentence


@pytest.mark.parametrize("kind", KINDS)
def test_a_zero_reward_of_the_paper_s_program_is_not_far_from_optimal(kind):
    model = random_model(0, kind=kind)
    dear = FiniteLP(l1=50.0, margin_cap=None).fit(model.mdp, model.expert)
    rounding = replace(dear, proof=replace(dear.proof, dual_bound=1e-9))
    assert [one for one in names(rounding, model.mdp, model.expert) if one != "same-successors"] == ["lambda-above-lambda-0"]


@pytest.mark.parametrize("share, told", [(1e-9, False), (0.5, True)])
def test_a_gap_is_rounding_where_price_and_margins_cancel(share, told):
    price = RESULT.proof.l1_norm
    near = replace(RESULT.proof, l1=1.0, margin_cap=None, objective=0.0, dual_bound=share * price)
    assert ("far-from-optimal" in names(replace(RESULT, proof=near), GRID.mdp, GRID.expert)) == told


def test_the_other_solver_mends_an_answer_that_was_short():
    assert names(FiniteLP(solver="highs").fit(GRID.mdp, GRID.expert), GRID.mdp, GRID.expert) == ()
