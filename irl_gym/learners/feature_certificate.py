"""What a reward in the span of features proves, recomputed from the world, the expert and alpha alone.

Of a table: V = (I - gamma P_pi)^-1 phi alpha and (4) in *every* reachable state, not in the sample only. Of a generative
model: the rows of the sample, with their standard errors. The bound above every objective is Lagrange's (`weights.Rows.bound`),
valid for any duals. Axes: S states, A actions, K features.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from irl_gym._typing import Indices
from irl_gym.comparisons import as_compared, compare
from irl_gym.dynamic_programming import optimum
from irl_gym.margins import comparable, least_per_state, margins_of
from irl_gym.mdp import TabularMDP
from irl_gym.optimality import Loss, loss_on, told_loss
from irl_gym.policies import as_distribution
from irl_gym.proven import Proven
from irl_gym.rewards import TabularReward
from irl_gym.sampling_error import told_by_counts


@dataclass(frozen=True, eq=False)
class FeatureCertificate(Proven):
    """What a reward alpha . phi proves."""

    expert_optimal: bool | None
    """Is the expert optimal under R? On a table by `loss_bound`, None where that is undecided; of a generative model, does (10)
    hold in all of S_0, to two standard errors?"""
    loss_low: float | None
    """The best policy earns at least this more than the expert from d0 under R, rounding included; None without a table."""
    loss_bound: float | None
    """And at most this: in unknown states that the expert may reach, over all that it may do there."""
    loss_share: float | None
    """`loss_bound` as a share of what is at stake (`optimality`); NaN where every action is tied."""
    worst_violation: float
    """The largest violation of (4), in units of value; 0 when none."""
    margin: np.ndarray
    """(S,) smallest margin of the expert over another action, over the rows not listed as unbreakable; NaN where there is none;
    (|S_0|,) of a generative model."""
    violated: Indices
    """States, rows of the table or numbers in S_0, in which another action is better than the expert's."""
    unbreakable: Indices
    """States of S_0 with a row of (10) that no weights that satisfy (10) in all of S_0 make strict, as a program found."""
    unbreakable_rows: np.ndarray
    """(u, 2) state and action of each such row: left out of `margin`, one by one. Without a cap no program asks: empty."""
    objective: float
    """sum over S_0 of p(margin), minus l1 ||alpha||_1, recomputed."""
    dual_bound: float
    """No alpha has a larger objective."""
    penalty: float
    """Slope of p below 0."""
    margin_cap: float | None
    """Cap tau on margins; None in the paper's program."""
    l1: float
    """Price of ||alpha||_1."""
    alpha_l1_norm: float
    """||alpha||_1."""
    states: int
    """States of S_0 that count: those with a row which is not trivial."""
    trivial: int
    """States of S_0 that do not: every other action has the expert's successors."""
    rank: int
    """Rank of the rows: how many directions of alpha they say anything about."""
    n_features: int
    """K."""
    expressible: bool
    """Does some reward in the span of the features satisfy (10) in all of S_0, other than one that ties everything?"""
    zero: bool
    """Is alpha zero?"""
    indifferent: bool
    """Is the expert tied, to rounding, with every action in every state judged?"""
    standard_error: float | None
    """The largest standard error of a row of (10) under R; None where the rows are exact or had one rollout."""
    unknown: Indices
    """Reachable states, not terminal, in which nothing is known of the expert; none of a generative model."""
    sampling_error: float | None
    """The largest error of a margin on a counted table, of pairs that were visited; None where there is none."""
    unsettled: Indices
    """Reachable states of a counted table in which a margin above 0 is within its sampling error."""

    @property
    def degenerate(self) -> bool:
        """Does R say nothing: is the expert tied with every action in every state judged, as under R = 0?"""
        return self.zero or self.indifferent

    @property
    def _optimal(self) -> str:
        if self.loss_low is None or self.loss_bound is None:
            return "yes, to two standard errors in S_0" if self.expert_optimal else "no, (10) is violated in S_0"
        return told_loss(self.expert_optimal, self.loss_low, self.loss_bound, self.loss_share, self.unknown.size)

    def __str__(self) -> str:
        """The certificate in a few lines a person reads."""
        finite = self.margin[np.isfinite(self.margin)]
        span = f"{finite.min():.3g} to {finite.max():.3g} in {finite.size} states" if finite.size else "none"
        lines = [
            f"expert optimal under R   {self._optimal}",
            f"margins                  {span}",
            self.optimality,
            f"sample                   {self.states} states; {self.trivial} more have no other successors to compare",
            f"features                 {self.n_features}; the rows have rank {self.rank}",
        ]
        lines += told_by_counts(self.sampling_error, self.unsettled.size)
        if self.violated.size:
            lines.append(f"violated                 (4) in {self.violated.size} states, by at most {self.worst_violation:.2e}")
        if not self.expressible:
            lines.append("expressible              no reward in the span of the features makes the expert optimal")
        if self.unbreakable.size:
            count, states = len(self.unbreakable_rows), self.unbreakable.size
            lines.append(
                f"unbreakable              {count} rows of (10), in {states} states, that no weights make strict if all hold"
            )
        if self.degenerate:
            lines.append(f"degenerate               {'R is zero' if self.zero else 'R ties the expert with every action'}")
        if self.standard_error is not None:
            lines.append(f"standard error           {self.standard_error:.2e} at most, of a row under R")
        return "\n".join(lines)


