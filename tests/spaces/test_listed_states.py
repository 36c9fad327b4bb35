import pickle

import numpy as np
import pytest
from gymnasium import spaces
from gymnasium.vector.utils import concatenate, create_empty_array
from hypothesis import given
from hypothesis import strategies as st

from irl_gym.errors import InvalidMDP, UnknownObservation
from irl_gym.spaces.integer_spaces import checked_members, key_of, keys_of_numbers, numbers_of_keys, to_numbers
from irl_gym.spaces.listed_states import ListedStates, in_order
from irl_gym.spaces.states import States

SPACES = {
    "Discrete from 5": spaces.Discrete(40, start=5),
    "MultiDiscrete": spaces.MultiDiscrete([7, 9]),
    "MultiBinary": spaces.MultiBinary((3, 3)),
    "Box": spaces.Box(-9, 9, (2,), np.int16),
    "picture": spaces.Box(0, 255, (19, 19, 3), np.uint8),
    "Tuple": spaces.Tuple([spaces.Discrete(32), spaces.Discrete(11), spaces.Discrete(2)]),
    "Dict": spaces.Dict(b=spaces.Discrete(20), a=spaces.Tuple([spaces.Discrete(9), spaces.MultiBinary(4)])),
}
every_space = pytest.mark.parametrize("space", SPACES.values(), ids=SPACES.keys())


def sampled(space, n=30):
    """Distinct numbers of n samples, in order; and the samples."""
    space.seed(0)
    members = [space.sample() for _ in range(n)]
    key = key_of(space)
    numbers = numbers_of_keys(space, list({key(one): None for one in members}))
    return numbers[in_order(numbers)], members


def equal(a, b):
    if isinstance(a, dict):
        return a.keys() == b.keys() and all(equal(a[key], b[key]) for key in a)
    if isinstance(a, tuple):
        return len(a) == len(b) and all(map(equal, a, b))
    return np.array_equal(a, b)


@every_space
def test_keys_hold_the_numbers_of_observations(space):
    _, members = sampled(space)
    batch = concatenate(space, members, create_empty_array(space, len(members)))
    assert (numbers_of_keys(space, list(map(key_of(space), members))) == to_numbers(space, batch)).all()


@every_space
def test_numbers_give_the_keys_back(space):
    keys = list(map(key_of(space), sampled(space)[1]))
    assert keys_of_numbers(space, numbers_of_keys(space, keys)) == keys


@every_space
def test_rows_decode_to_what_encodes_to_them(space):
    numbers, members = sampled(space)
    index = ListedStates(space, numbers)
    assert all(equal(index.decode(index.encode(one)), one) for one in members)


@every_space
def test_a_batch_encodes_as_each_of_its_members(space):
    numbers, members = sampled(space)
    index = ListedStates(space, numbers)
    batch = concatenate(space, members, create_empty_array(space, len(members)))
    assert index.is_batch(batch)
    assert index.encode_batch(batch).tolist() == [index.encode(one) for one in members]


@every_space
def test_a_single_observation_is_no_batch(space):
    numbers, members = sampled(space)
    assert not ListedStates(space, numbers).is_batch(members[0])


@given(st.lists(st.tuples(st.integers(-5, 5), st.integers(-300, 300)), min_size=1, max_size=60, unique=True))
def test_rows_are_the_order_of_the_numbers(pairs):
    space = spaces.Box(-300, 300, (2,), np.int32)
    index = ListedStates(space, np.array(sorted(pairs)))
    assert index.encode_batch(np.array(sorted(pairs), dtype=np.int32)).tolist() == list(range(len(pairs)))


def test_listed_states_are_states():
    assert isinstance(ListedStates(spaces.Discrete(3), np.array([[1]])), States)


def test_terminal_copies_come_last_and_decode_to_their_states():
    index = ListedStates(spaces.Discrete(9), np.array([[2], [4]]), {1: 2})
    assert (index.n_states, index.encode(4, terminated=True), index.encode(2, terminated=True), index.decode(2)) == (3, 2, 0, 4)


def test_a_batch_finds_terminal_copies_where_terminated():
    index = ListedStates(spaces.Discrete(9), np.array([[2], [4]]), {1: 2})
    assert index.encode_batch(np.array([4, 4, 2]), terminated=np.array([False, True, True])).tolist() == [1, 2, 0]


@pytest.mark.parametrize("observation", [0, 3, 8])
def test_an_observation_that_is_not_listed_is_refused(observation):
    with pytest.raises(UnknownObservation, match=f"observation {observation} is not a state"):
        ListedStates(spaces.Discrete(9), np.array([[2], [4]])).encode(observation)


def test_a_long_observation_is_cut_in_the_message():
    space = spaces.MultiBinary(40)
    with pytest.raises(UnknownObservation, match=r"\[0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0\]\.\.\."):
        ListedStates(space, np.ones((1, 40), dtype=np.int64)).encode(np.zeros(40, dtype=np.int8))


@pytest.mark.parametrize("numbers", [[[2], [2]], [[3], [2]], [[0, 1], [0, 0]]])
def test_numbers_out_of_order_are_refused(numbers):
    with pytest.raises(InvalidMDP, match="row 1"):
        ListedStates(spaces.MultiDiscrete([9] * len(numbers[0])), np.array(numbers))


@pytest.mark.parametrize("numbers", [np.zeros((0, 1), dtype=int), np.zeros(3, dtype=int), np.zeros((2, 1))])
def test_numbers_of_another_shape_or_kind_are_refused(numbers):
    with pytest.raises(InvalidMDP, match="expected \\(n, k\\) integers"):
        ListedStates(spaces.Discrete(9), numbers)


def test_listed_states_survive_pickle():
    index = pickle.loads(pickle.dumps(ListedStates(spaces.Discrete(9), np.array([[2], [4]]), {1: 2})))
    assert (index.n_states, index.encode(4)) == (3, 1)


def test_numbers_are_kept_in_few_bytes():
    space = SPACES["picture"]
    assert ListedStates(space, sampled(space)[0]).numbers.dtype == np.uint8


def test_members_of_a_space_are_checked():
    with pytest.raises(UnknownObservation, match="observation 9 is outside"):
        checked_members(spaces.Discrete(9), np.array([[3], [9]]))


def test_a_key_refuses_floats():
    with pytest.raises(UnknownObservation, match="float64"):
        key_of(spaces.MultiBinary(2))(np.array([0.0, 1.0]))


def test_numbers_of_another_space_are_refused():
    with pytest.raises(InvalidMDP, match=r"numbers have shape \(1, 2\): expected \(n, 1\), as many as Discrete\(4\) has"):
        ListedStates(spaces.Discrete(4), np.array([[0, 1]]))


@pytest.mark.parametrize("number", [-1, 4, 2**62])
def test_numbers_of_no_member_are_refused(number):
    with pytest.raises(UnknownObservation, match=f"observation {number} is outside Discrete"):
        ListedStates(spaces.Discrete(4), np.array([[number]]))


def test_negative_and_very_large_numbers_stay_integers():
    numbers = np.array([[-1], [2**60 + 1]])
    states = ListedStates(spaces.Box(-1, 2**61, (1,), np.int64), numbers)
    assert states.numbers_of(np.array([0, 1])).tolist() == numbers.tolist() and states.numbers.dtype == np.int64


def test_terminal_copies_that_do_not_stand_behind_the_rows_are_refused():
    with pytest.raises(InvalidMDP, match="terminal_copies leads to rows"):
        ListedStates(spaces.Discrete(4), np.array([[0], [3]]), {0: 3})
