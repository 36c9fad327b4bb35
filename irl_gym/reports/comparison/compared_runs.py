"""What the sections of a comparison may need of its runs, by name: each part is by the runs' letters."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from irl_gym.features.linear_reward import LinearReward
from irl_gym.judging.curves import Curve
from irl_gym.mdp.rewards import TabularReward
from irl_gym.reports.comparison.shared_worlds import PolicyRows, one_scale, one_world, run_places
from irl_gym.reports.page.contents import RunContents
from irl_gym.reports.page.report import page_title
from irl_gym.reports.page.scene import Scene
from irl_gym.runs.pooling import Pool
from irl_gym.runs.pooling import pools as pools_of
from irl_gym.runs.run import Run


@dataclass(frozen=True, eq=False)
class ComparedRuns:
    """Supplies sections (`irl_gym.runs.supply`)."""

    runs: Mapping[str, Run]
    """By letter."""

    def _each(self, part: Callable[[Run], Any]) -> dict[str, Any]:
        return {letter: part(run) for letter, run in self.runs.items()}

    @cached_property
    def configs(self) -> Mapping[str, Mapping[str, Any]]:
        """The experiments."""
        return self._each(lambda run: run.config)

    @cached_property
    def titles(self) -> Mapping[str, str]:
        """The environments."""
        return self._each(lambda run: page_title(run.env_id, run.config))

    @cached_property
    def places(self) -> Mapping[str, str]:
        """The environments, with the arguments that tell them apart."""
        return run_places(self.titles, self.configs)

    @cached_property
    def metrics(self) -> Mapping[str, Mapping[str, Any]]:
        """What was judged."""
        return self._each(lambda run: run.metrics)

    @cached_property
    def policies(self) -> Mapping[str, PolicyRows]:
        """How good each policy is."""
        return self._each(lambda run: run.metrics["policies"])

    @cached_property
    def recomputed(self) -> Mapping[str, bool]:
        """Is what they say of the expert under the reward computed from their files?"""
        return self._each(lambda run: run.recomputed)

    @cached_property
    def stages(self) -> Mapping[str, Mapping[str, Mapping[str, Any]]]:
        """The records of each finished stage."""
        return self._each(lambda run: run.stages)

    @cached_property
    def certificates(self) -> Mapping[str, Mapping[str, Any]]:
        """The contents of certificate.json."""
        return self._each(lambda run: run.certificate)

    @cached_property
    def diagnoses(self) -> Mapping[str, Mapping[str, Any] | None]:
        """What the doctor says."""
        return self._each(lambda run: run.diagnosis)

    @cached_property
    def place_names(self) -> Mapping[str, Callable[[int, int | None], str]]:
        """What a state is called, or a state and an action."""
        return self._each(lambda run: run.place_name)

    @cached_property
    def learned(self) -> Mapping[str, TabularReward | LinearReward | None]:
        """The recovered rewards."""
        return self._each(lambda run: run.learned)

    @cached_property
    def scenes(self) -> Mapping[str, Scene | None]:
        """What is known state by state."""
        return self._each(lambda run: RunContents(run).scene)

    @cached_property
    def curves(self) -> Mapping[str, Curve]:
        """The learning curves."""
        return self._each(lambda run: run.curve)

    @cached_property
    def pools(self) -> Sequence[Pool]:
        """Those that differ in their seed alone."""
        return pools_of(self.runs)

    @cached_property
    def same_world(self) -> bool:
        """Are all of one environment, so that their values can be compared?"""
        return one_world(self.titles, self.configs)

    @cached_property
    def same_scale(self) -> bool:
        """Is a score of one as much as the same score of another?"""
        return self.same_world and one_scale(self.policies)


def lettered(runs: Sequence[Run]) -> ComparedRuns:
    """Runs by their letters."""
    return ComparedRuns({chr(ord("A") + i): run for i, run in enumerate(runs)})
