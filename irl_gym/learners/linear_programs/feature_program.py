"""FeatureLP's programs, in which order they are solved, and what the answers say.

With a cap, the rows of (10) that no weights make strict are found first (`expressible`), and left out one by one: they earn no
margin, and their violation costs what it did. Half of the largest margin that all other rows can have at once is then attained
by each of them: their sum cannot be larger, so nothing pays for a violation while l1 is 0.
"""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from irl_gym.learners.linear_programs.expressible import breakable, most_agreement, uniform_margin
from irl_gym.learners.linear_programs.feature_rows import FeatureRows
from irl_gym.learners.linear_programs.weights import ROUNDING, Rows, Weights, best_weights
from irl_gym.programs.solvers import Solving, Status

NOTHING = 1e-8
"""An objective or a sum of margins below this, over the size of the rows, is the solvers' rounding."""


@dataclass(frozen=True, eq=False)
class SolvedFeatures:
    """The program's answer, and what is said of it."""

    weights: Weights
    status: Status
    expressible: bool
    """Does some reward of the span satisfy (10), other than one that ties everything?"""
    ties: np.ndarray
    """(n,) rows that no weights make strict, left out of margins."""
    cap: float | None
    objective: float
    bound: float


def solve_features(
    found: FeatureRows, penalty: float, l1: float, margin_cap: float | Literal["auto"] | None, solving: Solving
) -> SolvedFeatures:
    """The weights, and what became of them; penalty, l1 and margin_cap are `FeatureLP`'s."""
    rows, unit = found.rows, NOTHING * found.rows.scale
    program: dict[str, Any] = {"slope": float(penalty), "l1": float(l1), "cap": np.inf}
    ties, expressible = np.zeros(len(rows.d), dtype=bool), None
    cap = None if margin_cap == "auto" else margin_cap
    if margin_cap is not None:
        strict, uniform = _strict(found, solving)
        expressible = bool(strict.any())
        ties = expressible & ~(strict | found.equal | found.idle)
        if margin_cap == "auto":
            cap = uniform / 2 if uniform > 0 else _typical_margin(found.apart(ties), program, solving)
    rows = found.apart(ties)
    program["cap"] = np.inf if cap is None else float(cap)
    weights = best_weights(rows, **program, solving=solving)
    if expressible is None:
        least = rows.least(weights.alpha)
        satisfied = bool(least.min() >= -unit and least.max() > unit)
        expressible = satisfied or most_agreement(rows, weights.alpha, solving=solving) > NOTHING
    bound = rows.bound(weights.y, **program)
    if bound <= min(unit, np.inf if cap is None else NOTHING * cap):
        weights = Weights(np.zeros_like(weights.alpha), weights.y, weights.answer)  # as good, and says what is the case
    status = weights.answer.status
    if not expressible:
        status = Status.INEXPRESSIBLE
    elif not weights.alpha.any():
        status = Status.ZERO_WEIGHTS
    objective = rows.objective(weights.alpha, **program)
    return SolvedFeatures(weights, status, expressible, ties, None if cap is None else float(cap), objective, bound)


def _strict(found: FeatureRows, solving: Solving) -> tuple[np.ndarray, float]:
    """(n,) rows that some weights make strict, all others at 0 or above; and the largest margin that these have at once."""
    rows = found.rows
    moving = ~found.equal & (np.abs(rows.d).max(axis=1) > ROUNDING * rows.scale)
    uniform = uniform_margin(rows, moving, solving=solving)
    if uniform > 0:
        return moving, uniform
    if most_agreement(rows, solving=solving) <= NOTHING:
        return np.zeros_like(moving), 0.0
    strict = breakable(rows, found.row_states, moving, solving=solving)
    return strict, uniform_margin(rows, strict, solving=solving)


def _typical_margin(rows: Rows, program: dict[str, Any], solving: Solving) -> float | None:
    """A tenth of the mean margin under the paper's reward; None where it is 0."""
    mean = float(np.maximum(rows.least(best_weights(rows, **program, solving=solving).alpha), 0.0).mean())
    return mean / 10 if mean > NOTHING * rows.scale else None
