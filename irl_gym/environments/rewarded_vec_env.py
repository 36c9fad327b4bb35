"""A reward of observations in place of a vector environment's own, a batch at a time."""

from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from stable_baselines3.common.vec_env import VecEnv, VecEnvWrapper, VecNormalize

from irl_gym.errors import InvalidParameter
from irl_gym.features.linear_reward import LinearReward
from irl_gym.spaces.batches import batch_of_one, take


def rewarded(venv: VecEnv, reward: LinearReward, gamma: float) -> VecEnv:
    """A vector environment that pays a reward, on a scale that agents learn from."""
    return normalised(RewardedVecEnv(venv, reward), gamma)


def normalised(venv: VecEnv, gamma: float) -> VecEnv:
    """Rewards divided by the running deviation of their return: SB3's VecNormalize.

    A sum of K features may pay tens a step, which the losses of policy gradients do not take well: without the division PPO
    kept CartPole up for 128 steps on a reward on which it now does for 500. A positive number changes no comparison between
    policies. Observations stay as they are, and nothing is clipped.
    """
    return VecNormalize(venv, norm_obs=False, clip_reward=np.inf, gamma=gamma)


def check_steppable(env: gym.Env) -> None:
    """Check that SB3 can train on copies of an environment.

    Raises:
        InvalidParameter: actions that do not count from 0, or Tuple observations.
    """
    actions = env.action_space
    if isinstance(actions, spaces.Discrete) and actions.start != 0:
        raise InvalidParameter(
            f"the actions are {actions}: expected numbers from 0, as Stable-Baselines3 gives. Shift them, with "
            f"`gymnasium.wrappers.TransformAction(env, lambda a: a + {actions.start}, gymnasium.spaces.Discrete({actions.n}))`."
        )
    if isinstance(env.observation_space, spaces.Tuple):
        raise InvalidParameter(
            f"the observations are {env.observation_space}: expected others than a Tuple, which Stable-Baselines3 does not "
            "take. Flatten them, with `gymnasium.wrappers.FlattenObservation(env)`."
        )


class RewardedVecEnv(VecEnvWrapper):
    """Pays R = alpha . phi(s') on arrival, also where the arrival ends the episode; changes nothing else.

    Args:
        venv: Stable-Baselines3's vector environment.
        reward: of its observations.
    """

    def __init__(self, venv: VecEnv, reward: LinearReward):
        super().__init__(venv)
        self.reward = reward

    def reset(self) -> Any:
        """Begin all episodes anew."""
        return self.venv.reset()

    def step_wait(self) -> tuple[Any, np.ndarray, np.ndarray, list[dict[str, Any]]]:
        """Step all copies; those that end begin anew, and are paid for where they ended."""
        observations, _, dones, infos = self.venv.step_wait()
        paid = self.reward.of(observations)
        for i in np.flatnonzero(dones).tolist():
            ended = infos[i].get("terminal_observation", take(observations, i))
            paid[i] = self.reward.of(batch_of_one(ended))[0]
        return observations, paid.astype(np.float32), dones, infos
