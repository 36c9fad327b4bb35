"""The arithmetic of a distance: standardise two rewards on the same transitions, and measure their difference.

Pearson's distance sqrt((1 - rho) / 2) is half the norm of the difference of the standardised rewards, and is computed so:
1 - rho loses half of the digits where rho is near 1. Axes: n transitions.
"""

import numpy as np

from irl_gym._typing import Numbers
from irl_gym.checks import LARGEST, float_array
from irl_gym.errors import InvalidReward, UndefinedDistance

ROUNDING = 1e-12
"""Values of which the canonical form is this share of the reward, or less, are rounding: the canonical form is 0."""
DIGITS = 10
"""The same for numbers of low precision: this times the step from 1 to the next number, 1.2e-6 for float32."""


def numbers(name: str, values: object, expected: str) -> tuple[np.ndarray, float]:
    """Rewards as floats, and the share of the largest by which their sums can be off.

    Raises:
        InvalidReward: no numbers, numbers that are not finite, or beyond 1e300.
    """
    array = float_array(name, values, expected, InvalidReward)
    wrong = np.argwhere(~(np.abs(array) <= LARGEST))
    if wrong.size:
        where = tuple(int(i) for i in wrong[0])
        raise InvalidReward(f"{name} is {array[where]} at {list(where)}: a reward is a finite number, {LARGEST:g} at most.")
    dtype = np.asarray(values).dtype
    return array, max(ROUNDING, DIGITS * float(np.finfo(dtype).eps)) if dtype.kind == "f" else ROUNDING


def norm(values: Numbers, weights: Numbers, order: float) -> float:
    """(sum_i w_i |x_i|^p)^(1/p); the largest |x_i| where p is infinite."""
    largest = float(np.abs(values).max())
    if np.isinf(order) or largest == 0:
        return largest
    return largest * float((weights @ (np.abs(values) / largest) ** order) ** (1 / order))  # no power overflows


def standardised(values: Numbers, weights: Numbers, rounding: float, name: str) -> Numbers:
    """Values (n,), each off by `rounding` at most, with mean 0 and variance 1.

    Raises:
        UndefinedDistance: a variance of 0, but for rounding.
    """
    centred = values - weights @ values
    deviation, least = norm(centred, weights, 2), max(rounding, ROUNDING * float(np.abs(values).max()))
    if not deviation > least:
        raise UndefinedDistance(
            f"the canonical form of {name} has deviation {deviation:.1e} on the coverage distribution: expected more than "
            f"rounding, {least:.1e}, or its distance from another is not defined. The reward is zero, constant or only a "
            "potential, or the coverage too narrow. Of rewards in a table, `starc` has a place for it."
        )
    return centred / deviation


def ranks(values: Numbers, weights: Numbers, rounding: float) -> Numbers:
    """The share of weight below each value, and half of the share at it: ranks between 0 and 1, ties in the middle.

    Values are tied with the next larger one if they differ by `rounding` or less.
    """
    order = np.argsort(values, kind="stable")
    group = np.concatenate([[0], np.cumsum(np.diff(values[order]) > rounding)])
    share = np.bincount(group, weights[order])
    result = np.empty(values.size)
    result[order] = (np.cumsum(share) - share / 2)[group]
    return result


def half_difference(first: Numbers, second: Numbers, weights: Numbers, order: float = 2.0) -> float:
    """Half the norm of a difference, at most 1 but for rounding."""
    return 0.5 * norm(first - second, weights, order)
