"""Stock that is ordered and sold: many actions have the same successors, and only a fixed cost tells them apart."""

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from scipy.stats import poisson

from irl_gym.mdp.rewards import TabularReward
from irl_gym.mdp.tabular_mdp import TabularMDP

HOLDING, SHORTAGE, FIXED = 0.1, 2.0, 2.0


class Inventory(gym.Env):
    """Stock 0 to `most`: order, at most up to `most`, then a Poisson demand takes what there is. It never ends."""

    def __init__(self, most: int = 10, demand: float = 3.0):
        self.most, self.demand = most, demand
        self.observation_space = self.action_space = spaces.Discrete(most + 1)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.stock = int(self.np_random.integers(self.most + 1))
        return self.stock, {}

    def step(self, action):
        filled = min(self.stock + int(action), self.most)
        wanted = int(self.np_random.poisson(self.demand))
        self.stock = max(filled - wanted, 0)
        cost = HOLDING * self.stock + SHORTAGE * max(wanted - filled, 0) + FIXED * (action > 0)
        return self.stock, -cost, False, False, {}


def exact(most: int = 10, demand: float = 3.0, gamma: float = 0.95) -> tuple[TabularMDP, TabularReward]:
    """Its table by hand."""
    size, wanted = most + 1, np.arange(60)
    p = poisson.pmf(wanted, demand)
    P, R = np.zeros((size, size, size)), np.zeros((size, size))
    for s in range(size):
        for a in range(size):
            filled = min(s + a, most)
            following = np.maximum(filled - wanted, 0)
            np.add.at(P[s, a], following, p)
            R[s, a] = -p @ (HOLDING * following + SHORTAGE * np.maximum(wanted - filled, 0)) - FIXED * (a > 0)
    return TabularMDP.from_dense(P / P.sum(axis=2, keepdims=True), gamma, np.full(size, 1 / size)), TabularReward(R)


gym.register("Inventory-v0", entry_point=Inventory, max_episode_steps=200)
