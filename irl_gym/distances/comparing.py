"""The arithmetic of a distance: standardise two rewards on the same transitions, and measure their difference.

Pearson's distance sqrt((1 - rho) / 2) is half the norm of the difference of the standardised rewards, and is computed so:
1 - rho loses half of the digits where rho is near 1. Axes: n transitions.
"""

import numpy as np

from irl_gym._typing import Numbers
from irl_gym.errors import UndefinedDistance

ROUNDING = 1e-12
"""Values of which the canonical form is this share of the reward, or less, are rounding: the canonical form is 0."""
SAME_RANK = 1e-9
"""Values closer than this share of their spread have the same rank: they differ by rounding."""


def norm(values: Numbers, weights: Numbers, order: float) -> float:
    """(sum_i w_i |x_i|^p)^(1/p); the largest |x_i| where p is infinite."""
    largest = float(np.abs(values).max())
    if np.isinf(order) or largest == 0:
        return largest
    return largest * float((weights @ (np.abs(values) / largest) ** order) ** (1 / order))  # no power overflows


def standardised(values: Numbers, weights: Numbers, rounding: float, name: str) -> Numbers:
    """Values with mean 0 and variance 1.

    Raises:
        UndefinedDistance: a variance of 0, but for rounding.
    """
    centred = values - weights @ values
    deviation = norm(centred, weights, 2)
    if not deviation > rounding:
        raise UndefinedDistance(
            f"the canonical form of {name} has deviation {deviation:.1e} on the coverage distribution: expected more than 0, "
            "or its distance from another is not defined. The reward is zero, constant or only a potential, or the coverage "
            "too narrow. `starc` has a place for such rewards."
        )
    return centred / deviation


def ranks(values: Numbers, weights: Numbers, rounding: float) -> Numbers:
    """The share of weight below each value, and half of the share at it: ranks between 0 and 1, ties in the middle."""
    order = np.argsort(values, kind="stable")
    ordered = values[order]
    tied = max(SAME_RANK * (ordered[-1] - ordered[0]), rounding)
    group = np.concatenate([[0], np.cumsum(np.diff(ordered) > tied)])
    share = np.bincount(group, weights[order])
    result = np.empty(values.size)
    result[order] = (np.cumsum(share) - share / 2)[group]
    return result


def half_difference(first: Numbers, second: Numbers, weights: Numbers, order: float = 2.0) -> float:
    """Half the norm of a difference, at most 1 but for rounding."""
    return 0.5 * norm(first - second, weights, order)
