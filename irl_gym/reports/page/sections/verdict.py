"""What is said at the top of a page: the verdict, and the table of all that was judged. Both are functions of metrics.json."""

from collections.abc import Mapping
from typing import Any

from irl_gym.intervals import TOO_FEW, Interval
from irl_gym.judging import measures
from irl_gym.judging.confirmation import loss_told
from irl_gym.judging.measures import explained, no_score, shown
from irl_gym.judging.scores import EXPERT, RANDOM, RETRAINED, agent_of, called, others, score_of, the
from irl_gym.judging.shares import MUCH, judged, judgements, returns_of
from irl_gym.learners.linear_programs.proofs.proven import ROUNDING
from irl_gym.mdp.sampling_error import estimated_table
from irl_gym.reports.page.sections.proof import whence
from irl_gym.reports.page.sections.section import Section
from irl_gym.written import counted, number, percent, sentence_of, sum_of


def policies_table(metrics: Mapping[str, Any]) -> Section:
    """Every policy that was judged, with how it came about; and the learned reward: all measures of both."""
    rows, reward = metrics["policies"], metrics["reward"]
    columns, lines = shown(measures.POLICIES, list(rows.values())), shown(measures.REWARDS, [reward])
    table = {
        "headings": ["policy", *(one.heading for one in columns)],
        "rows": [(f"{called(name)}, {how(row)}", *(one.text(row) for one in columns)) for name, row in rows.items()],
        "lines": [(one.heading, one.text(reward)) for one in lines],
        "note": " ".join(map(sentence_of, explained([*columns, *lines], metrics))),
    }
    lead = "What each policy is worth in the environment as it is" + (", and what the learned reward allows." if lines else ".")
    return Section("summary", "Under the true reward", lead, (), "summary", table)


def how(row: Mapping[str, Any]) -> str:
    """How a policy came about, by its row of metrics.json."""
    return str(row.get("how", "not recorded in this version"))


def verdict(metrics: Mapping[str, Any], *, recomputed: bool) -> dict[str, Any]:
    """The sentence at the top, four figures, each with whether it is good, and how every agent was judged.

    Args:
        metrics: the content of metrics.json.
        recomputed: was what it says of the expert under the reward computed from the run's files?
    """
    agent, reward = _agent(metrics), metrics["reward"]
    score, share = agent.get("score"), reward.get("worst_tie_regret_share")
    optimal, mood = reward.get("expert_optimal"), judged(metrics["policies"], metrics.get("table")).mood
    lost = "" if share is None else f"{sum_of(max(reward['worst_tie_regret'], 0.0))} of value, as a share "
    whose = "the agent's" if agent_of(metrics["policies"]) == RETRAINED else "the policy's"
    figures = [
        {
            "label": f"{whose} score",
            "value": score_of(score),
            "note": "random actions are 0, the expert is 1" if score is not None else no_score(metrics),
            "mood": mood,
        },
        {
            "label": f"{whose} mean return",
            "value": number(agent.get("mean_return")),
            "note": _returns(metrics),
            "mood": mood,
        },
    ]
    of_reward = [
        {
            "label": "lost by the worst tie",
            "value": "not known" if share is None else percent(max(share, 0.0)),
            "note": f"{lost}of what the expert has over random, by the worst policy that is best under the learned reward",
            "mood": "plain" if share is None else "good" if share <= MUCH else "bad",
        },
        {
            "label": "expert optimal under it",
            "value": answer(optimal),
            "note": "degenerate: the reward says nothing" if reward.get("degenerate") else _proved(reward, recomputed),
            "mood": _mood(optimal, reward),
        },
    ]
    told = judgements(metrics["policies"], metrics.get("table"))
    return {
        "sentence": _sentence(metrics, score, share, optimal, recomputed),
        "figures": [*figures, *(of_reward if _judged(reward) else [])],
        "judged": f"How score and mean return are coloured: {told}",
    }


def _agent(metrics: Mapping[str, Any]) -> Mapping[str, Any]:
    """The row of the policy that is spoken of."""
    return metrics["policies"][agent_of(metrics["policies"])]


