"""What is measured of a policy and of a learned reward, under the true reward: one list of each.

From the lists are made: the rows of metrics.json and metrics.csv (`measured`), and what terminal, page and comparison say of
them (`shown`, `explained`). Who adds a measure adds an entry here, and it is in all of them.

    keys       what the numbers are called in metrics.json: one, or a number with what belongs to it, as the ends of an interval
    heading    what they are called where people read them
    caption    what they are, in words that follow the heading and a colon
    format     the numbers as text
    of         computes them from a record of all that it may need
Axes: S states, A actions.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np

from irl_gym import facts
from irl_gym._typing import ActionSets
from irl_gym.errors import UndefinedDistance
from irl_gym.intervals import Interval, as_interval
from irl_gym.judging.confirmation import loss_by_episodes, value_by_episodes
from irl_gym.judging.distances import epic, starc
from irl_gym.judging.expected_returns import expected_return, expected_told
from irl_gym.judging.metrics import Tie, agreement, policy_value, worst_tie
from irl_gym.judging.scores import Scale, score_of
from irl_gym.judging.shares import MUCH, share_of_return
from irl_gym.mdp.episodes import Episode
from irl_gym.mdp.rewards import TabularReward
from irl_gym.tables.tabulation import Tabulation
from irl_gym.written import number, percent, sum_of, with_ends

NONE = "none"
"""In place of a number that is not worked out of this policy."""


@dataclass(frozen=True, eq=False)
class Yardstick:
    """What all policies of a run are judged by."""

    scale: Scale
    """Of scores."""
    expert: Interval | None
    """The expert's mean return; None where it is not known, as the next one."""
    random: Interval | None
    """That of random actions."""
    table: Tabulation | None
    """None where the environment can only be stepped."""
    horizon: int | None
    """Steps that values count; None for all."""
    good: ActionSets | None
    """(S, A) actions that agree with the expert; None without a table."""
    limit: int | None = None
    """Steps after which episodes are cut; None where the table is not exact, or that was not recorded."""


@dataclass(frozen=True, eq=False)
class JudgedPolicy:
    """A policy with what is known of it, and what it is judged by."""

    policy: Any
    """(S,) actions or (S, A) probabilities of a table, elsewhere what has `predict`; None where only its episodes are known."""
    value: float
    """Discounted, from the start, under the true reward."""
    returns: Interval | None
    """Its mean undiscounted return; None where it is not known."""
    episodes: Sequence[Episode]
    """Fresh ones of the environment itself; none where there are none, as of a run that is read again."""
    reference: bool
    """Is it one of those that the others are measured by?"""
    by: Yardstick
    """The same for all."""

    @property
    def counted(self) -> bool:
        """Are there fresh episodes to hold against a table that was counted?"""
        return self.by.table is not None and self.by.table.mdp.visits is not None and len(self.episodes) > 0


@dataclass(frozen=True, eq=False)
class JudgedReward:
    """A learned reward, and what it is judged by."""

    learned: TabularReward
    """On the rows of the table."""
    table: Tabulation
    """With the true reward."""
    scale: Scale
    """Of scores."""
    horizon: int | None
    """Steps that values count; None for all."""

    @cached_property
    def worst(self) -> Tie:
        """The worst policy under the true reward among those greedy under the learned one."""
        return worst_tie(self.table.mdp, self.learned, self.table.reward)

    @cached_property
    def worst_value(self) -> float:
        """Its value from the start."""
        if self.horizon is None:
            return self.worst.value
        return policy_value(self.table.mdp, self.table.reward, self.worst.policy, self.horizon)

    @property
    def lost(self) -> float:
        """What it has less than the expert."""
        return self.scale.expert - self.worst_value


