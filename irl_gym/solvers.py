"""Linear programs to answers: the only module that knows solver names.

HiGHS (simplex) answers small programs with a vertex, exact to rounding; Clarabel (interior point) is the faster on large
sparse ones: Ng & Russell's program on a 50x50 grid (gamma 0.99) took HiGHS 9.8 s and Clarabel 0.4 s. Clarabel factorises by
qdldl: its own choice, faer, took six times as long on a 100x100 grid. When one solver fails the other is tried once.
"""

import enum
import time
import warnings
from dataclasses import dataclass
from typing import Any, Literal

import cvxpy as cp
import numpy as np

from irl_gym.checks import checked_number, is_word
from irl_gym.errors import InvalidParameter, SolverFailed, SolverInfeasible, SolverTimeout

SolverName = Literal["auto", "clarabel", "highs"]
SMALL = 1_500
"""Rows up to which HiGHS is chosen."""


class Status(enum.Enum):
    """What became of a linear program, in a sentence with the mend."""

    OPTIMAL = "Optimal within the solver's tolerances."
    INACCURATE = (
        "Solved, but short of the solver's tolerances. Read the certificate's duality gap; if it is too large, choose the "
        "other solver."
    )
    ZERO = (
        "R = 0 is optimal: the l1 penalty is above lambda_0, where no reward is worth its price. Lower l1 below lambda_0, or "
        "make it auto."
    )
    ZERO_WEIGHTS = (
        "R = 0 is optimal, alpha = 0: no reward in the span of the features is worth more. Lower l1, or give features that "
        "tell the expert's successors from other actions'."
    )
    INEXPRESSIBLE = (
        "No reward in the span of the features makes the expert optimal, but those that tie it with everything; this one "
        "violates least. Give more or other features."
    )


@dataclass(frozen=True)
class Answer:
    """How a linear program was answered; the values are in its variables."""

    status: Status
    solver: str
    seconds: float
    """Wall time of compiling and solving, retries included."""
    objective: float
    iterations: int
    attempts: int

    def to_json(self) -> dict[str, Any]:
        """What is noted of a program: everything but its objective."""
        return {
            "solver": self.solver,
            "seconds": self.seconds,
            "iterations": self.iterations,
            "attempts": self.attempts,
            "status": self.status.value,
        }


@dataclass(frozen=True)
class _Solver:
    cvxpy_name: str
    options: dict[str, Any]
    time_option: str


_SOLVERS = {
    "clarabel": _Solver(
        cp.CLARABEL,
        {"tol_gap_abs": 1e-9, "tol_gap_rel": 1e-9, "tol_feas": 1e-9, "max_iter": 500, "direct_solve_method": "qdldl"},
        "time_limit",
    ),
    "highs": _Solver(
        cp.HIGHS,
        {"primal_feasibility_tolerance": 1e-9, "dual_feasibility_tolerance": 1e-9},
        "time_limit",
    ),
}
_OTHER = {"clarabel": "highs", "highs": "clarabel"}


def check_solving(solver: Any, time_limit: Any) -> None:
    """Check what `solve` takes, before anything is built.

    Raises:
        InvalidParameter: an unknown solver name, or a time limit that is not positive.
    """
    if not is_word(solver, "auto", *_SOLVERS):
        raise InvalidParameter(f"solver is {solver!r}: expected 'auto', 'clarabel' or 'highs'.")
    if time_limit is not None:
        checked_number("time_limit", time_limit, "seconds above 0, or None", above=0)


def solve(problem: cp.Problem, *, rows: int, solver: SolverName = "auto", time_limit: float | None = None) -> Answer:
    """Solve a linear program; on failure retry once with the other solver.

    Args:
        problem: a cvxpy problem; its variables and constraints hold the answer and the duals afterwards.
        rows: its number of constraint rows, by which "auto" chooses.
        solver: "auto", "clarabel" or "highs"; a named solver is tried first and the other after it.
        time_limit: seconds for each attempt.

    Raises:
        InvalidParameter: an unknown solver name, or a time limit that is not positive.
        SolverTimeout: the time limit was reached.
        SolverInfeasible: the constraints contradict each other.
        SolverFailed: unbounded, or no solver gave an answer.
    """
    check_solving(solver, time_limit)
    first = ("highs" if rows <= SMALL else "clarabel") if solver == "auto" else solver
    start = time.perf_counter()
    failures: list[str] = []
    for attempt, name in enumerate((first, _OTHER[first]), start=1):
        failure = _attempt(problem, name, time_limit)
        if failure is None:
            status = Status.OPTIMAL if problem.status == cp.OPTIMAL else Status.INACCURATE
            stats = problem.solver_stats
            iterations = int(stats.num_iters or 0) if stats is not None else 0
            return Answer(status, name, time.perf_counter() - start, float(np.asarray(problem.value)), iterations, attempt)
        if problem.status == cp.INFEASIBLE:
            raise SolverInfeasible(f"{name} finds that the constraints contradict each other: no reward satisfies them.")
        failures.append(f"{name}: {failure}")
    reasons = "; ".join(failures)
    if "time limit" in reasons and "unbounded" not in reasons:
        raise SolverTimeout(f"no answer in {time_limit} s ({reasons}): raise time_limit, or choose the other solver.")
    raise SolverFailed(f"no solver gave an answer ({reasons}): rescale the problem, or report it with its table.")


def _attempt(problem: cp.Problem, name: str, time_limit: float | None) -> str | None:
    """Solve with one solver; return None, or what went wrong."""
    chosen = _SOLVERS[name]
    options = dict(chosen.options)
    if time_limit is not None:
        options[chosen.time_option] = time_limit
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # an inaccurate answer is a Status, not a warning
            problem.solve(solver=chosen.cvxpy_name, **options)
    except (cp.SolverError, ValueError) as error:
        text = str(error).splitlines()[0] if str(error) else type(error).__name__
        timed_out = time_limit is not None and problem.status in (cp.USER_LIMIT, None)
        return f"time limit ({text})" if timed_out and "limit" in text.lower() else text
    if problem.status in (cp.OPTIMAL, cp.OPTIMAL_INACCURATE):
        return None
    if problem.status == cp.USER_LIMIT or problem.status == "user_limit":
        return f"time limit of {time_limit} s" if time_limit is not None else "iteration limit"
    return str(problem.status)
