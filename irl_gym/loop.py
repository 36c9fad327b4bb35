"""The stages of the loop, in order, over a run folder.

    table           `tabulate`: P, d0 and the true reward; checked against `env.step`
    expert          a planner on the true reward
    demonstrations  episodes of the expert, a Minari dataset
    reward          a learner, from P and the expert's policy (Ng & Russell's section 3 takes the complete policy, not episodes)
    agent           a planner that sees only the learned reward, shaped by its expected advantage
    metrics         exact values under the true reward, returns of episodes in the environment itself
    figures         rewards, values, policies, learning curve
The true reward enters the table, the expert and the judging only; the learning curve judges, it does not steer.
"""

import csv
import os
import re
import time
from collections.abc import Callable
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from irl_gym import figures, metrics
from irl_gym._typing import Actions, ActionSets
from irl_gym.datasets import write_minari
from irl_gym.demonstrations import Episode, collect, collect_from_table
from irl_gym.dynamic_programming import policy_iteration, tied
from irl_gym.evaluation import evaluate
from irl_gym.experiment import Experiment
from irl_gym.planners import Agent, Planner, tabular_actions
from irl_gym.policies import Policy, TabularPolicy, as_distribution, support
from irl_gym.rewards import TabularReward
from irl_gym.run_folder import RunFolder, read_json, write_json
from irl_gym.shaping import ExpectedAdvantage, Transform, Unchanged
from irl_gym.tabular_vec_env import TabularVecEnv
from irl_gym.tabulate import make, tabulate
from irl_gym.tabulation import Tabulation

STAGES = ("expert", "demonstrations", "reward", "agent", "metrics", "figures")
"""After the table, which is made anew at each start: it is cheap and exact."""
DEFAULT_EPISODE_STEPS = 500
"""Time limit of episodes in environments that have none."""

OnProgress = Callable[[str, float], None]
"""Called with a stage and the share of it that is done, from 0 to 1."""


