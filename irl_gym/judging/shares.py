"""Is an agent good? Two shares of what the expert has over random actions, and the worse one decides.

    of value (the score)    (agent - random) / (expert - random), discounted values
    of mean return          the same of undiscounted returns of episodes in the environment itself

Each flatters where the other does not: at gamma 0.99 an agent that balances CartPole's pole for 425 steps of 500 can have a
score of 0.977, and has 0.843 of the return. Where random actions are disastrous both are kind: who shows a share shows returns.

Returns are sampled. That a share of return is at least g is a statement on three means, of agent, expert e and random r < e:

    share >= g    where    a - g e - (1 - g) r >= 0
The interval of this sum is by the squares of the half-widths of each mean's own (Zou & Donner 2008, "Construction of confidence
limits about effect measures"); one that is unknown adds nothing. A share that falls short, but by that interval need not, is
left *open*. Mean returns make no scale, and do not count, where the expert's is no better than that of random actions, or what
they differ by is not known to a quarter (`scores.BLUR`). If the score is that of an estimated table, nothing is judged then.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from irl_gym.facts import Mood
from irl_gym.intervals import Interval, as_interval
from irl_gym.judging.metrics import normalised_score
from irl_gym.judging.scores import BLUR, EXPERT, RANDOM, agent_of, called, others, score_of, who

GOOD = 0.9
"""A share from which on an agent is good."""
MUCH = 0.05
"""A share that is much to lose."""

WORDS: Mapping[Mood, str] = {"good": "good", "open": "left open", "bad": "not good", "plain": "not judged"}
"""What each is called; plain is where nothing is judged."""
WELL: Mapping[Mood, str] = {"good": "Yes", "open": "Perhaps", "bad": "No", "plain": "Not judged"}
"""Does an agent do as well as the expert, by how it is judged?"""


@dataclass(frozen=True)
class Judged:
    """What an agent's two shares say of it."""

    mood: Mood
    """By the worse of the two."""
    score: float | None
    """Share of value; None where there is no score."""
    share: float | None
    """Share of mean return; None where mean returns make no scale."""
    fault: str | None
    """Why they make none, in words that follow a colon."""

    @property
    def brief(self) -> str:
        """The judgement with its shares."""
        if self.mood == "plain":
            return WORDS[self.mood]
        of_return = "" if self.share is None else f", {_below(self.share)} of mean return"
        return f"{WORDS[self.mood]} ({_below(self.score)} of value{of_return})"

    @property
    def told(self) -> str:
        """The judgement in words that follow a colon, and how it was reached."""
        if self.score is None:
            return "not at all, as there is no score."
        if self.mood == "plain":
            return f"not at all, as the score is that of a table which is an estimate, and {self.fault}."
        scale = f"random actions are 0, the expert is 1, and good begins at {GOOD:g}"
        if self.share is None:
            return f"{self.brief}; {scale}. Mean returns do not count: {self.fault}."
        doubt = ", which by its 95 % interval it may reach" if self.mood == "open" else ""
        return f"{self.brief}. The worse of the two shares decides; {scale}{doubt}."


def returns_of(row: Mapping[str, Any]) -> Interval | None:
    """The mean return of a policy's row in metrics.json; None where it has none."""
    mean = row.get("mean_return")
    return None if mean is None else as_interval(mean, row.get("return_low"), row.get("return_high"))


def share_of_return(agent: Interval | None, expert: Interval | None, random: Interval | None) -> float | None:
    """Where a mean return lies between random actions (0) and the expert (1); None where these make no scale."""
    if agent is None or expert is None or random is None or _fault(expert, random) is not None:
        return None
    return normalised_score(agent.estimate, random.estimate, expert.estimate)


def judged(policies: Mapping[str, Mapping[str, Any]], table: Mapping[str, Any] | None, name: str | None = None) -> Judged:
    """The judgement of one of a run's policies.

    Args:
        policies: the rows of metrics.json.
        table: its entry of that name; None where there is no table.
        name: which; None for the one that is spoken of where there is room for one.
    """
    own = policies[agent_of(policies) if name is None else name]
    score, means = own.get("score"), [returns_of(row) for row in (own, policies[EXPERT], policies[RANDOM])]
    estimated = not (table or {}).get("exact", True)
    return judge(None if score is None else as_interval(score, score, score), *means, estimated=estimated)


