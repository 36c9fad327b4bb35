"""Which of several runs is best, in a sentence, and their learning curves in one figure.

Runs are ranked by score only where a score is as much in one as in another: in one world, with experts and random actions that
are worth the same. Curves are of values in one world, and of scores elsewhere.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from irl_gym.judging.scores import CALLED, EXPERT, RANDOM, agent_of, called, score_of, several
from irl_gym.reports.comparison.pooled import averaged, returned, spoken
from irl_gym.reports.comparison.shared_worlds import agree, levels_of, levels_told, one_scale, one_world, worth
from irl_gym.reports.page.panels import Panel
from irl_gym.reports.page.sections.section import Section
from irl_gym.reports.page.sections.training import curves, usual_levels
from irl_gym.runs.pooling import Pool
from irl_gym.runs.run import Run
from irl_gym.written import number, sentence_of

TITLE = "Learning curves"


def sentence(named: Mapping[str, Run], found: Sequence[Pool]) -> str:
    """Which agent is best, by score and beside it by mean return; of runs that only differ in their seed, how good all are."""
    agents = {agent_of(run.metrics["policies"]) for run in named.values()}
    who, all_of = (called(*agents), several(*agents)) if len(agents) == 1 and agents <= {*CALLED} else ("agent", "agents")
    scores = {letter: _agent(run)["score"] for letter, run in named.items()}
    known = {letter: score for letter, score in scores.items() if score is not None}
    if not known:
        return "None of these runs has a score; each run's own page says why."
    if len(found) == 1 and len(found[0].runs) == len(named) and found[0].score is not None:
        expert, (pool,) = "the expert" if one_scale(named) else "the own expert of each", found
        means = f"a score of {spoken(pool.score)} and a {returned(pool)}, each the {averaged(pool)} with its 95 % interval"
        return f"Over {len(named)} seeds the {all_of} have {means}. By score random actions are 0, {expert} is 1."
    if not one_scale(named):
        each = "; ".join(f"run {letter} {_earned(run)} ({_ends({letter: run})})" for letter, run in named.items())
        return (
            f"Scores of the {all_of}: {each}. By score random actions are 0, the expert is 1. {_unlike(named)}, so a "
            "score says how near each agent comes to its own expert, not which run is better."
        )
    best, worst = max(known, key=lambda one: known[one]), min(known, key=lambda one: known[one])
    scale = f"By score random actions are 0, the expert is 1; by mean return {_ends(named)}."
    if score_of(known[best]) == score_of(known[worst]):
        paid = _spread([_agent(run)["mean_return"] for run in named.values()])
        return f"The {all_of} have one score, {score_of(known[best])}, and mean return {paid}. {scale}"
    return (
        f"The {who} of run {best} has the best score, {_earned(named[best])}; that of run {worst} the worst, "
        f"{_earned(named[worst])}.{_otherwise(named, best)} {scale}"
    )


def _agent(run: Run) -> Mapping[str, Any]:
    """The row of the policy that is spoken of."""
    policies = run.metrics["policies"]
    return policies[agent_of(policies)]


def _earned(run: Run) -> str:
    """A score with its mean return."""
    row = _agent(run)
    return f"{score_of(row['score'])} with mean return {number(row['mean_return'])}"


def _ends(named: Mapping[str, Run]) -> str:
    """What random actions and the expert return."""
    random, expert = (
        _spread([run.metrics["policies"][name]["mean_return"] for run in named.values()]) for name in (RANDOM, EXPERT)
    )
    return f"random actions have {random}, the expert {expert}"


def _spread(found: Sequence[float]) -> str:
    """Mean returns: the least and the largest."""
    return " to ".join(dict.fromkeys(map(number, (min(found), max(found)))))


def _otherwise(named: Mapping[str, Run], best: str) -> str:
    """Which run has the highest mean return, if that is not the one with the best score."""
    returns = {letter: _agent(run)["mean_return"] for letter, run in named.items()}
    most = max(returns, key=lambda one: returns[one])
    return "" if returns[most] == returns[best] else f" The highest mean return is that of run {most}, {number(returns[most])}."


def _unlike(named: Mapping[str, Run]) -> str:
    """Why scores are not on one scale."""
    if not one_world(named):
        return "The environments differ"
    apart = "random actions are" if agree(worth(named, EXPERT)) else "the experts are"
    return f"In these runs {apart} not worth the same"


def learning(named: Mapping[str, Run]) -> Section:
    """All learning curves in one figure."""
    trained = {letter: run for letter, run in named.items() if len(run.curve.steps)}
    if not trained:
        return Section("learning", TITLE, "No agent was trained step by step.")
    if one_world(named):
        series = {f"run {letter}": (run.curve.steps, run.curve.value, None) for letter, run in trained.items()}
        levels = levels_of({f"run {letter}": {letter: run} for letter, run in trained.items()})
        what, told = "discounted value from the start", levels_told(levels)
    else:
        series = {f"run {letter}": curve for letter, run in trained.items() if (curve := _scores(run)) is not None}
        levels, what, told = [*usual_levels(1.0, 0.0)], "score", "random actions are 0, the expert is 1"
    if not series:
        return Section("learning", TITLE, "No run has a score to draw.")
    ends = "; ".join(f"{name} ends at {number(values[-1])}" for name, (_, values, _) in series.items())
    panel = Panel("curves", what.capitalize(), sentence_of(f"{ends}; {told}"), curves(series, levels, what), height=400)
    left = [letter for letter in named if f"run {letter}" not in series]
    lead = "What each agent earned under the true reward as it trained."
    lead += f" Without a curve, as nobody was trained step by step, or without a score: {', '.join(left)}." if left else ""
    return Section("learning", TITLE, lead, [panel])


def _scores(run: Run) -> tuple[np.ndarray, np.ndarray, None] | None:
    """A learning curve in scores; None where the expert is no better than random actions."""
    low, high = (run.metrics["policies"][policy]["value"] for policy in (RANDOM, EXPERT))
    if low is None or high is None or not high > low:
        return None
    return run.curve.steps, (run.curve.value - low) / (high - low), None
