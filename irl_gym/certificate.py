"""What a learned reward proves, recomputed from P, the expert and R alone; nothing is taken from the solver's word.

Primal: V = (I - gamma P_pi)^-1 R (5), the margins of (4), and the objective of the LP at R.
Dual: for *any* y >= 0 on the rows of (4), Lagrange's bound
    D(y) = sum_s T (1 - sum_a y(s, a))+  +  R_max sum_i (|c_i| - l1)+
is above every objective, where T bounds a margin (the cap, or 2 R_max / (1 - gamma)) and c is the gradient of
sum y margins with respect to R. So D(y) - objective bounds what the reward falls short of the optimum, whatever the solver did.
Axes: S states, A actions, n rows of (4).
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp

from irl_gym._typing import Indices, Vector
from irl_gym.comparisons import Comparisons, compare
from irl_gym.dynamic_programming import Discounted
from irl_gym.mdp import TabularMDP
from irl_gym.rewards import TabularReward, as_reward

OPTIMAL_WITHIN = 1e-8
"""What solvers' feasibility leaves of (4). A violation below this, times max |R| and a tenth of 1 / (1 - gamma), is none; nor
is such a margin one."""


@dataclass(frozen=True, eq=False)
class Certificate:
    """What a learned reward proves. States outside the reachable ones are not judged."""

    expert_optimal: bool
    """Is the expert optimal under R? (4) holds, to rounding."""
    worst_violation: float
    """The largest violation of (4), in units of value; 0 when none."""
    margin: Vector
    """(S,) smallest margin of the expert over another action; NaN where (4) has no row that R can move."""
    objective: float
    """The LP's objective at R, recomputed."""
    dual_bound: float
    """No reward has a larger objective; NaN when no duals were given."""
    l1: float
    """lambda of the objective above."""
    lambda_0: float | None
    """The l1 above which R = 0 is optimal; None when not computed."""
    margin_cap: float | None
    """The cap tau on margins; None in Ng & Russell's own LP."""
    l1_norm: float
    """||R||_1."""
    least_l1_norm: float
    """No reward with all margins at the cap has a smaller ||R||_1; NaN when that was not asked."""
    constant: bool
    """Does R have the same value everywhere, and so say nothing?"""
    zero: bool
    """Is R zero everywhere?"""
    unconstrained: Indices
    """Reachable states, not terminal, in which (4) has no row at all or only trivial ones."""
    inseparable: Indices
    """Reachable states where a reward on states leaves the expert tied with an action of equal successors; none for R(s, a)."""
    marginless: Indices
    """Reachable states with rows but without a positive margin under R."""

    @property
    def duality_gap(self) -> float:
        """dual_bound - objective: how far R can be from the LP's optimum."""
        return self.dual_bound - self.objective

    @property
    def degenerate(self) -> bool:
        """Is R zero or constant?"""
        return self.zero or self.constant

    def __str__(self) -> str:
        """The certificate in a few lines a person reads."""
        finite = self.margin[np.isfinite(self.margin)]
        optimal = "yes" if self.expert_optimal else f"no, (4) is violated by {self.worst_violation:.2e}"
        span = f"{finite.min():.3g} to {finite.max():.3g} in {finite.size} states" if finite.size else "none"
        lines = [
            f"expert optimal under R   {optimal}",
            f"margins                  {span}",
            f"objective                {self.objective:.6g}, at most {max(self.duality_gap, 0.0):.1e} below the optimum",
        ]
        if np.isfinite(self.least_l1_norm):
            above = max(self.l1_norm - self.least_l1_norm, 0.0)
            lines.append(f"||R||_1                  {self.l1_norm:.6g}, at most {above:.1e} above the least with these margins")
        if self.degenerate:
            lines.append(f"degenerate               R is {'zero' if self.zero else 'constant'}")
        if self.inseparable.size:
            lines.append(
                f"same successors          in {self.inseparable.size} states an action that no state reward tells apart"
            )
        if self.marginless.size:
            lines.append(f"no margin                in {self.marginless.size} states, where ties remain")
        return "\n".join(lines)

    def to_json(self) -> dict[str, Any]:
        """The certificate as json holds it: NaN becomes None."""
        return plain(self, "duality_gap", "degenerate")


def plain(certificate: Any, *properties: str) -> dict[str, Any]:
    """The fields of a certificate, and some of its properties, as json holds them: NaN becomes None."""
    found: dict[str, Any] = {}
    for name in (*certificate.__dataclass_fields__, *properties):
        value = getattr(certificate, name)
        if isinstance(value, np.ndarray):
            found[name] = [None if v != v else v for v in value.tolist()]
        else:
            found[name] = None if value != value else value
    return found


