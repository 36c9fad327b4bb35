"""A linear program as matrices, and the bound that any multipliers of its rows give.

    maximise    cost . x + constant    subject to    A x <= b,  lower <= x <= upper
Weak duality: for y >= 0 every feasible x has cost . x <= b . y + sum_j max over its range of (cost - A^T y)_j x_j.
Axes: x all unknowns in a vector, n rows.
"""

from dataclasses import dataclass
from typing import Any

import cvxpy as cp
import numpy as np
import scipy.sparse as sp

from irl_gym.programs.solvers import Answer, Solving, solve


@dataclass(frozen=True, eq=False)
class LinearProgram:
    """Maximise cost . x + constant subject to A x <= b, lower <= x <= upper."""

    cost: np.ndarray
    A: sp.csr_array
    b: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    box: np.ndarray
    """An optimum has |x| at most this; implied, and used for the bound alone."""
    constant: float

    def solve(self, solving: Solving) -> tuple[np.ndarray, np.ndarray, Answer]:
        """X, the multipliers of A x <= b, and how the solver did."""
        x = cp.Variable(self.cost.size)
        rows: Any = self.A @ x <= self.b
        low, high = np.flatnonzero(np.isfinite(self.lower)), np.flatnonzero(np.isfinite(self.upper))
        constraints = [rows, x[low] >= self.lower[low]] + ([x[high] <= self.upper[high]] if high.size else [])
        size = self.b.size + low.size + high.size
        problem = cp.Problem(cp.Maximize(self.cost @ x), constraints)
        answer = solve(problem, rows=size, solving=solving)
        return np.asarray(x.value).ravel(), np.asarray(rows.dual_value).ravel(), answer

    def bound(self, multipliers: np.ndarray) -> float:
        """Weak duality: for any multipliers >= 0, above the objective of every feasible point."""
        y = np.maximum(multipliers, 0.0)
        reduced = self.cost - self.A.T @ y
        low, high = np.maximum(self.lower, -self.box), np.minimum(self.upper, self.box)
        return float(self.b @ y + np.maximum(reduced * low, reduced * high).sum()) + self.constant
