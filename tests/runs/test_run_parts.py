"""The parts of a run: its curve, and what its states and actions are called."""

import numpy as np
import pytest
from gymnasium import spaces
from tiny_env import TableEnv, lottery

from irl_gym.judging.curves import Curve, read_curve, sampled_returns, write_curve
from irl_gym.judging.metrics import policy_value
from irl_gym.spaces.listed_states import ListedStates, usual_observation
from irl_gym.spaces.names import action_names, state_name

# --- the parts ---


def test_sampled_returns_have_the_mean_that_the_table_says(toy_text):
    table = toy_text("FrozenLake 4x4 slippery")
    policies = [np.full(16, 1), np.full(16, 2)]
    found = sampled_returns(table, policies, 4_000, limit=100, seed=0)
    undiscounted = type(table.mdp)(table.mdp.P, 1 - 1e-9, table.mdp.d0)
    for returns, policy in zip(found, policies, strict=True):
        error = returns.std() / np.sqrt(returns.size)
        assert abs(returns.mean() - policy_value(undiscounted, table.reward, policy, horizon=100)) < 4 * error


def test_a_curve_is_read_as_it_was_written(tmp_path):
    curve = Curve(*np.random.default_rng(0).random((5, 7)).round(12))
    write_curve(Curve(np.arange(7.0), curve.value, curve.mean, curve.low, curve.high), tmp_path / "curve.csv")
    again = read_curve(tmp_path / "curve.csv")
    assert np.array_equal(again.steps, np.arange(7)) and np.array_equal(again.high, curve.high)


@pytest.mark.parametrize(
    ("env_id", "observation", "name"),
    [
        ("Taxi-v4", 328, "taxi 3, 1; passenger at Y, to R"),
        ("Blackjack-v1", {"natural": 1, "observation": (21, 1, 1)}, "21 with an ace against ace, natural 1"),
        ("Deck-v0", (3, 1), "(3, 1)"),
        ("CartPole-v1", np.array([0.01234, -1.0, 0, 0], dtype=np.float32), "(0.0123, -1, 0, 0)"),
        (None, np.zeros((7, 7, 3), dtype=np.uint8), "7 x 7 x 3 numbers, all 0"),
        (None, np.eye(5, dtype=np.int8)[[1, 0, 0, 0, 0]] * 2, "5 x 5 numbers: 2 at [0, 1], 2 at [1, 0], 2 at [2, 0], 2 more"),
        (None, np.zeros(9, dtype=np.float32), "9 numbers"),
    ],
)
def test_a_state_is_called_by_its_observation(env_id, observation, name):
    assert state_name(env_id, observation) == name


def test_states_of_many_numbers_are_called_by_what_differs():
    maps = np.tile(np.arange(25).reshape(5, 5) % 3, (4, 1, 1)).reshape(4, 25)
    maps[np.arange(4), [3, 7, 11, 24]] = 9
    states = ListedStates(spaces.Box(0, 9, (5, 5), np.int8), maps[np.lexsort(maps.T[::-1])])
    names = [state_name(None, states.decode(row), usual=usual_observation(states)) for row in range(4)]
    assert sorted(names) == [f"5 x 5 numbers: 9 at {place}" for place in ([0, 3], [1, 2], [2, 1], [4, 4])]


def test_parts_of_many_numbers_are_called_by_what_differs():
    usual = {"map": np.zeros(9, dtype=np.int8), "key": 0}
    assert state_name(None, {"map": np.eye(9, dtype=np.int8)[4], "key": 1}, usual=usual) == "map 9 numbers: 1 at [4], key 1"


def test_actions_that_nobody_named_are_numbered():
    assert action_names(TableEnv(lottery(0.5), [1.0])) == ("action 0",)
