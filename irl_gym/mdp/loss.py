"""Is an expert optimal under a reward? Decided by the value at stake, from the start, with all rounding.

    loss = d0 . (V* - V_pi)                what the best policy earns more than the expert
    scale = min(d0 . (V* - V_random), span of V* over the states that the expert or an optimal policy visits)
The expert is optimal where the loss is at most `OPTIMAL_SHARE` of the scale: yes, no, or undecided where the bounds of both do
not settle it. The smaller of the two scales counts, so that an outlier of R which only bad actions reach, or only a gamble,
does not dilute a loss. Where V* is flat over those states, to float64 or to what the solver of R left open, their largest |V*|
takes the place of its span, or if that is 0 to float64 too, what the terms of V* add up to without their signs (payments that
cancel); where every action everywhere is tied there is no scale, and nothing to lose.
Axes: S states, A actions.
"""

from dataclasses import dataclass

import numpy as np

from irl_gym._typing import ActionSets, Matrix, StateMask
from irl_gym.facts import counted
from irl_gym.mdp.planning.discounted import EPSILON
from irl_gym.mdp.planning.dynamic_programming import optimum
from irl_gym.mdp.planning.howard import OUTWARDS, Optimum
from irl_gym.mdp.tabular_mdp import TabularMDP, TransitionTable

OPTIMAL_SHARE = 1e-6
"""Share of the scale that an optimal expert may lose."""
AT_STAKE = (
    "what the best policy has over random actions, or if that is less, the span of its values over the states that it or the "
    "expert visits"
)
"""The scale, in words."""
FLAT = 64 * EPSILON
"""Share of |V*| below which its span is rounding."""


@dataclass(frozen=True)
class Loss:
    """What the best policy earns more than an expert, from d0 and discounted: bounds that hold with all rounding."""

    low: float
    """At least this; where that would settle it, less what the rounding of the table's own numbers may make of it."""
    high: float
    """At most this."""
    scale_low: float
    """What is at stake, at least; 0 where every action is tied."""
    scale_high: float
    """And at most."""
    tied: bool
    """Is every action tied in every state that is not terminal?"""

    @property
    def optimal(self) -> bool | None:
        """Is the expert optimal? None where the bounds leave it undecided."""
        if self.tied or self.high <= OPTIMAL_SHARE * self.scale_low:
            return True
        return False if self.low > OPTIMAL_SHARE * self.scale_high else None

    @property
    def share(self) -> float:
        """The loss as a share of the scale, at most; NaN where every action is tied."""
        if self.tied:
            return float("nan")
        if self.high == 0:
            return 0.0
        return self.high / self.scale_low if self.scale_low > 0 else float("inf")


def told_loss(optimal: bool | None, low: float, high: float, share: float, unknown: int = 0) -> str:
    """Is the expert optimal, and what the best policy earns more, in a sentence; infinity where it is not known.

    `unknown` is the number of states in which the expert may do anything.
    """
    if optimal and not np.isfinite(share):
        return "yes: all actions are tied"
    if optimal:
        return f"yes: the best policy earns at most {high:.1e} more, {share:.1e} of what is at stake" if high else "yes"
    if optimal is None:
        most = f"{low:.3g} to {high:.3g} more" if np.isfinite(high) else f"at least {low:.3g} more, how much is not known"
        free = f"; the expert may do anything in {counted(unknown)} where it was not seen" if unknown else ""
        return f"undecided: the best policy earns {most}{free}"
    return f"no: the best policy earns at least {low:.3g} more"


def loss_of(found: Optimum, expert: Matrix, unknown: StateMask | None = None) -> Loss:
    """What an expert loses against the best policy.

    Args:
        found: the optimum of a table whose states can all be reached, under the reward.
        expert: (S, A) probabilities.
        unknown: (S,) states in which the expert may do anything: the bounds are over all that it may do there.
    """
    mdp, e, nowhere = found.table.mdp, found.error, np.zeros(found.policy.size, dtype=bool)
    below, above = found.shortfall(expert, nowhere if unknown is None else unknown)
    low, high = _sum(mdp.d0, below - e, -1), _sum(mdp.d0, above + found.above, 1)
    random = found.shortfall(np.full(expert.shape, 1 / expert.shape[1]), nowhere)
    gain = max(_sum(mdp.d0, random[0] - e, -1), 0.0), _sum(mdp.d0, random[1] + found.above, 1)
    span = _span(found, expert)
    scale = min(gain[0], max(span[0], 0.0)), min(gain[1], span[1])
    if low > OPTIMAL_SHARE * scale[1]:  # a "no", unless the rounding of the table's own numbers makes it
        low -= float(mdp.d0 @ (found.drift(found.best) + found.drift(expert)))
    tied = bool(found.tied()[~mdp.terminal].all()) and not low > OPTIMAL_SHARE * scale[1]
    return Loss(max(low, 0.0), max(high, 0.0), *scale, tied)


def loss_on(table: TabularMDP, found: Optimum, expert: Matrix, unknown: StateMask | None = None) -> Loss:
    """The same where the optimum is of a counted table as it was compared (`optimality_rows.as_compared`), and of the table
    itself.

    Whether actions that the counts do not tell from the expert's lead where its own do is not known: the bounds allow both.
    """
    one = loss_of(found, expert, unknown)
    if found.table.mdp is table:
        return one
    other = loss_of(optimum(table, found.table.reward), expert, unknown)
    scale = min(one.scale_low, other.scale_low), max(one.scale_high, other.scale_high)
    return Loss(min(one.low, other.low), max(one.high, other.high), *scale, one.tied and other.tied)


def _span(found: Optimum, expert: Matrix) -> tuple[float, float]:
    """Bounds of the span of V* over the states that the expert or an optimal policy visits, or of what stands for it."""
    visited, taken = _visited(found, expert)
    h, e = found.W.differences[visited], found.error[visited].astype(np.longdouble)
    low, high, unsure = float((h - e).max() - (h + e).min()), float((h + e).max() - (h - e).min()), float(e.max())
    largest = float(np.abs(h + np.longdouble(found.W.constant)).max())
    size = float(found.advantages.size[taken].max(initial=0.0))
    if high > max(FLAT * max(largest, size), found.table.reward.tolerance * found.table.horizon):
        return low * (1 - OUTWARDS), high * (1 + OUTWARDS)
    scale = largest if largest > max(FLAT * size, unsure) else size
    return scale * (1 - OUTWARDS) - unsure, scale * (1 + OUTWARDS) + unsure


def _visited(found: Optimum, expert: Matrix) -> tuple[StateMask, ActionSets]:
    """(S,) the states that the expert or an optimal policy visits, and (S, A) what these do there.

    The optimal policy does what the expert does, where that is tied.
    """
    mdp = found.table.mdp
    like = (found.tied() | (expert == 0)).all(axis=1)
    optimal = np.where(like[:, None], expert, np.eye(mdp.n_actions)[found.policy])
    reached = [TransitionTable(mdp.P_pi(policy), mdp.d0).reachable for policy in (expert, optimal)]
    taken = (expert > 0) & reached[0][:, None] | (optimal > 0) & reached[1][:, None]
    return reached[0] | reached[1], taken


def _sum(d0: np.ndarray, values: np.ndarray, side: int) -> float:
    """d0 . values, rounded to one side."""
    where = d0 > 0
    return float(d0[where] @ values[where] + side * OUTWARDS * (d0[where] @ np.abs(values[where])))
