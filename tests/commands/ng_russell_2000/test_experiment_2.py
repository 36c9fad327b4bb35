"""Experiment 2 of the paper: the mountain car."""

import json
from dataclasses import replace

import numpy as np
import pytest

from irl_gym.commands.ng_russell_2000.experiment_2 import PARKING, PLATEAU, Experiment2, gaussians

QUICK = Experiment2.quick()


@pytest.fixture(scope="module")
def outcome():
    return QUICK.run()


def missed(outcome):
    return [one.what for one in outcome.checks if one.verdict is False]


def test_experiment_2_meets_every_bar_when_quick(outcome):
    assert missed(outcome) == []


def test_experiment_2_features_sum_to_the_plateau_on_the_road():
    road = np.stack([np.linspace(-1.2, 0.5, 50), np.linspace(-0.07, 0.07, 50)], axis=1)
    np.testing.assert_allclose(gaussians()(road).sum(axis=1), -PLATEAU, atol=4e-4)


def test_experiment_2_reward_of_the_valley_changes_sign_at_the_zeros(outcome):
    for (left, right), R in zip(outcome.humps, outcome.park.R, strict=True):
        road = outcome.park.road
        assert left < PARKING[0] < PARKING[1] < right
        assert (R[(road > left) & (road < right)] > 0).all()
        assert R[road < left][-1] <= 0 and R[road > right][0] <= 0


def test_experiment_2_hump_is_nan_when_the_valley_pays_nothing(outcome):
    flat = replace(outcome.park, R=-np.ones_like(outcome.park.R))
    assert np.isnan(flat.hump(0)).all()
    assert json.dumps(replace(outcome, park=flat).to_json(), allow_nan=False)


def test_experiment_2_cars_that_leave_do_so_under_the_expert_too(outcome):
    expert, *fitted = outcome.drives
    assert 0 < expert.left < 0.2 and all(abs(one.left - expert.left) < 0.02 for one in fitted)


@pytest.mark.slow
def test_experiment_2_meets_every_bar():
    assert missed(replace(Experiment2(), others=False).run()) == []
