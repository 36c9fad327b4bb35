"""Environments and episodes of them, in every kind of space."""

import gymnasium as gym
import numpy as np
from gymnasium import spaces

from irl_gym.mdp.episodes import collect


class Walk(gym.Env):
    """Whatever the action, the next member of the space in a seeded list; ends after a number of steps that it draws."""

    def __init__(self, space, actions):
        self.observation_space, self.action_space = space, actions

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.observation_space.seed(seed)
        self.left = int(self.np_random.integers(1, 6))
        return self.observation_space.sample(), {}

    def step(self, action):
        assert self.action_space.contains(np.int64(action))
        self.left -= 1
        ended = self.left == 0
        return self.observation_space.sample(), float(self.np_random.random()), ended, False, {}


class Random:
    def __init__(self, n_actions):
        self.n_actions, self.rng = n_actions, np.random.default_rng(0)

    def predict(self, observation, deterministic=False):
        return self.rng.integers(self.n_actions), None


HIGH = np.array([4.8, np.inf, 0.4], np.float32)
SPACES = {
    "Discrete": spaces.Discrete(7, start=3),
    "Tuple": spaces.Tuple([spaces.Discrete(32), spaces.Discrete(11), spaces.Discrete(2)]),
    "Box of integers": spaces.Box(0, 9, (2, 2), np.uint8),
    "Box of floats": spaces.Box(-HIGH, HIGH),
    "Box of doubles": spaces.Box(np.float64(-1.0), np.float64(1.0), (), np.float64),
    "MultiDiscrete": spaces.MultiDiscrete([3, 4]),
    "MultiBinary": spaces.MultiBinary(3),
    "Dict": spaces.Dict(
        place=spaces.MultiDiscrete([5, 5]), fuel=spaces.Box(0.0, 1.0, (1,), np.float32), key=spaces.Discrete(2)
    ),
    "nested": spaces.Tuple([spaces.Discrete(2), spaces.Dict(a=spaces.Discrete(4), b=spaces.MultiBinary(2))]),
}


def demonstrations(kind, episodes=6):
    """An environment with this kind of observations, and episodes of a random policy."""
    if kind == "Blackjack":
        env = gym.make("Blackjack-v1")
    elif kind == "CartPole":
        env = gym.make("CartPole-v1")
    else:
        env = Walk(SPACES[kind], spaces.Discrete(3, start=1))
    return env, list(collect(env, Random(int(env.action_space.n)), episodes, seed=11))


def same(one, again):
    """Are two batches equal, to the bit and in layout?"""
    if isinstance(one, dict):
        return isinstance(again, dict) and one.keys() == again.keys() and all(same(one[key], again[key]) for key in one)
    if isinstance(one, tuple):
        return isinstance(again, tuple) and len(one) == len(again) and all(map(same, one, again))
    return one.dtype == again.dtype and np.array_equal(one, again)


def check_same(episodes, again, *, rewards=True):
    assert len(episodes) == len(again)
    for left, right in zip(episodes, again, strict=True):
        assert same(left.observations, right.observations)
        assert left.actions.tolist() == right.actions.tolist()
        assert not rewards or left.rewards.tolist() == right.rewards.tolist()
        assert (left.terminated, left.truncated) == (right.terminated, right.truncated)
