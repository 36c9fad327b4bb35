"""What a learned reward proves, recomputed from P, the expert and R alone; nothing is taken from the solver's word.

Primal: V = (I - gamma P_pi)^-1 R (5), the margins of (4), and the objective of the LP at R.
Dual: `dual_bound`, for any multipliers of (4). Where the expert is known in part, or errs, see `learners.soft_certificate`.
Is the expert optimal? By what the best policy earns more (`optimality`), with all rounding; row by row, a violation or a margin
counts beyond its own rounding and what the solver of R left open (`TabularReward.tolerance`).
Axes: S states, A actions, n rows of (4).
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from irl_gym._typing import ActionSets, Indices, Numbers, Vector
from irl_gym.comparisons import Comparisons, as_compared, compare
from irl_gym.discounted import Discounted
from irl_gym.dual_bound import DualBound
from irl_gym.dynamic_programming import optimum
from irl_gym.howard import Optimum
from irl_gym.margins import Margins, comparable, least_per_state, margins_of
from irl_gym.mdp import TabularMDP
from irl_gym.optimality import loss_on, told_loss
from irl_gym.policies import policy_array
from irl_gym.proven import Proven
from irl_gym.rewards import TabularReward, as_reward
from irl_gym.sampling_error import told_by_counts


@dataclass(frozen=True, eq=False)
class Certificate(Proven):
    """What a learned reward proves. States outside the reachable ones are not judged."""

    expert_optimal: bool | None
    """Is the expert optimal under R? None where it is undecided: by `loss_bound`, or by what its unknown actions may lose."""
    loss_low: float
    """The best policy earns at least this more than the expert from d0 under R, in units of value, rounding included."""
    loss_bound: float
    """And at most this: in unknown states that the expert may reach, over all that it may do there."""
    loss_share: float
    """`loss_bound` as a share of what is at stake (`optimality`); NaN where every action is tied."""
    worst_violation: float
    """The largest violation of (4), in units of value; 0 when none."""
    margin: Vector
    """(S,) smallest margin of the expert over another action, over the rows of (4) that R can move and that are not listed as
    unbreakable; NaN where there is none."""
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
    """Does R have the same value everywhere? Where episodes end it may prefer much: see `degenerate`."""
    zero: bool
    """Is R zero everywhere?"""
    unconstrained: Indices
    """Reachable states, not terminal, in which (4) has no row at all or only trivial ones."""
    inseparable: Indices
    """Reachable states where a reward on states leaves the expert tied with an action of equal successors; none for R(s, a)."""
    marginless: Indices
    """Reachable states with rows but without a positive margin under R."""
    unbreakable: Indices
    """States with a row that no reward makes strict while the expert is optimal everywhere, as a program found."""
    unbreakable_rows: np.ndarray
    """(u, 2) state and action of each such row: left out of `margin`, one by one. Where no program asked, it is empty."""
    slack: float | None = None
    """C, the price of a violation of (4); None where rows are hard."""
    unknown: Indices = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    """Reachable states, not terminal, in which nothing is known of the expert: no rows, not judged."""
    violated: Indices = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    """States with a violated row of (4)."""
    violated_rows: np.ndarray = field(default_factory=lambda: np.zeros((0, 2), dtype=np.int64))
    """(v, 2) state and action of each violated row: the action is worth more than the expert's under R."""
    violations: Numbers = field(default_factory=lambda: np.zeros(0))
    """(v,) by how much each is violated, in units of value."""
    violated_visits: Numbers = field(default_factory=lambda: np.zeros(0))
    """(v,) how often the row's state was visited; NaN when that is not known."""
    indifferent: bool = False
    """Is the expert tied, to rounding, in every row of (4)?"""
    sampling_error: float | None = None
    """The largest error of a margin on a counted table, of pairs that were visited; None where the table is exact."""
    unsettled: Indices = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    """Reachable states of a counted table in which a margin above 0 is within its sampling error."""

    @property
    def degenerate(self) -> bool:
        """Does R say nothing: is the expert tied with every action in every state judged, as under R = 0?"""
        return self.zero or self.indifferent

    def served(self, n_actions: int) -> ActionSets:
        """(S, A) actions of states with half of the cap or more as their margin, but those listed as unbreakable."""
        found = (np.nan_to_num(self.margin) > (self.margin_cap or 0.0) / 2)[:, None].repeat(n_actions, axis=1)
        found[tuple(self.unbreakable_rows.T)] = False
        return found

    def __str__(self) -> str:
        """The certificate in a few lines a person reads."""
        finite = self.margin[np.isfinite(self.margin)]
        optimal = told_loss(self.expert_optimal, self.loss_low, self.loss_bound, self.loss_share, self.unknown.size)
        span = f"{finite.min():.3g} to {finite.max():.3g} in {finite.size} states" if finite.size else "none"
        lines = [
            f"expert optimal under R   {optimal}",
            f"margins                  {span}",
            self.optimality,
        ]
        lines += told_by_counts(self.sampling_error, self.unsettled.size)
        if np.isfinite(self.least_l1_norm):
            above = max(self.l1_norm - self.least_l1_norm, 0.0)
            lines.append(f"||R||_1                  {self.l1_norm:.6g}, at most {above:.1e} above the least with these margins")
        if self.degenerate:
            lines.append(f"degenerate               {'R is zero' if self.zero else 'R ties the expert with every action'}")
        if self.inseparable.size:
            lines.append(
                f"same successors          in {self.inseparable.size} states an action that no state reward tells apart"
            )
        if self.marginless.size:
            lines.append(f"no margin                in {self.marginless.size} states, where ties remain")
        if self.unbreakable.size:
            count, states = len(self.unbreakable_rows), self.unbreakable.size
            lines.append(
                f"unbreakable              {count} rows of (4), in {states} states, that no reward makes strict if all hold"
            )
        if self.violated.size:
            count, states, most = self.violations.size, self.violated.size, self.violations.max()
            lines.append(f"violated                 {count} rows of (4), in {states} states, by at most {most:.2e}")
        if self.unknown.size:
            lines.append(f"unknown                  nothing is known of the expert in {self.unknown.size} reachable states")
        return "\n".join(lines)


