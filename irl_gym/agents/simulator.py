"""A world that can be run and solved for a reward: what Ng & Russell's section 5 asks for, and no more.

Where there is an exact table its rows are drawn instead of `env.step`, which is the same distribution, many times faster; a
discretisation is only planned on, and the environment itself is run. Axes: N episodes, K features.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from stable_baselines3.common.env_util import make_vec_env

from irl_gym.agents.planners import Planner, ValueIteration
from irl_gym.checks import checked_number, discrete_actions
from irl_gym.environments.closing import close
from irl_gym.environments.rewarded_vec_env import check_steppable, normalised, rewarded
from irl_gym.environments.rollouts import maker_of, moments_of
from irl_gym.environments.tabular_vec_env import TabularVecEnv, shows_rows
from irl_gym.errors import InvalidParameter, NotDiscrete, NotTabular, a_type
from irl_gym.features.feature_maps import FeatureMap, checked_features, over_rows
from irl_gym.features.linear_reward import LinearReward
from irl_gym.mdp.policies import Policy, generator
from irl_gym.mdp.sampling import Successors
from irl_gym.mdp.tabular_mdp import check_discount
from irl_gym.programs.killable import check_limit
from irl_gym.records import Record
from irl_gym.spaces.batches import batch_size
from irl_gym.tables.tabulate import tabulate
from irl_gym.tables.tabulation import Tabulation

MOST_TABLED = 1 << 25
"""Numbers of phi kept in a table while a world is run: 256 MB; beyond, features are evaluated as they are met."""


@dataclass(frozen=True, eq=False)
class Simulator(Record):
    """An environment, who solves it for a reward, and a discount.

    Raises:
        InvalidDiscount: gamma outside (0, 1).
        InvalidParameter: fewer than 1 copies.
    """

    env: gym.Env
    """The world; copies of it are run."""
    planner: Planner
    """Finds a policy for a reward: ValueIteration, on the table; or SB3, on the table if one is given, else on the world."""
    gamma: float
    """Discount; no environment carries one."""
    table: Tabulation | None = None
    """Of the environment, `tabulate` or `discretize`; ValueIteration makes one if it is missing."""
    num_envs: int = 8
    """Copies that SB3 trains on."""

    def __post_init__(self) -> None:
        check_discount(self.gamma)
        checked_number("num_envs", self.num_envs, "a whole number of at least 1", least=1, whole=True)
        if not isinstance(self.env, gym.Env):
            raise InvalidParameter(f"env is {a_type(self.env)}: expected an environment, such as gymnasium.make gives.")
        if not isinstance(self.planner, Planner):
            raise InvalidParameter(f"planner is {self.planner!r}: expected one with `plan`, such as ValueIteration() or SB3().")
        discrete_actions(self.env.action_space, error=InvalidParameter)
        if self.table is not None and (
            self.table.states.space != self.env.observation_space or self.table.mdp.n_actions != self.n_actions
        ):
            raise InvalidParameter(
                f"the table is of observations {self.table.states.space} and {self.table.mdp.n_actions} actions: expected "
                f"{self.env.observation_space} and {self.n_actions}, the environment's. Is it another one's?"
            )

    @property
    def exact(self) -> bool:
        """Is it solved exactly, on a table?"""
        return isinstance(self.planner, ValueIteration)

    @cached_property
    def known(self) -> Tabulation | None:
        """The table, if there is one.

        Raises:
            NotTabular, NotDiscrete: ValueIteration needs one, and none can be made.
        """
        if self.table is not None or not self.exact:
            return self.table
        try:
            return tabulate(self.env, gamma=self.gamma, check_steps=0)
        except (NotTabular, NotDiscrete) as error:
            raise type(error)(f"{error} Or plan with SB3, which needs none.") from error

    @property
    def n_actions(self) -> int:
        """A."""
        space = self.env.action_space
        return int(space.n) if isinstance(space, spaces.Discrete) else 0

    def plan(self, reward: LinearReward, *, seed: int = 0) -> Policy:
        """A policy for a reward of observations."""
        table = self.known
        if table is None:
            check_steppable(self.env)
            world = rewarded(make_vec_env(maker_of(self.env), self.num_envs, seed=seed), reward, self.gamma)
        else:
            world = TabularVecEnv(
                table.mdp, reward.tabular(table.states), num_envs=self.num_envs, max_episode_steps=self._limit,
                states=table.states, show_rows=shows_rows(table.states), seed=seed,
            )  # fmt: skip
            if not self.exact:
                world = normalised(world, self.gamma)
        try:
            return self.planner.plan(world, gamma=self.gamma, seed=seed)
        finally:
            close(world)

    @property
    def limit(self) -> int | None:
        """Steps after which episodes are cut: the environment's time limit where it is run, none where its table is drawn."""
        if self.known is not None and self.known.evidence.exact:
            return None  # a time limit is no part of an MDP
        return self._limit

    @property
    def _limit(self) -> int | None:
        spec = self.env.spec
        return None if spec is None else spec.max_episode_steps

    def sums(self, policy: Policy | None, features: FeatureMap, n: int, *, horizon: int, seed: int) -> np.ndarray:
        """(N, K) sum_t gamma^t phi(s_t) of n episodes of a policy, cut after `horizon` steps: (11) of Ng & Russell.

        Args:
            policy: with SB3's `predict`, taken deterministically; None for uniformly random actions.
            features: phi of observations.
            n: N.
            horizon: steps.
            seed: of the episodes.
        """
        policy = policy or RandomPolicy(self.n_actions, generator(seed))
        total = np.zeros((n, features.n_features))
        for time, who, phi in self._seen(policy, features, n, horizon, seed):
            check_limit()
            total[who] += self.gamma**time * phi
        return total

    def _seen(
        self, policy: Policy, features: FeatureMap, n: int, horizon: int, seed: int
    ) -> Iterator[tuple[int, np.ndarray, np.ndarray]]:
        """Time, episodes that go on, and their features (m, K)."""
        table = self.known
        if table is not None and table.evidence.exact:
            yield from _drawn(table, policy, features, n, horizon, seed)
            return
        for moment in moments_of(self.env, policy, n, seed=seed, most=horizon):
            yield moment.time, moment.who, checked_features(features, moment.observations)