@dataclass(frozen=True, eq=False)
class Judged:
    """The margins of a reward, and what rounding or noise leaves of them."""

    margin: np.ndarray
    """Smallest margin of each state, over the rows that count; NaN where there is none."""
    short: np.ndarray
    """By what the expert's action is worse than the best in each state, or differs from another that it takes; at least 0."""
    tolerance: float | np.ndarray
    """A violation below this is none; one number, or one for each state."""
    indifferent: bool
    """Is the expert tied with every action in every state judged?"""
    loss: Loss | None = None
    """What the best policy earns more; None where there is no table."""
    unknown: Indices = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    """States of the table in which nothing is known of the expert."""
    sampling_error: float | None = None
    """The largest error of a margin that a counted table leaves."""
    unsettled: Indices = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    """States with a margin within it."""


def judge_table(mdp: TabularMDP, expert: Any, known: np.ndarray, reward: TabularReward, ties: np.ndarray) -> Judged:
    """Margins (S,) under a reward (S,) of every reachable state in which the expert is known.

    `ties` (u, 2) are states and actions that no margin is taken over.
    """
    rows = np.flatnonzero(mdp.reachable)
    part, distribution = mdp.restrict(rows), as_distribution(expert, mdp.n_states, mdp.n_actions)[rows]
    seen = known[rows] | part.terminal
    c = compare(part, distribution, np.flatnonzero(seen))
    R = reward.of_rows(rows)
    found = optimum(as_compared(part, c, True), R)
    margins = margins_of(found, c)
    left_out = np.isin(rows[c.states] * mdp.n_actions + c.actions, ties @ [mdp.n_actions, 1])
    kept = comparable(c, R) & ~left_out
    margin, short, none = np.full((3, mdp.n_states), np.nan)
    margin[rows] = least_per_state(margins.values[kept], c.states[kept], part.n_states)
    short[rows] = -least_per_state(-margins.violations(c.equal), c.states, part.n_states)
    none[rows] = -least_per_state(-margins.none, c.states, part.n_states)
    indifferent = bool((np.abs(margins.values) <= margins.none).all())
    error, open_ = None, np.zeros_like(kept)
    if c.sampling is not None:
        error, open_ = c.sampling.unsettled(margins.values, margins.worth, kept, margins.none)
    return Judged(
        margin,
        np.nan_to_num(short),
        np.nan_to_num(none),
        indifferent,
        loss_on(part, found, distribution, ~seen),
        rows[~seen],
        error,
        rows[np.unique(c.states[open_])],
    )
