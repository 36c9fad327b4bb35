"""What the sections of a page may need of a run, by name, beside the run's own fields; None what it has not got."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from irl_gym.judging.curves import Curve
from irl_gym.judging.scores import others
from irl_gym.reports.page.maps import Map
from irl_gym.reports.page.scene import Scene
from irl_gym.runs.films import Film
from irl_gym.runs.run import Run


@dataclass(frozen=True, eq=False)
class RunContents:
    """Supplies sections (`irl_gym.runs.supply`)."""

    run: Run
    """What it is the contents of."""

    @cached_property
    def scene(self) -> Scene | None:
        """What is known state by state; None where there is no table."""
        run = self.run
        if run.table is None:
            return None
        told = run.metrics.get("demonstrations", {})
        by_episodes = bool(told.get("episodes_only", False))
        agents = {name: run.agents[name] for name in others(run.agents)}
        return Scene(run.table, run.tabular, run.expert, agents, run.actions, run.state_name, run.grid, by_episodes)

    @property
    def place_name(self) -> Callable[[int, int | None], str]:
        """What a state is called, or a state and an action."""
        return self.run.place_name

    @property
    def rewarded(self) -> bool:
        """Was a reward learned?"""
        return self.run.learned is not None

    @property
    def given(self) -> bool:
        """Was a dataset given, in place of an expert?"""
        return self.run.config.get("dataset") is not None

    @property
    def place(self) -> Map | None:
        """The map of cells that a token can move over."""
        place = None if self.scene is None else self.scene.place
        return place if place is not None and place.plane is None else None

    @property
    def lambda_path(self) -> Mapping[str, Any] | None:
        """How the reward changes with lambda, if it has pieces."""
        path = self.run.lambda_path
        return path if path is not None and len(path["rewards"]) else None

    @property
    def curve(self) -> Curve | None:
        """The learning curve; None where the agent was planned exactly."""
        return self.run.curve if len(self.run.curve.steps) else None

    @property
    def films(self) -> Mapping[str, Film] | None:
        """Those in which something happens, by name; None where there are none."""
        return {name: film for name, film in self.run.films.items() if film.steps} or None

    @property
    def policies(self) -> Mapping[str, Any]:
        """How good each policy is."""
        return self.run.metrics["policies"]

    @property
    def training(self) -> Mapping[str, Any]:
        """What was measured of the agent's training."""
        return self.run.metrics["training"]

    @property
    def told_of_table(self) -> Mapping[str, Any] | None:
        """How big the table is, and how far off it can be; None where there is none."""
        return self.run.metrics.get("table")

    @property
    def learner(self) -> Mapping[str, Any]:
        """The learner as the configuration has it."""
        return self.run.config.get("learner") or {}
