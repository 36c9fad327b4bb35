"""The linear program over feature weights that sections 4 and 5 of Ng & Russell (2000) share, written with cvxpy.

    unknowns    alpha (K,), |alpha_i| <= 1
                u, v (G,) >= 0         what each group's least row has above and below 0
    maximise    sum_g u_g - slope v_g - l1 ||alpha||_1
    subject to  u_g - v_g <= d_r . alpha      for each row r of group g,      u_g <= cap
At the optimum u_g - slope v_g = p(min_r d_r . alpha), with p(x) = slope x below 0, x between 0 and cap, and cap above.
In section 4 a group is a state and its rows are its actions; in section 5 a group is a policy found so far, with one row.

`bound` is Lagrange's: for *any* y >= 0 with w_g, the sum of y over group g, at most slope (and at least 1 without a cap),
    sum_g cap (1 - w_g)+  +  sum_i (|sum_r y_r d_ri| - l1)+
is above every objective, whatever the solver did. Axes: K features, n rows, G groups.
"""

from dataclasses import dataclass
from typing import Any

import cvxpy as cp
import numpy as np
import scipy.sparse as sp

from irl_gym.checks import checked_number
from irl_gym.features.feature_maps import blocks
from irl_gym.programs import native
from irl_gym.programs.killable import called, check_limit
from irl_gym.programs.solvers import AUTO, Answer, Solving, check_solving, solve

ROUNDING = 1e-12
"""Singular values of the rows below this, over the largest, are the rounding of values."""


def check_weighing(learner: Any) -> None:
    """Check the fields that learners of linear rewards share: penalty, l1, horizon, seed, solver and time_limit.

    Raises:
        InvalidParameter: one outside its range.
    """
    checked_number("penalty", learner.penalty, "a slope of at least 1, such as the paper's 2", least=1)
    checked_number("l1", learner.l1, "a number of at least 0", least=0)
    checked_number("seed", learner.seed, "a whole number of at least 0", least=0, whole=True)
    if learner.horizon is not None:
        checked_number("horizon", learner.horizon, "a number of steps of at least 1, or None", least=1, whole=True)
    check_solving(learner.solver, learner.time_limit)


@dataclass(frozen=True, eq=False)
class Rows:
    """What a reward alpha . phi says of the expert, row by row."""

    d: np.ndarray
    """(n, K) expert's value minus the other's, feature by feature."""
    groups: np.ndarray
    """(n,) group of each row, 0 to G - 1, increasing."""

    @property
    def n_groups(self) -> int:
        """G."""
        return int(self.groups[-1]) + 1 if self.groups.size else 0

    @property
    def starts(self) -> np.ndarray:
        """(G,) the first row of each group."""
        return np.searchsorted(self.groups, np.arange(self.n_groups))

    @property
    def scale(self) -> float:
        """The largest |d|; 1 where all are 0."""
        return float(np.abs(self.d).max(initial=0.0)) or 1.0

    @property
    def rank(self) -> int:
        """Rank of d: how many directions of alpha the expert says anything about."""
        triangle = np.zeros((0, self.d.shape[1]))
        for part in blocks(*self.d.shape):  # by QR: d^T d would square the condition, and lose what is below 1e-8
            check_limit()
            triangle = np.asarray(np.linalg.qr(np.concatenate([triangle, self.d[part] / self.scale]), mode="r"))
        values = called(10.0 * max(triangle.shape) ** 3, native.singular_values, triangle)
        return int((values > ROUNDING * values.max(initial=0.0)).sum())

    def least(self, alpha: np.ndarray) -> np.ndarray:
        """(G,) min over the rows of each group of d . alpha."""
        return np.minimum.reduceat(self.d @ alpha, self.starts) if self.groups.size else np.zeros(0)

    def active(self, alpha: np.ndarray, slope: float, cap: float = np.inf) -> tuple[np.ndarray, np.ndarray]:
        """(G,) the row that is least in each group, and the slope of p there."""
        values = self.d @ alpha
        chosen = np.lexsort((values, self.groups))[self.starts]
        return chosen, np.select([values[chosen] < 0, values[chosen] < cap], [slope, 1.0], 0.0)

    def terms(self, alpha: np.ndarray, slope: float, cap: float = np.inf) -> np.ndarray:
        """(G,) p(least)."""
        least = self.least(alpha)
        return np.minimum(np.where(least < 0, slope * least, least), cap)

    def objective(self, alpha: np.ndarray, *, slope: float, l1: float, cap: float = np.inf) -> float:
        """sum_g p(least) - l1 ||alpha||_1."""
        return float(self.terms(alpha, slope, cap).sum()) - l1 * float(np.abs(alpha).sum())

    def bound(self, y: np.ndarray, *, slope: float, l1: float, cap: float = np.inf) -> float:
        """Lagrange's bound above every objective, from duals (n,) of any quality."""
        y = np.maximum(np.nan_to_num(y), 0.0)
        weight = np.bincount(self.groups, y, minlength=self.n_groups)
        size = np.bincount(self.groups, minlength=self.n_groups)
        empty = (weight <= 0) & np.isinf(cap)
        y = np.where(empty[self.groups], 1 / size[self.groups], y)
        weight = np.where(empty, 1.0, weight)
        least = 1.0 if np.isinf(cap) else 0.0
        y = y * (np.clip(weight, least, slope) / np.where(weight > 0, weight, 1.0))[self.groups]
        slack = 0.0 if np.isinf(cap) else cap * float(np.maximum(1 - weight, 0.0).sum())
        return slack + float(np.maximum(np.abs(y @ self.d) - l1, 0.0).sum())


