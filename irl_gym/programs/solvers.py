"""Linear programs to answers: the only module that knows solver names.

HiGHS (simplex) answers small programs with a vertex, exact to rounding; Clarabel (interior point) is the faster on large
sparse ones: Ng & Russell's program on a 50x50 grid (gamma 0.99) took HiGHS 9.8 s and Clarabel 0.4 s. Clarabel factorises by
qdldl: its own choice, faer, took six times as long on a 100x100 grid. When one solver fails the other is tried once, never
without a limit. All programs of a fit, and all attempts, share one limit of time: a solver has what those before it left. It
looks at the clock between its iterations; where one could be long, since factors fill up (10,000 states whose successors are
drawn at random), it works in a process that is killed when the time is up (`killable`).
"""

import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Literal

import cvxpy as cp
import numpy as np

from irl_gym.checks import is_word
from irl_gym.errors import InvalidParameter, SolverFailed, SolverInfeasible, SolverTimeout
from irl_gym.programs import native
from irl_gym.programs.deadline import NEVER, Deadline
from irl_gym.programs.killable import called, within
from irl_gym.programs.status import Status as Status

SolverName = Literal["auto", "clarabel", "highs"]
SMALL = 1_500
"""Rows up to which HiGHS is chosen."""
SECOND_SECONDS, SECOND_SHARE = 60.0, 10.0
"""A second attempt without a time limit ends after so many seconds, or so many times what the first took, whichever is more."""


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
    run: Callable[[native.NativeProgram, dict[str, Any], float], Any]


_SOLVERS = {
    "clarabel": _Solver(
        cp.CLARABEL,
        {"tol_gap_abs": 1e-9, "tol_gap_rel": 1e-9, "tol_feas": 1e-9, "max_iter": 500, "direct_solve_method": "qdldl"},
        native.clarabel,
    ),
    "highs": _Solver(
        cp.HIGHS,
        {"primal_feasibility_tolerance": 1e-9, "dual_feasibility_tolerance": 1e-9},
        native.highs,
    ),
}
_OTHER = {"clarabel": "highs", "highs": "clarabel"}


@dataclass(frozen=True)
class Solving:
    """How the programs of one fit are solved, and until when."""

    solver: SolverName = "auto"
    """"auto" chooses by size; a named solver is tried first, and the other after it."""
    deadline: Deadline = field(default=NEVER)
    """Of all of them together."""

    @classmethod
    def begun(cls, solver: SolverName, time_limit: float | None) -> "Solving":
        """The clock of a fit starts now.

        Args:
            solver: its name.
            time_limit: seconds for all programs and attempts together; None for no limit.

        Raises:
            InvalidParameter: an unknown solver name, or a time limit that is not positive.
        """
        if not is_word(solver, "auto", *_SOLVERS):
            raise InvalidParameter(f"solver is {solver!r}: expected 'auto', 'clarabel' or 'highs'.")
        return cls(solver, Deadline.after(time_limit))


AUTO = Solving()
"""By size, without a limit."""


def check_solving(solver: Any, time_limit: Any) -> None:
    """Check a learner's fields, before anything is built.

    Raises:
        InvalidParameter: an unknown solver name, or a time limit that is not positive.
    """
    Solving.begun(solver, time_limit)


def solve(problem: cp.Problem, *, rows: int, solving: Solving = AUTO) -> Answer:
    """Solve a linear program; on failure retry once with the other solver.

    Args:
        problem: a cvxpy problem; its variables and constraints hold the answer and the duals afterwards.
        rows: its number of constraint rows, by which "auto" chooses.
        solving: with which solver, and until when.

    Raises:
        SolverTimeout: the time limit was reached.
        SolverInfeasible: the constraints contradict each other.
        SolverFailed: unbounded, or no solver gave an answer.
    """
    first = ("highs" if rows <= SMALL else "clarabel") if solving.solver == "auto" else solving.solver
    start, deadline = time.perf_counter(), solving.deadline
    failures: list[str] = []
    for attempt, name in enumerate((first, _OTHER[first]), start=1):
        failure = _attempt(problem, name, deadline)
        seconds = time.perf_counter() - start
        if failure is None:
            status = Status.OPTIMAL if problem.status == cp.OPTIMAL else Status.INACCURATE
            stats = problem.solver_stats
            iterations = int(stats.num_iters or 0) if stats is not None else 0
            return Answer(status, name, seconds, float(np.asarray(problem.value)), iterations, attempt)
        if failure == cp.INFEASIBLE:  # now: the problem keeps the status of an earlier answer
            raise SolverInfeasible(f"{name} finds that the constraints contradict each other: no reward satisfies them.")
        failures.append(f"{name}: {failure}")
        if not deadline.left:
            break
        if deadline is NEVER:
            deadline = Deadline.after(max(SECOND_SECONDS, SECOND_SHARE * seconds))
    reasons = "; ".join(failures)
    if not solving.deadline.left:
        raise solving.deadline.late(reasons)
    longer = " Give time_limit, for the second to have longer." if not deadline.left else ""
    raise SolverFailed(f"no solver gave an answer ({reasons}): rescale the problem, or report it with its table.{longer}")


def _attempt(problem: cp.Problem, name: str, deadline: Deadline) -> str | None:
    """Solve with one solver in the time that is left; return None, or what went wrong."""
    chosen, late = _SOLVERS[name], f"time limit of {deadline.seconds} s"
    if not deadline.left:
        return late
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # an inaccurate answer is a Status, not a warning
            compiled: Any = problem.get_problem_data(chosen.cvxpy_name, solver_opts=chosen.options)
            data, chain, inverse = compiled
            bounds = data.get("lower_bounds"), data.get("upper_bounds")
            program = data["c"], data["A"].tocsc(), data["b"], int(data["dims"].zero), *bounds
            with within(deadline):
                found = called(_operations(program), chosen.run, program, chosen.options, deadline.until)
            problem.unpack_results(found, chain, inverse)
    except SolverTimeout:
        return late
    except (cp.SolverError, ValueError) as error:
        text = str(error).splitlines()[0] if str(error) else type(error).__name__
        return text if deadline.left else f"{late} ({text})"
    if problem.status in (cp.OPTIMAL, cp.OPTIMAL_INACCURATE):
        return None
    if problem.status == cp.USER_LIMIT:
        return "iteration limit" if deadline.left else late
    return str(problem.status)


def _operations(program: native.NativeProgram) -> float:
    """Of a factorisation in which nothing is sparse: more than one iteration can take."""
    return float(sum(program[1].shape)) ** 3 / 3