@dataclass(frozen=True, eq=False)
class Measure:
    """Something that is measured of a policy, or of a reward."""

    keys: tuple[str, ...]
    """In metrics.json and metrics.csv; the first is what it is known by."""
    heading: str
    """Of its column or row, where people read it."""
    caption: str | Callable[[Mapping[str, Any]], str]
    """What it is, in words that follow the heading and a colon; or a function of metrics.json that says so."""
    format: Callable[..., str]
    """The numbers of `keys` as text; None for one that is not known."""
    of: Callable[[Any], tuple[Any, ...]]
    """The numbers of `keys`, from a `JudgedPolicy` or a `JudgedReward`."""
    asked: Callable[[Any], bool] = lambda judged: True
    """Is it worked out at all of this one? Else metrics.json does not have the keys."""
    sampled: bool = False
    """Does it rest on episodes? These are not kept: who reads a run has its record."""
    relative: bool = False
    """Are random actions 0 and the expert 1 by definition? Then nothing is learned from theirs."""
    even_unknown: bool = False
    """Is it worth saying that it is not known?"""

    def worth_telling(self, told: Mapping[str, Any]) -> bool:
        """Has a row of metrics.json anything to say of it?"""
        return told.get(self.keys[0]) is not None or (self.even_unknown and self.keys[0] in told)

    def text(self, told: Mapping[str, Any]) -> str:
        """What a row of metrics.json has of it."""
        return self.format(*map(told.get, self.keys)) if self.keys[0] in told else NONE

    def explanation(self, metrics: Mapping[str, Any]) -> str:
        """What it is, in words that follow a colon."""
        return self.caption if isinstance(self.caption, str) else self.caption(metrics)


def measured(measures: Sequence[Measure], judged: Any, *, sampled: bool = True) -> dict[str, Any]:
    """The numbers of some measures, as metrics.json holds them.

    Args:
        measures: a list of this module.
        judged: a `JudgedPolicy` or a `JudgedReward`, as the list asks for.
        sampled: those that rest on episodes, too.
    """
    asked = [one for one in measures if (sampled or not one.sampled) and one.asked(judged)]
    return {key: found for one in asked for key, found in zip(one.keys, one.of(judged), strict=True)}


def shown(measures: Sequence[Measure], rows: Sequence[Mapping[str, Any]]) -> list[Measure]:
    """The measures that are worth a column, by the rows of metrics.json."""
    return [one for one in measures if any(map(one.worth_telling, rows))]


def explained(measures: Sequence[Measure], metrics: Mapping[str, Any]) -> list[str]:
    """What some measures are, a sentence each; those of one caption together."""
    headings: dict[str, list[str]] = {}
    for one in measures:
        headings.setdefault(one.explanation(metrics), []).append(one.heading)
    return [f"{', '.join(told)}: {caption}." for caption, told in headings.items()]


def no_score(metrics: Mapping[str, Any]) -> str:
    """Why there is no score, in words that follow a colon."""
    return str(metrics.get("score_reason") or "the expert earns no more than random actions")


def _interval(*numbers: float | None) -> str:
    """A mean with its 95 % interval, in as many digits as are worth reading."""
    estimate, low, high = numbers
    return "not known" if estimate is None else with_ends(as_interval(estimate, low, high), partial(number, digits=3))


def _value_told(metrics: Mapping[str, Any]) -> str:
    """Where values come from."""
    told, table = metrics["demonstrations"], metrics["table"]
    if table is None:
        return "discounted, from the start, mean of episodes"
    cut = f", cut after {facts.counted(table['horizon'], 'step')}" if table.get("horizon") is not None else ""
    given = ", the expert's that of its episodes, paid by the table" if told["given"] else ""
    where = "exact" if table.get("exact", True) else "computed on a table that is an estimate"
    return f"{where}, discounted, from the start{cut}{given}"


def _score_told(metrics: Mapping[str, Any]) -> str:
    """What the ends of the scale are."""
    told = metrics["demonstrations"]
    errs = " with its errors" if told["episodes_only"] and not told["given"] else ""
    return f"random = 0, expert{errs} = 1"


def _agreement_told(metrics: Mapping[str, Any]) -> str:
    """What an action agrees with."""
    own = "one of the expert's actions, or an optimal one where it is optimal"
    return f"share of states with {'an optimal action' if metrics['demonstrations']['episodes_only'] else own}"


def _agrees(one: JudgedPolicy) -> float | None:
    """How often it does what the expert does."""
    if one.by.table is None or one.by.good is None or one.policy is None:
        return None
    return agreement(one.by.table.mdp, one.policy, one.by.good)