class Loop:
    """One run: the stages, in order, over a folder.

    Args:
        experiment: what to do.
        out: the folder.
        on_progress: told how far each stage is.

    Raises:
        UnknownEnvironment, NotTabular, NotDiscrete: no table can be made.
        RunConflict: the folder holds another run.
    """

    def __init__(self, experiment: Experiment, out: str | os.PathLike, on_progress: OnProgress | None = None):
        self.experiment = experiment
        self.env = make(experiment.env_id, **experiment.env_kwargs)
        self.report_progress = on_progress or (lambda stage, share: None)
        self.report_progress("table", 0.0)
        start = time.perf_counter()
        self.table: Tabulation = tabulate(self.env, gamma=experiment.gamma, seed=experiment.seed)
        self.table_seconds = time.perf_counter() - start
        self.folder = RunFolder(out, experiment.to_json())
        self.report_progress("table", 1.0)

    @property
    def limit(self) -> int:
        """Steps after which an episode is truncated."""
        spec = self.env.spec
        return (spec.max_episode_steps if spec is not None else None) or DEFAULT_EPISODE_STEPS

    def stage(self, name: str) -> dict[str, Any]:
        """Run one stage, or read its record if it was finished before."""
        makers = {
            "expert": self._make_expert,
            "demonstrations": self._make_demonstrations,
            "reward": self._make_reward,
            "agent": self._make_agent,
            "metrics": self._make_metrics,
            "figures": self._make_figures,
        }
        self.report_progress(name, 0.0)
        record = self.folder.run(name, makers[name])
        self.report_progress(name, 1.0)
        return record

    # Results of finished stages, read from the folder: so a run that continues sees what one in a single go sees.

    @cached_property
    def expert_actions(self) -> Actions:
        """(S,) the expert."""
        return self.folder.load("expert.npz", _load_actions)

    @cached_property
    def agent_actions(self) -> Actions:
        """(S,) the retrained agent, deterministic."""
        return self.folder.load("agent_policy.npz", _load_actions)

    @cached_property
    def learned(self) -> TabularReward:
        """The recovered reward."""
        return self.folder.load("reward.npz", TabularReward.load)

    @cached_property
    def optimal_set(self) -> ActionSets:
        """(S, A) the expert's optimal set: all optimal actions if it is optimal, else the actions it takes."""
        mdp, reward = self.table.mdp, self.table.reward
        best = policy_iteration(mdp, reward)
        value = self.true_value(self.expert_actions)
        tolerance = metrics.TIE_TOLERANCE * float(np.abs(reward.values).max())
        if value >= float(mdp.d0 @ best.V) - tolerance:
            return tied(best.Q, tolerance)
        return support(self.expert_actions, mdp.n_states, mdp.n_actions)

    def _train(self, planner: Planner, reward: TabularReward, progress: Callable[[int, Policy], None] | None) -> Policy:
        env = TabularVecEnv(
            self.table.mdp, reward, num_envs=self.experiment.num_envs, max_episode_steps=self.limit,
            states=self.table.states, seed=self.experiment.seed,
        )  # fmt: skip
        return planner.plan(env, gamma=self.experiment.gamma, seed=self.experiment.seed, progress=progress)

    def _share(self, stage: str, planner: Planner) -> Callable[[int, Policy], None]:
        total = max(1, getattr(planner, "total_timesteps", 1))
        return lambda steps, _: self.report_progress(stage, min(1.0, steps / total))

    def _make_expert(self, folder: Path) -> dict[str, Any]:
        planner = self.experiment.expert
        policy = self._train(planner, self.table.reward, self._share("expert", planner))
        _save_policy(policy, folder / "expert")
        np.savez(folder / "expert.npz", actions=tabular_actions(policy, self.table.states))
        return {"planner": type(planner).__name__, **_steps(policy)}

    def episodes(self, policy: Any, n: int, seed: int) -> list[Episode]:
        """Episodes of a tabular policy in the environment: from the table where it holds every reward, else by stepping."""
        table = self.table
        if table.payments.entries is not None:
            drawn = collect_from_table(
                table.mdp, table.payments.entries, table.states, policy, n, seed=seed, max_episode_steps=self.limit
            )
            return list(drawn)
        distribution = as_distribution(policy, table.mdp.n_states, table.mdp.n_actions)
        actor = TabularPolicy(distribution, table.states, seed)
        return list(collect(self.env, actor, n, seed=seed, max_episode_steps=self.limit))

    @property
    def uniform(self) -> np.ndarray:
        """(S, A) the random policy."""
        mdp = self.table.mdp
        return np.full((mdp.n_states, mdp.n_actions), 1 / mdp.n_actions)

    def _make_demonstrations(self, folder: Path) -> dict[str, Any]:
        experiment = self.experiment
        recorded = self.episodes(self.expert_actions, experiment.episodes, experiment.seed)
        chance = self.episodes(self.uniform, experiment.eval_episodes, experiment.seed)
        dataset_id = dataset_name(experiment.env_id)
        root = folder / "dataset"
        root.mkdir()
        write_minari(
            recorded, dataset_id, self.env, root=root, algorithm=type(experiment.expert).__name__,
            description=f"Expert demonstrations of {experiment.env_id}, gamma {experiment.gamma}, seed {experiment.seed}.",
            code_permalink="scripts/recover_and_retrain.py of irl_gym",
            random_return=float(np.mean([episode.total_reward for episode in chance])),
            expert_return=float(np.mean([episode.total_reward for episode in recorded])),
        )  # fmt: skip
        return {
            "dataset_id": dataset_id,
            "episodes": len(recorded),
            "environment_steps": sum(map(len, recorded)),
            "seed": experiment.seed,
        }

    def _make_reward(self, folder: Path) -> dict[str, Any]:
        result = self.experiment.learner.fit(self.table.mdp, self.expert_actions)
        result.reward.save(folder / "reward.npz")
        write_json(folder / "certificate.json", result.certificate.to_json())
        return {"status": result.status.value, "objective": result.objective, "stats": dict(result.stats)}

    @cached_property
    def transform(self) -> Transform:
        """What is done to the learned reward before retraining."""
        if not self.experiment.shaping:
            return Unchanged()
        return ExpectedAdvantage(self.certificate["margin_cap"])

    @cached_property
    def certificate(self) -> dict[str, Any]:
        """The content of certificate.json."""
        return self.folder.load("certificate.json", read_json)

    def _make_agent(self, folder: Path) -> dict[str, Any]:
        planner = self.experiment.retrain
        reward = self.transform.apply(self.learned, self.table.mdp)
        share = self._share("agent", planner)
        curve: list[tuple[int, float]] = []

        def watch(steps: int, policy: Policy) -> None:
            share(steps, policy)
            curve.append((steps, self.true_value(tabular_actions(policy, self.table.states))))

        policy = self._train(planner, reward, watch)
        actions = tabular_actions(policy, self.table.states)
        _save_policy(policy, folder / "agent")
        np.savez(folder / "agent_policy.npz", actions=actions)
        with (folder / "learning_curve.csv").open("w", newline="") as file:
            csv.writer(file).writerows([("environment_steps", "true_value"), *curve])
        return {"planner": type(planner).__name__, **_steps(policy)}

    def true_value(self, policy: Any) -> float:
        """Exact discounted value of a tabular policy from d0 under the true reward."""
        return metrics.policy_value(self.table.mdp, self.table.reward, policy)

    def _make_metrics(self, folder: Path) -> dict[str, Any]:
        content = evaluate(self)
        write_json(folder / "metrics.json", content)
        return {}

    def _make_figures(self, folder: Path) -> dict[str, Any]:
        made = folder / "figures"
        made.mkdir()
        figures.draw(self, made)
        return {}


def _load_actions(path: Path) -> np.ndarray:
    with np.load(path, allow_pickle=False) as archive:
        return archive["actions"]


def _save_policy(policy: Policy, stem: Path) -> None:
    """Keep an agent in SB3's own zip; a table of actions needs no more than its npz."""
    if isinstance(policy, Agent):
        policy.save(stem.with_suffix(".zip"))


def _steps(policy: Policy) -> dict[str, int]:
    """Environment steps that a policy was trained on."""
    return {"environment_steps": policy.model.num_timesteps if isinstance(policy, Agent) else 0}


def dataset_name(env_id: str) -> str:
    """The Minari id under which a run's demonstrations are kept."""
    plain = re.sub(r"[^-\w]+", "-", env_id.split(":")[-1]).lower()
    return f"irl_gym/{plain}-expert-v0"