def as_well(policies: Mapping[str, Mapping[str, Any]]) -> str:
    """The question that `WELL` answers."""
    return f"Does the {who(policies)} do as well as the expert?"


def judgements(policies: Mapping[str, Mapping[str, Any]], table: Mapping[str, Any] | None) -> str:
    """The judgement of every policy that is no reference, in words that follow a colon; by name where there are several."""
    told = {name: judged(policies, table, name).told for name in others(policies)}
    return " ".join(told.values()) if len(told) == 1 else " ".join(f"{called(name)}: {one}" for name, one in told.items())


def judge(
    score: Interval | None, agent: Interval | None, expert: Interval | None, random: Interval | None, *, estimated: bool = False
) -> Judged:
    """Judge an agent by the worse of its shares.

    Args:
        score: share of value; None where there is none.
        agent: its mean return; None where it is not known, as the next two.
        expert: the expert's.
        random: that of random actions.
        estimated: is the score that of a table which is an estimate?
    """
    share = share_of_return(agent, expert, random)
    if score is None:
        return Judged("plain", None, share, None)
    own: Mood = "good" if score.estimate >= GOOD else "open" if score.high >= GOOD else "bad"
    if agent is None or expert is None or random is None:
        return Judged(own, score.estimate, None, "they are not known")
    if share is None:
        return Judged("plain" if estimated else own, score.estimate, None, _fault(expert, random))
    paid: Mood = "good" if share >= GOOD else "open" if _short_at_best(agent, expert, random) >= 0 else "bad"
    worse = paid if own == "good" or paid == "bad" else own
    return Judged(worse, score.estimate, share, None)


def _fault(expert: Interval, random: Interval) -> str | None:
    """Why mean returns make no scale; None where they make one."""
    apart = expert.estimate - random.estimate
    if not apart > 0:
        return "the expert's mean return is no better than that of random actions"
    if float(np.hypot(_down(expert), _up(random))) > BLUR * apart:
        return "the episodes hardly tell the expert's mean return from that of random actions"
    return None


def _short_at_best(agent: Interval, expert: Interval, random: Interval) -> float:
    """The upper end of the interval of a - g e - (1 - g) r."""
    short = agent.estimate - GOOD * expert.estimate - (1 - GOOD) * random.estimate
    return short + float(np.linalg.norm([_up(agent), GOOD * _down(expert), (1 - GOOD) * _down(random)]))


def difference(one: Interval, other: Interval) -> Interval:
    """One mean less another, with its interval; an interval that is unknown adds nothing."""
    low, high = np.hypot(_down(one), _up(other)), np.hypot(_up(one), _down(other))
    apart = one.estimate - other.estimate
    return Interval(apart, float(apart - low), float(apart + high))


def _up(mean: Interval) -> float:
    return mean.high - mean.estimate if mean.known else 0.0


def _down(mean: Interval) -> float:
    return mean.estimate - mean.low if mean.known else 0.0


def _below(share: float | None) -> str:
    """A share with three decimals, which says 0.900 only of what is as much."""
    text = score_of(share)
    return f"just below {GOOD:g}" if share is not None and share < GOOD and text == f"{GOOD:.3f}" else text


def training_fell_short(policies: Mapping[str, Any], table: Mapping[str, Any] | None, lost: float | None) -> str | None:
    """Where every policy that is best under the reward is good, and the agent is not: that sentence; else None.

    Args:
        policies: the rows of metrics.json.
        table: its entry of that name; None where there is no table.
        lost: the share that the worst tie loses; None where that is not known.
    """
    if judged(policies, table).mood != "bad" or lost is None or lost > MUCH or not (table or {}).get("exact"):
        return None
    least = math.floor(1000 * (1 - lost)) / 1000
    return f"Every policy that is best under the reward has a score of at least {least:.3f}"