def _by_episodes(found: Interval) -> tuple[float | None, ...]:
    """The value that fresh episodes say it has."""
    return found.estimate, *found.ends


POLICIES: tuple[Measure, ...] = (
    Measure(("value",), "value", _value_told, number, lambda one: (one.value,)),
    Measure(("score",), "score", _score_told, score_of, lambda one: (one.by.scale.score(one.value),), relative=True),
    Measure(
        ("mean_return", "return_low", "return_high"), "mean return (95 %)", "undiscounted, sampled", _interval,
        lambda one: (None, None, None) if one.returns is None else (one.returns.estimate, *one.returns.ends), sampled=True,
    ),
    Measure(
        ("expected_return",), "expected return", expected_told, number,
        lambda one: (expected_return(one.by.table, one.policy, one.by.limit),), asked=lambda one: one.by.limit is not None,
    ),
    Measure(
        ("return_share",), "returned", "the mean return as a share, random = 0, expert = 1", score_of,
        lambda one: (share_of_return(one.returns, one.by.expert, one.by.random),), sampled=True, relative=True,
    ),
    Measure(
        ("sampled_value", "sampled_low", "sampled_high"), "value by episodes (95 %)",
        "the same as value, by episodes that were not counted", _interval,
        lambda one: _by_episodes(value_by_episodes(one.by.table, one.episodes, one.by.horizon)),
        asked=lambda one: one.counted, sampled=True,
    ),
    Measure(
        ("loses_at_most",), "loses at most",
        "of value against the policy that is best by the table, by episodes that were not counted, with 95 % confidence",
        number, lambda one: (loss_by_episodes(one.by.table, one.episodes).ends[1],),
        asked=lambda one: one.counted and one.by.horizon is None and not one.reference, sampled=True,
        even_unknown=True,
    ),
    Measure(("agreement",), "agreement", _agreement_told, percent, lambda one: (_agrees(one),)),
)  # fmt: skip
"""Of a policy."""


def _worst_told(regret: float, share: float | None) -> str:
    """What the worst tie loses, where there is a scale to say it on."""
    if share is None:
        return "not known, as there is no score"
    lost, of_range = sum_of(abs(regret)), f", {percent(abs(share))} of what the expert has over random"
    beware = "; how an agent breaks ties decides what it earns" if share > MUCH else ""
    return f"none: it gains {lost}{of_range}" if regret < 0 and lost != "0" else f"{lost}{of_range}{beware}"


def _distance(distance: float | None) -> str:
    return "not known" if distance is None else f"{distance:.2f}"


def _apart(one: JudgedReward, distance: Callable[..., float]) -> float | None:
    """How far it is from the true reward, where episodes go; None where that is not defined."""
    rows = np.flatnonzero(one.table.mdp.reachable)
    try:
        return distance(one.table.mdp.restrict(rows), *(reward.values[rows] for reward in (one.table.reward, one.learned)))
    except UndefinedDistance:
        return None


WORST = "the worst policy that is best under the learned reward"
APART = (
    "between the learned reward and the true one: 0 ranks all policies alike, 0.71 is unrelated, 1 the opposite; the best "
    "policies can be the same in spite of it"
)

REWARDS: tuple[Measure, ...] = (
    Measure(
        ("reward_on",), "reward paid on", "what the learned reward depends on", str,
        lambda one: ("state" if one.learned.on_states else "state-action",),
    ),
    Measure(("worst_tie_value",), "value of the worst tie", f"that of {WORST}", number, lambda one: (one.worst_value,)),
    Measure(
        ("worst_tie_regret", "worst_tie_regret_share"), "worst-tie regret", f"what {WORST} loses against the expert",
        _worst_told, lambda one: (one.lost, one.scale.share(one.lost)),
    ),
    Measure(("starc",), "STARC distance", APART, _distance, lambda one: (_apart(one, starc),)),
    Measure(("epic",), "EPIC distance", APART, _distance, lambda one: (_apart(one, epic),)),
)  # fmt: skip
"""Of a learned reward, where there is a table."""
