"""The stages of the loop, in order, over a run folder.

    table           `tabulate` or `discretize`: P, d0 and the true reward; none where the environment can only be stepped. An
                    enumeration that was killed is continued, and a table that was made is kept
    expert          a planner on the true reward; or what a dataset says of the expert's policy
    demonstrations  episodes of the expert, a Minari dataset; or the dataset that was given
    reward          a learner: from P and the expert's policy (Ng & Russell, sections 3 and 4), or from episodes (section 5)
    agent           a planner that sees only the learned reward, on a table shaped by its expected advantage
    metrics         values under the true reward, exact on tables, and returns of episodes in the environment itself
    figures         rewards, values, policies, learning curve
    record          films of expert and agent, the map, the figures as csv
    ambiguity       how far the reward is left open, and what the doctor says of it
    report          report.html
The true reward enters the table, the expert and the judging only; the learning curve judges, it does not steer.
"""

import os
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from irl_gym import figures, final_stages
from irl_gym.choices import environment_of
from irl_gym.claims import claim, record_start, write_environment, write_version
from irl_gym.curves import write_curve
from irl_gym.datasets import load_minari, read_minari, write_minari
from irl_gym.demonstrated import most_frequent, visits
from irl_gym.demonstrations import EmpiricalPolicy, Episode, empirical_policy
from irl_gym.endings import in_table, left_out
from irl_gym.evaluation import evaluate
from irl_gym.experiment import Experiment, as_config
from irl_gym.given import FromFile
from irl_gym.glances import Glances
from irl_gym.learners.base import IRLResult, Learner
from irl_gym.learners.feature import FeatureLP
from irl_gym.learners.finite import FiniteLP
from irl_gym.learners.trajectory import TrajectoryLP
from irl_gym.linear_reward import LinearReward, check_savable, load_reward
from irl_gym.logs import log_scalars, logged
from irl_gym.minari_files import dataset_name, unkept
from irl_gym.places import place_of
from irl_gym.planners import SB3, Agent, Planner
from irl_gym.policies import Policy
from irl_gym.rewards import TabularReward
from irl_gym.run_folder import LOGS, RunFolder, read_json, write_json
from irl_gym.shaping import ExpectedAdvantage, Transform, Unchanged, typical_loss
from irl_gym.simulator import Simulator
from irl_gym.table_files import TABLE, keep_table
from irl_gym.worlds import SteppedWorld, TableWorld

OnProgress = Callable[[str, float], None]
"""Called with a stage and the share of it that is done, from 0 to 1."""


