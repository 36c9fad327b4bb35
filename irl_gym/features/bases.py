"""Features of coordinates: Gaussian radial bases, the Fourier basis, polynomials.

The coordinates are those of a Box as they are, or what `coordinates` makes of an observation: `Unravel((8, 8))` makes row and
column of FrozenLake's cells. Axes: N observations, d coordinates, K features.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations_with_replacement, product
from math import comb, prod
from typing import Any

import numpy as np

from irl_gym.checks import any_array, checked_number, float_array
from irl_gym.errors import InvalidFeatures
from irl_gym.features.feature_maps import ALL

MOST = 1_000_000
"""Features K at most: each is a row of exponents, held in memory."""


@dataclass(frozen=True, eq=False)
class RadialBasis:
    """Gaussians of unit height: phi_i(x) = exp(-sum_j (x_j - c_ij)^2 / (2 sigma_j^2)).

    Raises:
        InvalidFeatures: centres or widths of the wrong shape, or a width that is not positive.
    """

    centres: np.ndarray
    """(K, d)."""
    sigma: np.ndarray | float
    """(d,) or a number: widths, in the units of the coordinates; infinite leaves a coordinate out."""
    coordinates: Callable[[Any], np.ndarray] | None = None
    """Makes (N, d) coordinates of observations; None takes them as they are, flattened."""

    def __post_init__(self) -> None:
        centres = float_array("centres", self.centres, "(K, d) numbers", InvalidFeatures)
        if centres.ndim != 2 or centres.size == 0 or not np.isfinite(centres).all():
            raise InvalidFeatures(f"centres have shape {centres.shape}: expected (K, d) finite numbers, at least one centre.")
        sigma = float_array("sigma", self.sigma, "a width for each coordinate", InvalidFeatures)
        if sigma.shape not in ((), (centres.shape[1],)) or not (sigma > 0).all():
            raise InvalidFeatures(
                f"sigma is {sigma.tolist()}: expected a width above 0 for each of {centres.shape[1]} coordinates."
            )
        _check_callable(self.coordinates)
        object.__setattr__(self, "centres", centres)
        object.__setattr__(self, "sigma", np.broadcast_to(sigma, centres.shape[1:]).copy())

    @classmethod
    def grid(
        cls,
        low: Sequence[float] | np.ndarray,
        high: Sequence[float] | np.ndarray,
        counts: int | Sequence[int] | np.ndarray,
        *,
        width: float = 1.0,
        coordinates: Callable[[Any], np.ndarray] | None = None,
    ) -> "RadialBasis":
        """Centres on a regular grid from `low` to `high`, both included; sigma is `width` spacings.

        Args:
            low: (d,) lowest centre.
            high: (d,) highest centre.
            counts: centres along each coordinate; one alone stands in the middle and its sigma is `width` times the range.
            width: sigma in units of the spacing.
            coordinates: as the field.
        """
        low_, high_ = _bounds(low, high)
        given = any_array("counts", counts, "whole numbers", InvalidFeatures)
        if given.dtype.kind not in "iu" or given.shape not in ((), low_.shape) or (given < 1).any():
            raise InvalidFeatures(
                f"counts is {counts!r}: expected at least one centre along each coordinate, one whole number or {low_.size}."
            )
        each = np.broadcast_to(given, low_.shape)
        _check_count(prod(each.tolist()), "counts")
        width = checked_number("width", width, "a number of spacings above 0", above=0, error=InvalidFeatures)
        axes = [np.linspace(a, b, n) if n > 1 else np.array([(a + b) / 2]) for a, b, n in zip(low_, high_, each, strict=True)]
        spacing = (high_ - low_) / np.maximum(each - 1, 1)
        return cls(np.array(list(product(*axes))), width * spacing, coordinates)

    @property
    def n_features(self) -> int:
        """K."""
        return len(self.centres)

    @property
    def scaling(self) -> str:
        """What comes out."""
        widths = ", ".join(f"{s:.4g}" for s in np.atleast_1d(self.sigma))
        return f"Gaussians of unit height, sigma {widths} in units of the coordinates, values 0 to 1"

    def __call__(self, observations: Any, columns: slice = ALL) -> np.ndarray:
        """(N, K) heights."""
        scaled = _coordinates(observations, self.coordinates, self.centres.shape[1]) / self.sigma
        centres = self.centres[columns] / self.sigma
        distance = np.zeros((len(scaled), len(centres)))
        for x, c in zip(scaled.T, centres.T, strict=True):  # not by scalar products, which cancel
            distance += (x[:, None] - c) ** 2
        return np.exp(-0.5 * distance)


@dataclass(frozen=True, eq=False)
class Fourier:
    """The Fourier basis of order n: phi_c(x) = cos(pi c . u), u = (x - low) / (high - low), c in {0..n}^d.

    K = (n + 1)^d (Konidaris, Osentoski & Thomas 2011). Outside low..high it goes on as a cosine.

    Raises:
        InvalidFeatures: bounds that do not fit together, or an order below 0.
    """

    low: Sequence[float] | np.ndarray
    """(d,) u = 0 there."""
    high: Sequence[float] | np.ndarray
    """(d,) u = 1 there."""
    order: int = 3
    """n, at least 0."""
    coordinates: Callable[[Any], np.ndarray] | None = None
    """Makes (N, d) coordinates of observations; None takes them as they are, flattened."""

    def __post_init__(self) -> None:
        low, _ = _bounds(self.low, self.high)
        _check_callable(self.coordinates)
        _order(self.order)
        _check_count((int(self.order) + 1) ** min(low.size, 20), "order")  # 2^20 are too many already

    @cached_property
    def frequencies(self) -> np.ndarray:
        """(K, d) c."""
        return _exponents(self.order, len(self.low))

    @property
    def n_features(self) -> int:
        """K."""
        return len(self.frequencies)

    @property
    def scaling(self) -> str:
        """What comes out."""
        return f"cosines of coordinates scaled from {_span(self.low, self.high)} to 0..1, values -1 to 1"

    def __call__(self, observations: Any, columns: slice = ALL) -> np.ndarray:
        """(N, K) cosines."""
        low, high = _bounds(self.low, self.high)
        unit = (_coordinates(observations, self.coordinates, len(low)) - low) / (high - low)
        return np.cos(np.pi * unit @ self.frequencies[columns].T)


@dataclass(frozen=True, eq=False)
class Polynomial:
    """Monomials of coordinates: phi_c(x) = prod_j u_j^c_j, u = 2 (x - low) / (high - low) - 1, sum_j c_j <= degree.

    The first is 1. Outside low..high they grow as powers do.

    Raises:
        InvalidFeatures: bounds that do not fit together, or a degree below 0.
    """

    low: Sequence[float] | np.ndarray
    """(d,) u = -1 there."""
    high: Sequence[float] | np.ndarray
    """(d,) u = 1 there."""
    degree: int = 2
    """At least 0."""
    coordinates: Callable[[Any], np.ndarray] | None = None
    """Makes (N, d) coordinates of observations; None takes them as they are, flattened."""

    def __post_init__(self) -> None:
        low, _ = _bounds(self.low, self.high)
        _check_callable(self.coordinates)
        _order(self.degree)
        _check_count(comb(low.size + int(self.degree), min(low.size, int(self.degree), 20)), "degree")  # of (40 over 20), too

    @cached_property
    def exponents(self) -> np.ndarray:
        """(K, d) c, by total degree."""
        d = len(self.low)
        chosen = (which for n in range(self.degree + 1) for which in combinations_with_replacement(range(d - 1, -1, -1), n))
        return np.array([np.bincount(np.array(which, dtype=int), minlength=d) for which in chosen])

    @property
    def n_features(self) -> int:
        """K."""
        return len(self.exponents)

    @property
    def scaling(self) -> str:
        """What comes out."""
        return f"monomials of coordinates scaled from {_span(self.low, self.high)} to -1..1, values -1 to 1 inside"

    def __call__(self, observations: Any, columns: slice = ALL) -> np.ndarray:
        """(N, K) monomials."""
        low, high = _bounds(self.low, self.high)
        unit = 2 * (_coordinates(observations, self.coordinates, len(low)) - low) / (high - low) - 1
        return np.prod(unit[:, None, :] ** self.exponents[columns], axis=2)


def _coordinates(observations: Any, coordinates: Callable[[Any], np.ndarray] | None, d: int) -> np.ndarray:
    if coordinates is not None:
        observations = coordinates(observations)
    array = float_array(
        "the observations", observations, "numbers; give `coordinates` that makes (N, d) of them", InvalidFeatures
    )
    array = array.reshape(len(array), int(np.prod(array.shape[1:])))  # not by -1, which no batch of none allows
    if array.shape[1] != d:
        raise InvalidFeatures(
            f"observations have {array.shape[1]} coordinates: expected {d}, as the features have. Give `coordinates` that "
            "chooses or makes them, such as Unravel((8, 8)) for the cells of an 8x8 map."
        )
    return array


def _bounds(low: Any, high: Any) -> tuple[np.ndarray, np.ndarray]:
    arrays = [float_array(name, value, "(d,) numbers", InvalidFeatures) for name, value in (("low", low), ("high", high))]
    fine = arrays[0].ndim == 1 and arrays[0].shape == arrays[1].shape and arrays[0].size
    if not (fine and np.isfinite(arrays).all() and (arrays[0] < arrays[1]).all()):
        raise InvalidFeatures(f"the bounds are {low} and {high}: expected finite low < high for each coordinate.")
    return arrays[0], arrays[1]


def _span(low: Any, high: Any) -> str:
    return f"{np.asarray(low).tolist()}..{np.asarray(high).tolist()}"


def _order(order: Any) -> None:
    checked_number("the order", order, "a whole number of at least 0", least=0, whole=True, error=InvalidFeatures)


def _check_callable(coordinates: Any) -> None:
    if coordinates is not None and not callable(coordinates):
        raise InvalidFeatures(f"coordinates is {coordinates!r:.80}: expected a function of observations, or None.")


def _check_count(count: int, by: str) -> None:
    if count > MOST:
        raise InvalidFeatures(
            f"there are more than {MOST:,} features: expected at most as many. Lower the {by}, or choose fewer coordinates."
        )


def _exponents(order: int, d: int) -> np.ndarray:
    return np.array(list(product(range(order + 1), repeat=d)))
