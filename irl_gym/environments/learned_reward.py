"""A learned reward in place of an environment's own, or of a vector environment's.

`shaping` pays the expected advantage under the reward in its place (`irl_gym.mdp.shaping`, Ng, Harada & Russell 1999), as a
run's own agent is paid: the same policies are optimal, and an agent that learns from steps finds them, since what an action
loses is paid at once. It needs P, which neither an environment nor a reward carries, so it is asked for, never guessed.
Axes: S states, A actions, N environments.
"""

import os
from typing import Any, Protocol, runtime_checkable

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode, VectorEnv, VectorWrapper

from irl_gym.errors import InvalidInput, InvalidReward
from irl_gym.features.linear_reward import LinearReward, load_payment
from irl_gym.mdp.rewards import RewardFunction, as_reward
from irl_gym.mdp.shaping import ShapedReward
from irl_gym.mdp.tabular_mdp import TabularMDP, checked_mdp
from irl_gym.spaces.batches import batch_of_one, take
from irl_gym.spaces.states import StateIndex, States


@runtime_checkable
class Tabulated(Protocol):
    """A table with the numbering of its states, such as a Tabulation."""

    @property
    def mdp(self) -> TabularMDP:
        """P, gamma and d0."""
        ...

    @property
    def states(self) -> States:
        """Observations to rows and back."""
        ...


@runtime_checkable
class Rewarded(Protocol):
    """What holds a reward, such as an Outcome; None of a learner of policies alone."""

    @property
    def reward(self) -> RewardFunction | None:
        """The reward."""
        ...


Payable = RewardFunction | Rewarded | np.ndarray | str | os.PathLike
Shaping = Tabulated | TabularMDP | None


class LearnedReward(gym.Wrapper, gym.utils.RecordConstructorArgs):
    """Pays a learned reward, or its shaping; keeps the true one in `info["true_reward"]`; changes nothing else.

    A reward on states is paid on arrival, also when the arrival terminates. With `shaping` what is paid is the reward's
    expected advantage, between -1 and 0, and returns are no longer the reward's: `info["learned_reward"]` has what it pays.
    The wrapper can be rebuilt from the spec of the environment: `reward` may be the path of a file that the reward's `save`
    wrote, which is what makes that spec JSON.

    Args:
        env: any environment whose observations `states` knows; any at all for a LinearReward that is not shaped.
        reward: what is paid: a reward function, an outcome that has one, an array (S,) or (S, A), or the path of a file that
            holds one. Of a run, `reward_shaped.npz` is shaped already, and `reward.npz` is the reward as it is.
        states: turns observations into rows; the default is the numbering of the Tabulation that `shaping` is, else that of
            the observation space, but for a LinearReward: without `states` its features are of the observations themselves.
        shaping: the Tabulation, or the mdp, to plan on; None to pay the reward as it is.

    Raises:
        NotDiscrete: no state index is given and the observation space is not made of integers.
        InvalidReward: no reward, one for another number of states or actions, or states of another observation space.
        InvalidMDP: `shaping` is no table.
    """

    def __init__(self, env: gym.Env, reward: Payable, states: States | None = None, *, shaping: Shaping = None):
        reward = os.fspath(reward) if isinstance(reward, os.PathLike) else reward
        gym.utils.RecordConstructorArgs.__init__(self, reward=reward, states=states, shaping=shaping)
        gym.Wrapper.__init__(self, env)
        self.reward_function, self.states = _prepared(reward, states, shaping, env.observation_space, env.action_space)
        self._first_action = int(getattr(env.action_space, "start", 0))
        self._at: Any = None

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begin an episode of the environment."""
        observation, info = self.env.reset(seed=seed, options=options)
        self._at = _place(self.states, observation)
        return observation, info

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Step the environment; pay the learned reward.

        Raises:
            UnknownObservation: the environment showed a state that the index does not hold.
        """
        if self._at is None:
            raise InvalidInput("step before the first episode: call reset first.")
        observation, true_reward, terminated, truncated, info = self.env.step(action)
        following = _place(self.states, observation, terminated=bool(terminated))
        number = int(action) - self._first_action if isinstance(self.env.action_space, spaces.Discrete) else action
        paid, learned = (float(one.item()) for one in _paid(self.reward_function, self._at, number, following))
        self._at = following
        return observation, paid, terminated, truncated, {**info, "true_reward": true_reward, "learned_reward": learned}


