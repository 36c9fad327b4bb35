"""Cells: a grid as a numbering of states; interpolation between its centres."""

import itertools
import pickle

import numpy as np
import pytest
from gymnasium import spaces
from hypothesis import given
from hypothesis import strategies as st

from irl_gym.errors import InvalidParameter, UnknownObservation
from irl_gym.spaces.coordinates import CircularCoordinates, Coordinates
from irl_gym.spaces.states import States
from irl_gym.tables.cells import Cells

LOW, HIGH = np.array([-1.0, 0.0, 2.0]), np.array([1.0, 4.0, 3.0])
BOX = spaces.Box(LOW.astype(np.float32), HIGH.astype(np.float32))
STRAIGHT = Coordinates(BOX, ("x", "y", "z"), LOW, HIGH, np.zeros(3, dtype=bool))
SHOWN = spaces.Box(np.array([-1, -1, -8], dtype=np.float32), np.array([1, 1, 8], dtype=np.float32))
ROUND = CircularCoordinates(
    SHOWN, ("angle", "speed"), np.array([-np.pi, -8.0]), np.array([np.pi, 8.0]), np.array([True, False])
)
ENDING = np.array([3, 7, 11])


def test_cells_are_a_numbering_of_states():
    assert isinstance(Cells(STRAIGHT, 3), States)


def test_cells_are_numbered_row_by_row():
    cells = Cells(STRAIGHT, (2, 4, 3))
    centres = itertools.product([-0.5, 0.5], [0.5, 1.5, 2.5, 3.5], np.array([1, 3, 5]) / 6 + 2)
    np.testing.assert_allclose(cells.centres(np.arange(24)), list(centres))


@pytest.mark.parametrize(("coordinates", "bins"), [(STRAIGHT, (2, 4, 3)), (ROUND, (7, 4)), (ROUND, 1)])
def test_cells_decode_to_what_encodes_to_them(coordinates, bins):
    cells = Cells(coordinates, bins)
    rows = np.arange(cells.n_states)
    observations = cells.decode_batch(rows)
    assert observations.dtype == np.float32 and all(cells.space.contains(observation) for observation in observations)
    np.testing.assert_array_equal(cells.encode_batch(observations), rows)
    assert [cells.encode(cells.decode(row)) for row in rows[:5].tolist()] == rows[:5].tolist()


@given(st.integers(0, 10_000))
def test_cells_encode_to_the_nearest_centre(seed):
    cells, rng = Cells(STRAIGHT, (2, 4, 3)), np.random.default_rng(seed)
    observations = rng.uniform(LOW - 1, HIGH + 1, size=(20, 3)).astype(np.float32)
    away = (observations[:, None, :] - cells.centres(np.arange(24))) / cells.widths
    np.testing.assert_array_equal(cells.encode_batch(observations), np.square(away).sum(axis=2).argmin(axis=1))


def test_cells_wrap_angles_around():
    cells = Cells(ROUND, (8, 1))
    just_below, just_above = (ROUND.observe(np.array([[angle, 0.0]])) for angle in (np.pi - 0.01, np.pi + 0.01))
    assert cells.encode_batch(np.concatenate([just_below, just_above])).tolist() == [7, 0]


@given(st.integers(0, 10_000))
def test_cells_spread_reproduces_linear_functions_between_the_outermost_centres(seed):
    cells, rng = Cells(STRAIGHT, (3, 4, 5)), np.random.default_rng(seed)
    points = rng.uniform(LOW + cells.widths / 2, HIGH - cells.widths / 2, size=(30, 3))
    slope, constant = rng.normal(size=3), rng.normal()
    rows, weights = cells.spread(points)
    values = cells.centres(np.arange(cells.n_cells)) @ slope + constant
    np.testing.assert_allclose((weights * values[rows]).sum(axis=1), points @ slope + constant, atol=1e-12)


@given(st.integers(0, 10_000))
def test_cells_spread_weights_are_a_distribution(seed):
    points = np.random.default_rng(seed).uniform([-20, -20], [20, 20], size=(50, 2))
    rows, weights = Cells(ROUND, (5, 6)).spread(points)
    assert (weights >= 0).all() and rows.min() >= 0 and rows.max() < 30
    np.testing.assert_allclose(weights.sum(axis=1), 1, atol=1e-12)


def test_cells_spread_is_the_nearest_centre_beyond_the_outermost_ones():
    cells = Cells(STRAIGHT, (3, 4, 5))
    rows, weights = cells.spread(np.array([HIGH + 1]))
    assert weights[rows == cells.n_cells - 1].sum() == 1


def test_cells_spread_wraps_angles_around():
    rows, weights = Cells(ROUND, (4, 1)).spread(np.array([[np.pi, 0.0]]))
    shares = np.bincount(rows.ravel(), weights.ravel())
    np.testing.assert_allclose(shares, [0.5, 0, 0, 0.5], atol=1e-12)


def test_cells_spread_puts_a_centre_on_itself_alone_in_spite_of_rounding():
    cells = Cells(STRAIGHT, 7)
    rows, weights = cells.spread(cells.centres(np.arange(cells.n_cells)) * (1 + 1e-15))
    assert ((weights > 0).sum(axis=1) == 1).all()
    np.testing.assert_array_equal(rows[weights > 0], np.arange(cells.n_cells))


def test_cells_have_terminal_copies_at_the_end():
    cells = Cells(STRAIGHT, (2, 4, 3), ENDING)
    observations = cells.decode_batch(np.arange(24))
    expected = np.arange(24)
    expected[ENDING] = [24, 25, 26]
    np.testing.assert_array_equal(cells.encode_batch(observations, terminated=np.ones(24, dtype=bool)), expected)
    np.testing.assert_array_equal(cells.encode_batch(observations, terminated=np.zeros(24, dtype=bool)), np.arange(24))
    np.testing.assert_array_equal(cells.decode_batch(np.array([24, 25, 26])), observations[ENDING])
    assert (cells.terminal_copies, cells.n_states) == ({3: 24, 7: 25, 11: 26}, 27)
    assert cells.encode(observations[7], terminated=True) == 25


def test_cells_survive_pickling():
    cells = Cells(ROUND, (7, 4), ENDING)
    again = pickle.loads(pickle.dumps(cells))
    rows = np.arange(cells.n_states)
    np.testing.assert_array_equal(again.decode_batch(rows), cells.decode_batch(rows))
    assert (again.n_states, again.space) == (cells.n_states, cells.space)


def test_cells_tell_a_batch_from_an_observation():
    cells = Cells(STRAIGHT, 3)
    assert cells.is_batch(np.zeros((2, 3))) and not cells.is_batch(np.zeros(3))


@pytest.mark.parametrize("bins", [0, -1, 2.5, (3, 3), (3, 0, 3), "3", True, None])
def test_cells_refuse_bad_bins(bins, unchecked):
    with pytest.raises(InvalidParameter, match="bins"):
        Cells(STRAIGHT, bins)


@pytest.mark.parametrize("observation", [[0.0, 0.0], [0.0, np.nan, 2.0], "here", [[0.0], [1.0, 2.0]]])
def test_cells_refuse_what_is_no_observation(observation):
    with pytest.raises(UnknownObservation, match="observation"):
        Cells(STRAIGHT, 3).encode(observation)
