"""EPIC's theorem 4.9 on random MDPs."""

import numpy as np
import pytest

from irl_gym.distances.bounds import epic_bound
from irl_gym.distances.random_rewards import random_mdp


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
    from models import ring

    mdp = ring([[1, 1], [0, 0]])
    found = epic_bound(mdp, np.array([0.0, 1.0]), np.arange(8.0).reshape(2, 2, 2) ** 2)
    assert found.K == pytest.approx(4.0)  # each of 2 states half of the time: 0.5 / (1 / 8)
