"""What FiniteLP proves of its program, recomputed from P, the expert and R alone; nothing is taken from the solver's word.

Primal: V = (I - gamma P_pi)^-1 R (5), the margins of (4), and the objective of the LP at R.
Dual: `dual_bound`, for any multipliers of (4). Where the expert is known in part, or errs, see `soft_proof`.
What the reward says of the expert, as any reward does, is `irl_gym.mdp.optimality`.
Axes: S states, A actions, n rows of (4).
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from irl_gym._typing import ActionSets, Indices
from irl_gym.facts import Fact, counted, plain
from irl_gym.learners.linear_programs.proofs.dual_bound import DualBound
from irl_gym.learners.linear_programs.proofs.proven import Proven, cap_told
from irl_gym.mdp.margins import least_per_state, row_margins
from irl_gym.mdp.optimality import certify
from irl_gym.mdp.optimality_rows import Comparisons
from irl_gym.mdp.planning.discounted import Discounted
from irl_gym.mdp.rewards import TabularReward
from irl_gym.mdp.tabular_mdp import TabularMDP
from irl_gym.mdp.time_expanded import Repeated

ROUNDING = 1e-12
"""A norm above the least by no more than this is the least."""


@dataclass(frozen=True, eq=False)
class FiniteProof(Proven):
    """What FiniteLP proves of its program."""

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
    slack: float | None
    """C, the price of a violation of (4); None where rows are hard."""
    l1_norm: float
    """||R||_1."""
    least_l1_norm: float
    """No reward with all margins at the cap has a smaller ||R||_1; NaN when that was not asked."""
    zero: bool
    """Is R zero everywhere?"""
    unbreakable_rows: np.ndarray
    """(u, 2) state and action of each row of (4) that no reward makes strict while the expert is optimal everywhere, as a
    program found; at some time, where there is a horizon. Without a cap none asks: empty."""
    horizon: int | None = None
    """H, where sums are of H steps, undiscounted, and the reward is one for all times."""
    optimal_within: bool | None = None
    """Is the expert optimal at each time then? None where it is undecided, or there is no horizon."""
    loss_within: float = 0.0
    """The best policy earns at most this more than the expert in H steps."""

    @property
    def unbreakable(self) -> Indices:
        """States with such a row."""
        return np.unique(self.unbreakable_rows[:, 0])

    def _facts(self) -> Iterator[Fact]:
        yield from super()._facts()
        if self.horizon is not None:
            yield self._within
        zero = "not computed" if self.lambda_0 is None else f"{self.lambda_0:.5g}, from which on R is 0"
        yield Fact("lambda, the price of ||R||_1", f"{self.l1:.5g}; lambda_0 {zero}")
        yield cap_told(self.margin_cap)
        if self.slack is not None:
            yield Fact("slack", f"a violation of (4) costs {self.slack:g}, where a margin is worth 1")
        least = ""
        if np.isfinite(self.least_l1_norm):
            above = self.l1_norm - self.least_l1_norm
            how = f"at most {above:.1e} above the least" if above > ROUNDING else "the least"
            least = f", {how} with these margins"
        yield Fact("||R||_1", f"{self.l1_norm:.6g}{least}")
        if len(self.unbreakable_rows):
            told = f"{counted(len(self.unbreakable_rows), 'action')} in {counted(self.unbreakable.size)}"
            yield Fact("always tied", f"{told}: no reward of this kind that makes the expert optimal prefers its own", "open")

    @property
    def _within(self) -> Fact:
        """Is the expert optimal in H steps, in a sentence."""
        told = f"undiscounted, the best policy earns at most {self.loss_within:.2g} more than the expert"
        if self.optimal_within:
            return Fact(f"within {counted(self.horizon or 0, 'step')}", f"the expert is optimal at each time: {told}", "good")
        sure = "it is undecided whether" if self.optimal_within is None else "it is not so that"
        mood = "open" if self.optimal_within is None else "bad"
        return Fact(f"within {counted(self.horizon or 0, 'step')}", f"{sure} the expert is optimal: {told}", mood)

    def to_json(self) -> dict[str, Any]:
        """As json holds it: NaN and infinity become None. Without a horizon nothing is said of one."""
        without = () if self.horizon is not None else ("horizon", "optimal_within", "loss_within")
        return {name: one for name, one in plain(self, "duality_gap", "unbreakable").items() if name not in without}


def served(mdp: TabularMDP, expert: Any, reward: TabularReward, proof: FiniteProof) -> ActionSets:
    """(S, A) actions of states in which an expert's margin is half of the cap or more, but those listed as unbreakable."""
    margin = certify(mdp, expert, reward, errs=proof.slack is not None, unbreakable=proof.unbreakable_rows).margin
    found = (np.nan_to_num(margin) > (proof.margin_cap or 0.0) / 2)[:, None].repeat(mdp.n_actions, axis=1)
    found[tuple(proof.unbreakable_rows.T)] = False
    return found


def prove(
    part: TabularMDP,
    comparisons: Comparisons,
    reward: TabularReward,
    counted: np.ndarray,
    *,
    r_max: float,
    l1: float = 0.0,
    lambda_0: float | None = None,
    margin_cap: float | None = None,
    unbreakable_rows: np.ndarray | None = None,
    y: np.ndarray | None = None,
    y_l1: np.ndarray | None = None,
    tie: Repeated | None = None,
) -> FiniteProof:
    """Recompute the LP's objective at a reward, and the bound above every objective.

    Args:
        part: the reachable part of the MDP.
        comparisons: its rows of (4).
        reward: (S,) or (S, A), of the part.
        counted: (n,) rows whose margins are in the objective: each state's least one.
        r_max: bound on |R| of the LP; the dual bound depends on it.
        l1: lambda of the LP's objective.
        lambda_0: reported as given.
        margin_cap: cap tau of the margins, None for Ng & Russell's LP.
        unbreakable_rows: (u, 2) reported as given; None for none.
        y: (n,) duals of the rows of (4); any values give a valid bound.
        y_l1: (n,) duals of the program that makes ||R||_1 least with all margins at the cap.
        tie: of a reward that is the same in several rows, whose numbers count once in ||R||_1.
    """
    discounted = Discounted(part.P_pi(comparisons.distribution), part.gamma)
    margins = row_margins(part, comparisons, reward, discounted)
    least = least_per_state(margins[counted], comparisons.states[counted], part.n_states)
    total = float(np.nansum(np.minimum(least, np.inf if margin_cap is None else margin_cap)))
    numbers = reward.values if tie is None else tie.numbers(reward.values)
    norm = float(np.abs(numbers).sum())
    dual = DualBound(part, comparisons, discounted, reward.on_states, counted, r_max, l1, margin_cap, tie)
    return FiniteProof(
        objective=total - l1 * norm,
        dual_bound=dual.bound(y),
        l1=float(l1),
        lambda_0=None if lambda_0 is None else float(lambda_0),
        margin_cap=None if margin_cap is None else float(margin_cap),
        slack=None,
        l1_norm=norm,
        least_l1_norm=dual.least_l1_norm(y_l1),
        zero=not reward.values.any(),
        unbreakable_rows=np.zeros((0, 2), dtype=np.int64) if unbreakable_rows is None else unbreakable_rows,
    )
