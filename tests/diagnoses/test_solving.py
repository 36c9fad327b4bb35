"""A solver at its limit."""

from dataclasses import replace

from models import paper_grid
from patients import finding, names

from irl_gym.learners.finite import FiniteLP
from irl_gym.solvers import Status

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
    wide = replace(RESULT, certificate=replace(RESULT.certificate, dual_bound=RESULT.objective * 2))
    assert names(wide, GRID.mdp, GRID.expert) == ("far-from-optimal",)


def test_a_norm_that_could_be_smaller_is_told():
    large = replace(RESULT, certificate=replace(RESULT.certificate, least_l1_norm=RESULT.certificate.l1_norm / 2))
    assert "least with these margins" in finding("far-from-optimal", large, GRID.mdp, GRID.expert).sentence


def test_the_other_solver_mends_an_answer_that_was_short():
    assert names(FiniteLP(solver="highs").fit(GRID.mdp, GRID.expert), GRID.mdp, GRID.expert) == ()
