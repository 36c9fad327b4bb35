"""Observations that a space of integers does not hold, and spaces that cannot be numbered."""

import numpy as np
import pytest
from gymnasium import spaces

from irl_gym.errors import NotDiscrete, UnknownObservation
from irl_gym.spaces.integer_spaces import as_batch, checked_members, first_of, is_batch, key_of, ranges, to_numbers

DISCRETE = spaces.Discrete(5)
BYTES = spaces.Box(0, 255, (2,), np.uint8)
PAIR = spaces.Tuple([DISCRETE, BYTES])
NAMED = spaces.Dict(a=DISCRETE, b=BYTES)


@pytest.mark.parametrize(
    ("space", "batch", "message"),
    [
        (DISCRETE, 3, r"observation 3 is no batch: expected \(N, \.\.\.\)"),
        (DISCRETE, np.array(3), r"observation array\(3\) is no batch"),
        (DISCRETE, [[1], [2, 3]], r"observations \[\[1\], \[2, 3\]\] differ in shape"),
        (DISCRETE, [np.nan], r"observation \[nan\] has dtype float64"),
        (DISCRETE, np.array([2**64 - 1], dtype=np.uint64), "observation holds 18446744073709551615"),
        (BYTES, np.zeros((4, 3), np.uint8), r"observation of shape \(3,\): expected \(2,\)"),
        (PAIR, 5, "observation 5: expected a tuple"),
        (PAIR, np.array(5), "expected a tuple"),
        (PAIR, (np.array([1, 2]), np.zeros((3, 2), np.uint8)), r"parts of observations are \[2, 3\] long: expected one length"),
        (NAMED, None, "observation None: expected a dict"),
        (NAMED, [{"a": 1}], "expected a dict"),
        (NAMED, {"a": np.array([1])}, "observation has no key 'b'"),
    ],
)
def test_what_is_no_batch_of_a_space_is_refused(space, batch, message):
    with pytest.raises(UnknownObservation, match=message):
        to_numbers(space, batch)


@pytest.mark.parametrize(("space", "batch"), [(DISCRETE, np.zeros(0, int)), (BYTES, np.zeros((0, 2), np.uint8))])
def test_a_batch_of_none_has_no_numbers(space, batch):
    assert to_numbers(space, batch).shape == (0, len(ranges(space)))


@pytest.mark.parametrize(
    ("space", "observation"),
    [(DISCRETE, [[1], [2, 3]]), (PAIR, 5), (PAIR, None), (PAIR, ()), (PAIR, {}), (NAMED, 5), (NAMED, {}), (NAMED, [{"a": 1}])],
)
def test_what_is_no_observation_is_no_batch(space, observation):
    assert not is_batch(space, observation)


@pytest.mark.parametrize(
    "space", [spaces.Tuple([]), spaces.Dict({}), spaces.Box(0, 9, (0,), np.int64), spaces.Tuple([DISCRETE, spaces.Dict({})])]
)
def test_a_space_with_nothing_in_it_is_refused(space):
    with pytest.raises(NotDiscrete, match="is empty: expected at least one number"):
        ranges(space)


@pytest.mark.parametrize("low", [0, 2**63])
def test_a_box_beyond_64_bits_is_refused(low):
    with pytest.raises(NotDiscrete, match=r"too many to number"):
        ranges(spaces.Box(low, 2**64 - 1, (2,), np.uint64))


def test_bounds_at_the_end_of_64_bits_hold_their_members():
    space = spaces.Box(2**63 - 3, 2**63 - 1, (1,), np.int64)
    assert checked_members(space, np.array([[2**63 - 1]])).tolist() == [[2**63 - 1]]


@pytest.mark.parametrize(
    ("space", "observation", "message"),
    [
        (DISCRETE, 2.5, r"observation 2\.5 is no integer"),
        (DISCRETE, "3", "observation '3' is no integer"),
        (BYTES, [256, 1], r"observation \[256, 1\] is not of uint8"),
        (BYTES, [0.0, 1.0], "has dtype float64"),
        (BYTES, np.zeros(4, np.uint8), r"observation of shape \(4,\): expected \(2,\)"),
        (spaces.Tuple([BYTES]), ([-1, 1],), r"is not of uint8"),
    ],
)
def test_two_observations_never_share_a_key_by_rounding_or_wrapping(space, observation, message):
    with pytest.raises(UnknownObservation, match=message):
        key_of(space)(observation)


@pytest.mark.parametrize("observation", [[7, 255], (7, 255), np.array([7, 255])])
def test_the_key_does_not_depend_on_the_type_of_the_array(observation):
    assert key_of(BYTES)(observation) == key_of(BYTES)(np.array([7, 255], np.uint8))


def test_a_batch_of_one_holds_the_observation():
    one = {"a": 3, "b": np.array([1, 2], np.uint8)}
    again = first_of(NAMED, as_batch(NAMED, one))
    assert again["a"] == 3 and again["b"].tolist() == [1, 2]
