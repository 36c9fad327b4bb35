"""Experiment 3 of the paper: the continuous grid world."""

from dataclasses import replace

import numpy as np
import pytest

from irl_gym.commands.ng_russell_2000.experiment_3 import Curves, Experiment3

SMALL = replace(Experiment3.quick(), trajectories=300, rounds=4, runs=1, trials=2000, optimum_trials=20_000, judged_from=3)


@pytest.fixture(scope="module")
def small():
    return SMALL.run()


def missed(outcome):
    return [one.what for one in outcome.checks if one.verdict is False]


def curves(distance, patience=2, noise=0.0):
    numbers = np.arange(len(distance), dtype=float)
    return Curves(numbers, numbers, numbers, np.array(distance), np.full(len(distance), noise), numbers, patience)


def test_experiment_3_answer_is_the_nearest_round_so_far():
    np.testing.assert_array_equal(curves([5.0, 7.0, 3.0, 4.0]).answer, [0, 0, 2, 2])


@pytest.mark.parametrize(
    ("distance", "noise", "stop"), [([5, 4, 6, 7, 8], 0.0, 3), ([5, 4, 3, 2, 1], 0.0, 4), ([5, 4, 3, 2, 1], 3.0, 2)]
)
def test_experiment_3_stop_is_that_of_fit(distance, noise, stop):
    assert curves(distance, noise=noise).stop == stop


def test_experiment_3_optimum_is_6_55(small):
    assert small.optimum == pytest.approx(6.55, abs=4 * small.optimum_error)


def test_experiment_3_values_come_near_to_the_optimum_and_not_above(small):
    values = small.of("value")
    assert values.max() < 1.02 * small.optimum and values.max() > 0.95 * small.optimum


def test_experiment_3_gives_the_same_numbers_when_run_again(small):
    assert SMALL.run().to_json() == small.to_json()


def test_experiment_3_other_seeds_give_other_numbers(small):
    assert replace(SMALL, seed=1).run().to_json()["runs"] != small.to_json()["runs"]


@pytest.mark.slow
def test_experiment_3_meets_every_bar():
    assert missed(replace(Experiment3(), others=False).run()) == []
