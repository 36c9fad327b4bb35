"""Is an expert optimal under a reward, by what margin, and in which states? Of any reward, whoever made it: `certify`.

Recomputed from P, the expert and R alone: what the best policy earns more (`loss`), and row by row whether (4) of Ng & Russell
(2000) holds. A violation or a margin counts beyond its own rounding and what the solver of R left open
(`TabularReward.tolerance`); what is within these and no tie over all steps is undecided. All is worked out in units of the
largest |R|, to which values are in proportion.
The margin of a row is how much more the expert's action is worth than another, Q(s, pi) - Q(s, a),
    where the expert goes on     if it is known in every state and taken at its word: (4), with V = (I - gamma P_pi)^-1 R (5)
    where one acts best          if it is not known in some state, or errs: then nothing is made up of what it does later
What a learner's program says of a reward, its terms, its gap and its bound, is the learner's proof.
Axes: S states, A actions, n rows of (4) among the reachable states.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from irl_gym._typing import Indices, Numbers, Vector
from irl_gym.checks import checked_flag
from irl_gym.errors import InvalidReward
from irl_gym.facts import Fact, aligned, counted, plain
from irl_gym.mdp.loss import AT_STAKE, Loss, loss_on, told_loss
from irl_gym.mdp.margins import Margins, comparable, least_per_state, margins_under
from irl_gym.mdp.optimality_rows import Comparisons, compare, left_out
from irl_gym.mdp.policies import as_distribution, completed
from irl_gym.mdp.rewards import TabularReward, as_reward
from irl_gym.mdp.sampling_error import counted_table
from irl_gym.mdp.tabular_mdp import TabularMDP, checked_mdp
from irl_gym.records import Record

ROUNDING = 1e-9
"""Share of the largest |R| up to which rewards are the same."""


@dataclass(frozen=True, eq=False)
class Optimality(Record):
    """What a reward says of an expert. States that cannot be reached from d0 are not judged."""

    expert_optimal: bool | None
    """Is the expert optimal under R? None where it is undecided: by `loss_bound`, or by what its unknown actions may lose."""
    loss_low: float
    """The best policy earns at least this more than the expert from d0 under R, in units of value, rounding included."""
    loss_bound: float
    """And at most this: in unknown states that the expert may reach, over all that it may do there."""
    loss_share: float
    """`loss_bound` as a share of what is at stake (`loss`); NaN where every action is tied."""
    at_stake: float
    """What is at stake, at most, in units of value; 0 where every action is tied."""
    errs: bool
    """Was the expert taken for one that may err?"""
    worst_violation: float
    """The largest violation of (4), in units of value; 0 when none."""
    margin: Vector
    """(S,) smallest margin of the expert over another action, of the rows of (4) that R can move and that were not given as
    unbreakable; NaN where there is none."""
    left_out: int
    """Rows of (4) that margins and ties leave out as unbreakable, on the word of who gave them."""
    constant: bool
    """Does R have the same value everywhere? Where episodes end it may prefer much: see `degenerate`."""
    zero: bool
    """Is R zero everywhere?"""
    indifferent: bool
    """Is the expert tied, to rounding, in every row of (4)?"""
    unconstrained: Indices
    """Reachable states, not terminal, where the expert is known and no action that it leaves out can be told from its own."""
    inseparable: Indices
    """Reachable states where a reward on states leaves the expert tied with an action of equal successors; none for R(s, a)."""
    marginless: Indices
    """Reachable states with rows but without a positive margin under R: tied, violated or undecided."""
    undecided: Indices
    """Reachable states in which rounding, or what the counts or the solver of R left open, hides whether another action is
    better, none certainly being so."""
    violated: Indices
    """States with a violated row of (4)."""
    violated_rows: np.ndarray
    """(v, 2) state and action of each violated row: the action is worth more than the expert's under R; or, where the expert
    takes it too, something else than its mix."""
    violations: Numbers
    """(v,) by how much each is violated, in units of value."""
    unknown: Indices
    """Reachable states, not terminal, in which nothing is known of the expert: no rows, not judged."""
    sampling_error: float | None
    """The largest error of a margin on a counted table, of pairs that were visited; None where the table is exact."""
    unsettled: Indices
    """Reachable states of a counted table in which a margin above 0 is within its sampling error."""

    @property
    def degenerate(self) -> bool:
        """Does R say nothing: is the expert tied with every action in every state judged, as under R = 0?"""
        return self.zero or self.indifferent

    @property
    def tied(self) -> Indices:
        """Reachable states in which another action is as good as the expert's, to rounding, and none is better."""
        return np.setdiff1d(self.marginless, np.union1d(self.violated, self.undecided))

    def facts(self) -> tuple[Fact, ...]:
        """All of this, in sentences."""
        return (*self._of_the_whole(), *self._of_states())

    def _of_the_whole(self) -> Iterator[Fact]:
        bounds = self.loss_low, self.loss_bound, self.loss_share
        told = told_loss(self.expert_optimal, *bounds, self.unknown.size)
        good = "plain" if self.degenerate or self.unsettled.size else "good"
        mood = "open" if self.expert_optimal is None else good if self.expert_optimal else "bad"
        yield Fact("expert optimal under it", told, mood)
        if np.isfinite(self.loss_share) and self.loss_bound:
            yield Fact("at stake", f"{self.at_stake:.4g}: {AT_STAKE}")
        if self.sampling_error is not None:
            yield Fact("judged on", counted_table(self.sampling_error), "open")
        if self.degenerate:
            yield Fact("degenerate", "R is zero" if self.zero else "R ties the expert with every action", "bad")
        finite = self.margin[np.isfinite(self.margin)]
        span = f"{finite.min():.3g} to {finite.max():.3g} in {counted(finite.size)}" if finite.size else "none"
        later = "one acts best" if self.errs or self.unknown.size else "the expert goes on"
        out = f"; {counted(self.left_out, 'row')} of (4) given as unbreakable left out" if self.left_out else ""
        yield Fact("margins", f"{span}: how much better the expert's action is than the next, where {later} afterwards{out}")

    def _of_states(self) -> Iterator[Fact]:
        if self.violated.size:
            yield Fact("violated", violated_told(self.violated.size, len(self.violated_rows), self.worst_violation), "bad")
        if self.tied.size and not self.zero:
            told = f"in {counted(self.tied.size)} another action is as good as the expert's to rounding, and none better"
            yield Fact("tied", told, "open")
        if self.undecided.size:
            told = f"in {counted(self.undecided.size)} no action is certainly better than the expert's, and one may be"
            yield Fact("undecided", f"{told}: what rounding and all later steps leave open is more than the difference", "open")
        if self.unsettled.size:
            yield Fact("left open by the counts", f"{unsettled_told(self.unsettled.size)}; more steps to count tell", "open")
        if self.inseparable.size:
            told = alike_told(self.inseparable.size, estimated=self.sampling_error is not None)
            told = f"{told}: no reward on states tells them apart, one on states and actions can"
            yield Fact("cannot be settled", told, "open")
        if self.unconstrained.size:
            told = f"in {counted(self.unconstrained.size)} no action that the expert leaves out can be told from its own"
            yield Fact("without a comparison", told)
        if self.unknown.size:
            told = f"in {counted(self.unknown.size)} that can be reached nothing is known of it, and nothing is asked of it"
            yield Fact("expert not seen", told)

    def __str__(self) -> str:
        """The facts, line by line."""
        return aligned(self.facts())

    def to_json(self) -> dict[str, Any]:
        """As json holds it: NaN and infinity become None."""
        return plain(self, "degenerate")


