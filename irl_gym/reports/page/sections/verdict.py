"""The first screen of a page: what a stranger asks, in plain words.

Does the agent do as well as the expert? Is the reward to be trusted? Both are answered from metrics.json, from what is proved,
and from what the doctor said. What next? That is in `next_step`.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

from irl_gym.facts import Mood
from irl_gym.intervals import TOO_FEW, Interval
from irl_gym.judging import scores
from irl_gym.judging.confirmation import loss_told
from irl_gym.judging.copied import copied_told
from irl_gym.judging.measures import no_score
from irl_gym.judging.scores import EXPERT, RANDOM, RETRAINED, agent_of, others, score_of, the
from irl_gym.judging.shares import GOOD, MUCH, WELL, as_well, judged, returns_of
from irl_gym.mdp.sampling_error import estimated_table
from irl_gym.reports.page.sections.judged import answer, how
from irl_gym.reports.page.sections.proof import whence
from irl_gym.runs.certificates import facts_in
from irl_gym.written import counted, number, percent

ROUNDED = 1e-9
"""A share that is no more than rounding."""


class Told(NamedTuple):
    """The answer to a question."""

    answer: str
    """In a word or two."""
    mood: Mood
    sentences: tuple[str, ...]
    """In whole sentences, of which the last may be empty."""


def verdict(
    metrics: Mapping[str, Any], certificate: Mapping[str, Any], diagnosis: Mapping[str, Any] | None, rewarded: bool,
    recomputed: bool, whose: str, config: Mapping[str, Any],
) -> dict[str, Any]:  # fmt: skip
    """What the run was about; two questions with their answers and figures; and whose word all of it is.

    Args:
        metrics: the content of metrics.json.
        certificate: that of certificate.json.
        diagnosis: that of diagnosis.json; None for an earlier version's run.
        rewarded: was a reward learned?
        recomputed: was what it says of the expert under the reward computed from the run's files?
        whose: whose word it is, what is said of the run.
        config: the content of config.json.
    """
    agent, reward = _agent(metrics), metrics["reward"]
    who = scores.who(metrics["policies"])
    trusted = _trusted(metrics, certificate, diagnosis, recomputed) if rewarded else _policy_trusted(certificate)
    questions = [
        {
            "question": as_well(metrics["policies"]),
            **_well(metrics, config)._asdict(),
            "figures": _earned(metrics, agent, who),
        },
        {
            "question": f"Is the {'reward' if rewarded else 'policy'} to be trusted?",
            **trusted._asdict(),
            "figures": _of_reward(reward, recomputed) if "expert_optimal" in reward else [],
        },
    ]
    return {"about": _about(who, rewarded), "questions": questions, "whose": whose}


def _about(who: str, rewarded: bool) -> str:
    """What was done, for who never heard of it."""
    if not rewarded:
        return "An expert showed what to do. From that a policy was learned, without a reward; here it is judged."
    then = "an agent was then paid by that reward alone" if who == "agent" else "here it is judged"
    return f"An expert showed what to do. From that a reward was recovered that is to explain it; {then}."


def _agent(metrics: Mapping[str, Any]) -> Mapping[str, Any]:
    """The row of the policy that is spoken of."""
    return metrics["policies"][agent_of(metrics["policies"])]


def _well(metrics: Mapping[str, Any], config: Mapping[str, Any]) -> Told:
    """Does the agent do as well as the expert?"""
    rows, agent = metrics["policies"], _agent(metrics)
    mood = judged(rows, metrics.get("table")).mood
    random, expert = (_mean(returns_of(rows[name])) for name in (RANDOM, EXPERT))
    earns = (
        f"{_who(metrics)} earns {_mean(returns_of(agent))} an episode on average, the expert {expert}, random actions {random}."
    )
    score = "" if agent.get("score") is not None else f"There is no score, as {no_score(metrics)}."
    agrees, told = agent.get("agreement"), metrics.get("demonstrations", {})
    taken = "an optimal action" if told.get("episodes_only") else "one of the expert's actions, or another that is as good,"
    acts = "" if agrees is None else f"It takes {taken} in {percent(agrees)} of the states."
    return Told(
        WELL[mood],
        mood,
        (earns, score, acts, _beside(metrics), copied_told(metrics, config.get("eval_episodes", 0)), _counted(metrics, agent)),
    )


def _earned(metrics: Mapping[str, Any], agent: Mapping[str, Any], who: str) -> list[dict[str, Any]]:
    """The figures of score and mean return, in the colour of the worse."""
    score, mood = agent.get("score"), judged(metrics["policies"], metrics.get("table")).mood
    return [
        {
            "label": f"the {who}'s score",
            "value": score_of(score),
            "note": f"discounted; random actions are 0, the expert is 1, good begins at {GOOD:g}"
            if score is not None
            else no_score(metrics),
            "mood": mood,
        },
        {
            "label": f"the {who}'s mean return",
            "value": number(agent.get("mean_return")),
            "note": _returns(metrics),
            "mood": mood,
        },
    ]


def _of_reward(reward: Mapping[str, Any], recomputed: bool) -> list[dict[str, Any]]:
    """The figures of a reward under which the expert was judged."""
    share, optimal = reward.get("worst_tie_regret_share"), reward.get("expert_optimal")
    return [
        {
            "label": "lost by the unluckiest agent",
            "value": "not known" if share is None else percent(max(share, 0.0)),
            "note": "of what the expert has over random actions, by the worst of the policies that are best under it",
            "mood": "plain" if share is None else "good" if share <= MUCH else "bad",
        },
        {
            "label": "expert best under it",
            "value": answer(optimal),
            "note": "degenerate: the reward says nothing" if reward.get("degenerate") else whence(recomputed),
            "mood": _mood(optimal, reward),
        },
    ]


def _trusted(
    metrics: Mapping[str, Any], certificate: Mapping[str, Any], diagnosis: Mapping[str, Any] | None, recomputed: bool
) -> Told:
    """Is the reward to be trusted? Yes only where all of it was looked at on an exact table, and nothing is against it."""
    reward, share = metrics["reward"], metrics["reward"].get("worst_tie_regret_share")
    said = _said(diagnosis)
    if metrics.get("table") is None or "expert_optimal" not in reward:
        none = "Without a table it is not known of all policies what the reward makes of them."
        return Told("Not decided", "open", (none, _own_words(certificate), said))
    optimal, record = reward["expert_optimal"], "" if recomputed else ", by the run's own record"
    who = "what the expert is seen to do most" if reward.get("errs") else "what the expert does"
    if reward.get("degenerate"):
        return Told("No", "bad", (f"It says nothing: under it no action is better than another{record}.", said))
    if optimal is False:
        return Told("No", "bad", (f"Under it {who} is not the best that can be done{record}.", _tie(share), said))
    if optimal is None:
        return Told("Not decided", "open", (f"Whether {who} is the best under it is undecided{record}.", _tie(share), said))
    best = f"Under it {who} is the best that can be done{record}."
    estimated = not (metrics.get("table") or {}).get("exact", True) or reward.get("unsettled_states")
    sure = share is not None and share <= MUCH and not estimated and (diagnosis or {}).get("answer") == "healthy"
    here = "All this is of this environment and of no other." if sure else ""
    return Told("Yes" if sure else "With care", "good" if sure else "open", (best, _tie(share), said, here))


def _tie(share: float | None) -> str:
    """What the worst policy that is best under the reward loses."""
    if share is None:
        return "What an agent may lose that is best under it is not known, as there is no score."
    if share <= ROUNDED:
        return "Every policy that is best under it does as well as the expert in the environment."
    return (
        f"The unluckiest policy that is best under it would lose {percent(share)} of what the expert has over random actions."
    )


def _said(diagnosis: Mapping[str, Any] | None) -> str:
    """What the doctor, who looks for what is wrong, found."""
    if diagnosis is None:
        return "Nobody looked for what may be wrong with it: an earlier version of irl_gym made the run."
    n, record = len(diagnosis["findings"]), "as recorded when the run was made"
    if n:
        return f"The doctor, which looks for what may be wrong, has {counted(n, 'finding')}, {record}."
    if diagnosis["answer"] == "healthy":
        return f"The doctor, which looks for what may be wrong, found nothing, {record}."
    return f"The doctor could not examine it, {record}: {diagnosis['why']}."


def _policy_trusted(certificate: Mapping[str, Any]) -> Told:
    """Is a policy to be trusted that came without a reward? What its learner proves of it speaks against it, or does not."""
    against = [one for one in facts_in(certificate)[1] if one.mood in ("open", "bad")]
    no_reward = "There is no reward that would say why it acts so, or what to do in a changed environment."
    if against:
        return Told("With care", "open", (_own_words(certificate), no_reward))
    return Told("Nothing is against it", "plain", ("What its learner proves of it speaks not against it.", no_reward))


def _own_words(certificate: Mapping[str, Any]) -> str:
    """What the learner's own record says that is undecided or not as one would wish; what it says first where nothing is."""
    facts = facts_in(certificate)[1]
    told = [one for one in facts if one.mood in ("open", "bad")] or [*facts[:1]]
    words = "; ".join(f"{one.label}: {one.sentence}" for one in told[:2])
    return f"By its learner's own record, {words}." if words else ""


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


def _mood(optimal: bool | None, reward: Mapping[str, Any]) -> Mood:
    """Of whether the expert is optimal: not good where the reward says nothing or a counted table leaves margins open."""
    if optimal is False or reward.get("degenerate"):
        return "bad"
    return "good" if optimal and not reward.get("unsettled_states") else "plain"


def _who(metrics: Mapping[str, Any]) -> str:
    """The policy that is spoken of."""
    name = agent_of(metrics["policies"])
    if name == RETRAINED:
        return "The agent that saw only the recovered reward"
    return f"T{the(name)[1:]} ({how(metrics['policies'][name])})"


def _beside(metrics: Mapping[str, Any]) -> str:
    """The other policies that are no references."""
    rows, spoken = metrics["policies"], agent_of(metrics["policies"])
    return " ".join(
        f"Beside it, {the(name)} ({how(rows[name])}) has a score of {score_of(rows[name].get('score'))} and a mean return of "
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
    return f"All this is judged on {estimated_table(table, reward)}{left}.{loss_told(agent)}"
