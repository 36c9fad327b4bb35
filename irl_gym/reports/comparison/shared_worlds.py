"""What the runs of a comparison have in common: the environment, and what the expert and random actions are worth there.

Values can be compared where the world is the same: environment, discount, and whatever is made of it. Scores can be compared
where, besides, the expert and random actions are worth the same: a score says how near an agent comes to its own expert.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from irl_gym.intervals import interquartile_mean
from irl_gym.judging.scores import REFERENCES
from irl_gym.reports.page.sections.asked import written
from irl_gym.reports.page.sections.training import COLOURS, Level, stroke, usual_levels
from irl_gym.runs.pooling import without_seeds

PolicyRows = Mapping[str, Any]
"""What metrics.json says of each policy of a run, by its name."""
WORLD = ("gamma", "start_seeds", "reveal", "bins", "samples", "table")
"""Entries of a configuration that make another world of an environment."""
SHORT = 20
"""Characters of an argument that is told even if it is the same in all runs."""
SAME = 1e-6
"""Values whose difference is below this share of the largest are the same: planners stop before that."""


def run_places(titles: Mapping[str, str], configs: Mapping[str, Mapping[str, Any]]) -> dict[str, str]:
    """What the environment of each run is called: its id, with short arguments, and whatever runs of one id differ in."""
    short = {
        key
        for config in configs.values()
        for key, one in (config.get("env_kwargs") or {}).items()
        if len(written(one)) <= SHORT
    }
    given = {letter: dict(_given(config)) for letter, config in configs.items()}
    told = {}
    for letter, title in titles.items():
        same = [given[other] for other, one in titles.items() if one == title]
        keys = [
            key
            for key in dict.fromkeys(key for one in same for key in one)
            if key in short or any(one.get(key) != same[0].get(key) for one in same)
        ]
        differing = ", ".join(f"{key}={written(given[letter][key])}" for key in keys if key in given[letter])
        told[letter] = title + (f" ({differing or 'no arguments'})" if keys else "")
    return told


def _given(config: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """What the environment was made with, and what was made of it; without what was left as it is."""
    yield from (config.get("env_kwargs") or {}).items()
    rest = without_seeds(config)
    yield from ((key, rest[key]) for key in (*WORLD, *_dataset(config)) if rest.get(key) not in (None, [], {}, 0, "known"))


def run_title(config: Mapping[str, Any], place: str) -> str:
    """Environment, learner and seed."""
    learner = (config.get("learner") or {}).get("type", "")
    return f"{place}, {learner}, seed {config.get('seed')}"


def one_world(titles: Mapping[str, str], configs: Mapping[str, Mapping[str, Any]]) -> bool:
    """Are all runs of the same environment, and is the same made of it, so that their values can be compared?"""
    return len({(title, _world(configs[letter])) for letter, title in titles.items()}) == 1


def _world(config: Mapping[str, Any]) -> str:
    """What makes the world, but for seeds."""
    rest = without_seeds(config)
    return written({key: rest.get(key) for key in ("env_kwargs", *WORLD, *_dataset(config))})


def _dataset(config: Mapping[str, Any]) -> tuple[str, ...]:
    """The dataset, where it says what the environment is: two may have recorded one id with different arguments."""
    return () if config.get("env_id") is not None else ("dataset", "dataset_root")


def worth(policies: Mapping[str, PolicyRows], policy: str) -> dict[str, float | None]:
    """What a policy, such as expert or random, is worth in each run; None where that is not known."""
    return {letter: rows[policy]["value"] for letter, rows in policies.items()}


def agree(values: Mapping[str, float | None]) -> bool:
    """Are values the same, but for rounding?"""
    known = [one for one in values.values() if one is not None]
    if len(known) < len(values):
        return not known
    found = np.array(known, dtype=np.float64)
    return bool(np.ptp(found) <= SAME * np.abs(found).max(initial=0.0))


def one_scale(policies: Mapping[str, PolicyRows]) -> bool:
    """Is a score of one run as much as the same score of another in this world?"""
    return all(agree(worth(policies, policy)) for policy in REFERENCES)


def levels_of(drawn: Mapping[str, Mapping[str, PolicyRows]]) -> list[Level]:
    """The levels in a figure of values: one where all runs agree, else one for each curve, in its colour.

    Args:
        drawn: the policies of the runs of each curve, one or the seeds of a pool, by its name and in the order of drawing.
    """
    made: list[Level] = []
    every = {letter: rows for runs in drawn.values() for letter, rows in runs.items()}
    for usual in usual_levels(None, None):
        values = worth(every, usual.name)
        if agree(values):
            made.append(usual._replace(value=next(iter(values.values()))))
            continue
        for i, (name, runs) in enumerate(drawn.items()):
            known = [one for one in worth(runs, usual.name).values() if one is not None]
            level = interquartile_mean(np.array(known)) if known else None
            colour, _, marker = stroke(i)
            shape = marker if i >= len(COLOURS) else None
            made.append(Level(f"{usual.name} of {name}", level, colour, usual.dash, listed=False, marker=shape))
    return made


def levels_told(levels: Sequence[Level]) -> str:
    """What a caption says of the levels."""
    own = "" if all(level.listed for level in levels) else ", where they differ each run's in its own colour"
    return f"the expert is dashed and random actions are dotted{own}"
