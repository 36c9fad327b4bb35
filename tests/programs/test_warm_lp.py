"""A linear program whose objective changes, against SciPy."""

import models
import numpy as np
import pytest
import scipy.sparse as sp
from scipy.optimize import linprog

from irl_gym.errors import InvalidParameter, SolverFailed, SolverInfeasible, SolverTimeout
from irl_gym.judging.ambiguity.widths import feasible_widths
from irl_gym.programs.deadline import Deadline
from irl_gym.programs.silent_highs import SilentHighs
from irl_gym.programs.warm_lp import WarmLP


def random_program(seed, n=12, m=20):
    """(A, low, high, least, most) with a point inside: rows below, above, between and equal; unknowns in a box."""
    rng = np.random.default_rng(seed)
    A = sp.random_array((m, n), density=0.4, rng=rng, format="csr")
    inside = A @ rng.uniform(-1, 1, n)
    low = np.where(np.arange(m) % 4 == 0, -np.inf, inside - rng.uniform(0, 1, m))
    high = np.where(np.arange(m) % 4 == 1, np.inf, inside + rng.uniform(0, 1, m))
    low[2], high[2] = inside[2], inside[2]
    return A, low, high, np.full(n, -1.0), np.full(n, 2.0)


def by_scipy(A, low, high, least, most, cost):
    upper, lower = np.isfinite(high), np.isfinite(low)
    rows = sp.vstack([A[np.flatnonzero(upper)], -A[np.flatnonzero(lower)]])
    found = linprog(cost, rows, np.concatenate([high[upper], -low[lower]]), bounds=np.stack([least, most], axis=1))
    assert found.success
    return found.fun


@pytest.mark.parametrize("seed", range(10))
def test_optima_agree_with_scipy_as_the_objective_changes(seed):
    program, rng = random_program(seed), np.random.default_rng(seed + 100)
    warm = WarmLP(*program)
    for cost in rng.normal(size=(8, 12)):
        assert warm.minimise(cost).objective == pytest.approx(by_scipy(*program, cost), abs=1e-7)


def test_answers_satisfy_the_constraints():
    A, low, high, least, most = random_program(0)
    x = WarmLP(A, low, high, least, most).minimise(np.arange(12.0)).x
    assert (A @ x >= low - 1e-8).all() and (A @ x <= high + 1e-8).all()
    assert (x >= least - 1e-8).all() and (x <= most + 1e-8).all()


@pytest.mark.parametrize("seed", range(5))
def test_row_duals_are_what_the_objective_grows_by(seed):
    A, low, high, least, most = random_program(seed)
    cost = np.random.default_rng(seed).normal(size=12)
    before = WarmLP(A, low, high, least, most).minimise(cost)
    after = WarmLP(A, low + 1e-5, high + 1e-5, least, most).minimise(cost)
    assert after.objective - before.objective == pytest.approx(1e-5 * before.row_duals.sum(), abs=1e-9)


def test_duals_price_every_unknown():
    A, low, high, least, most = random_program(3)
    cost = np.arange(12.0) - 5
    vertex = WarmLP(A, low, high, least, most).minimise(cost)
    assert np.allclose(A.T @ vertex.row_duals + vertex.reduced_costs, cost, atol=1e-8)


def test_same_objectives_give_the_same_bytes():
    costs = np.random.default_rng(1).normal(size=(6, 12))
    first, second = WarmLP(*random_program(1)), WarmLP(*random_program(1))
    assert [first.minimise(c).x.tobytes() for c in costs] == [second.minimise(c).x.tobytes() for c in costs]


def test_next_solve_starts_where_the_last_ended():
    warm = WarmLP(*random_program(2))
    assert warm.minimise(np.ones(12)).iterations > 0
    assert warm.minimise(np.ones(12)).iterations == 0


def test_contradiction_is_said():
    A = sp.csr_array(np.ones((2, 1)))
    with pytest.raises(SolverInfeasible, match="contradict"):
        WarmLP(A, np.array([1.0, -np.inf]), np.array([np.inf, 0.0]), np.array([-5.0]), np.array([5.0])).minimise(np.ones(1))


def test_program_without_an_end_is_said():
    A = sp.csr_array(np.ones((1, 1)))
    with pytest.raises(SolverFailed, match="expected an optimum"):
        WarmLP(A, np.array([-np.inf]), np.array([1.0]), np.array([-np.inf]), np.array([np.inf])).minimise(np.ones(1))


def test_time_limit_is_kept():
    rng = np.random.default_rng(0)
    A = sp.csr_array(rng.normal(size=(400, 300)))
    inside = A @ rng.normal(size=300)
    warm = WarmLP(A, inside - 1, inside + 1, np.full(300, -10.0), np.full(300, 10.0), deadline=Deadline.after(1e-9))
    with pytest.raises(SolverTimeout, match=r"1e-09 s.*raise time_limit"):
        warm.minimise(rng.normal(size=300))


def test_program_on_which_a_warm_start_is_lost_is_solved_from_nothing():
    model = models.random_model(seed=9, S=9, A=2)  # HiGHS ended one of these solves with "Unknown"
    assert np.isfinite(feasible_widths(model.mdp, model.expert, margin=None, reward_on="state-action").high).all()


@pytest.mark.parametrize("part", ["low", "high", "least", "most"])
@pytest.mark.parametrize("wrong", [np.zeros(5), np.nan])
def test_bounds_of_another_length_or_nan_are_named(part, wrong):
    bounds = dict(zip(("low", "high", "least", "most"), random_program(0)[1:], strict=True))
    bounds[part] = np.full(bounds[part].size, wrong) if np.isscalar(wrong) else wrong
    with pytest.raises(InvalidParameter, match=f"{part} has shape .*: expected {12 if part.endswith('st') else 20} numbers"):
        WarmLP(random_program(0)[0], **bounds)


@pytest.mark.parametrize("cost", [np.zeros(11), np.full(12, np.nan), np.full(12, np.inf)])
def test_a_cost_of_another_length_or_not_finite_is_named(cost):
    with pytest.raises(InvalidParameter, match="expected 12 finite numbers"):
        WarmLP(*random_program(0)).minimise(cost)


def test_a_program_without_perturbations_has_the_same_optimum():
    cost = np.random.default_rng(5).normal(size=12)
    plain, perturbed = (WarmLP(*random_program(4), perturbed=one) for one in (False, True))
    assert plain.minimise(cost).objective == pytest.approx(perturbed.minimise(cost).objective, abs=1e-9)


def test_a_program_that_starts_from_another_s_end_has_nothing_left_to_do():
    first, second = WarmLP(*random_program(6)), WarmLP(*random_program(6))
    assert first.minimise(np.ones(12)).iterations > 0
    second.start_from(first)
    assert second.minimise(np.ones(12)).iterations == 0


def test_highs_is_silent_from_its_first_moment(capfd):
    solver = SilentHighs()
    solver.setOptionValue("threads", 1)
    solver.run()
    assert solver.getOptionValue("output_flag")[1] is False and capfd.readouterr().out == ""