def violated_told(states: int, rows: int, worst: float) -> str:
    """That (4) is violated."""
    return f"in {counted(states)} another action is better under it: {counted(rows, 'row')} of (4), by at most {worst:.3g}"


def alike_told(states: int, *, estimated: bool) -> str:
    """That actions have the successors of the expert's."""
    return (
        f"in {counted(states)} an action leads where the expert's own does{', as far as the counts tell' if estimated else ''}"
    )


def unsettled_told(states: int) -> str:
    """That counts leave margins open."""
    return f"in {counted(states)} a margin is within its sampling error, and may be noise"


def certify(
    mdp: TabularMDP,
    expert: Any,
    reward: TabularReward | np.ndarray,
    *,
    errs: bool = False,
    unbreakable: Any = None,
) -> Optimality:
    """What a reward says of an expert, whoever made it.

    Args:
        mdp: the MDP; only states reachable from d0 are judged.
        expert: (S,) actions, (S, A) probabilities or (S, A) set. Rows of NaN say that nothing is known of it in a state, where
            it may do anything.
        reward: (S,) or (S, A).
        errs: the expert may err, as one that is known by its episodes. What follows an action is then worth what acting best
            is, and of several actions that it takes some may be worse; otherwise all have to be as good.
        unbreakable: (u, 2) states and actions of rows that no reward makes strict, as a program found: `margin` and
            `marginless` leave them out, one by one.

    Raises:
        InvalidMDP: something else than a table.
        InvalidPolicy: an expert of the wrong shape or content.
        InvalidReward: a reward of the wrong shape, or one so large that what it is worth is no float64.
        InvalidParameter: `errs` that is neither True nor False, or rows that the table does not have.
    """
    mdp, reward, errs = checked_mdp(mdp), as_reward(reward), checked_flag("errs", errs)
    reward.expected(mdp)  # checks the shape
    policy, known = completed(expert, mdp.n_states)
    distribution = as_distribution(policy, mdp.n_states, mdp.n_actions)
    rows = np.flatnonzero(mdp.reachable)
    part, (R, unit) = mdp.restrict(rows), reward.of_rows(rows).in_units()
    unknown = ~known[rows] & ~part.terminal
    c = compare(part, distribution[rows], np.flatnonzero(~unknown))
    best = errs or bool(unknown.any())
    found, margins = margins_under(part, c, R, best=best)
    loss = loss_on(part, found, c.distribution, unknown)
    if margins.same.all() and not unknown.any() and found.table.mdp is part:  # else the counts leave it open
        loss = replace(loss, tied=True)
    paid = R.values if R.on_states else R.values[~part.terminal]
    largest = float(np.abs(paid).max(initial=0.0))  # in units
    told = _of_rows(mdp, rows, c, R, margins, unknown, c.equal & (not best), left_out(mdp, rows, c, unbreakable), loss)
    in_values = {"loss_low": loss.low, "loss_bound": loss.high, "at_stake": loss.scale_high, **told}
    return Optimality(
        **{name: _in_values(one, unit, largest, mdp) if name in VALUES else one for name, one in in_values.items()},
        expert_optimal=loss.optimal,
        loss_share=loss.share,
        errs=errs,
        constant=not paid.size or bool(np.ptp(paid) <= ROUNDING * largest),
        zero=largest == 0.0,
        unknown=rows[unknown],
    )