def _comparable(comparisons: Comparisons, reward: TabularReward) -> np.ndarray:
    """(n,) rows that a margin is taken over: not an equality, and not trivial for the reward's kind."""
    return ~comparisons.equal & ~comparisons.trivial if reward.on_states else ~comparisons.equal


def row_margins(
    mdp: TabularMDP, comparisons: Comparisons, reward: TabularReward, discounted: Discounted | None = None
) -> np.ndarray:
    """(n,) the margin of each row of (4) under a reward: Q(s, pi) - Q(s, a), for rewards on states as in (4).

    `discounted` is I - gamma P_pi where it was factorised before.
    """
    discounted = discounted or Discounted(mdp.P_pi(comparisons.distribution), mdp.gamma)
    if reward.on_states:
        return comparisons.rows @ discounted.solve(reward.values)
    R = reward.expected(mdp)
    V = discounted.solve(mdp.mixing(comparisons.distribution) @ R.ravel())
    stacked = comparisons.states * mdp.n_actions + comparisons.actions
    return V[comparisons.states] - R.ravel()[stacked] - mdp.gamma * (mdp.P[stacked] @ V)


def least_per_state(values: np.ndarray, states: np.ndarray, n_states: int) -> Vector:
    """(S,) the smallest value of each state's rows; NaN where it has none."""
    least = np.full(n_states, np.inf)
    np.minimum.at(least, states, values)
    return np.where(np.isfinite(least), least, np.nan)


def certify(
    mdp: TabularMDP,
    expert: Any,
    reward: TabularReward | np.ndarray,
    *,
    r_max: float = 1.0,
    l1: float = 0.0,
    lambda_0: float | None = None,
    margin_cap: float | None = None,
    counted: Indices | None = None,
    y: np.ndarray | None = None,
    y_l1: np.ndarray | None = None,
) -> Certificate:
    """Recompute what a reward proves about an expert.

    Args:
        mdp: the MDP; only states reachable from d0 are judged.
        expert: (S,) actions, (S, A) probabilities or (S, A) set.
        reward: (S,) or (S, A).
        r_max: bound on |R| of the LP; the dual bound depends on it.
        l1: lambda of the LP's objective.
        lambda_0: reported as given.
        margin_cap: cap tau of the margins, None for Ng & Russell's LP (in which a trivial row makes a state's margin 0).
        counted: states whose margins are in the objective; None for all with a row.
        y: (n,) duals of the rows of (4) among the reachable states, in the order of `comparisons.compare`; any values give a
            valid bound.
        y_l1: (n,) duals of the program that makes ||R||_1 least with all margins at the cap.

    Raises:
        InvalidPolicy: an expert of the wrong shape or content.
        InvalidReward: a reward of the wrong shape.
    """
    reward = as_reward(reward)
    reward.expected(mdp)  # checks the shape
    rows = np.flatnonzero(mdp.reachable)
    part = mdp.restrict(rows)
    mdp.mixing(expert)  # checks shape and content for all states
    comparisons = compare(part, np.asarray(expert)[rows])
    discounted = Discounted(part.P_pi(comparisons.distribution), part.gamma)
    R = TabularReward(reward.values[rows])
    values = row_margins(part, comparisons, R, discounted)
    usable = _comparable(comparisons, R)
    least = least_per_state(values[usable], comparisons.states[usable], part.n_states)
    rounding = OPTIMAL_WITHIN * float(np.abs(R.values).max()) * (1 + 0.1 / (1 - mdp.gamma))
    if y is not None:  # a trivial row bounds no margin, so its dual may not tighten D(y)
        y = np.where(usable | comparisons.equal, y, 0.0)
    violations = np.where(comparisons.equal, np.abs(values), np.maximum(-values, 0.0))
    worst = float(violations.max(initial=0.0))
    objective_states = _objective_states(comparisons, usable, margin_cap, counted, rows)
    margins = least[objective_states]
    total = float(np.minimum(margins, np.inf if margin_cap is None else margin_cap).sum())
    dual = _Dual(part, comparisons, discounted, R.on_states, objective_states, r_max, l1, margin_cap)
    norm = float(np.abs(R.values).sum())
    paid = R.values if R.on_states else R.values[~part.terminal]
    tied = comparisons.states[comparisons.trivial & ~comparisons.equal & R.on_states]
    margin = np.full(mdp.n_states, np.nan)
    margin[rows] = least
    return Certificate(
        expert_optimal=bool(worst <= rounding),
        worst_violation=worst,
        margin=margin,
        objective=total - l1 * norm,
        dual_bound=dual.bound(y),
        l1=float(l1),
        lambda_0=None if lambda_0 is None else float(lambda_0),
        margin_cap=None if margin_cap is None else float(margin_cap),
        l1_norm=norm,
        least_l1_norm=dual.least_l1_norm(y_l1),
        constant=bool(np.ptp(paid) <= 1e-9 * r_max) if paid.size else True,
        zero=bool(np.abs(paid).max(initial=0.0) <= 1e-9 * r_max),
        unconstrained=rows[np.isnan(least) & ~part.terminal],
        inseparable=rows[np.unique(tied)],
        marginless=rows[least <= rounding],
    )


