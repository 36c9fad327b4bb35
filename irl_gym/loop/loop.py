"""The stages of the loop, in order, over a run folder.

    table           `tabulate` or `discretize`: P, d0 and the true reward; none where the environment can only be stepped. An
                    enumeration that was killed is continued, and a table that was made is kept
    expert          a planner on the true reward; or what a dataset says of the expert's policy
    demonstrations  episodes of the expert, a Minari dataset; or the dataset that was given
    reward          a learner's outcome, of what it needs of all that is known: a reward, a policy or both
    agent           a planner that sees only the learned reward, on a table shaped by its expected advantage
    clone           a copy of the demonstrations, to be judged beside what was learned
    metrics         values under the true reward, exact on tables, and returns of episodes in the environment itself
    figures         rewards, values, policies, learning curve
    record          films of expert and agent, the map, the figures as csv
    ambiguity       how far the reward is left open, and what the doctor says of it
    report          report.html
The true reward enters the table, the expert and the judging only; the learning curve judges, it does not steer.
"""

import os
import time
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import gymnasium as gym

from irl_gym.agents.planners import Planner
from irl_gym.agents.simulator import Simulator
from irl_gym.demonstrations.datasets import load_minari, read_minari
from irl_gym.demonstrations.shown import ShownPolicy
from irl_gym.errors import InvalidParameter, a_type
from irl_gym.facts import counted
from irl_gym.features.linear_reward import LinearReward, check_savable, load_reward
from irl_gym.files.run_folder import RunFolder
from irl_gym.judging.curves import NO_CURVE, Curve, read_curve
from irl_gym.judging.scores import CLONE, LEARNED
from irl_gym.learners.base import Outcome
from irl_gym.learners.problem import Oracle, Problem, Spaces
from irl_gym.loop import stages
from irl_gym.loop.makers import MAKERS
from irl_gym.loop.stages import REWARD, OnProgress
from irl_gym.loop.world_choice import place_of
from irl_gym.loop.worlds import RunWorld
from irl_gym.mdp.episodes import Episode
from irl_gym.mdp.rewards import TabularReward
from irl_gym.runs.certificates import read_certificate
from irl_gym.runs.experiment import Experiment, as_config
from irl_gym.runs.identity import claim, record_dataset, record_start, write_environment, write_version
from irl_gym.runs.named_parts import environment_of
from irl_gym.runs.scorecard import TOLD_STAGES, read_metrics
from irl_gym.runs.supply import missing, supplied
from irl_gym.tables.table_files import TABLE

UNFINISHED = 0.999
"""Share of a stage that is told at most before its end."""


