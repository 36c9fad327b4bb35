"""A ten-line environment, things for it to hold, and generators that can be rewound: for the tests of snapshots."""

import dataclasses
import random

import gymnasium as gym
import numpy as np
from gymnasium.wrappers import FrameStackObservation, TimeAwareObservation

from irl_gym.tables.copies.snapshots import Snapshots
from irl_gym.tables.copies.stripped import without_watchers


class StandIn:
    """A generator that can be rewound."""

    made = 0

    def __init__(self):
        StandIn.made += 1
        self.rewind()

    def rewind(self):
        self.inner = np.random.default_rng(7)

    def random(self, *args):
        return self.inner.random(*args)

    def choice(self, *args, **kwargs):
        return self.inner.choice(*args, **kwargs)

    def integers(self, *args, **kwargs):
        return self.inner.integers(*args, **kwargs)


def twin(value):
    return StandIn() if isinstance(value, np.random.Generator | random.Random) else None


class Walk(gym.Env):
    """The user's environment: a line of 20 cells, a key on cell 3, a coin at every step."""

    action_space = gym.spaces.Discrete(2)
    observation_space = gym.spaces.Discrete(40)

    def __init__(self, **more):
        self.place, self.has_key = 0, False
        for name, value in more.items():
            setattr(self, name, value)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.place, self.has_key = 0, False
        return 0, {}

    def step(self, action):
        slip = self.np_random.random() < 0.2
        self.place = min(max(self.place + (1 if (action == 1) != slip else -1), 0), 19)
        self.has_key |= self.place == 3
        return self.place + 20 * self.has_key, float(self.has_key), self.place == 19, False, {}


@dataclasses.dataclass
class Bag:
    items: list


class Stubborn:
    """Cannot be pickled, but copied."""

    def __init__(self, n=0):
        self.n = n

    def __reduce_ex__(self, protocol):
        raise TypeError("no pickle of me")

    def __deepcopy__(self, memo):
        return Stubborn(self.n)


def snapshots_of(env, seed=0):
    env.reset(seed=seed)
    own = without_watchers(env)
    own.reset(seed=seed)
    return own, Snapshots(own, twin)


def frames():
    limited = gym.make("FrozenLake-v1")
    return FrameStackObservation(TimeAwareObservation(limited, flatten=False, normalize_time=False), 3)
