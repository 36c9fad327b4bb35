"""Runs that differ in nothing but their seed, taken together: interquartile means with 95 % intervals.

A single seed says little of a method (Agarwal et al. 2021, "Deep Reinforcement Learning at the Edge of the Statistical
Precipice"). Runs with the same configuration are one pool, with one run a seed. Pools that differ in their environment alone
are taken together once more, by their scores: what varies is the seeds within each environment.
Axes: T pools, n seeds.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from irl_gym.intervals import Interval, iqm_interval
from irl_gym.judging.scores import EXPERT, RANDOM, agent_of
from irl_gym.judging.shares import Judged, judge
from irl_gym.runs.run import Run

PLACE = ("env_id", "env_kwargs", "dataset", "dataset_root", "table")
"""Entries of a configuration in which pooled environments may differ."""
PARTS = ("table", "expert", "learner", "inner", "retrain")
"""Entries of a configuration that are objects, and may have a seed of their own."""


@dataclass(frozen=True, eq=False)
class Pool:
    """Runs of one configuration, with different seeds."""

    runs: Mapping[str, Run]
    """n runs by what they are called, in the order of their seeds."""

    @property
    def first(self) -> Run:
        """One of them, for what they share."""
        return next(iter(self.runs.values()))

    @cached_property
    def policies_of_runs(self) -> dict[str, Mapping[str, Any]]:
        """What metrics.json says of each policy, by run."""
        return {name: run.metrics["policies"] for name, run in self.runs.items()}

    @cached_property
    def policies(self) -> list[str]:
        """The names of the policies that all runs judged."""
        rows = [*self.policies_of_runs.values()]
        return [name for name in rows[0] if all(name in row for row in rows)]

    @property
    def agent(self) -> str:
        """The one that is spoken of."""
        return agent_of(self.policies)

    def scores_of(self, name: str) -> np.ndarray | None:
        """(n,) score of each run's policy of a name; None where a run has none."""
        found = [rows[name]["score"] for rows in self.policies_of_runs.values()]
        return None if any(one is None for one in found) else np.array(found, dtype=np.float64)

    def score_of(self, name: str) -> Interval | None:
        """The interquartile mean of these scores."""
        found = self.scores_of(name)
        return None if found is None else over_seeds(found)

    @property
    def scores(self) -> np.ndarray | None:
        """(n,) score of each agent; None where a run has none."""
        return self.scores_of(self.agent)

    @property
    def score(self) -> Interval | None:
        """The interquartile mean of the scores."""
        return self.score_of(self.agent)

    @cached_property
    def mean_returns(self) -> dict[str, Interval]:
        """The interquartile means of mean undiscounted returns, by policy."""
        rows = self.policies_of_runs.values()
        return {
            name: over_seeds(np.array([row[name]["mean_return"] for row in rows], dtype=np.float64)) for name in self.policies
        }

    @property
    def judged(self) -> Judged:
        """The agents by the worse share of both means."""
        return self.judged_of(self.agent)

    def judged_of(self, name: str) -> Judged:
        """The same of the policies of a name."""
        table = self.first.metrics.get("table") or {}
        means = (self.mean_returns[one] for one in (name, EXPERT, RANDOM))
        return judge(self.score_of(name), *means, estimated=not table.get("exact", True))


def over_seeds(values: np.ndarray) -> Interval:
    """The interquartile mean of (n,) or (T, n) values with its interval."""
    return iqm_interval(values)


def pools(named: Mapping[str, Run]) -> list[Pool]:
    """The pools of at least two seeds; of runs with the same seed the first counts.

    Args:
        named: runs by what they are called.
    """
    names, made = list(named), []
    for group in _alike([without_seeds(run.config) for run in named.values()]):
        seeds: dict[int, str] = {}
        for i in group:
            seeds.setdefault(named[names[i]].config["seed"], names[i])
        if len(seeds) > 1:
            made.append(Pool({seeds[seed]: named[seeds[seed]] for seed in sorted(seeds)}))
    return made


def over_environments(found: Sequence[Pool]) -> list[tuple[list[Pool], Interval]]:
    """Pools that differ in their environment alone and have equally many seeds, with the mean of their scores."""
    scored = [(pool, scores) for pool in found if (scores := pool.scores) is not None]
    groups = _alike([_placeless(pool.first.config) | {"n": scores.size} for pool, scores in scored])
    return [
        ([scored[i][0] for i in group], over_seeds(np.stack([scored[i][1] for i in group])))
        for group in groups
        if len(group) > 1
    ]


def without_seeds(config: Mapping[str, Any]) -> dict[str, Any]:
    """A configuration without its seed and those of its parts: the command line gives one seed to all of them."""
    rest = {name: value for name, value in config.items() if name != "seed"}
    for name in PARTS:
        if isinstance(part := rest.get(name), Mapping):
            rest[name] = {key: value for key, value in part.items() if key != "seed"}
    return rest


def _placeless(config: Mapping[str, Any]) -> dict[str, Any]:
    """A configuration without seeds and environment."""
    return {name: value for name, value in without_seeds(config).items() if name not in PLACE}


def _alike(configs: Sequence[Mapping[str, Any]]) -> list[list[int]]:
    """The positions of configurations that are the same."""
    found: dict[str, list[int]] = {}
    for i, config in enumerate(configs):
        found.setdefault(json.dumps(config, sort_keys=True), []).append(i)
    return list(found.values())
