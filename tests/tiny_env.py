"""Environments of a few states that publish a table, and may do something else than it says."""

import gymnasium as gym
import numpy as np
from gymnasium import spaces

Line = tuple[float, int, float, bool]
Table = list[list[list[Line]]]


class Room(gym.Env):
    """Shows a dictionary, and ends after some steps."""

    observation_space = spaces.Dict(a=spaces.Discrete(9), b=spaces.Box(0, 9, (2,)))
    action_space = spaces.Discrete(2)

    def __init__(self, steps: int):
        self.steps = steps

    def reset(self, *, seed=None, options=None):
        self.t = 0
        return self._seen(), {}

    def _seen(self):
        return {"a": np.int64(self.t), "b": np.full(2, self.t, dtype=np.float32)}

    def step(self, action):
        self.t += 1
        return self._seen(), 0.0, self.t == self.steps, False, {}


class TableEnv(gym.Env):
    """Publishes `P`, and steps by `truth`, which is `P` unless told otherwise."""

    def __init__(self, P: Table, start: list[float], truth: Table | None = None, truth_start: list[float] | None = None):
        self.P, self.initial_state_distrib = P, start
        self.truth, self.truth_start = truth or P, truth_start or start
        self.observation_space = spaces.Discrete(len(P))
        self.action_space = spaces.Discrete(len(P[0]))
        self.s = None

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.s = int(self.np_random.choice(len(self.truth_start), p=self.truth_start))
        return self.s, {}

    def step(self, action):
        lines = self.truth[self.s][action]
        chosen = self.np_random.choice(len(lines), p=[line[0] for line in lines])
        _, self.s, reward, terminated = lines[chosen]
        return self.s, reward, terminated, False, {}


def coin(p: float = 0.5, win: float = 1.0, lose: float = 0.0, ends: bool = True) -> Table:
    """State 0 tosses a coin: with p to state 1, which is the end, else to itself. State 1 loops on itself."""
    return [[[(p, 1, win, ends), (1 - p, 0, lose, False)]], [[(1.0, 1, 0.0, True)]]]


def lottery(p: float) -> Table:
    """State 0 always ends in state 1, and pays 1 with probability p: s, a and s' do not settle what is paid."""
    return [[[(p, 1, 1.0, True), (1 - p, 1, 0.0, True)]], [[(1.0, 1, 0.0, True)]]]


def both_ways() -> Table:
    """State 1 is entered by action 0 of state 0 without and by action 1 with an end; state 2 is the end otherwise."""
    end = [(1.0, 2, 0.0, True)]
    return [
        [[(1.0, 1, 0.0, False)], [(1.0, 1, 5.0, True)]],
        [[(1.0, 2, 2.0, True)], [(1.0, 0, 0.0, False)]],
        [end, end],
    ]
