"""What a reward in the span of features proves, recomputed from the world, the expert and alpha alone.

Of a table: V = (I - gamma P_pi)^-1 phi alpha and (4) in *every* reachable state, not in the sample only. Of a generative
model: the rows of the sample, with their standard errors. The bound above every objective is Lagrange's (`weights.Rows.bound`),
valid for any duals. Axes: S states, A actions, K features.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from irl_gym._typing import Indices
from irl_gym.certificate import OPTIMAL_WITHIN
from irl_gym.comparisons import compare
from irl_gym.dynamic_programming import Discounted
from irl_gym.mdp import TabularMDP
from irl_gym.policies import as_distribution
from irl_gym.proven import Proven


@dataclass(frozen=True, eq=False)
class FeatureCertificate(Proven):
    """What a reward alpha . phi proves."""

    expert_optimal: bool
    """Is the expert optimal under R in every state judged? (4) holds, to rounding, or to two standard errors."""
    worst_violation: float
    """The largest violation of (4), in units of value; 0 when none."""
    margin: np.ndarray
    """(S,) smallest margin of the expert over another action, NaN where there is none; (|S_0|,) of a generative model."""
    violated: Indices
    """States, rows of the table or numbers in S_0, in which another action is better than the expert's."""
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

    @property
    def degenerate(self) -> bool:
        """Does R say nothing: is the expert tied with every action in every state judged, as under R = 0?"""
        return self.zero or self.indifferent

    def __str__(self) -> str:
        """The certificate in a few lines a person reads."""
        finite = self.margin[np.isfinite(self.margin)]
        no = f"no, (4) is violated in {self.violated.size} of {finite.size} states, by {self.worst_violation:.2e} at most"
        lines = [
            f"expert optimal under R   {'yes' if self.expert_optimal else no}",
            f"margins                  {finite.min():.3g} to {finite.max():.3g} in {finite.size} states",
            self.optimality,
            f"sample                   {self.states} states; {self.trivial} more have no other successors to compare",
            f"features                 {self.n_features}; the rows have rank {self.rank}",
        ]
        if not self.expressible:
            lines.append("expressible              no reward in the span of the features makes the expert optimal")
        if self.degenerate:
            lines.append(f"degenerate               {'R is zero' if self.zero else 'R ties the expert with every action'}")
        if self.standard_error is not None:
            lines.append(f"standard error           {self.standard_error:.2e} at most, of a row under R")
        return "\n".join(lines)


@dataclass(frozen=True, eq=False)
class Judged:
    """The margins of a reward, and what rounding or noise leaves of them."""

    margin: np.ndarray
    """Smallest margin of each state; NaN where there is none."""
    tied: np.ndarray
    """The largest difference between actions that the expert takes in a state; 0 where it takes one."""
    tolerance: float | np.ndarray
    """A violation below this is none; one number, or one for each state."""
    indifferent: bool
    """Is the expert tied with every action in every state judged?"""


def judge_table(mdp: TabularMDP, expert: Any, known: np.ndarray, R: np.ndarray, discounted: Discounted) -> Judged:
    """Margins (S,) under R (S,) of every reachable state in which the expert is known, by one solve and one product."""
    distribution = as_distribution(expert, mdp.n_states, mdp.n_actions)
    V = discounted.solve(R)
    onwards = (mdp.P @ V).reshape(mdp.n_states, mdp.n_actions)
    advantage = (distribution * onwards).sum(axis=1, keepdims=True) - onwards
    taken = distribution > 0
    judged = mdp.reachable & ~mdp.terminal & known
    if mdp.visits is not None:  # actions that the counts do not tell from the expert's
        rows = compare(mdp, distribution, np.flatnonzero(judged))
        advantage[rows.states[rows.trivial], rows.actions[rows.trivial]] = 0.0
    margin = np.where(taken, np.inf, advantage).min(axis=1)
    scale = float(np.abs(R).max(initial=0.0))
    tolerance = OPTIMAL_WITHIN * scale * (1 + 0.1 / (1 - mdp.gamma))
    margin[~judged | ~np.isfinite(margin)] = np.nan
    tied = np.where(judged, np.where(taken, np.abs(advantage), 0.0).max(axis=1), 0.0)
    return Judged(margin, tied, tolerance, bool(np.abs(advantage[judged]).max(initial=0.0) <= tolerance))
