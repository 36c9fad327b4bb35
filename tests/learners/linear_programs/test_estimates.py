"""Sampled values of policies, and which round is the answer."""

import numpy as np
import pytest

from irl_gym.learners.linear_programs.estimates import Estimate, nearest, usable
from irl_gym.mdp.episodes import Episode


def test_estimate_of_one_feature_keeps_its_shape():
    one = Estimate.of(np.array([[1.0], [3.0]]))
    assert one.mean.tolist() == [2.0] and one.variance(np.ones(1)) == pytest.approx(1.0)


def test_estimate_of_one_episode_knows_no_error():
    assert np.isnan(Estimate.of(np.ones((1, 3))).variances).all()


@pytest.mark.parametrize("n", [3, 5, 40])
def test_estimate_has_the_variances_of_numpy(n):
    sums = np.random.default_rng(n).normal(size=(n, 5))
    one, alpha = Estimate.of(sums), np.arange(5.0)
    assert one.variances == pytest.approx(sums.var(axis=0, ddof=1) / n)
    assert one.variance(alpha) == pytest.approx((sums @ alpha).var(ddof=1) / n)


@pytest.mark.parametrize(
    ("distances", "errors", "expected"),
    [([3.0, 1.0], [0.1, 0.1], (1, False)), ([3.0, 1.0], [0.1, 2.0], (1, True)), ([1.0, 2.0, 3.0], [0.1] * 3, (0, True))],
)
def test_nearest_is_the_least_distance_until_nothing_comes_nearer(distances, errors, expected):
    assert nearest(distances, errors, patience=2) == expected


def test_usable_keeps_to_the_limit_of_the_world():
    ended = Episode(np.array([0, 1]), np.array([0]), np.zeros(1), True, False)
    assert usable([ended], 50, 20).horizon == 20