def _objective_states(
    comparisons: Comparisons, usable: np.ndarray, cap: float | None, counted: np.ndarray | None, rows: np.ndarray
) -> np.ndarray:
    """States whose margins are summed: those counted; without a cap, none with a trivial row, whose margin is 0."""
    states = np.unique(comparisons.states[usable])
    if cap is None:
        states = np.setdiff1d(states, comparisons.states[~usable & ~comparisons.equal])
    if counted is not None:
        states = np.intersect1d(states, np.flatnonzero(np.isin(rows, counted)))
    return states


@dataclass(frozen=True, eq=False)
class _Dual:
    """Lagrange's bound for one program."""

    mdp: TabularMDP
    comparisons: Comparisons
    discounted: Discounted
    on_states: bool
    objective_states: np.ndarray
    r_max: float
    l1: float
    cap: float | None

    def bound(self, y: np.ndarray | None) -> float:
        """The least D(y)."""
        return float("nan") if y is None else min(map(self.at, self._signed(y)))

    def _signed(self, y: np.ndarray) -> list[np.ndarray]:
        """Y >= 0 on the inequalities, with either sign on the equalities, whose sign solvers leave open."""
        equal, positive = self.comparisons.equal, np.maximum(y, 0.0)
        return [np.where(equal, sign * y, positive) for sign in ((1.0, -1.0) if equal.any() else (1.0,))]

    def at(self, y: np.ndarray) -> float:
        """D(y), for y >= 0 on the inequalities."""
        mdp, comparisons = self.mdp, self.comparisons
        most = 2 * self.r_max / (1 - mdp.gamma) if self.cap is None else self.cap
        weights = np.where(comparisons.equal, 0.0, y)
        per_state = np.bincount(comparisons.states, weights=weights, minlength=mdp.n_states)
        slack = most * float(np.maximum(1 - per_state[self.objective_states], 0.0).sum())
        return slack + self.r_max * float(np.maximum(np.abs(self.gradient(y)) - self.l1, 0.0).sum())

    def least_l1_norm(self, y: np.ndarray | None) -> float:
        """Lagrange's bound below every ||R||_1 with all margins at the cap: cap sum(y) - R_max sum_i (|c_i| - 1)+."""
        if y is None or self.cap is None:
            return float("nan")
        counted = np.isin(self.comparisons.states, self.objective_states) & ~self.comparisons.equal
        bounds = []
        for signed in self._signed(y):
            beyond = np.maximum(np.abs(self.gradient(signed)) - 1, 0.0).sum()
            bounds.append(self.cap * float(signed[counted].sum()) - self.r_max * float(beyond))
        return max(bounds)

    def gradient(self, y: np.ndarray) -> np.ndarray:
        """c, the gradient of sum y margins with respect to R: (S,) or (S*A,), by one transposed solve."""
        mdp, comparisons = self.mdp, self.comparisons
        if self.on_states:
            return self.discounted.solve_transposed(comparisons.rows.T @ y)
        stacked = comparisons.states * mdp.n_actions + comparisons.actions
        on_V = np.bincount(comparisons.states, weights=y, minlength=mdp.n_states)
        on_V = on_V - mdp.gamma * (sp.csr_array(mdp.P[stacked]).T @ y)
        u = self.discounted.solve_transposed(on_V)
        c = mdp.mixing(comparisons.distribution).T @ u - np.bincount(stacked, weights=y, minlength=mdp.P.shape[0])
        return np.where(np.repeat(mdp.terminal, mdp.n_actions), 0.0, c)
