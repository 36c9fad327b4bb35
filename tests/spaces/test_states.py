import pickle

import numpy as np
import pytest
from gymnasium import spaces
from gymnasium.vector.utils import concatenate, create_empty_array
from hypothesis import given
from hypothesis import strategies as st

from irl_gym.errors import InvalidMDP, InvalidParameter, NotDiscrete, UnknownObservation
from irl_gym.spaces.states import StateIndex, States

small = st.integers(1, 4)
leaves = st.one_of(
    st.builds(lambda n, start: spaces.Discrete(n, start=start), small, st.integers(-3, 3)),
    st.builds(spaces.MultiDiscrete, st.lists(small, min_size=1, max_size=3)),
    st.builds(lambda n, m: spaces.MultiDiscrete(np.full((n, m), 2)), st.integers(1, 2), st.integers(1, 2)),
    st.builds(lambda n, low: spaces.MultiDiscrete([n, 2], start=[low, 1]), small, st.integers(-3, 3)),
    st.builds(spaces.MultiBinary, st.integers(1, 3)),
    st.builds(lambda low, n, w: spaces.Box(low, low + n, (w,), np.int16), st.integers(-3, 3), small, st.integers(1, 2)),
    st.builds(lambda n: spaces.Box(0, n, (), np.uint8), small),
)
nested = st.recursive(
    leaves,
    lambda parts: st.one_of(
        st.lists(parts, min_size=1, max_size=2).map(spaces.Tuple),
        st.dictionaries(st.sampled_from("abc"), parts, min_size=1, max_size=2).map(spaces.Dict),
    ),
    max_leaves=3,
)
EXAMPLES = {
    "Discrete": (spaces.Discrete(3), 3),
    "Discrete from 5": (spaces.Discrete(3, start=5), 3),
    "MultiDiscrete": (spaces.MultiDiscrete([2, 3]), 6),
    "MultiBinary": (spaces.MultiBinary((2, 2)), 16),
    "Box": (spaces.Box(-1, 1, (2,), np.int8), 9),
    "Tuple": (spaces.Tuple([spaces.Discrete(2), spaces.MultiBinary(2)]), 8),
    "Dict": (spaces.Dict(x=spaces.Discrete(2), y=spaces.Discrete(3, start=1)), 6),
    "nested": (spaces.Dict(x=spaces.Tuple([spaces.Discrete(2), spaces.Dict(z=spaces.Discrete(5))])), 10),
}
examples = pytest.mark.parametrize(("space", "size"), EXAMPLES.values(), ids=EXAMPLES.keys())


def batch_of(space, members):
    """Stacked as Gymnasium's vector environments do."""
    return concatenate(space, members, create_empty_array(space, len(members)))


@examples
def test_state_index_counts_the_members_of_a_space(space, size):
    assert StateIndex(space).n_states == size


@given(space=nested, seed=st.integers(0, 1000))
def test_encode_of_decode_is_the_row(space, seed):
    index = StateIndex(space)
    row = int(np.random.default_rng(seed).integers(index.n_states))
    assert index.encode(index.decode(row)) == row


@given(space=nested, seed=st.integers(0, 1000))
def test_decode_gives_a_member_of_the_space(space, seed):
    index = StateIndex(space)
    assert space.contains(index.decode(seed % index.n_states))


@given(space=nested, seed=st.integers(0, 1000))
def test_encode_of_a_sample_is_a_row_that_decodes_to_it(space, seed):
    space.seed(seed)
    index, sample = StateIndex(space), space.sample()
    assert spaces.flatten(space, index.decode(index.encode(sample))).tolist() == spaces.flatten(space, sample).tolist()


@given(space=nested, seed=st.integers(0, 1000))
def test_encode_batch_equals_encode_of_each(space, seed):
    space.seed(seed)
    index, members = StateIndex(space), [space.sample() for _ in range(5)]
    assert index.encode_batch(batch_of(space, members)).tolist() == [index.encode(member) for member in members]


@given(space=nested)
def test_decode_batch_is_what_encode_batch_reads(space):
    index = StateIndex(space)
    rows = np.arange(min(index.n_states, 50))
    np.testing.assert_array_equal(index.encode_batch(index.decode_batch(rows)), rows)


@pytest.mark.parametrize("name", ["Discrete", "Discrete from 5", "MultiDiscrete", "MultiBinary", "Box", "Dict"])
def test_is_batch_tells_one_from_many(name):
    space, _ = EXAMPLES[name]
    index = StateIndex(space)
    assert (index.is_batch(space.sample()), index.is_batch(batch_of(space, [space.sample()]))) == (False, True)


def test_encode_finds_the_terminal_copy_when_terminated():
    index = StateIndex(spaces.Discrete(3), terminal_copies={1: 3})
    assert [index.encode(o, terminated=t) for o in (1, 2) for t in (False, True)] == [1, 3, 2, 2]