def _returns(metrics: Mapping[str, Any]) -> str:
    """The interval of the agent's mean return, and what random actions and the expert return."""
    rows = metrics["policies"]
    agent, random, expert = (returns_of(row) for row in (_agent(metrics), rows[RANDOM], rows[EXPERT]))
    if agent is None:
        return "not recorded in this version"
    sure = f"95 %: {number(agent.low)} to {number(agent.high)}" if agent.known else f"{TOO_FEW} how surely"
    return f"{sure}; random actions have {_mean(random)}, the expert {_mean(expert)}"


def _mean(found: Interval | None) -> str:
    return number(None if found is None else found.estimate)


def _mood(optimal: bool | None, reward: Mapping[str, Any]) -> str:
    """Of whether the expert is optimal: not good where the reward says nothing or a counted table leaves margins open."""
    if optimal is False or reward.get("degenerate"):
        return "bad"
    return "good" if optimal and not reward.get("unsettled_states") else "plain"


def answer(optimal: bool | None) -> str:
    """Yes, no or undecided."""
    return "undecided" if optimal is None else "yes" if optimal else "no"


def _proved(reward: Mapping[str, Any], recomputed: bool) -> str:
    gap, whose = reward.get("duality_gap"), whence(recomputed)
    if gap is None:
        return whose
    if gap <= ROUNDING * max(1.0, abs(reward.get("objective") or 0.0)):
        return f"{whose}; to rounding no reward does better in the program, as recorded"
    return f"{whose}; the program's optimum is at most {number(gap, 2)} away, as recorded"


def _sentence(
    metrics: Mapping[str, Any], score: float | None, share: float | None, optimal: bool | None, recomputed: bool
) -> str:
    agent = _agent(metrics)
    random, expert = (_mean(returns_of(metrics["policies"][name])) for name in (RANDOM, EXPERT))
    who, returned = _who(metrics), f"a mean return of {_mean(returns_of(agent))}"
    earned = (
        f"{who} has a score of {score_of(score)} and {returned}: random actions have 0 and {random}, the expert has 1 "
        f"and {expert}"
        if score is not None
        else f"{who} has value {number(agent['value'])} and {returned}: random actions have {random}, the expert {expert}; "
        f"there is no score, as {no_score(metrics)}"
    )
    tie = (
        ""
        if share is None
        else f"; the unluckiest policy that is best under that reward would lose {percent(max(share, 0.0))} of what the expert "
        "has over random actions"
        if share > 1e-9
        else "; every policy that is best under that reward is as good as the expert"
    )
    who = "what the expert is seen to do most" if metrics["reward"].get("errs") else "the expert"
    certified = f"; whether {who} is optimal under it is undecided"
    if optimal is not None:
        certified = f"; {who} is {'' if optimal else 'not '}optimal under it"
    certified += "" if recomputed else ", by the run's own record"
    if not _judged(metrics["reward"]):
        certified = ""
    return f"{earned}{tie}{certified}.{_beside(metrics)}{_counted(metrics, agent)}"


def _judged(reward: Mapping[str, Any]) -> bool:
    """Was there a reward, under which the expert was judged? Some learners give a policy alone."""
    return "expert_optimal" in reward


def _who(metrics: Mapping[str, Any]) -> str:
    """The policy that is spoken of."""
    name = agent_of(metrics["policies"])
    if name == RETRAINED:
        return "The agent that saw only the recovered reward"
    return f"T{the(name)[1:]} ({how(metrics['policies'][name])})"


def _beside(metrics: Mapping[str, Any]) -> str:
    """The other policies that are no references."""
    rows, spoken = metrics["policies"], agent_of(metrics["policies"])
    return "".join(
        f" Beside it, {the(name)} ({how(rows[name])}) has a score of {score_of(rows[name].get('score'))} and a mean return of "
        f"{_mean(returns_of(rows[name]))}."
        for name in others(rows)
        if name != spoken
    )


def _counted(metrics: Mapping[str, Any], agent: Mapping[str, Any]) -> str:
    """What the verdict rests on, where the table is counted; nothing where it is exact."""
    reward, table = metrics["reward"], metrics.get("table") or {}
    if table.get("exact", True):
        return ""
    n = reward.get("unsettled_states")
    left = f", and in {counted(n, 'state')} a margin is smaller than its error" if n else ""
    return f" All this is judged on {estimated_table(table, reward)}{left}.{loss_told(agent)}"
