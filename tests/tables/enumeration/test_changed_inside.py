"""A large part that deep steps change in place, where no random walk comes, and other steps change back."""

import gymnasium as gym
import pytest
from gymnasium import spaces

from irl_gym.tables.enumeration.table import Enumeration

DEEP, LAST = 12, 30


class Deep(gym.Env):
    """A lock of 30 turns, each wrong one of which leads back; from the twelfth on they are counted in a large list."""

    observation_space, action_space = spaces.Discrete(LAST + 1), spaces.Discrete(2)

    def __init__(self, back: bool):
        self.back, self.at = back, 0
        self.world = {"map": [0, *range(600)]}

    def turns(self):
        return self.at + self.world["map"][0]

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.at = self.world["map"][0] = 0
        return self.turns(), {}

    def step(self, action):
        right, deep = action == (self.turns() % 3 == 0), self.at == DEEP
        if not right and not (deep and self.back):
            self.at = self.world["map"][0] = 0
        elif deep:
            self.world["map"][0] = max(0, min(self.world["map"][0] + (1 if right else -1), LAST - DEEP))
        else:
            self.at += 1
        return self.turns(), 0.0, self.turns() == LAST, False, {}


@pytest.mark.parametrize("back", [False, True])
def test_a_large_part_that_only_deep_steps_change_in_place_is_part_of_the_state(back):
    table = Enumeration().table(Deep(back), 0.9)
    assert table.mdp.n_states == LAST + 1 and table.evidence.exact
