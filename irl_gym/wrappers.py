"""A learned reward in place of an environment's own."""

import os
from typing import Any

import gymnasium as gym
import numpy as np

from irl_gym.errors import InvalidInput, InvalidReward
from irl_gym.rewards import RewardFunction, TabularReward, as_reward
from irl_gym.states import StateIndex, States


def _as_function(reward: RewardFunction | np.ndarray | str) -> RewardFunction:
    if isinstance(reward, str):
        return TabularReward.load(reward)
    return as_reward(reward) if isinstance(reward, np.ndarray) else reward


class LearnedReward(gym.Wrapper, gym.utils.RecordConstructorArgs):
    """Pays a learned reward; keeps the true one in `info["true_reward"]`; changes nothing else.

    A reward on states is paid on arrival, also when the arrival terminates. The wrapper can be rebuilt from the spec of the
    environment: `reward` may be the path of a file written by `TabularReward.save`, which is what makes that spec JSON.

    Args:
        env: any environment whose observations `states` knows.
        reward: what is paid: a reward function, an array (S,) or (S, A), or the path of a file that holds one.
        states: turns observations into rows; the default numbers the observation space.

    Raises:
        NotDiscrete: no state index is given and the observation space is not made of integers.
        InvalidReward: a reward for another number of states or actions.
    """

    def __init__(self, env: gym.Env, reward: RewardFunction | np.ndarray | str | os.PathLike, states: States | None = None):
        reward = os.fspath(reward) if isinstance(reward, os.PathLike) else reward
        gym.utils.RecordConstructorArgs.__init__(self, reward=reward, states=states)
        gym.Wrapper.__init__(self, env)
        self.reward_function = _as_function(reward)
        self.states = StateIndex(env.observation_space) if states is None else states
        size = getattr(self.reward_function, "n_states", self.states.n_states)
        if size != self.states.n_states:
            raise InvalidReward(
                f"the reward has {size} states: expected {self.states.n_states}, those of {self.states.space}. Give the "
                "`states` of the Tabulation that the reward was learned on."
            )
        shape = np.shape(getattr(self.reward_function, "values", ()))
        if len(shape) == 2 and shape[-1] != getattr(env.action_space, "n", None):
            raise InvalidReward(f"the reward has {shape[-1]} actions: expected those of {env.action_space}.")
        self._first_action = int(getattr(env.action_space, "start", 0))
        self._row: int | None = None

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begin an episode of the environment."""
        observation, info = self.env.reset(seed=seed, options=options)
        self._row = self.states.encode(observation)
        return observation, info

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Step the environment; pay the learned reward.

        Raises:
            UnknownObservation: the environment showed a state that the index does not hold.
        """
        if self._row is None:
            raise InvalidInput("step before the first episode: call reset first.")
        observation, true_reward, terminated, truncated, info = self.env.step(action)
        following = self.states.encode(observation, terminated=bool(terminated))
        paid = float(self.reward_function.pay(self._row, int(action) - self._first_action, following))
        self._row = following
        return observation, paid, terminated, truncated, {**info, "true_reward": true_reward}