@dataclass(frozen=True, eq=False)
class Weights:
    """A solved program."""

    alpha: np.ndarray
    """(K,) within -1 to 1."""
    y: np.ndarray
    """(n,) duals of the rows."""
    answer: Answer
    """How the solver did."""


SAMPLE = 2_000
"""Groups up to which the program is solved as it stands; above, by generating its kinks."""


def best_weights(rows: Rows, *, slope: float, l1: float, cap: float = np.inf, solving: Solving = AUTO) -> Weights:
    """Solve the program.

    An optimum is a vertex, at which at most K of the G concave terms have a kink; all others are linear around it. So with many
    groups the terms far from a kink are taken as their linear piece, in a box around the best weights so far, at first those of
    a sample. Each such program is a relaxation within its box; one in which no piece is missing and the box does not bind has
    the optimum of the whole. The box grows after a program without a missing piece, and shrinks after one without a gain.

    Raises:
        SolverTimeout, SolverFailed: no answer.
    """
    program = _Program(slope, l1, cap, solving)
    K = rows.d.shape[1]
    if rows.n_groups <= SAMPLE:
        return _solve_part(rows, np.ones(rows.n_groups, dtype=bool), np.zeros(K), np.array([-np.ones(K), np.ones(K)]), program)
    part = np.zeros(rows.n_groups, dtype=bool)
    part[np.linspace(0, rows.n_groups - 1, SAMPLE).astype(int)] = True
    best = _solve_part(rows, part, np.zeros(K), np.array([-np.ones(K), np.ones(K)]), program).alpha
    value, radius, extra, stalls = rows.objective(best, slope=slope, l1=l1, cap=cap), RADIUS, np.zeros_like(part), 0
    while True:
        part = _kinks(rows, best, cap) | extra
        active, weight = rows.active(best, slope, cap)
        box = np.clip([best - radius, best + radius], -1, 1)
        found = _solve_part(rows, part, (weight * ~part) @ rows.d[active], box, program)
        model = np.where(weight == 0, cap if np.isfinite(cap) else 0.0, 0.0) + weight * (rows.d[active] @ found.alpha)
        missing = ~part & (model > rows.terms(found.alpha, slope, cap) + 1e-9 * rows.scale)
        now = rows.objective(found.alpha, slope=slope, l1=l1, cap=cap)
        if not missing.any():
            inside = (np.abs(found.alpha - best) < 0.999 * radius) | (np.abs(found.alpha) > 1 - 1e-9)
            if inside.all() or now <= value + 1e-9 * max(1.0, abs(value)):  # a best that its box does not bind is best of all
                found.y[active[~part]] = weight[~part]
                return found if now >= value else Weights(best, found.y, found.answer)
            radius *= 4
        elif now <= value:
            stalls += 1
            if stalls > MOST_STALLS or radius < 4 * LEAST_RADIUS:  # so the series ends
                extra |= missing
            else:
                radius /= 4
        if now > value:
            best, value = found.alpha, now


RADIUS, LEAST_RADIUS, MOST_STALLS = 0.25, 1e-4, 30
"""Half the width of the first box, and of the least; programs without a gain, after which missing pieces stay."""


@dataclass(frozen=True)
class _Program:
    slope: float
    l1: float
    cap: float
    solving: Solving


def _kinks(rows: Rows, alpha: np.ndarray, cap: float) -> np.ndarray:
    """(G,) the groups nearest to a kink at alpha: where the least row is near 0 or the cap, or near the next."""
    least, chosen = rows.least(alpha), rows.active(alpha, 1.0)[0]
    above = rows.d @ alpha - least[rows.groups]
    above[chosen] = np.inf
    second = np.minimum.reduceat(above, rows.starts)
    near = np.minimum.reduce([np.abs(least), np.abs(least - cap), second])
    mask = np.zeros(rows.n_groups, dtype=bool)
    mask[np.argsort(near, kind="stable")[:SAMPLE]] = True
    return mask


def _solve_part(rows: Rows, part: np.ndarray, linear: np.ndarray, box: np.ndarray, program: _Program) -> Weights:
    """The program with the rows of some groups only; the others are in `linear` (K,), the gradient of their sum.

    `box` (2, K) is what alpha lies between.
    """
    kept = part[rows.groups]
    d = rows.d[kept] / rows.scale
    groups = (np.cumsum(part) - 1)[rows.groups[kept]]
    n, G = len(d), int(part.sum())
    alpha, u, v = cp.Variable(rows.d.shape[1]), cp.Variable(G, nonneg=True), cp.Variable(G, nonneg=True)
    picks = sp.csr_array((np.ones(n), (np.arange(n), groups)), shape=(n, G))
    above: Any = picks @ (u - v) <= d @ alpha
    objective = cp.sum(u) - program.slope * cp.sum(v) + (linear / rows.scale) @ alpha
    constraints: list[Any] = [above, alpha >= box[0], alpha <= box[1]]
    if np.isfinite(program.cap):
        constraints.append(u <= program.cap / rows.scale)
    if program.l1:
        size = cp.Variable(alpha.size)
        constraints += [size >= alpha, size >= -alpha]
        objective = objective - (program.l1 / rows.scale) * cp.sum(size)
    problem = cp.Problem(cp.Maximize(objective), constraints)
    answer = solve(problem, rows=n, solving=program.solving)
    y = np.zeros(len(rows.groups))
    y[kept] = above.dual_value
    return Weights(np.clip(value_of(alpha), *box), y, answer)


def value_of(variable: cp.Variable) -> np.ndarray:
    """What a solved program gives a variable."""
    return np.asarray(variable.value, dtype=np.float64)
