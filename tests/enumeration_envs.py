"""Small environments that publish no table: to be enumerated."""

import random
import runpy
from pathlib import Path

import gymnasium as gym
import numpy as np
from gymnasium import spaces

RAND, RANDOM = np.random.rand, random.random
Racetrack = runpy.run_path(str(Path(__file__).parents[1] / "scripts/measure_environments.py"))["Racetrack"]
"""The one that is measured."""


class Corridor(gym.Env):
    """Cells 0 to n - 1, begun in the middle; action 0 goes left, 1 right; the last cell pays 1 and ends the episode."""

    def __init__(self, n=7):
        self.n = n
        self.observation_space, self.action_space = spaces.Discrete(n), spaces.Discrete(2)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.cell = self.n // 2
        return self.cell, {}

    def moved(self, action):
        self.cell = min(self.n - 1, max(0, self.cell + 2 * action - 1))
        return self.cell, float(self.cell == self.n - 1), self.cell == self.n - 1, False, {}

    def step(self, action):
        return self.moved(int(action))


class Slippery(Corridor):
    """Turns round with a chance of 0.2, as `slips` draws it; some kinds of draws cannot be enumerated."""

    def __init__(self, kind="generator", n=7):
        super().__init__(n)
        self.kind = kind
        self.old, self.plain = np.random.RandomState(0), random.Random(0)

    def slips(self):
        match self.kind:
            case "generator":
                return self.np_random.random() < 0.2
            case "random state":
                return self.old.rand() < 0.2
            case "random.Random":
                return self.plain.random() < 0.2
            case "module np.random":
                return np.random.rand() < 0.2  # noqa: NPY002 (what some environments do)
            case "module random":
                return random.random() < 0.2
            case "imported from np.random":
                return RAND() < 0.2
            case "imported from random":
                return RANDOM() < 0.2
            case "normal":
                return self.np_random.normal() < -0.8416212335729143  # the quantile of 0.2
            case "many outcomes":
                return self.np_random.integers(25_000) < 5_000
            case "mixed":
                return self.np_random.normal() < -0.8416212335729143 if self.cell == 1 else self.np_random.random() < 0.2
        raise AssertionError(self.kind)

    def step(self, action):
        return self.moved(1 - int(action) if self.slips() else int(action))


class Shows(Corridor):
    """Shows what it is told to show of its cell."""

    def __init__(self, space, show):
        super().__init__()
        self.observation_space, self.show = space, show

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        return self.show(self.cell), {}

    def step(self, action):
        _, *rest = self.moved(int(action))
        return self.show(self.cell), *rest


class Board(gym.Env):
    """size x size cells, four moves, from the corner to the opposite one."""

    def __init__(self, size=5, pause=None):
        self.size, self.pause = size, pause
        self.observation_space, self.action_space = spaces.MultiDiscrete([size, size]), spaces.Discrete(4)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.x = self.y = 0
        return self._seen(), {}

    def step(self, action):
        if self.pause is not None:
            self.pause()
        dx, dy = ((1, 0), (0, 1), (-1, 0), (0, -1))[action]
        self.x, self.y = min(self.size - 1, max(0, self.x + dx)), min(self.size - 1, max(0, self.y + dy))
        done = self.x == self.y == self.size - 1
        return self._seen(), 1.0 if done else -0.125, done, False, {}

    def _seen(self):
        return np.array([self.x, self.y])


class Lamps(gym.Env):
    """A user's own: two lamps and a place; a step walks, or presses a switch that works with probability 3/4."""

    observation_space = spaces.Tuple([spaces.Discrete(3), spaces.MultiBinary(2)])
    action_space = spaces.Discrete(2)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.state = {"place": 0, "lamps": [0, 0]}
        return self._seen(), {}

    def step(self, action):
        if action == 0:
            self.state["place"] = (self.state["place"] + 1) % 3
        elif self.state["place"] and self.np_random.random() < 0.75:
            self.state["lamps"][self.state["place"] - 1] ^= 1
        done = self.state["lamps"] == [1, 1]
        return self._seen(), float(done), done, False, {}

    def _seen(self):
        return self.state["place"], np.array(self.state["lamps"], dtype=np.int8)


class Plain(gym.Env):
    """500 x 500 cells in plain Python, four moves."""

    observation_space, action_space = spaces.Discrete(250_000), spaces.Discrete(4)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.x = self.y = 0
        return 0, {}

    def step(self, action):
        if action == 0:
            self.x = min(499, self.x + 1)
        elif action == 1:
            self.y = min(499, self.y + 1)
        elif action == 2:
            self.x = max(0, self.x - 1)
        else:
            self.y = max(0, self.y - 1)
        done = self.x == self.y == 499
        return 500 * self.y + self.x, float(done), done, False, {}


def same_table(a, b):
    """Byte for byte the same numbers."""
    pairs = [(a.mdp.P.data, b.mdp.P.data), (a.mdp.P.indices, b.mdp.P.indices), (a.mdp.P.indptr, b.mdp.P.indptr)]
    pairs += [(a.mdp.d0, b.mdp.d0), (a.reward.values, b.reward.values), (a.states.numbers, b.states.numbers)]
    return all(x.tobytes() == y.tobytes() for x, y in pairs) and a.states.terminal_copies == b.states.terminal_copies
