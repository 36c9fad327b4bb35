"""Feature maps of integers, and the checks that every map goes through."""

import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from irl_gym.errors import InvalidFeatures
from irl_gym.features import feature_maps as module
from irl_gym.features.bases import Fourier, Polynomial, RadialBasis
from irl_gym.features.feature_maps import (
    FeatureMap,
    Functions,
    OneHot,
    Table,
    Unravel,
    as_features,
    blocks,
    check_length,
    checked_features,
    over_rows,
)
from irl_gym.spaces.batches import batch_of_one, batch_size

POINTS = np.random.default_rng(0).uniform(-1, 2, size=(9, 2))
ROWS = np.array([3, 0, 5, 5])
MAPS = {
    "OneHot": (OneHot(6), ROWS),
    "Table": (Table(np.arange(24.0).reshape(6, 4)), ROWS),
    "Functions": (Functions(lambda x: np.stack([x, x**2, -x], axis=1), 3), ROWS),
    "RadialBasis": (RadialBasis.grid([0, 0], [1, 1], 3), POINTS),
    "RadialBasis of rows": (RadialBasis.grid([0, 0], [1, 2], (2, 3), coordinates=Unravel((2, 3))), ROWS),
    "Fourier": (Fourier([0, 0], [1, 1], 2), POINTS),
    "Polynomial": (Polynomial([0, 0], [1, 1], 3), POINTS),
}
every_map = pytest.mark.parametrize(("phi", "observations"), MAPS.values(), ids=MAPS.keys())
COLUMNS = [slice(None), slice(0, 1), slice(1, 3), slice(2, None), slice(-1, None), slice(0, 99), slice(0, 0)]


def squares(x):
    return np.stack([x, x**2], axis=1)


# --- every map ---


@every_map
def test_map_is_a_feature_map(phi, observations):
    assert isinstance(phi, FeatureMap)


@every_map
def test_map_gives_a_row_an_observation_and_a_column_a_feature(phi, observations):
    assert phi(observations).shape == (len(observations), phi.n_features)


@every_map
@pytest.mark.parametrize("columns", COLUMNS, ids=str)
def test_map_gives_the_columns_of_a_slice(phi, observations, columns):
    np.testing.assert_array_equal(phi(observations, columns), phi(observations)[:, columns])


@every_map
def test_map_says_what_it_does_with_the_coordinates(phi, observations):
    assert isinstance(phi.scaling, str) and len(phi.scaling) > 10


@pytest.mark.parametrize("name", [name for name in MAPS if name != "Functions"])
def test_map_survives_pickle(name):
    phi, observations = MAPS[name]
    again = pickle.loads(pickle.dumps(phi))
    np.testing.assert_array_equal(again(observations), phi(observations))


def test_functions_survive_pickle_when_the_function_does():
    again = pickle.loads(pickle.dumps(Functions(squares, 2, "x and its square")))
    assert again.scaling == "x and its square" and again(np.array([3])).tolist() == [[3, 9]]


@every_map
def test_map_takes_a_batch_of_none(phi, observations):
    assert phi(observations[:0]).shape == (0, phi.n_features)


# --- values ---


def test_one_hot_is_the_identity():
    np.testing.assert_array_equal(OneHot(4)(np.arange(4)), np.eye(4))


def test_table_gives_its_rows():
    assert Table(np.array([[1, 2], [3, 4], [5, 6]]))(np.array([2, 0])).tolist() == [[5, 6], [1, 2]]


def test_table_does_not_change_with_the_array_it_was_made_from():
    values = np.zeros((2, 2))
    phi = Table(values)
    values[:] = 7
    assert not phi.values.any() and not phi.values.flags.writeable


def test_table_names_the_range_of_its_values():
    assert Table(np.array([[-1.5, 2], [3, 4]])).scaling == "a table as given, values -1.5 to 4"


def test_unravel_gives_the_digits_of_a_state():
    row, column, passenger, destination = 4, 0, 2, 3
    taxi = ((row * 5 + column) * 5 + passenger) * 4 + destination
    assert Unravel((5, 5, 5, 4))(np.array([taxi, 0])).tolist() == [[4, 0, 2, 3], [0, 0, 0, 0]]


@given(shape=st.lists(st.integers(1, 4), min_size=1, max_size=3), data=st.data())
def test_unravel_is_undone_by_ravel(shape, data):
    rows = np.array(data.draw(st.lists(st.integers(0, int(np.prod(shape)) - 1), min_size=1)))
    digits = Unravel(tuple(shape))(rows).astype(int)
    np.testing.assert_array_equal(np.ravel_multi_index(digits.T, tuple(shape)), rows)


def test_functions_give_what_the_function_gives():
    assert Functions(squares, 2)(np.array([2, 3])).tolist() == [[2, 4], [3, 9]]


# --- arrays in the place of maps ---


def test_as_features_makes_a_table_of_an_array():
    assert isinstance(as_features(np.eye(3)), Table)


