"""What rewards in the span of features can say of the expert (Ng & Russell 2000, section 4): which rows of (10) can be strict.

Weights that leave no row below 0 form a convex cone, and what two of them give a row adds up: so some weights make strict, at
once, every row that any can. A row that none makes strict is *unbreakable* in these features: a state reward may break it.
Each program has K unknowns; the rows that bind are generated, first those worst under the answer before.
Axes: K features, n rows.
"""

from collections.abc import Callable
from itertools import count

import cvxpy as cp
import numpy as np

from irl_gym.learners.linear_programs import weights
from irl_gym.learners.linear_programs.strict_rows import SERVED, strict_rows
from irl_gym.learners.linear_programs.weights import ROUNDING, Rows, value_of
from irl_gym.programs.solvers import AUTO, Solving, solve

LEAST_MARGIN = 1e-6
"""A margin below this, over the size of the rows, is none: such a row is left out of the uniform margin."""
NOTHING = 1e-9
"""A value, or a violation, below this is the solvers' rounding."""
MOST_PURGES = 50
"""Rounds after which rows that are in stay in, so that the series ends."""

PartProgram = Callable[[np.ndarray], tuple[float, float, np.ndarray]]
"""(n,) rows that are in, to the program's value, what every row that counts has to reach, and alpha (K,)."""


def most_agreement(rows: Rows, near: np.ndarray | None = None, *, solving: Solving = AUTO) -> float:
    """A bound above the mean of d . alpha, over scale, of all rewards that leave *no* row below 0.

    Where it is 0, to rounding, the features express no reward that makes the expert optimal, but those that leave it tied with
    everything. Each program is a relaxation, so its bound holds for the whole. The first rows are the worst under `near` (K,).

    Raises:
        SolverTimeout, SolverFailed: no answer.
    """
    everything = np.ones(len(rows.d), dtype=bool)
    return _agreement(rows.d / rows.scale, everything, near, solving)[0]


def _agreement(d: np.ndarray, wanted: np.ndarray, near: np.ndarray | None, solving: Solving) -> tuple[float, np.ndarray]:
    """The bound on the mean of some rows (n,), and the weights that reach it."""
    mean = d[wanted].mean(axis=0)

    def solve_part(part: np.ndarray) -> tuple[float, float, np.ndarray]:
        alpha = cp.Variable(len(mean))
        satisfied = d[part] @ alpha >= 0
        problem = cp.Problem(cp.Maximize(mean @ alpha), [satisfied, alpha <= 1, alpha >= -1])
        solve(problem, rows=int(part.sum()), solving=solving)
        y = np.maximum(np.asarray(satisfied.dual_value), 0.0)
        return float(np.abs(mean + y @ d[part]).sum()), 0.0, value_of(alpha)

    return _generate(d, np.zeros_like(wanted), np.sign(mean) if near is None else near, solve_part)


def uniform_margin(rows: Rows, counted: np.ndarray | None = None, *, solving: Solving = AUTO) -> float:
    """The largest margin that all rows that count can have at once, with the others at 0 or above; 0 if there is none.

    Args:
        rows: n rows.
        counted: (n,) booleans; None for all that are not 0 themselves.
        solving: with which solver, and until when.

    Raises:
        SolverTimeout, SolverFailed: no answer.
    """
    d = rows.d / rows.scale
    moving = np.abs(d).max(axis=1, initial=0.0) > ROUNDING
    served = (moving if counted is None else counted)[moving]
    d = d[moving]
    if not served.any():
        return 0.0

    def solve_part(part: np.ndarray) -> tuple[float, float, np.ndarray]:
        alpha, margin = cp.Variable(d.shape[1]), cp.Variable()
        above = d[part] @ alpha >= margin * served[part].astype(float)
        problem = cp.Problem(cp.Maximize(margin), [above, alpha <= 1, alpha >= -1, margin <= d.shape[1]])  # bounded by no row
        solve(problem, rows=int(part.sum()), solving=solving)
        return float(np.asarray(margin.value)), float(np.asarray(margin.value)), value_of(alpha)

    found, _ = _generate(d, served, np.sign(d[served].mean(axis=0)), solve_part)
    return found * rows.scale if found > 1e-7 else 0.0  # below, it is the solvers' rounding


def breakable(rows: Rows, states: np.ndarray, wanted: np.ndarray, *, solving: Solving = AUTO) -> np.ndarray:
    """(n,) the wanted rows that some weights make strict, with every row at 0 or above.

    Args:
        rows: n rows.
        states: (n,) state of each, increasing.
        wanted: (n,) rows in question.
        solving: with which solver, and until when.

    Raises:
        SolverTimeout, SolverFailed: no answer.
    """
    d = rows.d / rows.scale

    def serve(asked: np.ndarray) -> np.ndarray:
        """The margins of all rows, in units of the least, under the sum of the best weights for what is left of those asked."""
        alpha, left = np.zeros(d.shape[1]), asked.copy()
        while left.any():
            most, more = _agreement(d, left, None, solving)
            new = left & (d @ more > SERVED * LEAST_MARGIN)
            if most <= NOTHING or not new.any():
                break
            alpha, left = alpha + more, left & ~new
        return d @ alpha / LEAST_MARGIN

    return strict_rows(states, wanted, serve)


def _generate(d: np.ndarray, counted: np.ndarray, alpha: np.ndarray, solve_part: PartProgram) -> tuple[float, np.ndarray]:
    """Value and weights of the last of a series of relaxations, each with the rows put in that the answer before violates most.

    Rows that are far from binding leave again, but for the last of many rounds, so that the programs stay small.

    Args:
        d: (n, K).
        counted: (n,) rows that have to reach what the program says; the others have to reach 0.
        alpha: (K,) before the first.
        solve_part: the relaxation.
    """
    part, value = np.zeros(len(d), dtype=bool), 0.0
    short, enough = d @ alpha, np.inf
    for number in count():
        worst = np.argsort(np.where(part, np.inf, short), kind="stable")[: max(1, weights.SAMPLE // 2)]
        worst = worst[(short[worst] < enough) & ~part[worst]]
        if not worst.size:
            break
        if number < MOST_PURGES:
            kept = np.argsort(np.where(part, short, np.inf), kind="stable")[: weights.SAMPLE]
            part &= np.isin(np.arange(len(d)), kept)
        part[worst] = True
        value, least, alpha = solve_part(part)
        if value <= NOTHING:
            break
        short, enough = d @ alpha - least * counted, -NOTHING
    return value, alpha
