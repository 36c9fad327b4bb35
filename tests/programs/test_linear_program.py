import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import linprog

from irl_gym.learners.linear_programs.programs import picking
from irl_gym.programs.linear_program import LinearProgram
from irl_gym.programs.solvers import Solving


def drawn(seed, n=4, m=6):
    """A bounded feasible program, and its optimum."""
    rng = np.random.default_rng(seed)
    A, b, cost = rng.normal(size=(m, n)), rng.uniform(0.5, 2, m), rng.normal(size=n)
    lower, upper = np.where(np.arange(n) % 2, -np.inf, 0.0), np.where(np.arange(n) < 2, 3.0, np.inf)
    A, b = np.vstack([A, np.eye(n), -np.eye(n)]), np.concatenate([b, np.full(2 * n, 5.0)])
    program = LinearProgram(cost, sp.csr_array(A), b, lower, upper, np.full(n, 5.0), 1.5)
    bounds = [
        (None if low == -np.inf else low, None if high == np.inf else high) for low, high in zip(lower, upper, strict=True)
    ]
    return program, 1.5 - linprog(-cost, A_ub=A, b_ub=b, bounds=bounds).fun


@given(seed=st.integers(0, 999))
def test_any_multipliers_bound_the_optimum(seed):
    program, best = drawn(seed)
    y = np.random.default_rng(seed).normal(size=program.b.size)
    assert program.bound(y) >= best - 1e-9


@pytest.mark.parametrize("seed", range(5))
def test_the_solvers_multipliers_attain_the_bound(seed):
    program, best = drawn(seed)
    x, y, _ = program.solve(Solving())
    assert program.cost @ x + program.constant == pytest.approx(best, abs=1e-7)
    assert program.bound(y) == pytest.approx(best, abs=1e-6)


def test_picking_selects_columns():
    assert (picking(np.array([2, 0]), 3) @ np.array([10.0, 20, 30])).tolist() == [30.0, 10.0]
