"""Learning curves in their file, and the only two returns that episodes can have."""

import csv
import json
from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest

from irl_gym.intervals import as_interval, mean_interval
from irl_gym.judging.curves import curve_of, read_curve, two_returns, write_curve
from irl_gym.runs.metrics_csv import write_metrics_csv
from irl_gym.tables.tabulate import tabulate


@pytest.fixture(scope="module")
def lake():
    return tabulate(gym.make("FrozenLake-v1"), gamma=0.9, check_steps=0)


def paying(table, entries):
    return replace(table, payments=replace(table.payments, entries=entries))


def ends(table):
    return table.mdp.terminal[table.mdp.P.indices]


def test_a_goal_that_ends_the_episode_makes_two_returns(lake):
    assert two_returns(lake) == (0.0, 1.0)


def test_a_price_on_every_end_makes_two_returns(lake):
    assert two_returns(paying(lake, np.where(ends(lake), -2.0, 0.0))) == (-2.0, 0.0)


def test_two_sizes_of_reward_make_more_returns(lake):
    entries = lake.payments.entries.copy()
    entries[np.flatnonzero(ends(lake) & (entries == 0))[0]] = 0.5
    assert two_returns(paying(lake, entries)) is None


def test_a_reward_that_ends_nothing_can_be_paid_again(lake):
    entries = np.zeros_like(lake.payments.entries)
    entries[np.flatnonzero(~ends(lake))[0]] = 1.0
    assert two_returns(paying(lake, entries)) is None


def test_nothing_is_certain_of_a_table_that_is_an_estimate(lake):
    assert two_returns(replace(lake, evidence=replace(lake.evidence, exact=False))) is None


@pytest.mark.parametrize("entries", [None, 0.0])
def test_nothing_is_certain_when_payments_are_not_known_or_none(lake, entries):
    assert two_returns(paying(lake, entries if entries is None else np.zeros_like(lake.payments.entries))) is None


@pytest.mark.parametrize("name", ["Taxi-v4", "CliffWalking-v1"])
def test_a_price_on_every_step_makes_many_returns(name):
    assert two_returns(tabulate(gym.make(name), gamma=0.9, check_steps=0)) is None


def test_an_interval_that_is_unknown_is_empty_in_the_curves_file_and_unknown_when_read(tmp_path):
    made = curve_of([0, 64], [0.1, 0.2], [np.ones(5), np.array([0.0, 1.0, 2.0])])
    write_curve(made, tmp_path / "curve.csv")
    lines = (tmp_path / "curve.csv").read_text().splitlines()
    assert lines[1].endswith(",1.0,,") and lines[2].count(",,") == 0
    again = read_curve(tmp_path / "curve.csv")
    assert np.isnan([again.low[0], again.high[0]]).all() and np.isfinite([again.low[1], again.high[1]]).all()
    assert np.array_equal(again.mean, made.mean)


def test_an_interval_that_is_unknown_is_empty_in_metrics_csv_and_unknown_when_read(tmp_path):
    found = mean_interval(np.full(200, 500.0))
    low, high = found.ends
    row = {"score": 1.0, "mean_return": found.estimate, "return_low": low, "return_high": high, "agreement": None}
    config = {"env_kwargs": {}, "learner": {"type": "FiniteLP"}, "retrain": None, "gamma": 0.9, "seed": 0}
    content = json.loads(json.dumps({"policies": {"expert": row}, "reward": {"degenerate": False}}))
    write_metrics_csv(content, tmp_path / "metrics.csv", env="CartPole-v1", config=config)
    with (tmp_path / "metrics.csv").open(newline="") as file:
        told = {one["metric"]: one["value"] for one in csv.DictReader(file) if one["policy"] == "expert"}
    assert told["return_low"] == told["return_high"] == told["agreement"] == ""
    ends_read = (float(told[name]) if told[name] else None for name in ("return_low", "return_high"))
    assert str(as_interval(float(told["mean_return"]), *ends_read)) == "500.000 (too few to say)"
