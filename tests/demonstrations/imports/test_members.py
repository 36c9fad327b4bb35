"""Observations are checked against every kind of space, all rows at once."""

import numpy as np
import pytest
from demonstrations.imports.demonstrators import SPACES, same
from gymnasium import spaces

from irl_gym.demonstrations.imports.members import members, width
from irl_gym.errors import InvalidDemonstrations, NotDiscrete


def name(row):
    return f"row {row}"


def samples(space, n=5):
    space.seed(4)
    return [space.sample() for _ in range(n)]


@pytest.mark.parametrize("kind", SPACES)
def test_members_of_a_space_are_members_of_it(kind):
    batch = members(SPACES[kind], samples(SPACES[kind]), "observation", name)
    assert same(batch, members(SPACES[kind], batch, "observation", name))


@pytest.mark.parametrize("kind", SPACES)
def test_the_width_is_that_of_the_numbers(kind):
    parts = {"Discrete": 1, "Tuple": 3, "Box of integers": 4, "Box of floats": 3, "Box of doubles": 1}
    assert width(SPACES[kind]) == (parts | {"MultiDiscrete": 2, "MultiBinary": 3, "Dict": 4, "nested": 4})[kind]


def test_a_matrix_is_split_among_the_parts_of_a_tuple():
    batch = members(SPACES["Tuple"], np.array([[13, 10, 0], [20, 1, 1]]), "observation", name)
    assert [part.tolist() for part in batch] == [[13, 20], [10, 1], [0, 1]]


def test_float32_bounds_are_compared_in_float32():
    space = spaces.Box(np.float32(-0.1), np.float32(0.1), (1,), np.float32)
    assert members(space, np.array([[0.1], [-0.1]]), "observation", name).dtype == np.float32


@pytest.mark.parametrize(
    "space, rows, message",
    [
        (spaces.Discrete(3, start=3), [3, 6], "row 1 has observation 6: expected a member of Discrete"),
        (spaces.Discrete(3, start=3), [3, 2], "row 1 has observation 2"),
        (spaces.Box(0, 9, (2,), np.uint8), [[1, 2], [3, -1]], r"row 1 has observation \[3, -1\]"),
        (spaces.Box(0, 9, (2,), np.uint8), [[1, 2], [3, 300]], r"row 1 has observation \[3, 300\]"),
        (spaces.Box(0, 9, (2,), np.uint8), [[1, 2, 3]], r"observations have shape \(1, 3\): expected \('n', 2\)"),
        (spaces.Box(-np.inf, np.inf, (1,), np.float32), [[0.0], [np.inf]], r"row 1 has observation \[inf\]"),
        (spaces.Box(-np.inf, np.inf, (1,), np.float32), [[0.0], [1e300]], r"row 1 has observation \[1e\+300\]"),
        (spaces.Box(-1, 1, (1,), np.float32), [[0.0], [1.5]], r"row 1 has observation \[1.5\]"),
        (spaces.MultiDiscrete([3, 4]), [[2, 3], [2, 4]], r"row 1 has observation \[2, 4\]"),
        (spaces.MultiBinary(2), [[0, 1], [0, 2]], r"row 1 has observation \[0, 2\]"),
        (SPACES["Tuple"], [(1, 2, 0), (1, 2)], r"row 1 has observation \(1, 2\): expected 3 parts"),
        (SPACES["Tuple"], [(1, 2, 0), (1, 11, 0)], r"row 1 has observation\[1\] 11"),
        (SPACES["Tuple"], [(1, 2, 0), 5], "row 1 has observation 5: expected 3 parts"),
        (SPACES["Tuple"], np.zeros((2, 4)), r"have shape \(2, 4\): expected \(n, 3\)"),
        (SPACES["Tuple"], (np.zeros(2), np.zeros(2), np.zeros(3)), r"have \[2, 2, 3\] rows"),
        (SPACES["Tuple"], (np.zeros(2), np.zeros(2)), "have 2 parts: expected 3"),
        (SPACES["nested"], [(1, {"a": 1, "b": [0, 1]}), (1, {"a": 4, "b": [0, 1]})], r"row 1 has observation\[1\]\['a'\] 4"),
        (SPACES["nested"], [(1, {"a": 1})], r"row 0 has observation\[1\] {'a': 1}: expected the keys \['a', 'b'\]"),
        (SPACES["Dict"], {"place": np.zeros((2, 2))}, "have the keys"),
        (SPACES["Dict"], [3], "row 0 has observation 3: expected the keys"),
        (SPACES["Dict"], 3, "row 0 has observation 3: expected the keys"),
        (spaces.Discrete(3), 3, r"observations have shape \(\)"),
        (spaces.Discrete(3), np.array(["2020-01-01"], dtype="datetime64[D]"), "expected numbers"),
        (spaces.Discrete(3), [1 + 2j], "expected numbers"),
        (spaces.Discrete(3), [None], "row 0 has observation nan"),
    ],
)
def test_what_is_outside_is_refused(space, rows, message):
    with pytest.raises(InvalidDemonstrations, match=message):
        members(space, rows, "observation", name)


def test_a_space_of_something_else_is_refused():
    with pytest.raises(NotDiscrete, match="cannot be read from arrays"):
        members(spaces.Text(5), ["abc"], "observation", name)
