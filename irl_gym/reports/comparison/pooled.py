"""The section of runs that differ in their seed alone: how good a method is over its seeds, and over environments."""

from collections.abc import Mapping, Sequence

from irl_gym.intervals import Interval
from irl_gym.judging.scores import CALLED, EXPERT, RANDOM, score_of, scored, several
from irl_gym.judging.scores import called as called_policy
from irl_gym.reports.comparison.runs_as_rows import runs_as_rows
from irl_gym.reports.page.sections.section import Section
from irl_gym.runs.pooling import Pool, over_environments
from irl_gym.written import number, percent, with_ends

TRIMMED = 4
"""Seeds from which on an interquartile mean leaves some out."""


def over_seeds(pools: Sequence[Pool], places: Mapping[str, str]) -> Section | None:
    """The section; None where no two runs differ in their seed alone.

    Args:
        pools: runs that differ in their seed alone.
        places: what the environment of each run is called.
    """
    if not pools:
        return None
    lead = (
        "Runs that differ in their seed alone, taken together: interquartile means with 95 % intervals, which "
        "resist outliers (Agarwal et al. 2021). Seeds that agree are too few to say how surely, and have no interval."
    )
    if min(len(pool.runs) for pool in pools) < TRIMMED:
        lead += f" Of fewer than {TRIMMED} seeds nothing is left out, so it is the mean; an interval of so few is wide."
    lead += "".join(f" {_together(several, score)}" for several, score in over_environments(pools))
    shown = runs_as_rows("Over seeds", {called(pool): _row(pool, places) for pool in pools})
    return Section("seeds", "Over seeds", lead, (), "compare", shown)


def called(pool: Pool) -> str:
    """The runs of a pool by their letters."""
    return f"runs {', '.join(sorted(pool.runs))}"


def told(pool: Pool) -> str:
    """A pool in one line."""
    n = len(pool.runs)
    if pool.score is None:
        return f"{called(pool)}: no score, since not every one of the {n} seeds has one; {returned(pool)}"
    means = f"score {spoken(pool.score)}, {returned(pool)}; {pool.judged.brief}"
    beside = [
        f"; {called_policy(name)}: score {spoken(pool.score_of(name))}, {pool.judged_of(name).brief}"
        for name in scored(pool.policies)
        if name != pool.agent
    ]
    return f"{called(pool)}, {averaged(pool)} over {n} seeds: {means}{''.join(beside)}"


def returned(pool: Pool) -> str:
    """The mean return of a pool's agents, and what there is to compare it with."""
    random, expert = (number(pool.mean_returns[name].estimate) for name in (RANDOM, EXPERT))
    return f"mean return {with_ends(pool.mean_returns[pool.agent])} where random actions have {random}, the expert {expert}"


def averaged(pool: Pool) -> str:
    """What the mean of a pool is."""
    return "mean" if len(pool.runs) < TRIMMED else "interquartile mean"


def spoken(score: Interval | None) -> str:
    """A score with its interval."""
    return "none" if score is None else with_ends(score, score_of)


def _row(pool: Pool, places: Mapping[str, str]) -> dict[str, str]:
    """What the table says of a pool."""
    config, letter = pool.first.config, next(iter(pool.runs))
    lost = [run.metrics["reward"].get("worst_tie_regret_share") for run in pool.runs.values() if run.learned is not None]
    told = {
        "environment": places[letter],
        "learner": str((config.get("learner") or {}).get("type", "")),
        "seeds": ", ".join(str(run.config["seed"]) for run in pool.runs.values()),
    }
    for name in scored(pool.policies):
        told |= _of_policy(pool, name)
    ends = " and ".join(number(pool.mean_returns[name].estimate) for name in (RANDOM, EXPERT))
    told["mean return of random actions and of the expert"] = ends
    if lost:  # not of learners of policies
        told["lost by the worst tie, at most"] = percent(None if None in lost else max(max(lost), 0.0))
    return told


def _of_policy(pool: Pool, name: str) -> dict[str, str]:
    """What the table says of the policies of one name."""
    whose, scores = f"the {several(name)}" if name in CALLED else name, pool.scores_of(name)
    ends = "none" if scores is None else " and ".join(map(score_of, (scores.min(), scores.max())))
    return {
        f"score of {whose} (95 %)": spoken(pool.score_of(name)),
        f"mean return of {whose} (95 %)": with_ends(pool.mean_returns[name]),
        f"{whose}, judged by the worse share": pool.judged_of(name).brief,
        f"score of {whose}, worst and best seed": ends,
    }


def _together(several: Sequence[Pool], score: Interval) -> str:
    letters = "; ".join(map(called, several))
    return f"Over the {len(several)} environments of {letters} the score is {spoken(score)}, by what varies within each."
