"""Does copying the demonstrations do as well? The clone of a run beside the policy that its learner is judged by.

It does as well if it has at most `NEAR` of what the expert has over random actions less than the agent, and worse if it has
more than that less. Values count where they are exact; returns, where they make a scale (`shares`), expected ones where these
are known, else mean ones by the 95 % interval of their difference: against what exact values say only if all of it is beyond
`NEAR`. What neither settles is undecided.
"""

import math
from collections.abc import Mapping
from functools import partial
from typing import Any, Literal

from irl_gym.intervals import Interval
from irl_gym.judging.scores import CLONE, EXPERT, FEWEST, RANDOM, agent_of, score_of, the
from irl_gym.judging.shares import difference, returns_of, share_of_return
from irl_gym.written import number, with_ends

Copied = Literal["as well", "worse", "undecided"]
NEAR = 0.01
"""Of what the expert has over random actions; what is less is no difference."""


def copied(metrics: Mapping[str, Any], episodes: int) -> Copied | None:
    """Does the clone do as well as the policy that is spoken of? None where there is no clone.

    Args:
        metrics: the content of metrics.json.
        episodes: N of which mean returns are the means; fewer than 11 that agree say nothing.
    """
    rows, table = metrics["policies"], metrics.get("table")
    if CLONE not in rows:
        return None
    clone, agent = rows[CLONE], rows[agent_of(rows)]
    exact = table is not None and table.get("exact", True) and clone["score"] is not None
    short = agent["score"] - clone["score"] if exact else None
    apart = _apart(*(_returns(row) for row in (clone, agent, rows[EXPERT], rows[RANDOM])), episodes=episodes)
    if (short is not None and short > NEAR) or (apart is not None and apart.high < -NEAR):
        return "worse"
    settled = short is not None or (apart is not None and apart.low >= -NEAR)
    return "as well" if settled else "undecided"


def _apart(
    clone: Interval | None, agent: Interval | None, expert: Interval | None, random: Interval | None, *, episodes: int
) -> Interval | None:
    """The clone's return less the agent's, in shares of what the expert has over random actions; None without a scale."""
    if clone is None or agent is None or share_of_return(clone, expert, random) is None:
        return None
    assert expert is not None and random is not None
    if episodes < FEWEST and not (clone.known and agent.known):
        return Interval(clone.estimate - agent.estimate, -math.inf, math.inf)
    found, scale = difference(clone, agent), expert.estimate - random.estimate
    return Interval(*(one / scale for one in found))


def copied_told(metrics: Mapping[str, Any], episodes: int) -> str:
    """The answer as a sentence, with the figures of both; nothing where no clone was asked for."""
    rows, answer = metrics["policies"], copied(metrics, episodes)
    if answer is None:
        why = metrics.get("demonstrations", {}).get("no_clone")
        return f"The demonstrations could not be copied, to compare with: {why}" if why else ""
    name, clone = agent_of(rows), rows[CLONE]
    opening = {
        "as well": "Copying the demonstrations does as well here",
        "worse": "Copying the demonstrations does worse here",
        "undecided": "Whether copying the demonstrations does as well here is undecided",
    }[answer]
    scores = clone["score"], rows[name]["score"]
    less = (
        "" if None in scores or answer != "worse" or scores[0] >= scores[1] else f": {scores[1] - scores[0]:.3f} of score less"
    )
    found = " and ".join(f"{what} {one}" for what, one in _earned(clone).items()).replace("of above", "above")
    return f"{opening}: the clone ({clone['how']}) has {found}, {the(name)} {' and '.join(_earned(rows[name]).values())}{less}."


def _returns(row: Mapping[str, Any]) -> Interval | None:
    """A row's expected return, where it is known exactly; else its mean return."""
    exact = row.get("expected_return")
    return returns_of(row) if exact is None else Interval(exact, exact, exact)


def _earned(row: Mapping[str, Any]) -> dict[str, str]:
    """A row's return and score, where it has them."""
    returns, score, exact = _returns(row), row["score"], row.get("expected_return") is not None
    told = {} if returns is None else {"a mean return of": with_ends(returns, partial(number, digits=3))}
    told = {"an expected return of": number(row["expected_return"])} if exact else told
    return told if score is None else {**told, "a score of": score_of(score)}