class Loop:
    """One run: the stages, in order, over a folder. Whoever makes it holds the folder (`own_files.held`).

    It supplies what stages need (`needs`): its fields and properties, and those of the world and the experiment. What a stage
    left is read from the folder, so that a run that continues sees what one in a single go sees.

    Args:
        experiment: what to do.
        out: the folder.
        on_progress: told how far each stage is.
        command: the command that reproduces the run; None where it is started from Python.

    Raises:
        UnknownEnvironment: no such environment.
        NotTrusted: the dataset names more than a registered environment, and is not trusted.
        NotTabular, NotDiscrete: no table can be made, and the learner needs one.
        DatasetMismatch: the dataset was recorded in another environment.
        RunConflict: the folder holds another run.
        RunNewer: the folder holds a run of a newer version.
    """

    experiment: Experiment
    """What to do."""
    env: gym.Env
    """The environment."""
    world: RunWorld
    """Where it is: with a table, or stepped."""
    folder: RunFolder
    """The folder of the run."""
    path: Path
    """Of the folder."""
    report_progress: OnProgress
    """Told by stages how far they are; their ends are told when what they made is in its place."""
    config: Mapping[str, Any]
    """The experiment as json."""

    def __init__(
        self,
        experiment: Experiment,
        out: str | os.PathLike,
        on_progress: OnProgress | None = None,
        command: Sequence[str] | None = None,
    ):
        self.experiment = experiment
        self._told = on_progress or (lambda stage, share, told: None)
        self.report_progress = lambda stage, share, told: self._told(stage, share and min(share, UNFINISHED), told)
        self._told("table", 0.0, "")
        start = time.perf_counter()
        for features in (getattr(experiment.learner, "features", None), experiment.features):
            check_savable(features)
        self.env = environment_of(
            experiment.env_id, experiment.env_kwargs, experiment.dataset, experiment.dataset_root,
            start_seeds=experiment.start_seeds, reveal=experiment.reveal, trust_dataset=experiment.trust_dataset,
        )  # fmt: skip
        path, config = self.path, self.config = Path(out), experiment.to_json()
        claim(path, config)
        self.world = place_of(experiment, self.env, path, lambda share, told: self.report_progress("table", share, told))
        self.table_seconds = time.perf_counter() - start
        self.folder = RunFolder(path, config)
        write_version(path, command)
        write_environment(path, self.env, self.env_id, None if self.env.spec is None else as_config(self.env.spec.kwargs))
        table_kept = (path / TABLE).exists()
        self.world.keep_table(path)
        record_start(path, table_kept=table_kept)
        states = self.world.states
        self._told("table", 1.0, "none, as it is stepped" if states is None else counted(states.n_states))

    def stage(self, name: str) -> dict[str, Any]:
        """Run one stage, or read its record if it was finished before."""
        self._told(name, 0.0, "")
        record = self.folder.run(name, lambda folder: self._made(name, folder))
        stages.clear(self.path, name)
        self._told(name, 1.0, "kept" if record.get("kept") else "")
        return record

    def _made(self, name: str, folder: Path) -> dict[str, Any]:
        """Make a stage in a folder; what is recorded of it."""
        record: dict[str, Any] = {}
        for make in MAKERS[name]:
            if missing(make, *self.sources, folder=folder) is None:
                record |= supplied(make, *self.sources, folder=folder)
        return record

    @property
    def sources(self) -> tuple[Any, ...]:
        """Who supplies what stages need, in this order."""
        return self, self.world, self.experiment

    # What stages need: first what there is from the start, then what they left.

    @property
    def env_id(self) -> str | None:
        """Of the environment."""
        return self.experiment.env_id or (None if self.env.spec is None else self.env.spec.id)

    @property
    def teacher(self) -> Planner | None:
        """Who plans the expert; None where its episodes are given."""
        return (self.experiment.expert or self.world.expert()) if self.experiment.dataset is None else None

    @property
    def simulator(self) -> Simulator:
        """The environment, and who solves it for a reward."""
        solver = self.experiment.inner or self.world.expert()
        return Simulator(self.env, solver, self.world.gamma, self.world.table, self.world.num_envs)

    @property
    def retrainer(self) -> Planner:
        """Who plans for the learned reward, or learns under it."""
        return self.experiment.retrain or self.world.planner(shaped=self.experiment.shaping)

    @cached_property
    def expert(self) -> Any:
        """The expert: (S,) actions or (S, A) of a table, else a policy; None where only its episodes are known."""
        return self.world.load(self.folder, "expert") if self.stage("expert")["files"] else None

    @cached_property
    def given(self) -> list[Episode] | None:
        """The episodes of a dataset, as they are; None where none was given."""
        if (asked := self.experiment).dataset is None:
            return None
        record_dataset(self.path, found := load_minari(asked.dataset, root=asked.dataset_root))
        return list(read_minari(found, env=self.env, after_end=asked.after_end))

    @cached_property
    def demonstrations(self) -> list[Episode]:
        """The expert's episodes."""
        if self.given is not None:
            return self.world.known(self.given, self.experiment.after_end)
        return list(read_minari(self.stage("demonstrations")["dataset_id"], root=self.path / "dataset"))

    @cached_property
    def seen(self) -> ShownPolicy | None:
        """What the episodes show of the expert in the table; None where a learner is given its whole policy."""
        return self.world.seen(self.demonstrations) if self.experiment.from_episodes else None

    @cached_property
    def problem(self) -> Problem:
        """What the learner is given of all that is known: the parts that it needs. Nothing else is worked out."""
        asked, world, needs = self.experiment, self.world, self.experiment.learner.needs
        parts: dict[str, Callable[[], Any]] = {
            "demonstrations": lambda: self.demonstrations,
            "expert": lambda: None if asked.from_episodes else self.expert,
            "environment": lambda: self.simulator,
            "oracle": lambda: None if asked.dataset else Oracle(world.actor(self.expert, asked.seed), not asked.epsilon),
            "dynamics": lambda: world.mdp,
            "reward": lambda: world.true,
            "features": lambda: asked.features,
            "gamma": lambda: world.gamma,
            "horizon": lambda: world.horizon,
            "also": lambda: (),
        }
        problem = Problem(Spaces(self.env.observation_space, self.env.action_space, world.states), **needs.worked_out(parts))
        return needs.with_actions(problem, asked.learner)

    @property
    def known_expert(self) -> Any:
        """What a learner of tables is given of the expert: its policy, or the most frequent actions, NaN where not seen."""
        return self.expert if self.seen is None else self.seen.policy

    @cached_property
    def outcome(self) -> Outcome:
        """What the learner gives, worked out now."""
        learner = self.experiment.learner
        found: Any = stages.learned(learner, self.problem, self.experiment.seed, self.path)
        if not isinstance(found, Outcome):
            raise InvalidParameter(f"{type(learner).__name__}.learn gave {a_type(found)}: expected an Outcome.")
        return found

    @cached_property
    def solved(self) -> Mapping[str, Any]:
        """What was recorded as the reward was learned."""
        return self.stage("reward")

    @cached_property
    def learned(self) -> TabularReward | LinearReward | None:
        """The recovered reward; None of a learner of policies alone."""
        return self.folder.load(REWARD, load_reward) if REWARD in self.stage("reward")["files"] else None

    @cached_property
    def learned_policy(self) -> Any:
        """The learner's own policy, as `agent`; None of a learner of rewards alone. One that no file keeps is learned again,
        from the same seed, where a run is continued.
        """
        record = self.stage("reward")
        if any(name.startswith(LEARNED) for name in record["files"]):
            return self.world.load(self.folder, LEARNED)
        return self.outcome.policy if record.get("policy", False) else None

    @cached_property
    def tabular(self) -> TabularReward | None:
        """The recovered reward in the table."""
        return None if self.learned is None else self.world.tabular(self.learned)

    @property
    def weights(self) -> LinearReward | None:
        """The recovered reward of observations, where there is no table."""
        return None if self.learned is None else self.world.weights(self.learned)

    @cached_property
    def certificate(self) -> Mapping[str, Any]:
        """The content of certificate.json."""
        return self.folder.load("certificate.json", read_certificate)

    @cached_property
    def agent(self) -> Any:
        """The retrained agent, deterministic: (S,) actions of a table, else a policy; None where there is no reward."""
        return None if self.learned is None else self.world.load(self.folder, "agent")

    @cached_property
    def clone(self) -> Any:
        """A copy of the demonstrations, as `agent`; None where the learner's policy is one, or they could not be copied."""
        return self.world.load(self.folder, CLONE) if self.stage("clone")["files"] else None

    @cached_property
    def curve(self) -> Curve:
        """What the agent was worth as it trained; without points where it was planned exactly, or there is none."""
        return NO_CURVE if self.learned is None else self.folder.load("learning_curve.csv", read_curve)

    @property
    def records(self) -> Mapping[str, Mapping[str, Any]]:
        """What was recorded of the stages that metrics.json tells of."""
        return {name: self.stage(name) for name in TOLD_STAGES}

    @cached_property
    def judged(self) -> Mapping[str, Any]:
        """The content of metrics.json."""
        return self.folder.load("metrics.json", read_metrics)