VALUES = ("loss_low", "loss_bound", "at_stake", "worst_violation", "margin", "violations", "sampling_error")
"""What is in units of value."""


def _in_values(one: Any, unit: int, largest: float, mdp: TabularMDP) -> Any:
    """A number, or an array, in units of 2^unit as it is, where the largest |R| is `largest`.

    Raises:
        InvalidReward: it is no float64.
    """
    if one is None:
        return None
    with np.errstate(over="ignore"):
        found = np.ldexp(one, unit)
    if (np.isinf(found) & np.isfinite(one)).any():
        raise InvalidReward(
            f"the reward is up to {np.ldexp(largest, unit):.3g}, and at gamma {mdp.gamma} what it is worth is no float64 "
            "number: expected a smaller one. Divide it by its largest number: the answer is the same, in other units."
        )
    return found if isinstance(one, np.ndarray) else float(found)


def _of_rows(
    mdp: TabularMDP, rows: Indices, c: Comparisons, R: TabularReward, margins: Margins, unknown: np.ndarray, equal: np.ndarray,
    without: np.ndarray, loss: Loss,
) -> dict[str, Any]:  # fmt: skip
    """What the rows of (4) say, each by itself.

    Args:
        mdp: the whole MDP.
        rows: (r,) its states in the part.
        c: the rows of (4) in the part.
        R: the reward on the part.
        margins: of each row.
        unknown: (r,) states without rows, as nothing is known of the expert.
        equal: (n,) rows that are violated to either side.
        without: (n,) rows that no margin is taken over.
        loss: what the expert loses: a "no" never goes with ties alone, nor a tie of every action with anything else.
    """
    usable = comparable(c, R)
    kept = usable & ~without
    margin = np.full(mdp.n_states, np.nan)
    margin[rows] = least_per_state(margins.values[kept], c.states[kept], rows.size)
    violations = margins.violations(equal)
    error, unsettled = None, np.zeros_like(kept)
    if c.sampling is not None:
        error, unsettled = c.sampling.unsettled(margins.values, margins.worth, kept, margins.none)
    violated = margins.violated(equal)
    tied = margins.tied if violated.any() or loss.optimal is not False else np.zeros_like(violated)
    tied = (tied | loss.tied) & ~violated
    undecided = (kept & ~margins.positive | equal) & ~tied & ~violated
    acting = np.flatnonzero(~unknown & ~mdp.terminal[rows])

    def named(chosen: np.ndarray) -> Indices:
        return rows[np.unique(c.states[chosen])].astype(np.int64)

    return {
        "worst_violation": float(violations.max(initial=0.0)),
        "margin": margin,
        "left_out": int(without.sum()),
        "indifferent": bool(tied.all()) and loss.optimal is not False,
        "unconstrained": rows[np.setdiff1d(acting, c.states[usable])],
        "inseparable": named(c.trivial & ~c.equal & R.on_states),
        "marginless": named(kept & (~margins.positive | tied)),
        "undecided": np.setdiff1d(named(undecided), named(violated)),
        "violated": named(violated),
        "violated_rows": c.pairs(rows, np.flatnonzero(violated)),
        "violations": violations[violated],
        "sampling_error": error,
        "unsettled": named(unsettled),
    }
