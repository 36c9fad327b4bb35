"""Values and standard errors of a distance from samples: delete-a-block jackknife (Efron & Stein 1981).

The sample is cut into B blocks that do not depend on each other, the distance is computed B times without one of them, and
    error^2 = (B - 1) / B sum_b (d_b - mean d)^2
Two independent samples, such as transitions and the draws of a canonical form, add their squares. The error says how the
distance would scatter over samples of this size; where the distance is near 0 its square root bends, and the error is large.
Axes: N transitions, K replicates, B blocks.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from irl_gym.errors import UndefinedDistance
from irl_gym.judging.distances.comparing import ROUNDING, half_difference, ranks, standardised

Roundings = tuple[float, float]
"""How far rounding puts values of the first and of the second reward off."""


@dataclass(frozen=True)
class Distance:
    """A distance estimated from samples."""

    value: float
    """The estimate, between 0 and 1."""
    error: float
    """Its standard error; infinite where one block of the sample holds all that varies."""
    n: int
    """Transitions that it rests on."""

    def __str__(self) -> str:
        return f"{self.value:.4f} ± {self.error:.4f} ({self.n} transitions)"


def jackknife(without: Callable[[int], float], blocks: int) -> float:
    """The variance of a statistic from its values without each block; infinite where one of these is not defined."""
    try:
        values = np.array([without(b) for b in range(blocks)])
    except UndefinedDistance:
        return np.inf
    return float((blocks - 1) * values.var())


def correlation_distance(first: np.ndarray, second: np.ndarray, rounding: Roundings, *, ranked: bool) -> float:
    """sqrt((1 - rho) / 2) of two samples (N,).

    Args:
        first: canonical values of one reward.
        second: of the other.
        rounding: values of each within its own are equal: one reward may be far larger than the other.
        ranked: use the correlation of ranks.

    Raises:
        UndefinedDistance: a sample without variance.
    """
    weights = np.full(first.size, 1 / first.size)
    named = zip(("the first reward", "the second reward"), (first, second), rounding, strict=True)
    if ranked:
        one, other = (standardised(ranks(x, weights, off), weights, ROUNDING, name) for name, x, off in named)
    else:
        one, other = (standardised(x, weights, off, name) for name, x, off in named)
    return half_difference(one, other, weights)


def replicated_distance(first: np.ndarray, second: np.ndarray, rounding: Roundings, *, centred: bool) -> float:
    """sqrt((1 - rho) / 2) of the means of replicates (N, K), without the noise of these means.

    A product of two different replicates has no noise in its mean, where the square of a noisy mean has; so
        E[x y]  is estimated by  mean_i sum_{k != l} x_ik y_il / (K (K - 1))

    Args:
        first: replicates of the canonical values of one reward.
        second: of the other, from the same draws.
        rounding: a mean square of each of at most the square of its own is 0.
        centred: take the mean over N off, as a correlation does; STARC does not.

    Raises:
        UndefinedDistance: a mean square that is not above 0.
    """
    if centred:
        first, second = first - first.mean(), second - second.mean()
    xx, yy, xy = _product(first, first), _product(second, second), _product(first, second)
    for name, square, off in zip(("first", "second"), (xx, yy), rounding, strict=True):
        if not square > off**2:
            raise UndefinedDistance(
                f"the canonical form of the {name} reward has a mean square of {square:.1e} on these transitions: expected "
                "more than 0, or its distance is not defined. The reward is constant or only a potential, or drowned in the "
                "noise of the draws. Raise `replicates`, or the number of transitions."
            )
    return float(np.sqrt(np.clip((1 - xy / np.sqrt(xx * yy)) / 2, 0.0, 1.0)))


def _product(x: np.ndarray, y: np.ndarray) -> float:
    k = x.shape[1]
    return float(((x.sum(axis=1) * y.sum(axis=1) - (x * y).sum(axis=1)) / (k * (k - 1))).mean())
