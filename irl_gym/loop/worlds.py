"""Where a run of the loop takes place: a table, exact or of cells, or an environment that can only be stepped.

Both train agents, run episodes and judge policies, in the same words, so that nobody asks which of the two it is; what only a
table has is None elsewhere. On a table a policy is its actions or probabilities, and values are exact (`table_world`); else it
is whatever has SB3's `predict`, and values are means of episodes. Axes: T steps.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.vec_env import VecEnv

from irl_gym.agents.neural_clone import NeuralClone
from irl_gym.agents.neural_proof import NeuralProof
from irl_gym.agents.noise import Noisy
from irl_gym.agents.planners import FOR_CONTROL, SB3, Agent, Planner, load_agent
from irl_gym.agents.simulator import RandomPolicy
from irl_gym.demonstrations.choices import AfterEnd
from irl_gym.environments.closing import close
from irl_gym.environments.rewarded_vec_env import check_steppable, rewarded
from irl_gym.environments.rollouts import maker_of, run_episodes
from irl_gym.errors import InvalidParameter, a_type
from irl_gym.features.linear_reward import LinearReward
from irl_gym.files.run_folder import RunFolder, read_json, write_json
from irl_gym.files.run_schema import Trained
from irl_gym.learners.base import Outcome
from irl_gym.learners.problem import Problem
from irl_gym.loop.table_world import Choose, Glance, Progress, TableWorld, step_limit
from irl_gym.mdp.episodes import Episode
from irl_gym.mdp.policies import Policy, generator
from irl_gym.mdp.rewards import TabularReward
from irl_gym.spaces.batches import batch_of_one

GLANCE = 20
"""Episodes for a point of the learning curve, where there is no table."""
COPYING = 4_000
"""Minibatches, at most, that copying demonstrations by a network takes: a few seconds beside the minutes of an agent."""
BATCH = 128
"""Steps of a minibatch, at least: where there are more demonstrations than so many minibatches hold, each has more of them."""


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
    table: ClassVar[None] = None
    """There is none, nor what follows from one."""
    mdp: ClassVar[None] = None
    states: ClassVar[None] = None
    true: ClassVar[None] = None
    layout: ClassVar[None] = None
    horizon: ClassVar[None] = None
    cloner: ClassVar[type] = NeuralClone
    """What copies demonstrations."""

    def __post_init__(self) -> None:
        check_steppable(self.env)
        if self.env.spec is None:
            raise InvalidParameter(f"{self.env} has no spec: expected an environment that gymnasium.make made. Register it.")

    @property
    def limit(self) -> int:
        """Steps after which episodes are cut."""
        return step_limit(self.env)

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

    def train(self, planner: Planner, reward: Any, progress: Progress = None) -> Policy:
        """A policy for a reward, the true one if None, from steps of the environment."""
        env: VecEnv = make_vec_env(maker_of(self.env), self.num_envs, seed=self.seed)
        if reward is not None:
            env = rewarded(env, reward, self.gamma)
        try:
            return planner.plan(env, gamma=self.gamma, seed=self.seed, progress=progress)
        finally:
            close(env)

    def tabular(self, reward: TabularReward | LinearReward) -> None:
        """A reward in the table: there is none."""

    def weights(self, reward: TabularReward | LinearReward) -> LinearReward | None:
        """A reward of observations: all that is known of it."""
        return None if reward.alpha is None else reward

    def paid(self, reward: Any, *, shaped: bool, margin_cap: float | None) -> Any:
        """What an agent is paid: the reward as it is."""
        return reward

    def pays(
        self,
        reward: TabularReward | LinearReward | None,
        observations: Sequence[Any],
        actions: Sequence[int | None],
        *,
        terminated: bool,
    ) -> tuple[list[int | None], np.ndarray]:
        """No rows of T + 1 observations, and (T,) what a reward of them pays on arrival; NaN of another."""
        known = None if reward is None else self.weights(reward)
        paid = [np.nan if known is None else known.of(batch_of_one(one))[0] for one in observations[1:]]
        return [None] * len(observations), np.array(paid, dtype=np.float64)

    def clone(self, problem: Problem, tell: Callable[[float], None]) -> Outcome[None, NeuralProof]:
        """A copy of demonstrations, by a network that is shown all of them."""
        learner = copier(sum(map(len, problem.demonstrations or ())))
        return learner.learn(problem, generator(self.seed), lambda epoch, *_: tell(epoch / learner.epochs))

    def keep_table(self, folder: Path) -> None:
        """Write nothing."""

    def can_keep(self, policy: Any) -> bool:
        """Is there a file for it? Of policies that act, agents of SB3 have one.

        Raises:
            InvalidParameter: it cannot act on observations.
        """
        if not isinstance(policy, Policy):
            raise InvalidParameter(
                f"the policy is {a_type(policy)}: expected, where there is no table, one with `predict`. Wrap a "
                "function of observations in `irl_gym.agents.experts.Acting`."
            )
        return isinstance(policy, Agent)

    def keep(self, policy: Policy, folder: Path, name: str, epsilon: float = 0.0) -> None:
        """Write an agent in SB3's zip, its algorithm and its noise as json."""
        if not isinstance(policy, Agent):
            raise InvalidParameter(
                f"{type(policy).__name__} cannot be kept: expected, where there is no table, an agent of SB3. Use SB3 as "
                "planner."
            )
        policy.save(folder / f"{name}.zip")
        write_json(folder / f"{name}.json", {"algorithm": type(policy.model).__name__, "epsilon": epsilon})

    def load(self, folder: RunFolder, name: str) -> Policy:
        """The agent: a file of this run's own, so SB3 may load it."""
        made: Any = folder.load(f"{name}.json", lambda path: read_json(path, Trained))
        agent = folder.load(f"{name}.zip", lambda path: load_agent(path, made["algorithm"]))
        space: Any = self.env.action_space
        return Noisy(agent, made["epsilon"], int(space.n), self.seed) if made["epsilon"] else agent

    def known(self, episodes: list[Episode], after_end: AfterEnd) -> list[Episode]:
        """Recorded episodes as they are."""
        return episodes

    def seen(self, episodes: list[Episode]) -> None:
        """How often each action was taken in each state: there are no states to count by."""

    def actor(self, policy: Any, seed: int) -> Policy:
        """A policy that acts on observations, as if it had not acted before."""
        return _anew(policy, seed)

    def chooser(self, policy: Any, seed: int) -> Choose:
        """What acts as in the episodes that judge a policy."""
        actor = self.actor(policy, seed)
        return lambda observation: int(np.asarray(actor.predict(observation, deterministic=True)[0]))

    def episodes(self, policy: Any, n: int, seed: int) -> list[Episode]:
        """Episodes of a policy, deterministic but for the random one and for noise, which is drawn anew from the seed."""
        acting = self.random if isinstance(policy, RandomPolicy) else _anew(policy, seed)
        return run_episodes(self.env, acting, n, seed=seed, most=self.limit)

    def value(self, policy: Any) -> float:
        """Mean discounted return of `eval_episodes` episodes."""
        return discounted_mean(self.episodes(policy, self.eval_episodes, self.seed + 7_919), self.gamma)

    def glance(self, policy: Policy) -> Glance:
        """The same of a few episodes, and their returns."""
        episodes = self.episodes(policy, GLANCE, self.seed + 7_919)
        return discounted_mean(episodes, self.gamma), np.array([episode.total_reward for episode in episodes])

    def returns(self, glanced: Sequence[np.ndarray]) -> tuple[Sequence[np.ndarray], None]:
        """The returns themselves; others are possible."""
        return glanced, None


RunWorld = TableWorld | SteppedWorld
"""Where a run takes place."""


def copier(steps: int) -> NeuralClone:
    """What copies so many steps: in as many epochs as `COPYING` minibatches make, 1 at least and 100 at most."""
    batch = max(BATCH, steps // COPYING)
    return NeuralClone(epochs=min(100, max(1, COPYING * batch // steps)), batch_size=batch, patience=3)


def _anew(policy: Any, seed: int) -> Any:
    """The policy; noise is drawn anew, else it would depend on the episodes before, and so on where a run was continued."""
    return replace(policy, seed=seed) if isinstance(policy, Noisy) else policy


def discounted_mean(episodes: list[Episode], gamma: float) -> float:
    """Mean discounted return."""
    return float(np.mean([gamma ** np.arange(len(one)) @ one.rewards for one in episodes]))
