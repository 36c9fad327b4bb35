"""EPIC's theorem 4.9 on random MDPs."""

import numpy as np
import pytest
from models import ring

from irl_gym.judging.distances import epic
from irl_gym.judging.distances.bounds import epic_bound
from irl_gym.judging.distances.random_rewards import random_mdp
from irl_gym.mdp.tabular_mdp import TabularMDP


@pytest.mark.parametrize("seed", range(20))
def test_regret_is_within_the_bounds(seed):
    rng = np.random.default_rng(seed)
    mdp = random_mdp(rng, 6, 3, 0.9)
    R = rng.normal(size=(6, 3, 6))
    found = epic_bound(mdp, R, R + rng.choice([0.1, 1.0, 10.0]) * rng.normal(size=R.shape))
    assert -1e-9 <= found.regret <= found.sharper + 1e-9 <= found.bound + 2e-9


def test_regret_and_bounds_are_0_for_a_scaled_reward():
    mdp = random_mdp(np.random.default_rng(0), 6, 3, 0.9)
    R = np.random.default_rng(1).normal(size=(6, 3, 6))
    found = epic_bound(mdp, R, 2 * R)
    assert max(abs(found.regret), found.bound) < 1e-8


def test_K_is_1_over_the_coverage_of_a_certain_transition():
    mdp = ring([[1, 1], [0, 0]])
    found = epic_bound(mdp, np.array([0.0, 1.0]), np.arange(8.0).reshape(2, 2, 2) ** 2)
    assert found.K == pytest.approx(4.0)  # each of 2 states half of the time: 0.5 / (1 / 8)


def test_K_counts_every_time_step_not_the_first_alone():
    """From any of 4 states to state 0: at first each transition has a quarter, later one is certain."""
    P = np.zeros((4, 2, 4))
    P[:, :, 0] = 1.0
    found = epic_bound(TabularMDP.from_dense(P, 0.9, np.full(4, 0.25)), np.arange(4.0), np.arange(8.0).reshape(4, 2) ** 2)
    assert found.K == pytest.approx(32.0)  # 1 / (1 / 32)


def test_the_sharper_bound_is_the_deviation_of_the_canonical_reward():
    mdp = random_mdp(np.random.default_rng(2), 5, 2, 0.8)
    R, other = np.random.default_rng(3).normal(size=(2, 5, 2, 5))
    mean = R.mean(axis=(1, 2))
    canonical = R + 0.8 * mean - mean[:, None, None] - 0.8 * mean.mean()
    found = epic_bound(mdp, R, other)
    assert found.sharper == pytest.approx(4 * found.K * canonical.std() * found.distance / (1 - 0.8))


def test_the_bound_is_that_of_the_theorem():
    mdp = random_mdp(np.random.default_rng(2), 5, 2, 0.8)
    R, other = np.random.default_rng(3).normal(size=(2, 5, 2, 5))
    found = epic_bound(mdp, R, other)
    assert found.distance == pytest.approx(epic(mdp, R, other, coverage=np.full(R.shape, 1 / R.size)))
    assert found.bound == pytest.approx(16 * found.K * np.sqrt((R**2).mean()) * found.distance / (1 - 0.8))
