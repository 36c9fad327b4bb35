"""What runs on tables that are estimates say of their errors."""

import json

import numpy as np
import pytest
from counted import counted, episode
from windy_env import Windy

from irl_gym.judging.estimated import errors_told, evidence_told
from irl_gym.tables.counted.counting import Interaction

pytestmark = pytest.mark.usefixtures("unchecked")


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
