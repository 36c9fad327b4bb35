"""What each row of (4) is worth under a reward, and how sure that is (Ng & Russell 2000, section 3.1).

A row is decided by itself: it holds, is violated, or is neither for certain; a margin counts beyond the rounding of the table's
own numbers and what the solver of R left open. Near gamma = 1 so many steps pay for a difference that this rounding hides what
matters: then what is within it is not known, and not called a tie. Axes: S states, A actions, n rows of (4).
"""

from dataclasses import dataclass

import numpy as np

from irl_gym._typing import Matrix, Vector
from irl_gym.mdp.optimality_rows import Comparisons, as_compared
from irl_gym.mdp.planning.discounted import Discounted
from irl_gym.mdp.planning.dynamic_programming import optimum
from irl_gym.mdp.planning.howard import Optimum
from irl_gym.mdp.rewards import TabularReward
from irl_gym.mdp.tabular_mdp import TabularMDP

TIE = 1e-8
"""Share of the terms of a difference, by the effective horizon, up to which it is none: a hundredth of what decides over all
steps."""


def comparable(comparisons: Comparisons, reward: TabularReward) -> np.ndarray:
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


@dataclass(frozen=True, eq=False)
class Margins:
    """What each row of (4) is worth under a reward."""

    values: np.ndarray
    """(n,) the expert's action less the other, in units of value."""
    unsure: np.ndarray
    """(n,) they are within this of the exact ones, on a counted table of those of the same later values."""
    none: np.ndarray
    """(n,) a margin or a violation up to this is none: the rounding of the table's numbers, and what the solver of R left."""
    rounding: np.ndarray
    """(n,) what of `unsure` is rounding."""
    same: np.ndarray
    """(n,) the two actions are equally good, to rounding of the table's numbers that comes to nothing over all steps."""
    tied: np.ndarray
    """(n,) or to that and what the solver of R left open."""
    worth: Vector
    """(S,) what arriving in a state is worth: the margins are differences of its means."""

    def violations(self, equal: np.ndarray) -> np.ndarray:
        """(n,) by how much a row is violated; rows that are `equal` (n,) to either side."""
        return np.where(equal, np.abs(self.values), np.maximum(-self.values, 0.0))

    def violated(self, equal: np.ndarray) -> np.ndarray:
        """(n,) rows that are violated for certain."""
        return self.violations(equal) - self.unsure > self.none

    @property
    def positive(self) -> np.ndarray:
        """(n,) rows with a margin, all rounding included."""
        return self.values - self.rounding > self.none

    def hold(self, equal: np.ndarray) -> np.ndarray:
        """(n,) rows that hold for certain: by a margin, or as a tie over all steps."""
        within = np.where(equal, np.abs(self.values), -self.values) + self.unsure <= self.none
        return within & (self.tied | (self.positive & ~equal))


@dataclass(frozen=True, eq=False)
class JudgedRows:
    """The rows of (4), with what they are worth under R."""

    states: np.ndarray
    """(n,) rows of the table."""
    actions: np.ndarray
    """(n,) the action that the expert's is compared with."""
    equal: np.ndarray
    """(n,) the expert takes this action too."""
    trivial: np.ndarray
    """(n,) both actions have the same successors."""
    found: Margins
    """Q(s, pi) - Q(s, a) of each row; NaN without a reward."""
    either: np.ndarray
    """(n,) rows that are violated to either side: equal ones, of an expert that is taken at its word."""
    usable: np.ndarray
    """(n,) rows that a reward of this kind can give a margin."""
    errors: np.ndarray
    """(n,) sampling errors of the margins; 0 on an exact table."""

    @property
    def margins(self) -> np.ndarray:
        """(n,) what they are worth."""
        return self.found.values

    @property
    def none(self) -> np.ndarray:
        """(n,) a margin or a violation up to this is none."""
        return self.found.none

    @property
    def violations(self) -> np.ndarray:
        """(n,) by how much each row of (4) is violated."""
        return self.found.violations(self.either)

    @property
    def violated(self) -> np.ndarray:
        """(n,) rows that are violated for certain."""
        return self.found.violated(self.either)

    @property
    def tied(self) -> np.ndarray:
        """(n,) rows whose margin is none, and no violation: not those that rounding hides."""
        return self.found.tied

    @property
    def unsettled(self) -> np.ndarray:
        """(k,) rows with a margin that is within its sampling error; none on an exact table."""
        return np.flatnonzero(self.usable & (self.margins > self.none) & (self.margins <= self.errors))


def margins_under(mdp: TabularMDP, comparisons: Comparisons, reward: TabularReward, *, best: bool) -> tuple[Optimum, Margins]:
    """What acting best is worth under a reward, and the margins of (4): where everybody acts best afterwards, or the expert."""
    found = optimum(as_compared(mdp, comparisons, reward.on_states), reward)
    return found, best_margins(found, comparisons) if best else margins_of(found, comparisons)


def margins_of(found: Optimum, comparisons: Comparisons, tolerance: float | None = None) -> Margins:
    """The margins of (4) under the reward of an optimum: V_pi(s) - Q_pi(s, a), where pi is the expert everywhere.

    `tolerance` is what the solver of R left open; None for the reward's own.
    """
    mine = comparisons.distribution
    behind, unsure = found.behind(mine)
    return _margins(found, comparisons, *found.less_than(behind, unsure), found.V - behind, mine, tolerance)


def best_margins(found: Optimum, comparisons: Comparisons) -> Margins:
    """The same where everybody acts best afterwards: Q*(s, pi) - Q*(s, a)."""
    (gap, wide), mine = found.gaps, comparisons.distribution
    gap = gap - (mine * gap).sum(axis=1, keepdims=True)
    own = np.multiply(mine, wide, out=np.zeros_like(wide), where=mine > 0)  # a bound may be infinite
    return _margins(found, comparisons, gap, wide + own.sum(axis=1, keepdims=True), found.V, found.best, None)


def _margins(
    found: Optimum,
    comparisons: Comparisons,
    values: Matrix,
    unsure: Matrix,
    V: Vector,
    onwards: Matrix,
    tolerance: float | None,
) -> Margins:
    at, reward = (comparisons.states, comparisons.actions), found.table.reward
    left = reward.tolerance if tolerance is None else tolerance
    worth = found.table.mdp.gamma * V + (reward.values if reward.on_states else 0.0)
    moved = ~(comparisons.trivial & reward.on_states)  # the others are 0 whatever the reward
    noise = 0.0 if comparisons.sampling is None else comparisons.sampling.of_margins(worth)
    margins, rounding = values[at] * moved, np.where(moved, unsure[at], 0.0)
    level = found.level_against(comparisons.distribution, onwards)[at]
    nothing = TIE / found.table.mdp.effective_horizon * found.advantages.size[at]
    same, tied = ((np.abs(margins) <= np.minimum(level, nothing) + more) & (rounding <= nothing) for more in (0.0, left))
    return Margins(margins, rounding + noise, level + left, rounding, same, tied, worth)
