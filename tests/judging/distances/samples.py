"""Samples of random models, and rewards of them, for the tests of sampled distances."""

import numpy as np
from models import random_model

from irl_gym.judging.distances import FreshSample, TableModel
from irl_gym.judging.distances.random_rewards import shaped

CONTINUING, ENDING = random_model(1, 8, 3, "sparse"), random_model(2, 8, 3, "terminal")


def rewards_of(model, noise=1.0):
    rng = np.random.default_rng(5)
    R = rng.normal(size=(8, 3, 8))
    other = R + noise * rng.normal(size=R.shape)
    return R, shaped(rng, model.mdp, other) if noise else 2 * R


def function(R):
    return lambda observations, actions, following: R[observations, actions, following]


def drawn(model, seed, n=1000, m=60):
    """Transitions, and fresh draws with uniform states and actions."""
    rng = np.random.default_rng(seed)
    table = TableModel(model.mdp)
    states = rng.integers(8, size=m)
    return table.transitions(n, rng), FreshSample(0.9, states, rng.integers(3, size=m), model.mdp.terminal[states]), rng


def random_actions(observations, rng):
    return rng.integers(3, size=len(observations))
