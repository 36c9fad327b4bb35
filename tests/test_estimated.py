"""What runs on tables that are estimates say of values and errors."""

import json

import numpy as np
import pytest
from counted import counted, episode
from windy_env import Windy

from irl_gym.counting import Interaction
from irl_gym.estimated import by_episodes, errors_told, evidence_told, told_by_episodes

pytestmark = pytest.mark.usefixtures("unchecked")


def paid(*rewards):
    return episode([0] * (len(rewards) + 1), [0] * len(rewards), rewards)


def test_values_by_episodes_are_discounted_means_with_an_interval():
    found = by_episodes([paid(0, 1), paid(0, 1), paid(1)], 0.5)
    assert found["value"] == pytest.approx(2 / 3) and found["low"] < 2 / 3 < found["high"] and found["episodes"] == 3


def test_an_interval_is_unknown_where_all_episodes_earned_the_same():
    assert by_episodes([paid(1), paid(1)], 0.5)["low"] is None


@pytest.mark.parametrize(("value", "outside"), [(0.5, False), (0.9, True)])
def test_a_value_of_the_table_outside_what_episodes_say_is_told(value, outside):
    found = {"value": 0.45, "low": 0.4, "high": 0.6, "episodes": 9}
    told = told_by_episodes({"expert": {"value": value, "by_episodes": found}, "random": {"value": 0.1, "by_episodes": None}})
    assert f"expert 0.450 (0.400 to 0.600), {value:.3f} by the table" in told and ("outside" in told) == outside
    assert "random" not in told


def test_nothing_is_told_of_episodes_where_the_table_is_exact():
    assert told_by_episodes({"expert": {"value": 1.0, "by_episodes": None}, "random": {"value": 0.0}}) == ""


def test_errors_are_told_in_numbers_and_words():
    rewards = np.random.default_rng(0).random(400)
    told = evidence_told(counted([episode([0, 1], [i % 2], [one]) for i, one in enumerate(rewards)]).table.evidence)
    kept = errors_told({"exact": False} | json.loads(json.dumps(told, sort_keys=True)))
    assert list(kept) == ["probabilities", "mean rewards", "values planned on it"]
    assert kept["mean rewards"].startswith(f"within {told['reward_error']:.2g}")


def test_hidden_state_that_was_found_leaves_no_bound_to_tell():
    told = evidence_told(Interaction(20_000).table(Windy(), 0.9).evidence)
    assert (
        told["error"] is None
        and "not bounded" in errors_told(told)["sampling noise"]
        and told["hidden_state"].startswith("found")
    )


def test_runs_of_earlier_versions_claim_no_more_than_sampling_noise():
    told = errors_told({"exact": False, "error": 0.1})
    assert told == {"probabilities": "within 0.1 for sampling noise, with 95 % confidence, if observations hide no state"}
    assert errors_told({"exact": True, "error": 0.0}) == {}