class Loop:
    """One run: the stages, in order, over a folder. Whoever makes it holds the folder (`own_files.held`).

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

    def __init__(
        self,
        experiment: Experiment,
        out: str | os.PathLike,
        on_progress: OnProgress | None = None,
        command: Sequence[str] | None = None,
    ):
        self.experiment = experiment
        self.report_progress = on_progress or (lambda stage, share: None)
        self.report_progress("table", 0.0)
        start = time.perf_counter()
        check_savable(getattr(experiment.learner, "features", None))
        self.env = environment_of(
            experiment.env_id, experiment.env_kwargs, experiment.dataset, experiment.dataset_root,
            start_seeds=experiment.start_seeds, reveal=experiment.reveal, trust_dataset=experiment.trust_dataset,
        )  # fmt: skip
        path, config = Path(out), experiment.to_json()
        claim(path, config)
        self.world: TableWorld | SteppedWorld = place_of(
            experiment, self.env, path, lambda share: self.report_progress("table", share)
        )
        self.table_seconds = time.perf_counter() - start
        self.folder = RunFolder(path, config)
        write_version(path, command)
        write_environment(path, self.env, self.env_id, None if self.env.spec is None else as_config(self.env.spec.kwargs))
        table_kept = (path / TABLE).exists()
        if isinstance(self.world, TableWorld):
            keep_table(self.world.table, path)
        record_start(path, table_kept=table_kept)
        self.report_progress("table", 1.0)

    def stage(self, name: str) -> dict[str, Any]:
        """Run one stage, or read its record if it was finished before."""
        makers = {
            "expert": self._make_expert,
            "demonstrations": self._make_demonstrations,
            "reward": self._make_reward,
            "agent": self._make_agent,
            "metrics": self._make_metrics,
            "figures": self._make_figures,
            "record": lambda folder: final_stages.record(self, folder),
            "ambiguity": lambda folder: final_stages.ambiguity(self, folder),
            "report": lambda folder: final_stages.report(self, folder),
        }
        self.report_progress(name, 0.0)
        record = self.folder.run(name, makers[name])
        self.report_progress(name, 1.0)
        return record

    @property
    def env_id(self) -> str | None:
        """Of the environment."""
        return self.experiment.env_id or (None if self.env.spec is None else self.env.spec.id)

    # Results of finished stages, read from the folder: so a run that continues sees what one in a single go sees.

    @cached_property
    def expert(self) -> Any:
        """The expert: (S,) actions or (S, A) of a table, else a policy; None where only its episodes are known."""
        if self.experiment.dataset is not None and isinstance(self.world, SteppedWorld):
            return None
        return self.world.load(self.folder, "expert")

    @cached_property
    def seen(self) -> EmpiricalPolicy | None:
        """What the episodes show of the expert in the table; None where a learner is given its whole policy."""
        if not self.experiment.from_episodes or not isinstance(self.world, TableWorld):
            return None
        return empirical_policy(self.demonstrations, self.world.table.states, self.world.table.mdp.n_actions)

    @property
    def known_expert(self) -> Any:
        """What a learner of tables is given of the expert: its policy, or the most frequent actions, NaN where not seen."""
        return self.expert if self.seen is None else most_frequent(self.seen)

    @cached_property
    def agent(self) -> Any:
        """The retrained agent, deterministic: (S,) actions of a table, else a policy."""
        return self.world.load(self.folder, "agent")

    @cached_property
    def learned(self) -> TabularReward | LinearReward:
        """The recovered reward."""
        return self.folder.load("reward.npz", load_reward)

    @cached_property
    def demonstrations(self) -> list[Episode]:
        """The expert's episodes."""
        asked = self.experiment
        if asked.dataset is not None:
            if not isinstance(self.world, TableWorld) or not self.world.table.evidence.exact:
                return self._given
            return list(in_table(self._given, self.world.table.mdp, self.world.table.states, asked.after_end))
        return list(read_minari(self.stage("demonstrations")["dataset_id"], root=self.folder.path / "dataset"))

    @cached_property
    def _given(self) -> list[Episode]:
        """The episodes of the dataset that was given, as they are."""
        asked = self.experiment
        return list(read_minari(str(asked.dataset), env=self.env, root=asked.dataset_root, after_end=asked.after_end))

    @cached_property
    def certificate(self) -> dict[str, Any]:
        """The content of certificate.json."""
        return self.folder.load("certificate.json", read_json)

    @cached_property
    def folder_metrics(self) -> dict[str, Any]:
        """The content of metrics.json."""
        return self.folder.load("metrics.json", read_json)

    def _share(self, stage: str, planner: Planner) -> Callable[[int, Policy], None]:
        total = max(1, getattr(planner, "total_timesteps", 1))
        return lambda steps, _: self.report_progress(stage, min(1.0, steps / total))

    def _make_expert(self, folder: Path) -> dict[str, Any]:
        if self.experiment.dataset is None:
            planner = self.experiment.expert or self.world.expert()
            policy = self.world.train(logged(planner, folder / LOGS / "expert"), None, self._share("expert", planner))
            self.world.keep(policy, folder, "expert", self.experiment.epsilon)
            made = {"environment_steps": 0, **planner.trained()} if isinstance(planner, FromFile) else _steps(policy)
            return {"planner": type(planner).__name__, **made}
        if self.seen is not None:
            np.savez(folder / "expert.npz", actions=most_frequent(self.seen))
            return {"planner": "most frequent action of the dataset", "states_seen": int(self.seen.visited.sum())}
        return {"planner": "unknown: the dataset's"}

    def _make_demonstrations(self, folder: Path) -> dict[str, Any]:
        asked = self.experiment
        if asked.dataset is not None:
            taken = sum(map(len, self.demonstrations))
            recorded = {"dataset_id": asked.dataset, "episodes": len(self.demonstrations), "steps_recorded": taken}
            steps = load_minari(asked.dataset, root=asked.dataset_root).total_steps if asked.after_end == "cut" else None
            return recorded | left_out(self._given, self.demonstrations, steps)
        recorded = self.world.episodes(self.expert, asked.episodes, asked.seed)
        chance = self.world.episodes(self.world.random, asked.eval_episodes, asked.seed)
        dataset_id = dataset_name(str(asked.env_id))
        root = folder / "dataset"
        root.mkdir()
        lost = unkept(self.env.spec)
        about = f"Expert demonstrations of {asked.env_id}, gamma {asked.gamma}, seed {asked.seed}."
        write_minari(
            recorded, dataset_id, None if lost else self.env, root=root, algorithm=self.stage("expert")["planner"],
            observation_space=self.env.observation_space, action_space=self.env.action_space,
            description=f"{about} {lost}" if lost else about,
            code_permalink="scripts/recover_and_retrain.py of irl_gym",
            random_return=float(np.mean([episode.total_reward for episode in chance])),
            expert_return=float(np.mean([episode.total_reward for episode in recorded])),
        )  # fmt: skip
        return {
            "dataset_id": dataset_id,
            "episodes": len(recorded),
            "environment_steps": sum(map(len, recorded)),
            "seed": asked.seed,
            **({"no_environment": lost} if lost else {}),
        }

    def _make_reward(self, folder: Path) -> dict[str, Any]:
        result = self._learn(self.experiment.learner)
        result.reward.save(folder / "reward.npz")
        write_json(folder / "certificate.json", result.certificate.to_json())
        return {"learner": type(self.experiment.learner).__name__, **result.record()}

    def _learn(self, learner: Learner) -> IRLResult:
        """Give a learner what it is of: a table and a policy, or a simulator and episodes."""
        world = self.world
        if isinstance(learner, TrajectoryLP):
            table = world.table if isinstance(world, TableWorld) else None
            solver = self.experiment.inner or world.expert()
            result = learner.fit(Simulator(self.env, solver, world.gamma, table, world.num_envs), self.demonstrations)
            return replace(result, stats={**result.stats, "inner": type(solver).__name__})
        assert isinstance(world, TableWorld)  # `place_of` makes no other world for other learners
        if isinstance(learner, FeatureLP):
            return learner.fit(world.table.mdp, self.known_expert, states=world.table.states)
        if isinstance(learner, FiniteLP) and self.seen is not None:
            return learner.fit(world.table.mdp, self.known_expert, visits=visits(self.seen))
        return learner.fit(world.table.mdp, self.known_expert)

    @property
    def shaped(self) -> bool:
        """Is the agent retrained on the expected advantage? That takes a table."""
        return self.experiment.shaping and isinstance(self.world, TableWorld)

    def transform(self, reward: TabularReward, mdp: Any) -> Transform:
        """What is done to the learned reward before retraining; losses count up to the margin cap, or a typical loss."""
        if not self.shaped:
            return Unchanged()
        return ExpectedAdvantage(self.certificate.get("margin_cap") or typical_loss(reward, mdp))

    def _make_agent(self, folder: Path) -> dict[str, Any]:
        world, reward = self.world, self.learned
        planner = self.experiment.retrain or world.planner(shaped=self.shaped)
        if isinstance(world, TableWorld):
            plain = world.tabular(reward)
            reward = self.transform(plain, world.table.mdp).apply(plain, world.table.mdp)
        glances = Glances(world, self._share("agent", planner))
        log = folder / LOGS / "retrained"
        policy = world.train(logged(planner, log), reward, glances.see)
        world.keep(policy, folder, "agent")
        curve = glances.curve()
        write_curve(curve, folder / "learning_curve.csv")
        if isinstance(planner, SB3):
            log_scalars(log, curve.steps, {"loop/true_value": curve.value, "loop/mean_return": curve.mean})
        return {"planner": type(planner).__name__, **_steps(policy)}

    def _make_metrics(self, folder: Path) -> dict[str, Any]:
        content = evaluate(self)
        write_json(folder / "metrics.json", content)
        return {}

    def _make_figures(self, folder: Path) -> dict[str, Any]:
        made = folder / "figures"
        made.mkdir()
        figures.draw(self, made)
        return {}


def _steps(policy: Policy) -> dict[str, int]:
    """Environment steps that a policy was trained on."""
    return {"environment_steps": policy.model.num_timesteps if isinstance(policy, Agent) else 0}
