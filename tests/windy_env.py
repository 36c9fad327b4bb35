"""A ring whose wind is decided at reset, by a number that cannot be listed and is not shown."""

import gymnasium as gym
from gymnasium import spaces

WINDY = 1.0
"""The wind blows where the normal number is above this: in 0.16 of all episodes."""


class Windy(gym.Env):
    """Cells 0 to 6 in a ring; where the wind blows, who leaves cell 3 is carried to cell 7, which nothing else leads to."""

    observation_space, action_space = spaces.Discrete(8), spaces.Discrete(2)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.wind, self.cell = self.np_random.normal(), 0
        return 0, {}

    def step(self, action):
        if self.cell == 7:
            self.cell = 0
        elif self.cell == 3 and self.wind > WINDY:
            self.cell = 7
        else:
            self.cell = (self.cell + 2 * int(action) - 1) % 7
        return self.cell, float(self.cell == 6), False, False, {}


class Calm(Windy):
    """The same, but the wind is drawn anew at every step: nothing is hidden."""

    def step(self, action):
        self.wind = self.np_random.normal()
        return super().step(action)


class PaidByMood(Windy):
    """Always calm, but what steps pay is decided at reset."""

    def step(self, action):
        mood, self.wind = self.wind, 0.0
        cell, _, *rest = super().step(action)
        self.wind = mood
        return cell, float(mood > WINDY), *rest
