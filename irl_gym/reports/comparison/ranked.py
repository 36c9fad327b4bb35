"""Which of several runs is best, in a sentence, and their learning curves in one figure.

Runs are ranked by score only where a score is as much in one as in another: in one world, with experts and random actions that
are worth the same. Curves are of values in one world, and of scores elsewhere.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from irl_gym.judging.curves import Curve
from irl_gym.judging.scores import CALLED, EXPERT, RANDOM, agent_of, called, score_of, several
from irl_gym.reports.comparison.pooled import averaged, returned, spoken
from irl_gym.reports.comparison.pooled import called as called_pool
from irl_gym.reports.comparison.shared_worlds import PolicyRows, agree, levels_of, levels_told, worth
from irl_gym.reports.page.panels import Panel
from irl_gym.reports.page.sections.section import Section
from irl_gym.reports.page.sections.training import curves as drawn
from irl_gym.reports.page.sections.training import usual_levels
from irl_gym.runs.pooling import Pool, over_seeds
from irl_gym.written import number, sentence_of

TITLE = "Learning curves"


def sentence(policies: Mapping[str, PolicyRows], pools: Sequence[Pool], same_world: bool, same_scale: bool) -> str:
    """Which agent is best, by score and beside it by mean return; of runs that only differ in their seed, how good all are."""
    agents = {agent_of(rows) for rows in policies.values()}
    who, all_of = (called(*agents), several(*agents)) if len(agents) == 1 and agents <= {*CALLED} else ("agent", "agents")
    scores = {letter: _agent(rows)["score"] for letter, rows in policies.items()}
    known = {letter: score for letter, score in scores.items() if score is not None}
    if not known:
        return "None of these runs has a score; each run's own page says why."
    if len(pools) == 1 and len(pools[0].runs) == len(policies) and pools[0].score is not None:
        expert, (pool,) = "the expert" if same_scale else "the own expert of each", pools
        means = f"a score of {spoken(pool.score)} and a {returned(pool)}, each the {averaged(pool)} with its 95 % interval"
        return f"Over {len(policies)} seeds the {all_of} have {means}. By score random actions are 0, {expert} is 1."
    if not same_scale:
        each = "; ".join(f"run {letter} {_earned(rows)} ({_ends({letter: rows})})" for letter, rows in policies.items())
        return (
            f"Scores of the {all_of}: {each}. By score random actions are 0, the expert is 1. "
            f"{_unlike(policies, same_world)}, so a score says how near each agent comes to its own expert, not "
            "which run is better."
        )
    best, worst = max(known, key=lambda one: known[one]), min(known, key=lambda one: known[one])
    scale = f"By score random actions are 0, the expert is 1; by mean return {_ends(policies)}."
    if score_of(known[best]) == score_of(known[worst]):
        paid = _spread([_agent(rows)["mean_return"] for rows in policies.values()])
        return f"The {all_of} have one score, {score_of(known[best])}, and mean return {paid}. {scale}"
    return (
        f"The {who} of run {best} has the best score, {_earned(policies[best])}; that of run {worst} the worst, "
        f"{_earned(policies[worst])}.{_otherwise(policies, best)} {scale}"
    )


def _agent(rows: PolicyRows) -> Mapping[str, Any]:
    """The row of the policy that is spoken of."""
    return rows[agent_of(rows)]


def _earned(rows: PolicyRows) -> str:
    """A score with its mean return."""
    row = _agent(rows)
    return f"{score_of(row['score'])} with mean return {number(row['mean_return'])}"


def _ends(policies: Mapping[str, PolicyRows]) -> str:
    """What random actions and the expert return."""
    random, expert = (_spread([rows[name]["mean_return"] for rows in policies.values()]) for name in (RANDOM, EXPERT))
    return f"random actions have {random}, the expert {expert}"


def _spread(found: Sequence[float]) -> str:
    """Mean returns: the least and the largest."""
    return " to ".join(dict.fromkeys(map(number, (min(found), max(found)))))


def _otherwise(policies: Mapping[str, PolicyRows], best: str) -> str:
    """Which run has the highest mean return, if that is not the one with the best score."""
    returns = {letter: _agent(rows)["mean_return"] for letter, rows in policies.items()}
    most = max(returns, key=lambda one: returns[one])
    return "" if returns[most] == returns[best] else f" The highest mean return is that of run {most}, {number(returns[most])}."


def _unlike(policies: Mapping[str, PolicyRows], same_world: bool) -> str:
    """Why scores are not on one scale."""
    if not same_world:
        return "The environments differ"
    apart = "random actions are" if agree(worth(policies, EXPERT)) else "the experts are"
    return f"In these runs {apart} not worth the same"


def learning(
    curves: Mapping[str, Curve], policies: Mapping[str, PolicyRows], same_world: bool, pools: Sequence[Pool]
) -> Section:
    """All learning curves in one figure; of runs that differ in their seed alone the mean with its interval, each run thin."""
    trained = {letter: one for letter, one in curves.items() if len(one.steps)}
    if not trained:
        return Section("learning", TITLE, "No agent was trained step by step.")
    what, told = "discounted value from the start", ""
    lines = {letter: (one.steps, one.value) for letter, one in trained.items()}
    if not same_world:
        what, told = "score", "random actions are 0, the expert is 1"
        scored = {letter: _scores(one, policies[letter]) for letter, one in trained.items()}
        lines = {letter: (trained[letter].steps, found) for letter, found in scored.items() if found is not None}
    if not lines:
        return Section("learning", TITLE, "No run has a score to draw.")
    groups = _groups(lines, pools)
    series, thin = {}, {}
    for name, letters in groups.items():
        steps, values = lines[letters[0]][0], np.stack([lines[letter][1] for letter in letters])
        band = np.array([over_seeds(column) for column in values.T]) if len(letters) > 1 else None
        series[name] = (steps, values[0], None) if band is None else (steps, band[:, 0], (band[:, 1], band[:, 2]))
        thin[name] = [] if band is None else [*values]
    levels = [*usual_levels(1.0, 0.0)]
    if same_world:
        levels = levels_of({name: {letter: policies[letter] for letter in letters} for name, letters in groups.items()})
        told = levels_told(levels)
    ends = "; ".join(
        f"{name} {'ends' if len(groups[name]) == 1 else 'end'} at {number(one[1][-1])}" for name, one in series.items()
    )
    seeds = (
        "; of seeds together the interquartile mean (of fewer than 4 the mean) with its 95 % interval shaded, each run thin"
        if any(thin.values())
        else ""
    )
    panel = Panel(
        "curves", what.capitalize(), sentence_of(f"{ends}{seeds}; {told}"), drawn(series, levels, what, thin), height=400
    )
    left = [letter for letter in curves if letter not in lines]
    lead = "What each agent earned under the true reward as it trained."
    lead += f" Without a curve, as nobody was trained step by step, or without a score: {', '.join(left)}." if left else ""
    return Section("learning", TITLE, lead, [panel])


def _groups(lines: Mapping[str, tuple[np.ndarray, np.ndarray]], pools: Sequence[Pool]) -> dict[str, list[str]]:
    """The letters of the runs of each curve, by its name: of a pool that was measured at the same steps, or of one run."""
    made: dict[str, list[str]] = {}
    pooled: set[str] = set()
    for pool in pools:
        steps = [lines[letter][0] for letter in pool.runs if letter in lines]
        if len(steps) == len(pool.runs) and all(np.array_equal(one, steps[0]) for one in steps):
            made[called_pool(pool)] = [*pool.runs]
            pooled |= {*pool.runs}
    return made | {f"run {letter}": [letter] for letter in lines if letter not in pooled}


def _scores(curve: Curve, rows: PolicyRows) -> np.ndarray | None:
    """A learning curve in scores; None where the expert is no better than random actions."""
    low, high = (rows[policy]["value"] for policy in (RANDOM, EXPERT))
    if low is None or high is None or not high > low:
        return None
    return (curve.value - low) / (high - low)
