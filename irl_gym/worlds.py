"""Where a run of the loop takes place: a table, exact or of cells, or an environment that can only be stepped.

Both train agents, run episodes and judge policies, in the same words. On a table a policy is its actions (S,) or probabilities
(S, A), and values are exact; elsewhere it is whatever has SB3's `predict`, and values are means of episodes.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.vec_env import VecEnv

from irl_gym import metrics
from irl_gym.closing import close
from irl_gym.demonstrations import Episode, collect, collect_from_table
from irl_gym.errors import InvalidParameter
from irl_gym.linear_reward import LinearReward
from irl_gym.noise import Noisy, noisy
from irl_gym.planners import FOR_ADVANTAGES, FOR_CONTROL, SB3, Agent, Planner, ValueIteration, load_agent, tabular_actions
from irl_gym.policies import Policy, TabularPolicy, as_distribution, generator, load_actions
from irl_gym.rewarded_vec_env import check_steppable, rewarded
from irl_gym.rewards import TabularReward
from irl_gym.rollouts import maker_of, run_episodes
from irl_gym.run_folder import RunFolder, read_json, write_json
from irl_gym.run_schema import Trained
from irl_gym.simulator import RandomPolicy
from irl_gym.tabular_vec_env import TabularVecEnv, shows_rows
from irl_gym.tabulation import Tabulation

DEFAULT_EPISODE_STEPS = 500
"""Time limit of episodes in environments that have none."""
GLANCE = 20
"""Episodes for a point of the learning curve, where there is no table."""

Progress = Callable[[int, Policy], None] | None


def step_limit(env: gym.Env) -> int:
    """Steps after which an episode is truncated."""
    return (env.spec.max_episode_steps if env.spec is not None else None) or DEFAULT_EPISODE_STEPS


@dataclass(frozen=True, eq=False)
class TableWorld:
    """An environment with a table."""

    env: gym.Env
    """The environment."""
    table: Tabulation
    """Exact, or of the cells of a grid: then values are the grid's, and episodes the environment's own."""
    num_envs: int
    """Copies that SB3 trains on."""
    seed: int
    """Of agents."""
    horizon: int | None = None
    """Steps that values count; None for all. The time limit, where the expert's value is that of episodes that were cut."""

    @property
    def gamma(self) -> float:
        """Discount."""
        return self.table.mdp.gamma

    @property
    def random(self) -> np.ndarray:
        """(S, A) the random policy."""
        mdp = self.table.mdp
        return np.full((mdp.n_states, mdp.n_actions), 1 / mdp.n_actions)

    def planner(self, *, shaped: bool) -> Planner:
        """PPO, with settings that suit the reward."""
        return SB3(hyperparameters=FOR_ADVANTAGES if shaped else {})

    def expert(self) -> Planner:
        """Exact planning."""
        return ValueIteration()

    def train(self, planner: Planner, reward: Any, progress: Progress = None) -> Policy:
        """A policy for a reward, the true one if None, from steps of the table."""
        paid = self.table.reward if reward is None else self.tabular(reward)
        env = TabularVecEnv(
            self.table.mdp, paid, num_envs=self.num_envs, max_episode_steps=step_limit(self.env),
            states=self.table.states, show_rows=shows_rows(self.table.states), seed=self.seed,
        )  # fmt: skip
        return planner.plan(env, gamma=self.gamma, seed=self.seed, progress=progress)

    def tabular(self, reward: TabularReward | LinearReward) -> TabularReward:
        """A reward of either kind in the table."""
        return reward.tabular(self.table.states) if isinstance(reward, LinearReward) else reward

    def keep(self, policy: Policy, folder: Path, name: str, epsilon: float = 0.0) -> None:
        """Write the actions, or with noise or of a table with several the probabilities; an agent in SB3's zip too."""
        if isinstance(policy, Agent):
            policy.save(folder / f"{name}.zip")
        actions: Any = tabular_actions(policy, self.table.states)
        if isinstance(policy, TabularPolicy) and not (policy.probabilities.max(axis=1) == 1).all():
            actions = policy.probabilities
        if epsilon:
            actions = noisy(actions, epsilon, self.table.mdp.n_actions)
        np.savez(folder / ("expert.npz" if name == "expert" else f"{name}_policy.npz"), actions=actions)

    def load(self, folder: RunFolder, name: str) -> np.ndarray:
        """(S,) actions; (S, A) probabilities of an expert read from data, NaN where nothing is known of it."""
        return folder.load("expert.npz" if name == "expert" else f"{name}_policy.npz", load_actions)

    def episodes(self, policy: Any, n: int, seed: int) -> list[Episode]:
        """Episodes: from the table where it is exact and holds every reward, else by stepping the environment."""
        table, limit = self.table, step_limit(self.env)
        if table.evidence.exact and table.payments.entries is not None:
            drawn = collect_from_table(
                table.mdp, table.payments.entries, table.states, policy, n, seed=seed, max_episode_steps=limit
            )
            return list(drawn)
        distribution = as_distribution(policy, table.mdp.n_states, table.mdp.n_actions)
        actor = TabularPolicy(distribution, table.states, seed)
        if table.evidence.exact:
            return list(collect(self.env, actor, n, seed=seed, max_episode_steps=limit))
        return run_episodes(self.env, actor, n, seed=seed, most=limit, deterministic=False)

    def value(self, policy: Any) -> float:
        """Exact discounted value from d0 under the true reward; the grid's, where the table is of cells."""
        return metrics.policy_value(self.table.mdp, self.table.reward, policy, self.horizon)

    def glance(self, policy: Policy) -> float:
        """The same, of a policy in training."""
        return self.value(tabular_actions(policy, self.table.states))


