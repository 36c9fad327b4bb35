"""Features phi: what a linear reward R = alpha . phi is a sum of (Ng & Russell 2000, equation (8)).

A feature map takes a batch of N observations, stacked as vector environments stack them, and gives (N, K) numbers. Where
a table stands alone the observations are its rows. No map scales or clips behind the caller's back: each says in `scaling`
what it does with the coordinates and which values come out.
    OneHot, Table    of integers: rows of a table, or observations of a Discrete space
    Functions        whatever the caller writes
    irl_gym.features.bases    of coordinates: RadialBasis, Fourier, Polynomial
Axes: N observations, d coordinates, K features.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np

from irl_gym.checks import checked_number, float_array
from irl_gym.errors import InvalidFeatures
from irl_gym.spaces.batches import batch_size

ALL = slice(None)
"""Every column."""
BLOCK = 1 << 22
"""Numbers evaluated at a time in long batches: 32 MB."""


@runtime_checkable
class FeatureMap(Protocol):
    """phi: observations to K numbers each."""

    @property
    def n_features(self) -> int:
        """K."""
        ...

    @property
    def scaling(self) -> str:
        """What is done to the coordinates, and which values come out, in a sentence."""
        ...

    def __call__(self, observations: Any, columns: slice = ALL) -> np.ndarray:
        """(N, K) values, or those of some columns."""
        ...


def checked_features(features: FeatureMap, observations: Any, columns: slice = ALL) -> np.ndarray:
    """(N, K) values of a feature map, checked.

    Raises:
        InvalidFeatures: another shape than (N, K), or a value that is not finite; with its observation and column.
    """
    values = float_array("the features", features(observations, columns), "(N, K) numbers", InvalidFeatures)
    wanted = (batch_size(observations), len(range(features.n_features)[columns]))
    if values.shape != wanted:
        raise InvalidFeatures(
            f"the features of {wanted[0]} observations have shape {values.shape}: expected {wanted}, one row an observation "
            "and one column a feature."
        )
    if not np.isfinite(values).all():
        row, column = np.argwhere(~np.isfinite(values))[0]
        where = range(features.n_features)[columns][column]
        raise InvalidFeatures(
            f"feature {where} of observation number {row} is {values[row, column]}: expected a finite number. Look at what the "
            "map does with that observation."
        )
    return values


def as_features(features: Any) -> FeatureMap:
    """A feature map as it is, or a Table made of an array (S, K).

    Raises:
        InvalidFeatures: neither.
    """
    if features is None:
        raise InvalidFeatures("features is None: expected phi. Give it features, or `learn` a problem that has some.")
    if isinstance(features, type):
        raise InvalidFeatures(f"the features are the class {features.__name__}: expected one made of it, such as OneHot(16).")
    return features if isinstance(features, FeatureMap) else Table(features)


def check_length(features: FeatureMap, n_states: int) -> None:
    """Check that features of states are of as many as there are.

    Raises:
        InvalidFeatures: a OneHot or Table of another length.
    """
    length = getattr(features, "n_states", n_states)
    if length != n_states:
        raise InvalidFeatures(f"the features are of {length} states: expected {n_states}, one row of phi a state.")


def over_rows(features: FeatureMap, decode: Callable[[np.ndarray], Any], rows: np.ndarray, columns: slice = ALL) -> np.ndarray:
    """(N, K) checked values in rows of a table, evaluated a block of rows at a time.

    Args:
        features: phi.
        decode: turns rows into observations; `StateIndex.decode_batch`, for example.
        rows: (N,) integers.
        columns: of these features only.
    """
    width = len(range(features.n_features)[columns])
    values = np.empty((rows.size, width))
    for part in blocks(rows.size, width):
        values[part] = checked_features(features, decode(rows[part]), columns)
    return values


def blocks(n: int, width: int) -> Iterator[slice]:
    """Slices of 0..n whose rows of `width` numbers fit into a block."""
    step = max(1, BLOCK // max(width, 1))
    for begin in range(0, n, step):
        yield slice(begin, min(begin + step, n))


@dataclass(frozen=True, eq=False)
class OneHot:
    """phi_i(s) = 1 where s = i, else 0: R(s) = alpha_s, any reward on states."""

    n: int
    """Number of states K = S; observations are 0 to n - 1."""

    def __post_init__(self) -> None:
        checked_number("n", self.n, "a whole number of at least 1", least=1, whole=True, error=InvalidFeatures)

    @property
    def n_features(self) -> int:
        """K = n."""
        return int(self.n)

    @property
    def n_states(self) -> int:
        """S = n."""
        return int(self.n)

    @property
    def scaling(self) -> str:
        """What comes out."""
        return "one-hot: 1 in the state, 0 elsewhere"

    def __call__(self, observations: Any, columns: slice = ALL) -> np.ndarray:
        """(N, K) rows of the identity."""
        rows = integers(observations, self.n_features)
        return (rows[:, None] == np.arange(self.n_features)[columns]).astype(np.float64)


@dataclass(frozen=True, eq=False)
class Table:
    """phi in a table: row s holds the features of observation s.

    Raises:
        InvalidFeatures: not (S, K), or a value that is not finite.
    """

    values: np.ndarray
    """(S, K) float64."""

    def __post_init__(self) -> None:
        values = float_array("the features", self.values, "(S, K) numbers", InvalidFeatures)
        if values.ndim != 2 or values.size == 0:
            raise InvalidFeatures(f"the features have shape {values.shape}: expected (S, K), at least one of each.")
        if not np.isfinite(values).all():
            s, i = np.argwhere(~np.isfinite(values))[0]
            raise InvalidFeatures(f"feature {i} of state {s} is {values[s, i]}: expected a finite number.")
        values.setflags(write=False)
        object.__setattr__(self, "values", values)

    @property
    def n_features(self) -> int:
        """K."""
        return self.values.shape[1]

    @property
    def n_states(self) -> int:
        """S."""
        return self.values.shape[0]

    @property
    def scaling(self) -> str:
        """What comes out."""
        return f"a table as given, values {self.values.min():.4g} to {self.values.max():.4g}"

    def __call__(self, observations: Any, columns: slice = ALL) -> np.ndarray:
        """(N, K) rows of the table."""
        return self.values[integers(observations, len(self.values)), columns]


@dataclass(frozen=True)
class Unravel:
    """Coordinates of discrete observations: the digits of their number, as `numpy.unravel_index`.

    Taxi's state is Unravel((5, 5, 5, 4)): row, column, passenger, destination; FrozenLake 8x8's is Unravel((8, 8)).
    """

    shape: tuple[int, ...]
    """Values that each coordinate can have."""

    def __post_init__(self) -> None:
        shape = self.shape if isinstance(self.shape, tuple | list) else (self.shape,)
        for count in shape:
            checked_number("Unravel's shape", count, "whole numbers of at least 1", least=1, whole=True, error=InvalidFeatures)
        object.__setattr__(self, "shape", tuple(int(count) for count in shape))

    def __call__(self, observations: Any) -> np.ndarray:
        """(N, d) coordinates."""
        rows = integers(observations, int(np.prod(self.shape)))
        return np.stack(np.unravel_index(rows, self.shape), axis=1).astype(np.float64)


@dataclass(frozen=True, eq=False)
class Functions:
    """Features that the caller computes."""

    function: Callable[[Any], np.ndarray]
    """A batch of N observations to (N, K) numbers."""
    n_features: int
    """K."""
    scaling: str = "as the function gives them"
    """What comes out, in the caller's words."""

    def __post_init__(self) -> None:
        checked_number("n_features", self.n_features, "at least 1", least=1, whole=True, error=InvalidFeatures)

    def __call__(self, observations: Any, columns: slice = ALL) -> np.ndarray:
        """(N, K) what the function gives."""
        values = np.asarray(self.function(observations))
        if values.ndim != 2 or values.shape[1] != self.n_features:
            raise InvalidFeatures(f"the function gave shape {values.shape}: expected (N, {self.n_features}).")
        return values[:, columns]


def integers(observations: Any, n: int) -> np.ndarray:
    """(N,) observations as integers from 0 to n - 1."""
    array = np.asarray(observations)
    if array.ndim != 1 or array.dtype.kind not in "iu":
        raise InvalidFeatures(
            f"observations have shape {array.shape} and dtype {array.dtype}: these features are of integers (N,). Use features "
            "of coordinates, such as RadialBasis, or number the observations with a StateIndex."
        )
    if array.size and not (0 <= array.min() and array.max() < n):
        wrong = array[(array < 0) | (array >= n)][0]
        raise InvalidFeatures(f"observation {wrong} has no features: expected 0 to {n - 1}.")
    return array
