"""A stream of pairs becomes episodes, one at a time."""

import numpy as np
import pytest
from gymnasium import spaces

from irl_gym.demonstrations.datasets import read_minari, write_minari
from irl_gym.demonstrations.imports.pairs import from_pairs
from irl_gym.errors import InvalidDemonstrations, InvalidParameter

LAKE = {"space": spaces.Discrete(16), "n_actions": 4}


def seen(episodes):
    return [(one.observations.tolist(), one.actions.tolist(), one.terminated) for one in episodes]


def test_a_pair_without_action_is_the_last_observation():
    assert seen(from_pairs([(0, 1), (4, 1), (8, None), (0, 2), (1, None)], **LAKE)) == [
        ([0, 4, 8], [1, 1], False),
        ([0, 1], [2], False),
    ]


def test_none_ends_an_episode():
    pairs = [None, (0, 1), (4, 1), None, None, (0, 2), (1, 1)]
    assert seen(from_pairs(pairs, **LAKE)) == [([0, 4, 4], [1, 1], False), ([0, 1, 1], [2, 1], False)]


def test_drop_leaves_out_last_actions_and_counts_them_at_the_end():
    with pytest.warns(UserWarning, match="the last action of 2 of 2 episodes is dropped"):
        dropped = seen(from_pairs([(0, 1), (4, 1), None, (0, 2), (1, 1)], last="drop", **LAKE))
    assert dropped == [([0, 4], [1], False), ([0, 1], [2], False)]


def test_repeat_keeps_the_last_action():
    assert seen(from_pairs([(0, 1), None, (0, 2), (1, 1)], last="repeat", **LAKE)) == [
        ([0, 0], [1], False),
        ([0, 1, 1], [2, 1], False),
    ]


def test_rewards_may_come_with_the_pairs():
    (one,) = from_pairs([(0, 1, 0.5), (4, 1, -1.0), (8, None, None)], **LAKE)
    assert one.rewards.tolist() == [0.5, -1.0]


def test_a_change_of_episode_ends_one():
    rows = [("a", 0, 1), ("a", 4, 1), ("b", 0, 2), ("b", 1, 1)]
    assert len(list(from_pairs(rows, fields=("episode", "observation", "action"), **LAKE))) == 2


def test_a_terminated_pair_ends_one_and_its_last_observation_may_follow():
    rows = [(0, 1, False), (4, 1, True), (8, None, None), (0, 2, True), (1, 1, False), (5, None, None)]
    episodes = from_pairs(rows[:3] + rows[4:], fields=("observation", "action", "terminated"), **LAKE)
    assert seen(episodes) == [([0, 4, 8], [1, 1], True), ([1, 5], [1], False)]


def test_a_terminated_pair_ends_one_without_an_observation_after_it():
    rows = [(0, 1, False), (4, 1, True), (0, 2, False), (1, 1, True)]
    episodes = from_pairs(rows, fields=("observation", "action", "terminated"), last="repeat", **LAKE)
    assert [one.actions.tolist() for one in episodes] == [[1, 1], [2, 1]]


def test_one_episode_is_in_memory_at_a_time():
    read = []

    def stream():
        for number in range(10**9):
            read.append(number)
            yield number % 16, None if number % 4 == 3 else 0

    episodes = from_pairs(stream(), **LAKE)
    next(episodes)
    next(episodes)
    assert len(read) == 8


@pytest.mark.parametrize(
    "pairs, message",
    [
        ([], "there are no pairs"),
        ([(0, 1), (4, 9), None], r"pair 1 \(from 0\) has action 9: expected a whole number from 0 to 3"),
        ([(0, 1), (4, 1), None, (0, 1), (16, 1)], r"pair 4 \(from 0\) has observation 16"),
        ([(0, 1), (4, 1.5), (8, None)], r"pair 1 .* has action 1.5"),
        ([(0, 1), (4, 1.5, 2, 3)], r"pair 1 .* is \(4, 1.5, 2, 3\): expected \(observation, action, reward\)"),
        ([7], r"pair 0 .* is 7"),
        ([(0, 1, 1.0), (4, 1, None), (8, 1, 0.0), (9, None)], "pair 1 .* has no reward"),
        ([(0, 1, 1.0), (4, 1, np.inf), (9, None)], "pair 1 .* has reward inf"),
        ([(8, None)], "pair 0 .* is the only row of its episode"),
        ([([0, 1], 1), (4, 1)], r"pair 1 .* of shape \(\)"),
    ],
)
def test_pairs_that_cannot_be_right_are_refused(pairs, message):
    with pytest.raises(InvalidDemonstrations, match=message):
        list(from_pairs(pairs, **LAKE))


def test_an_episode_that_goes_on_after_its_end_is_refused():
    rows = [("a", 0, 1, True), ("a", 4, 1, False), ("a", 8, None, None)]
    with pytest.raises(InvalidDemonstrations, match=r"pair 0 .* is terminated in the middle"):
        list(from_pairs(rows, fields=("episode", "observation", "action", "terminated"), **LAKE))


def test_flags_may_be_text():
    rows = [(0, 1, "False"), (4, 1, "false"), (8, 1, "True"), (0, 2, "False"), (1, 1, "False")]
    episodes = from_pairs(rows, fields=("observation", "action", "terminated"), last="repeat", **LAKE)
    assert [len(one) for one in episodes] == [3, 2]


def test_a_flag_that_is_no_boolean_is_named():
    with pytest.raises(InvalidDemonstrations, match=r"pair 1 \(from 0\) has truncated 'maybe'"):
        list(from_pairs([(0, 1, False), (4, 1, "maybe")], fields=("observation", "action", "truncated"), **LAKE))


def test_an_array_as_episode_is_refused():
    rows = [(np.array([1, 2]), 0, 1), (np.array([1, 2]), 4, 1)]
    with pytest.raises(InvalidDemonstrations, match=r"pair 0 \(from 0\) has episode array.*expected one number or name"):
        list(from_pairs(rows, fields=("episode", "observation", "action"), **LAKE))


@pytest.mark.parametrize("fields", [("action",), ("observation", "action", "colour"), ("observation", "action", "action")])
def test_unknown_fields_are_refused_at_once(fields):
    with pytest.raises(InvalidParameter, match="fields are"):
        from_pairs([(0, 1)], fields=fields, **LAKE)


def test_a_refused_pair_leaves_no_dataset(tmp_path):
    import gymnasium as gym

    env = gym.make("FrozenLake-v1")
    pairs = [(0, 1), (4, None), (0, 77), (4, None)]
    with pytest.raises(InvalidDemonstrations, match="pair 2"):
        write_minari(from_pairs(pairs, env=env), "stream-v0", env, root=tmp_path, algorithm="a person")
    assert not list(tmp_path.iterdir())
    write_minari(from_pairs(pairs[:2], env=env), "stream-v0", env, root=tmp_path, algorithm="a person")
    assert seen(read_minari("stream-v0", root=tmp_path)) == [([0, 4], [1], False)]