def certify(
    mdp: TabularMDP,
    expert: Any,
    reward: TabularReward | np.ndarray,
    *,
    r_max: float = 1.0,
    l1: float = 0.0,
    lambda_0: float | None = None,
    margin_cap: float | None = None,
    counted: np.ndarray | None = None,
    unbreakable: np.ndarray | None = None,
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
        counted: (n,) rows of (4) among the reachable states, in the order of `comparisons.compare`, whose margins are in the
            objective, each state's least one; None for all that R can move.
        unbreakable: (n,) rows that no reward makes strict, which `margin` leaves out; None where no program asked.
        y: (n,) duals of the same rows; any values give a valid bound.
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
    comparisons = compare(part, policy_array(expert)[rows])
    R = reward.of_rows(rows)
    found = optimum(as_compared(part, comparisons, R.on_states), R)
    margins = margins_of(found, comparisons)
    usable = comparable(comparisons, R)
    spoilt = comparisons.states[comparisons.trivial & ~usable & ~comparisons.equal & (margin_cap is None)]
    counted = usable & (~np.isin(comparisons.states, spoilt) if counted is None else counted)
    least = least_per_state(margins.values[counted], comparisons.states[counted], part.n_states)
    total = float(np.nansum(np.minimum(least, np.inf if margin_cap is None else margin_cap)))
    discounted = Discounted(part.P_pi(comparisons.distribution), part.gamma)
    dual = DualBound(part, comparisons, discounted, R.on_states, counted, r_max, l1, margin_cap)
    return Certificate(
        objective=total - l1 * float(np.abs(R.values).sum()),
        dual_bound=dual.bound(y),
        l1=float(l1),
        lambda_0=None if lambda_0 is None else float(lambda_0),
        margin_cap=None if margin_cap is None else float(margin_cap),
        least_l1_norm=dual.least_l1_norm(y_l1),
        unconstrained=rows[np.setdiff1d(np.flatnonzero(~part.terminal), comparisons.states[usable])],
        **judged(mdp, rows, found, comparisons, R, margins, r_max, unbreakable),
    )


def judged(
    mdp: TabularMDP, rows: np.ndarray, found: Optimum, comparisons: Comparisons, R: TabularReward, margins: Margins,
    r_max: float, unbreakable: np.ndarray | None, active: np.ndarray | None = None, unknown: np.ndarray | None = None,
    visits: np.ndarray | None = None,
) -> dict[str, Any]:  # fmt: skip
    """The fields of a certificate that do not depend on the program.

    Args:
        mdp: the whole MDP.
        rows: (r,) the states of the whole that are in the part.
        found: the optimum of the reachable part under R.
        comparisons: the rows of (4) in the part.
        R: the reward on the part.
        margins: of each row of (4).
        r_max: bound on |R|.
        unbreakable: (n,) rows that no reward makes strict; None where no program asked.
        active: (n,) rows that are judged of an expert that may err: among actions that it takes, some may be better; None for
            an expert whose actions are all as good, in all rows.
        unknown: (r,) states in which nothing is known of the expert; None where there is none.
        visits: (S,) how often each state was visited; None when that is not known.
    """
    part, equal = found.table.mdp, comparisons.equal
    erring = active is not None
    active = np.ones(equal.size, dtype=bool) if active is None else active
    to_both = equal & (not erring)
    violations = np.where(active, margins.violations(to_both), 0.0)
    paid = R.values if R.on_states else R.values[~part.terminal]
    tied = comparisons.states[comparisons.trivial & ~equal & R.on_states]
    usable = comparable(comparisons, R)
    left_out = usable & (np.zeros_like(usable) if unbreakable is None else unbreakable)
    kept = usable & ~left_out
    margin = np.full(mdp.n_states, np.nan)
    margin[rows] = least_per_state(margins.values[kept], comparisons.states[kept], part.n_states)
    without = kept & (margins.values <= margins.none)
    which = np.flatnonzero(active & margins.violated(to_both))
    states = rows[comparisons.states[which]].astype(np.int64)
    whole = part if comparisons.sampling is None else mdp.restrict(rows)
    loss = loss_on(whole, found, comparisons.distribution, unknown)
    error, unsettled = None, np.zeros_like(kept)
    if comparisons.sampling is not None:
        error, unsettled = comparisons.sampling.unsettled(margins.values, margins.worth, kept, margins.none)
    return {
        "expert_optimal": loss.optimal,
        "loss_low": loss.low,
        "loss_bound": loss.high,
        "loss_share": loss.share,
        "worst_violation": float(violations.max(initial=0.0)),
        "margin": margin,
        "l1_norm": float(np.abs(R.values).sum()),
        "constant": bool(np.ptp(paid) <= 1e-9 * r_max) if paid.size else True,
        "zero": bool(np.abs(paid).max(initial=0.0) <= 1e-9 * r_max),
        "indifferent": bool((np.abs(margins.values) <= margins.none)[active].all()),
        "inseparable": rows[np.unique(tied)],
        "marginless": rows[np.unique(comparisons.states[without])],
        "unbreakable": rows[np.unique(comparisons.states[left_out])],
        "unbreakable_rows": _pairs(comparisons, rows, left_out),
        "sampling_error": error,
        "unsettled": rows[np.unique(comparisons.states[unsettled])],
        "violated": np.unique(states),
        "violated_rows": _pairs(comparisons, rows, which),
        "violations": violations[which],
        "violated_visits": np.full(which.size, np.nan) if visits is None else visits[states].astype(np.float64),
    }


def _pairs(comparisons: Comparisons, rows: np.ndarray, which: np.ndarray) -> np.ndarray:
    """(k, 2) state of the whole MDP and action of some rows of (4)."""
    return np.stack([rows[comparisons.states[which]], comparisons.actions[which]], axis=1).astype(np.int64)