class VectorLearnedReward(VectorWrapper):
    """The same of a vector environment, such as `gymnasium.make_vec` makes, a batch at a time, in any of its autoreset modes.

    `infos["true_reward"]` and `infos["learned_reward"]` are (N,). The step with which a vector environment begins an episode
    anew pays nothing, as the environment's own.

    Args:
        env: any vector environment whose observations `states` knows.
        reward: as of `LearnedReward`, and so are the others.
        states: turns observations into rows.
        shaping: the Tabulation, or the mdp, to plan on; None to pay the reward as it is.

    Raises:
        NotDiscrete, InvalidReward, InvalidMDP: as `LearnedReward`.
    """

    def __init__(self, env: VectorEnv, reward: Payable, states: States | None = None, *, shaping: Shaping = None):
        super().__init__(env)
        space, actions = env.single_observation_space, env.single_action_space
        self.reward_function, self.states = _prepared(reward, states, shaping, space, actions)
        self._first_action = int(getattr(actions, "start", 0))
        self._mode = env.metadata.get("autoreset_mode", AutoresetMode.NEXT_STEP)
        self._at: Any = None
        self._begins = np.zeros(env.num_envs, dtype=bool)

    def reset(self, *, seed: Any = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begin the episodes of the environments, or of those that `options` names."""
        observations, infos = self.env.reset(seed=seed, options=options)
        self._at, self._begins = self._places(observations), np.zeros(self.num_envs, dtype=bool)
        return observations, infos

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Step the environments; pay the learned reward.

        Raises:
            UnknownObservation: an environment showed a state that the index does not hold.
        """
        if self._at is None:
            raise InvalidInput("step before the first episode: call reset first.")
        observations, true_rewards, terminated, truncated, infos = self.env.step(actions)
        ended, within = terminated | truncated, self._mode is AutoresetMode.SAME_STEP
        numbers = np.asarray(actions) - self._first_action
        following = self._places(observations, np.zeros_like(terminated) if within else terminated)
        paid, learned = (np.array(one, dtype=np.float64) for one in _paid(self.reward_function, self._at, numbers, following))
        for i in np.flatnonzero(ended).tolist() if within else ():  # they show how their next episodes begin
            arrived = _place(self.states, infos["final_obs"][i], terminated=bool(terminated[i]))
            here = take(self._at, i) if self.states is not None else take(self._at, slice(i, i + 1))
            paid[i], learned[i] = (one.item() for one in _paid(self.reward_function, here, numbers[i], arrived))
        paid[self._begins] = learned[self._begins] = 0.0
        self._at, self._begins = following, ended if self._mode is AutoresetMode.NEXT_STEP else self._begins
        told = {"true_reward": true_rewards, "learned_reward": learned}
        masks = {f"_{name}": np.ones(self.num_envs, dtype=bool) for name in told}
        return observations, paid, terminated, truncated, {**infos, **told, **masks}

    def _places(self, observations: Any, terminated: np.ndarray | None = None) -> Any:
        return observations if self.states is None else self.states.encode_batch(observations, terminated=terminated)


def _prepared(
    given: Any, states: States | None, shaping: Any, observations: spaces.Space, actions: spaces.Space
) -> tuple[RewardFunction, States | None]:
    """What is paid, and what it is paid of: rows of states, or observations where there are none."""
    reward = _reward_of(given)
    states = getattr(shaping, "states", None) if states is None else states
    if states is None and (shaping is not None or not isinstance(reward, LinearReward)):
        states = StateIndex(observations)
    if states is not None and states.space != observations:
        raise InvalidReward(
            f"the states are of {states.space}: expected those of {observations}, which the environment shows. Give the "
            "Tabulation of this environment."
        )
    if shaping is not None and states is not None:
        known = reward.learned if isinstance(reward, ShapedReward) else reward
        tabular = known.tabular(states) if isinstance(known, LinearReward) else known
        reward = ShapedReward.of(as_reward(tabular), checked_mdp(getattr(shaping, "mdp", shaping)))
    if states is not None:
        _check_size(reward, states, actions)
    return reward, states


def _reward_of(given: Any) -> RewardFunction:
    if isinstance(given, str | os.PathLike):
        return load_payment(given)
    held = getattr(given, "reward", given)
    if held is None:
        raise InvalidReward(
            f"the {type(given).__name__} has no reward, as its learner gives a policy alone: expected one with a reward. Learn "
            "one, such as with `FiniteLP().fit(mdp, expert)`."
        )
    return held if isinstance(held, RewardFunction) else as_reward(held)


def _place(states: States | None, observation: Any, *, terminated: bool = False) -> Any:
    """What the reward is of: a row, or the observation as a batch of one."""
    return batch_of_one(observation) if states is None else states.encode(observation, terminated=terminated)


def _paid(reward: RewardFunction, at: Any, actions: Any, following: Any) -> tuple[np.ndarray, np.ndarray]:
    """What is paid for steps, and what the reward itself pays."""
    paid = np.asarray(reward.pay(at, actions, following))
    return paid, np.asarray(reward.learned.pay(at, actions, following)) if isinstance(reward, ShapedReward) else paid


def _check_size(reward: RewardFunction, states: States, actions: spaces.Space) -> None:
    size = getattr(reward, "n_states", states.n_states)
    if size != states.n_states:
        raise InvalidReward(
            f"the reward has {size} states: expected {states.n_states}, those of {states.space}. Give the "
            "`states` of the Tabulation that the reward was learned on."
        )
    shape = np.shape(getattr(reward, "values", ()))
    if len(shape) == 2 and shape[-1] != getattr(actions, "n", None):
        raise InvalidReward(f"the reward has {shape[-1]} actions: expected those of {actions}.")
