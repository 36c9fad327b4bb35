"""One linear program, many objectives: the constraints are factored once and each solve starts where the last one ended.

    minimise c x   subject to   low <= A x <= high,   least <= x <= most
HiGHS's primal simplex stays feasible when only c changes, so the next optimum is often a few pivots away. Each answer is a
vertex. Not for large programs solved once; these are `irl_gym.programs.solvers`. Axes: n variables, m rows.
"""

from dataclasses import dataclass
from typing import Any

import highspy
import numpy as np
import scipy.sparse as sp

from irl_gym._typing import Sparse
from irl_gym.errors import InvalidParameter, SolverFailed, SolverInfeasible, SolverTimeout
from irl_gym.programs.deadline import NEVER, Deadline
from irl_gym.programs.silent_highs import SilentHighs

TOLERANCE = 1e-9
"""Of primal and dual feasibility, absolute."""
PRIMAL_SIMPLEX = 4
"""HiGHS's number for it."""


@dataclass(frozen=True, eq=False)
class Vertex:
    """An optimal vertex."""

    x: np.ndarray
    """(n,) the variables."""
    objective: float
    """c x."""
    row_duals: np.ndarray
    """(m,) the prices of the rows: what the objective grows by for each unit that a bound of the row does."""
    reduced_costs: np.ndarray
    """(n,) the prices of the variables' bounds."""
    iterations: int
    """Simplex pivots."""


class WarmLP:
    """A linear program whose objective changes. Bounds of +-np.inf are none.

    Args:
        A: (m, n), sparse.
        low: (m,) least values of the rows.
        high: (m,) largest values of the rows.
        least: (n,) least values of the variables.
        most: (n,) largest values of the variables.
        deadline: of all solves, together with whatever else it is given to.
        perturbed: HiGHS may shift costs and bounds a little on its way, which gets it anywhere; what is left of the shifts can
            make an answer slightly worse.

    Raises:
        InvalidParameter: bounds of another length than A, or NaN.
    """

    def __init__(
        self,
        A: Sparse,
        low: np.ndarray,
        high: np.ndarray,
        least: np.ndarray,
        most: np.ndarray,
        *,
        deadline: Deadline = NEVER,
        perturbed: bool = True,
    ):
        rows, columns = A.shape
        by_column = sp.csc_array(A)
        lp: Any = highspy.HighsLp()
        lp.num_col_, lp.num_row_ = columns, rows
        lp.col_cost_ = np.zeros(columns)
        lp.col_lower_, lp.col_upper_ = _bounds("least", least, columns), _bounds("most", most, columns)
        lp.row_lower_, lp.row_upper_ = _bounds("low", low, rows), _bounds("high", high, rows)
        lp.a_matrix_.format_ = highspy.MatrixFormat.kColwise
        lp.a_matrix_.start_, lp.a_matrix_.index_ = by_column.indptr, by_column.indices
        lp.a_matrix_.value_ = by_column.data
        self.columns = np.arange(columns, dtype=np.int32)
        self.deadline = deadline
        self.highs = SilentHighs()
        options: dict[str, Any] = {
            "threads": 1, "presolve": "off", "solver": "simplex", "simplex_strategy": PRIMAL_SIMPLEX,
            "primal_feasibility_tolerance": TOLERANCE, "dual_feasibility_tolerance": TOLERANCE,
        }  # fmt: skip
        if not perturbed:
            options |= {f"{kind}_perturbation_multiplier": 0.0 for kind in ("primal_simplex_bound", "dual_simplex_cost")}
        for name, value in options.items():
            self.highs.setOptionValue(name, value)
        self.highs.passModel(lp)

    def minimise(self, cost: np.ndarray) -> Vertex:
        """The least c x, from where the last solve ended.

        Args:
            cost: (n,) c.

        Raises:
            InvalidParameter: a cost of another length, or not finite.
            SolverInfeasible: the constraints contradict each other.
            SolverTimeout: the time limit was reached.
            SolverFailed: unbounded, or no answer.
        """
        cost = np.ascontiguousarray(cost, dtype=np.float64)
        if cost.shape != self.columns.shape or not np.isfinite(cost).all():
            raise InvalidParameter(f"cost has shape {cost.shape}: expected {self.columns.size} finite numbers, one a variable.")
        self.highs.changeColsCost(cost.size, self.columns, cost)
        self._run()
        if self.highs.getModelStatus() == highspy.HighsModelStatus.kUnknown:  # lost on its way: again, from nothing
            self.highs.clearSolver()
            self._run()
        self._check(self.highs.getModelStatus())
        solution = self.highs.getSolution()
        x = np.array(solution.col_value)
        return Vertex(
            x,
            float(cost @ x),
            np.array(solution.row_dual),
            np.array(solution.col_dual),
            int(self.highs.getInfo().simplex_iteration_count),
        )

    def start_from(self, other: "WarmLP") -> None:
        """Begin the next solve where the last one of another program of the same rows and columns ended."""
        self.highs.setBasis(other.highs.getBasis())

    def _run(self) -> None:
        if self.deadline is not NEVER:
            self.highs.setOptionValue("time_limit", self.highs.getRunTime() + self.deadline.left)
        self.highs.run()

    def _check(self, status: Any) -> None:
        kinds = highspy.HighsModelStatus
        if status == kinds.kOptimal:
            return
        if status == kinds.kInfeasible:
            raise SolverInfeasible("the linear program's constraints contradict each other: expected at least one point.")
        if status == kinds.kTimeLimit:
            raise SolverTimeout(
                f"no answer in {self.deadline.seconds} s, which all linear programs have together: raise time_limit, or give a "
                "smaller problem."
            )
        raise SolverFailed(f"HiGHS ended with {self.highs.modelStatusToString(status)!r}: expected an optimum.")


def _bounds(name: str, values: np.ndarray, size: int) -> np.ndarray:
    found = np.array(values, dtype=np.float64)
    if found.shape != (size,) or np.isnan(found).any():
        raise InvalidParameter(f"{name} has shape {found.shape}: expected {size} numbers, none of them NaN.")
    found[np.isposinf(found)], found[np.isneginf(found)] = highspy.kHighsInf, -highspy.kHighsInf
    return found