def _drawn(
    table: Tabulation, policy: Policy, features: FeatureMap, n: int, horizon: int, seed: int
) -> Iterator[tuple[int, np.ndarray, np.ndarray]]:
    rng = np.random.default_rng(seed)
    successors, states = Successors(table.mdp), table.states
    phi = _lookup(table, features)
    who, rows = np.arange(n), successors.start(n, rng)
    for time in range(horizon + 1):
        yield time, who, phi(rows)
        who, rows = who[~table.mdp.terminal[rows]], rows[~table.mdp.terminal[rows]]
        if not who.size or time == horizon:
            return
        actions, _ = policy.predict(states.decode_batch(rows), deterministic=True)
        rows = successors.draw(rows, np.asarray(actions).astype(np.int64), rng)


def _lookup(table: Tabulation, features: FeatureMap) -> Callable[[np.ndarray], np.ndarray]:
    """Features of rows: from a table of them where it is small."""
    states = table.states
    if states.n_states * features.n_features > MOST_TABLED:
        return lambda rows: over_rows(features, states.decode_batch, rows)
    values = over_rows(features, states.decode_batch, np.arange(states.n_states))
    return lambda rows: values[rows]


@dataclass(frozen=True, eq=False)
class RandomPolicy:
    """Uniformly random actions, whatever is observed."""

    n_actions: int
    """A."""
    rng: np.random.Generator
    """Draws them."""

    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None, deterministic: bool = False
    ) -> tuple[Any, Any]:
        """(N,) random actions for a batch of observations."""
        return self.rng.integers(self.n_actions, size=batch_size(observation)), state
