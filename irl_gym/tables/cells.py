"""A grid over a continuous state: every cell is a row of a table.

Cells are numbered row by row, the last coordinate fastest; the bounds of a coordinate are the outer edges of its outermost
cells. An observation outside the bounds belongs to the nearest cell, an angle wraps around. A cell that episodes end in has a
terminal copy at the end of the table, as the states of a StateIndex have. Axes: N points, d coordinates, C corners = 2^d.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from gymnasium import spaces

from irl_gym._typing import Indices, Points
from irl_gym.checks import checked_number
from irl_gym.errors import InvalidParameter, UnknownObservation
from irl_gym.records import Record
from irl_gym.spaces.coordinates import Coordinates

SNAP = 1e-9
"""A point this close to a cell's centre, in cells, is on it: rounding shall not make a second successor."""


@dataclass(frozen=True, eq=False)
class Cells(Record):
    """A numbering (`irl_gym.spaces.states.States`) of the cells of a regular grid.

    Raises:
        InvalidParameter: `bins` of the wrong length, or not whole numbers of at least 1; bounds that are not finite.
    """

    coordinates: Coordinates
    """Of the states, with finite bounds."""
    bins: int | Sequence[int]
    """Cells along each coordinate; one number for all."""
    ending: np.ndarray = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    """(m,) int64, increasing: the cells that have a terminal copy; cell `ending[i]` has row n_cells + i."""

    def __post_init__(self) -> None:
        self.coordinates.within({})  # checks that they are finite
        names = self.coordinates.names
        bins = [self.bins] * len(names) if isinstance(self.bins, int | np.integer) else self.bins
        if isinstance(bins, str) or not isinstance(bins, Sequence | np.ndarray) or len(bins) != len(names):
            raise InvalidParameter(
                f"bins is {self.bins!r}: expected a whole number, or one for each of the {len(names)} coordinates "
                f"({', '.join(names)})."
            )
        for name, count in zip(names, bins, strict=True):
            expected = "a whole number of cells of at least 1, and less than 2^62"
            checked_number(f"bins of {name}", count, expected, least=1, below=2**62, whole=True)
        object.__setattr__(self, "bins", tuple(int(count) for count in bins))

    @property
    def space(self) -> spaces.Space:
        """The observation space."""
        return self.coordinates.space

    @cached_property
    def shape(self) -> np.ndarray:
        """(d,) cells along each coordinate."""
        return np.array(self.bins, dtype=np.int64)

    @property
    def widths(self) -> np.ndarray:
        """(d,) sides of a cell."""
        return (self.coordinates.high - self.coordinates.low) / self.shape

    @cached_property
    def _place_values(self) -> np.ndarray:
        return np.append(np.cumprod(self.shape[:0:-1])[::-1], 1).astype(np.int64)

    @cached_property
    def n_cells(self) -> int:
        """Number of cells, without terminal copies."""
        return int(np.prod(self.shape))

    @property
    def n_states(self) -> int:
        """Number of rows, terminal copies included."""
        return self.n_cells + len(self.ending)

    @property
    def terminal_copies(self) -> Mapping[int, int]:
        """Row of a cell -> row of its terminal copy."""
        return self._copies

    @cached_property
    def _copies(self) -> dict[int, int]:
        return {int(cell): self.n_cells + i for i, cell in enumerate(self.ending)}

    def centres(self, rows: Indices) -> Points:
        """(N, d) the states in the middle of cells; of a terminal copy's cell."""
        copies = rows >= self.n_cells
        if copies.any():
            rows = rows.copy()
            rows[copies] = self.ending[rows[copies] - self.n_cells]
        return self.coordinates.low + (rows[:, None] // self._place_values % self.shape + 0.5) * self.widths

    def nearest(self, states: Points) -> Indices:
        """(N,) the cell of each state."""
        return self._wrapped(np.floor((states - self.coordinates.low) / self.widths)) @ self._place_values

    def spread(self, states: Points) -> tuple[np.ndarray, np.ndarray]:
        """Multilinear interpolation: each state as a mixture of the 2^d cells whose centres surround it.

        A function that is linear in the coordinates is reproduced exactly between the outermost centres, and goes on as a
        constant beyond them.

        Returns:
            Cells (N, C) and their weights (N, C), which are at least 0 and sum to 1. A cell may stand twice in a line.
        """
        last = np.where(self.coordinates.periodic, np.inf, self.shape - 1.0)
        first = np.where(self.coordinates.periodic, -np.inf, 0.0)
        place = np.clip((states - self.coordinates.low) / self.widths - 0.5, first, last)
        whole = np.round(place)
        place = np.where(np.abs(place - whole) < SNAP, whole, place)
        below = np.floor(place)
        share = place - below
        d = len(self.shape)
        cells, weights = np.zeros((len(states), 2**d), dtype=np.int64), np.ones((len(states), 2**d))
        for corner in range(2**d):
            above = (corner >> np.arange(d)) & 1
            cells[:, corner] = self._wrapped(below + above) @ self._place_values
            weights[:, corner] = np.where(above == 1, share, 1 - share).prod(axis=1)
        return cells, weights

    def _wrapped(self, places: np.ndarray) -> np.ndarray:
        """(N, d) whole places along each coordinate, wrapped or clamped to the grid."""
        return np.where(self.coordinates.periodic, places % self.shape, np.clip(places, 0, self.shape - 1)).astype(np.int64)

    def is_batch(self, observation: Any) -> bool:
        """Is this an array of observations, not a single one?"""
        return np.ndim(observation) == len(self.space.shape or ()) + 1

    def encode(self, observation: Any, *, terminated: bool = False) -> int:
        """The row of an observation's cell; of its terminal copy if it has one and `terminated` is true.

        Raises:
            UnknownObservation: of another shape than the space's, or NaN.
        """
        try:
            batch = np.asarray(observation)[None]
        except ValueError as error:
            raise UnknownObservation(f"observation {observation!r}: expected a member of {self.space}.") from error
        return int(self.encode_batch(batch, terminated=np.array([terminated]))[0])

    def encode_batch(self, observations: Any, *, terminated: np.ndarray | None = None) -> np.ndarray:
        """The rows of a batch of observations: (N,) int64.

        Args:
            observations: (N, ...) stacked.
            terminated: (N,) booleans; where true, the row of the terminal copy, if the cell has one.

        Raises:
            UnknownObservation: of another shape than the space's, or NaN.
        """
        array = np.asarray(observations)
        if array.dtype.kind not in "fiub" or array.shape[1:] != (self.space.shape or ()):
            raise UnknownObservation(
                f"observations of shape {array.shape[1:]} and dtype {array.dtype}: expected {self.space.shape}, members of "
                f"{self.space}."
            )
        states = self.coordinates.locate(array)
        wrong = np.flatnonzero(np.isnan(states).any(axis=1))
        if wrong.size:
            raise UnknownObservation(
                f"observation {array[wrong[0]].tolist()} is not a number: expected a member of {self.space}."
            )
        rows = self.nearest(states)
        if terminated is None or not len(self.ending):
            return rows
        found = np.minimum(np.searchsorted(self.ending, rows), len(self.ending) - 1)
        return np.where(terminated & (self.ending[found] == rows), self.n_cells + found, rows)

    def decode_batch(self, rows: Any) -> np.ndarray:
        """(N, ...) observations in the middle of the cells of rows."""
        return self.coordinates.observe(self.centres(np.asarray(rows)))

    def decode(self, row: int) -> Any:
        """The observation in the middle of a row's cell."""
        return self.decode_batch(np.array([row]))[0]
