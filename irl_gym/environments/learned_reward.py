"""A learned reward in place of an environment's own."""

import os
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces

from irl_gym.errors import InvalidInput, InvalidReward
from irl_gym.features.linear_reward import LinearReward, load_reward
from irl_gym.mdp.rewards import RewardFunction, as_reward
from irl_gym.spaces.batches import batch_of_one
from irl_gym.spaces.states import StateIndex, States


def _as_function(reward: RewardFunction | np.ndarray | str) -> RewardFunction:
    if isinstance(reward, str):
        return load_reward(reward)
    return as_reward(reward) if isinstance(reward, np.ndarray) else reward


class LearnedReward(gym.Wrapper, gym.utils.RecordConstructorArgs):
    """Pays a learned reward; keeps the true one in `info["true_reward"]`; changes nothing else.

    A reward on states is paid on arrival, also when the arrival terminates. The wrapper can be rebuilt from the spec of the
    environment: `reward` may be the path of a file that the reward's `save` wrote, which is what makes that spec JSON.

    Args:
        env: any environment whose observations `states` knows; any at all for a LinearReward.
        reward: what is paid: a reward function, an array (S,) or (S, A), or the path of a file that holds one.
        states: turns observations into rows; the default numbers the observation space, but for a LinearReward: without
            `states` its features are of the observations themselves.

    Raises:
        NotDiscrete: no state index is given and the observation space is not made of integers.
        InvalidReward: a reward for another number of states or actions.
    """

    def __init__(self, env: gym.Env, reward: RewardFunction | np.ndarray | str | os.PathLike, states: States | None = None):
        reward = os.fspath(reward) if isinstance(reward, os.PathLike) else reward
        gym.utils.RecordConstructorArgs.__init__(self, reward=reward, states=states)
        gym.Wrapper.__init__(self, env)
        self.reward_function = _as_function(reward)
        self.states: States | None = states
        if states is None and not isinstance(self.reward_function, LinearReward):
            self.states = StateIndex(env.observation_space)
        if self.states is not None:
            _check_size(self.reward_function, self.states, env)
        self._first_action = int(getattr(env.action_space, "start", 0))
        self._at: Any = None

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begin an episode of the environment."""
        observation, info = self.env.reset(seed=seed, options=options)
        self._at = self._place(observation)
        return observation, info

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Step the environment; pay the learned reward.

        Raises:
            UnknownObservation: the environment showed a state that the index does not hold.
        """
        if self._at is None:
            raise InvalidInput("step before the first episode: call reset first.")
        observation, true_reward, terminated, truncated, info = self.env.step(action)
        following = self._place(observation, terminated=bool(terminated))
        number = int(action) - self._first_action if isinstance(self.env.action_space, spaces.Discrete) else action
        paid = float(np.asarray(self.reward_function.pay(self._at, number, following)).reshape(()))
        self._at = following
        return observation, paid, terminated, truncated, {**info, "true_reward": true_reward}

    def _place(self, observation: Any, *, terminated: bool = False) -> Any:
        """What the reward is of: a row, or the observation as a batch of one."""
        if self.states is not None:
            return self.states.encode(observation, terminated=terminated)
        return batch_of_one(observation)


def _check_size(reward: RewardFunction, states: States, env: gym.Env) -> None:
    size = getattr(reward, "n_states", states.n_states)
    if size != states.n_states:
        raise InvalidReward(
            f"the reward has {size} states: expected {states.n_states}, those of {states.space}. Give the "
            "`states` of the Tabulation that the reward was learned on."
        )
    shape = np.shape(getattr(reward, "values", ()))
    if len(shape) == 2 and shape[-1] != getattr(env.action_space, "n", None):
        raise InvalidReward(f"the reward has {shape[-1]} actions: expected those of {env.action_space}.")