def test_encode_batch_finds_terminal_copies_where_terminated():
    index = StateIndex(spaces.Discrete(3), terminal_copies={1: 3, 2: 4})
    ended = np.array([False, True, True, True])
    assert index.encode_batch(np.array([1, 1, 2, 0]), terminated=ended).tolist() == [1, 3, 4, 0]


def test_decode_of_a_terminal_copy_is_its_state():
    assert StateIndex(spaces.Discrete(3), terminal_copies={1: 3}).decode(3) == 1


def test_state_index_survives_pickle():
    index = pickle.loads(pickle.dumps(StateIndex(EXAMPLES["nested"][0], terminal_copies={1: 10})))
    assert (index.n_states, index.encode(index.decode(7))) == (11, 7)


@pytest.mark.parametrize(
    "space",
    [
        spaces.Box(0, 1, (2,)),
        spaces.Tuple([spaces.Discrete(2), spaces.Box(0, 1)]),
        spaces.Dict(x=spaces.Text(5)),
        spaces.Sequence(spaces.Discrete(2)),
    ],
)
def test_state_index_refuses_a_space_that_is_not_made_of_integers(space):
    with pytest.raises(NotDiscrete, match=r"Discretise the environment first|Leave text out|Show the same"):
        StateIndex(space)


@pytest.mark.parametrize(
    "space",
    [
        spaces.MultiDiscrete([2**31] * 3),
        spaces.Box(np.iinfo(np.int64).min, np.iinfo(np.int64).max, (1,), np.int64),
        spaces.MultiBinary(63),
    ],
)
def test_state_index_refuses_a_space_too_large_to_number(space):
    with pytest.raises(NotDiscrete, match=r"more than 2\^62 elements"):
        StateIndex(space)


@pytest.mark.parametrize(
    ("name", "observation"),
    [
        ("Discrete", 3),
        ("Discrete", -1),
        ("Discrete", 1.0),
        ("Discrete", "left"),
        ("Discrete", None),
        ("Discrete", [0, 1]),
        ("Discrete from 5", 4),
        ("Discrete from 5", 8),
        ("MultiDiscrete", [1, 3]),
        ("MultiDiscrete", [1, 2, 0]),
        ("MultiDiscrete", [1, [2, 0]]),
        ("MultiBinary", [[0, 1], [1, 2]]),
        ("Box", [0.5, 0.5]),
        ("Tuple", (1,)),
        ("Tuple", (1, [0, 1], 2)),
        ("Tuple", 3),
        ("Dict", {"x": 1}),
        ("Dict", {"x": 1, "y": 0}),
        ("Dict", 3),
    ],
)
def test_encode_refuses_what_is_no_member(name, observation):
    with pytest.raises(UnknownObservation, match="observation"):
        StateIndex(EXAMPLES[name][0]).encode(observation)


def test_encode_names_the_observation_that_is_outside():
    with pytest.raises(UnknownObservation, match=r"observation 7 is outside Discrete\(3\)"):
        StateIndex(spaces.Discrete(3)).encode_batch(np.array([0, 7, 9]))


def test_state_index_offers_the_interface_of_states():
    assert isinstance(StateIndex(spaces.Discrete(3)), States)


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        ([5], "row 5 is outside the table: expected 0 to 4"),
        ([2, -1], "row -1 is outside the table"),
        (3, r"rows have shape \(\) and dtype int64: expected \(N,\) integers"),
        ([1.0], "dtype float64"),
        ([True], "dtype bool"),
        ([[1]], r"shape \(1, 1\)"),
    ],
)
def test_rows_that_are_not_the_tables_are_refused(rows, message):
    with pytest.raises(InvalidParameter, match=message):
        StateIndex(spaces.Discrete(4), {1: 4}).decode_batch(rows)


def test_no_rows_are_no_observations():
    assert StateIndex(spaces.MultiDiscrete([2, 3])).decode_batch([]).shape == (0, 2)


def test_a_row_of_a_space_too_large_to_list_is_decoded():
    assert StateIndex(spaces.MultiDiscrete([1000] * 6)).decode(5_003).tolist() == [0, 0, 0, 0, 5, 3]


def test_terminal_copies_in_any_order_are_decoded():
    index = StateIndex(spaces.Discrete(4), {3: 4, 1: 6, 2: 5})
    assert index.decode_batch([4, 5, 6, 0]).tolist() == [3, 2, 1, 0]


@pytest.mark.parametrize("copies", [{1: 9}, {1: 3}, {1: 4, 2: 4}, {9: 4}, {-1: 4}])
def test_terminal_copies_that_do_not_stand_behind_the_rows_are_refused(copies):
    with pytest.raises(InvalidMDP, match="terminal_copies"):
        StateIndex(spaces.Discrete(4), copies)


def test_as_many_ends_as_observations_are_expected():
    with pytest.raises(UnknownObservation, match=r"terminated has shape \(2,\): expected \(3,\)"):
        StateIndex(spaces.Discrete(4), {1: 4}).encode_batch([1, 2, 3], terminated=np.array([True, False]))