def test_as_features_leaves_a_map_as_it_is():
    phi = OneHot(3)
    assert as_features(phi) is phi


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ([1.0, 2.0], r"shape \(2,\): expected \(S, K\)"),
        (np.zeros((3, 0)), r"shape \(3, 0\)"),
        ([[1.0, np.nan], [0.0, 0.0]], "feature 1 of state 0 is nan"),
        ([[1.0, 2.0], [-np.inf, 0.0]], "feature 0 of state 1 is -inf"),
        ([[1.0], [2.0, 3.0]], "cannot be read as numbers"),
        ("one", "cannot be read as numbers"),
    ],
)
def test_as_features_refuses_what_is_no_table_of_numbers(values, message, unchecked):
    with pytest.raises(InvalidFeatures, match=message):
        as_features(values)


@pytest.mark.parametrize("n", [0, -1, 2.5, True, "4"])
def test_one_hot_refuses_a_number_that_is_none(n, unchecked):
    with pytest.raises(InvalidFeatures, match=f"n is {n!r}: expected a whole number"):
        OneHot(n)


@pytest.mark.parametrize("n", [0, 1.5])
def test_functions_refuse_a_number_of_features_that_is_none(n, unchecked):
    with pytest.raises(InvalidFeatures, match=f"n_features is {n}"):
        Functions(squares, n)


@pytest.mark.parametrize("phi", [OneHot(5), Table(np.zeros((5, 2)))])
def test_check_length_refuses_features_of_another_number_of_states(phi):
    with pytest.raises(InvalidFeatures, match="of 5 states: expected 4"):
        check_length(phi, 4)


@pytest.mark.parametrize("phi", [OneHot(4), Functions(squares, 2), Fourier([0], [1])])
def test_check_length_passes_features_of_as_many_or_of_any(phi):
    check_length(phi, 4)


# --- checks ---


@pytest.mark.parametrize("phi", [OneHot(4), Table(np.eye(4)), RadialBasis(np.zeros((1, 2)), np.ones(2), Unravel((2, 2)))])
@pytest.mark.parametrize(
    ("observations", "message"),
    [
        (np.array([0, 4]), "observation 4 has no features: expected 0 to 3"),
        (np.array([-1, 0]), "observation -1 has no features"),
        (np.array([0.0]), "dtype float64: these features are of integers"),
        (np.array([[0]]), r"shape \(1, 1\)"),
    ],
)
def test_map_of_integers_refuses_other_observations(phi, observations, message):
    with pytest.raises(InvalidFeatures, match=message):
        phi(observations)


@pytest.mark.parametrize(
    ("columns", "where"), [(slice(None), 2), (slice(1, 3), 2), (slice(2, 3), 2), (slice(-1, None), 2), (slice(2, 0, -1), 2)]
)
def test_checked_features_name_the_observation_and_column_of_a_nan(columns, where):
    values = np.zeros((4, 3))
    values[1, 2] = np.nan
    with pytest.raises(InvalidFeatures, match=f"feature {where} of observation number 1 is nan: expected a finite number"):
        checked_features(Functions(lambda rows: values[rows], 3), np.arange(4), columns)


def test_checked_features_pass_columns_that_are_finite():
    values = np.array([[1.0, np.inf, 2.0]])
    phi = Functions(lambda rows: values[rows], 3)
    assert checked_features(phi, np.array([0]), slice(2, None)).tolist() == [[2.0]]


@pytest.mark.parametrize("shape", [(3, 3), (4, 2), (4,)])
def test_functions_of_another_shape_are_refused(shape):
    phi = Functions(lambda rows: np.zeros(shape), 3)
    with pytest.raises(InvalidFeatures, match=r"shape \(" + ", ".join(map(str, shape))):
        checked_features(phi, np.arange(4))


def test_checked_features_refuse_what_is_no_number():
    with pytest.raises(InvalidFeatures, match="cannot be read as numbers"):
        checked_features(Functions(lambda rows: np.full((len(rows), 1), "a"), 1), np.arange(4))


@pytest.mark.parametrize("block", [1, 4, 1000])
def test_over_rows_does_not_depend_on_the_blocks(monkeypatch, block):
    monkeypatch.setattr(module, "BLOCK", block)
    found = over_rows(OneHot(9), lambda rows: 8 - rows, np.arange(9), slice(2, 5))
    np.testing.assert_array_equal(found, np.eye(9)[::-1, 2:5])


@pytest.mark.parametrize("block", [1, 5, 1000])
def test_blocks_cover_every_row_once(monkeypatch, block):
    monkeypatch.setattr(module, "BLOCK", block)
    assert [i for part in blocks(11, 2) for i in range(11)[part]] == list(range(11))


# --- batches ---


@pytest.mark.parametrize(
    ("observation", "batch"),
    [
        (3, np.array([3])),
        (np.array([1.0, 2.0]), np.array([[1.0, 2.0]])),
        ((1, np.array([2, 3])), (np.array([1]), np.array([[2, 3]]))),
        ({"a": 1, "b": (2, 3)}, {"a": np.array([1]), "b": (np.array([2]), np.array([3]))}),
    ],
)
def test_batch_of_one_adds_an_axis_to_each_part(observation, batch):
    found = batch_of_one(observation)
    assert repr(found) == repr(batch) and batch_size(found) == 1


def test_batch_size_looks_into_dicts_and_tuples():
    assert batch_size({"a": (np.zeros((5, 2)), np.zeros(5))}) == 5