@dataclass(frozen=True, eq=False)
class SteppedWorld:
    """An environment that can only be reset and stepped."""

    env: gym.Env
    """The environment, with a spec to make copies from."""
    gamma: float
    """Discount."""
    num_envs: int
    """Copies that SB3 trains on."""
    eval_episodes: int
    """Episodes of which a value is the mean."""
    seed: int
    """Of agents and episodes."""

    def __post_init__(self) -> None:
        check_steppable(self.env)
        if self.env.spec is None:
            raise InvalidParameter(f"{self.env} has no spec: expected an environment that gymnasium.make made. Register it.")

    @property
    def random(self) -> RandomPolicy:
        """Uniformly random actions."""
        space: Any = self.env.action_space
        return RandomPolicy(int(space.n), generator(self.seed))

    def planner(self, *, shaped: bool) -> Planner:
        """PPO, with settings that suit the observations."""
        return self.expert()

    def expert(self) -> Planner:
        """PPO, with settings that suit the observations."""
        if isinstance(self.env.observation_space, spaces.Discrete):
            return SB3(total_timesteps=FOR_CONTROL.total_timesteps)
        return FOR_CONTROL

    def check(self, name: str, planner: Planner | None) -> None:
        """Check that a planner needs no table.

        Raises:
            InvalidParameter: ValueIteration, which does.
        """
        if isinstance(planner, ValueIteration):
            raise InvalidParameter(
                f"{name} is value-iteration, but {self.env} has no table: expected an SB3 agent, such as ppo. Or make a table "
                "of cells with bins."
            )

    def train(self, planner: Planner, reward: Any, progress: Progress = None) -> Policy:
        """A policy for a reward, the true one if None, from steps of the environment."""
        env: VecEnv = make_vec_env(maker_of(self.env), self.num_envs, seed=self.seed)
        if reward is not None:
            env = rewarded(env, reward, self.gamma)
        try:
            return planner.plan(env, gamma=self.gamma, seed=self.seed, progress=progress)
        finally:
            close(env)

    def keep(self, policy: Policy, folder: Path, name: str, epsilon: float = 0.0) -> None:
        """Write an agent in SB3's zip, its algorithm and its noise as json."""
        if not isinstance(policy, Agent):
            raise InvalidParameter(f"{type(policy).__name__} cannot be kept: expected an agent of SB3. Use SB3 as planner.")
        policy.save(folder / f"{name}.zip")
        write_json(folder / f"{name}.json", {"algorithm": type(policy.model).__name__, "epsilon": epsilon})

    def load(self, folder: RunFolder, name: str) -> Policy:
        """The agent: a file of this run's own, so SB3 may load it."""
        made: Any = folder.load(f"{name}.json", lambda path: read_json(path, Trained))
        agent = folder.load(f"{name}.zip", lambda path: load_agent(path, made["algorithm"]))
        space: Any = self.env.action_space
        return Noisy(agent, made["epsilon"], int(space.n), self.seed) if made["epsilon"] else agent

    def episodes(self, policy: Any, n: int, seed: int) -> list[Episode]:
        """Episodes of a policy, deterministic but for the random one and for noise, which is drawn anew from the seed."""
        if isinstance(policy, Noisy):  # else it would depend on the episodes before, and so on where a run was continued
            policy = replace(policy, seed=seed)
        return run_episodes(self.env, policy, n, seed=seed, most=step_limit(self.env))

    def value(self, policy: Any) -> float:
        """Mean discounted return of `eval_episodes` episodes."""
        return discounted_mean(self.episodes(policy, self.eval_episodes, self.seed + 7_919), self.gamma)

    def glance(self, policy: Policy) -> float:
        """The same of a few episodes."""
        return discounted_mean(self.episodes(policy, GLANCE, self.seed + 7_919), self.gamma)


def discounted_mean(episodes: list[Episode], gamma: float) -> float:
    """Mean discounted return."""
    return float(np.mean([gamma ** np.arange(len(one)) @ one.rewards for one in episodes]))
