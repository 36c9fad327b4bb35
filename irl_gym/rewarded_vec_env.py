"""A reward of observations in place of a vector environment's own, a batch at a time."""

from typing import Any

import numpy as np
from stable_baselines3.common.vec_env import VecEnv, VecEnvWrapper, VecNormalize

from irl_gym.features import batch_of_one, take
from irl_gym.linear_reward import LinearReward


def rewarded(venv: VecEnv, reward: LinearReward, gamma: float) -> VecEnv:
    """A vector environment that pays a reward, divided by the running deviation of its return: SB3's VecNormalize.

    A sum of K features may pay tens a step, which the losses of policy gradients do not take well: without the division PPO
    kept CartPole up for 128 steps on a reward on which it now does for 500. A positive number changes no comparison between
    policies. Observations stay as they are, and nothing is clipped.
    """
    return VecNormalize(RewardedVecEnv(venv, reward), norm_obs=False, clip_reward=np.inf, gamma=gamma)


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
