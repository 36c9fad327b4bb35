"""Many cars driven in the true world, from states drawn anywhere in it: does a policy park? Axes: N cars."""

from dataclasses import dataclass
from typing import Any

import gymnasium as gym
import numpy as np

from irl_gym.environments.closing import close
from irl_gym.errors import InvalidParameter
from irl_gym.mdp.policies import Policy


@dataclass(frozen=True)
class Drive:
    """How cars fared that began anywhere."""

    value: float
    """Mean discounted true reward."""
    left: float
    """Share of the cars that left the road."""
    parked: float
    """Of the others: share of the last third of their steps spent in the interval."""


def drive(env: gym.Env, policy: Policy, *, within: tuple[float, float], n: int, steps: int, gamma: float, seed: int) -> Drive:
    """Drive n cars from uniform states of the environment's box.

    Args:
        env: registered, with a vector entry point whose `reset` takes `options["state"]`; position is coordinate 0.
        policy: acts deterministically.
        within: low and high of the positions in which a car is parked.
        n: cars.
        steps: of each.
        gamma: discount of the value.
        seed: of the first states.

    Raises:
        InvalidParameter: an environment of another kind.
    """
    spec, space = env.spec, env.observation_space
    if spec is None or not isinstance(space, gym.spaces.Box):
        raise InvalidParameter(f"env is {env}: expected a registered environment whose observations are of a Box.")
    vector: Any = gym.make_vec(spec, num_envs=n, vectorization_mode="vector_entry_point")
    low, high = space.low.astype(float), space.high.astype(float)
    first = np.random.default_rng(seed).uniform(low, high, size=(n, low.size)) * (1 - 1e-6)
    observations, _ = vector.reset(seed=seed, options={"state": first})
    here, value, parked = np.ones(n, dtype=bool), np.zeros(n), np.zeros(n)
    judged = range(steps - steps // 3, steps)
    for step in range(steps):
        actions, _ = policy.predict(observations, deterministic=True)
        observations, rewards, terminated, _, _ = vector.step(np.asarray(actions).astype(np.int64))
        value += gamma**step * np.where(here, rewards, 0.0)
        here &= ~terminated
        if step in judged:
            parked += (observations[:, 0] >= within[0]) & (observations[:, 0] <= within[1])
    close(vector)
    return Drive(float(value.mean()), float(1 - here.mean()), float(parked[here].mean() / len(judged)) if here.any() else 0.0)
