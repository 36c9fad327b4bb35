"""Checks of arguments that many places share: a number in a range, an array of floats."""

import numbers
from typing import Any

import numpy as np

from irl_gym.errors import InvalidInput, InvalidParameter

LARGEST = 1e300
"""Sums of larger numbers overflow."""


def checked_number(
    name: str,
    value: Any,
    expected: str,
    *,
    above: float | None = None,
    least: float | None = None,
    below: float | None = None,
    whole: bool = False,
    error: type[InvalidInput] = InvalidParameter,
) -> float:
    """Return a finite number within a range, as a float.

    Args:
        name: what it is called.
        value: what was given.
        expected: what the message says was expected, with the mend.
        above: it has to be greater than this.
        least: or at least this.
        below: and less than this.
        whole: only integers, NumPy's among them.
        error: raised when it is not.

    Raises:
        InvalidInput: of the class given.
    """
    kind = numbers.Integral if whole else numbers.Real
    try:
        number = float(value) if isinstance(value, kind) and not isinstance(value, bool) else np.nan
    except OverflowError:  # a whole number beyond floats
        number = np.inf
    fine = np.isfinite(number) and (above is None or number > above) and (least is None or number >= least)
    if not (fine and (below is None or number < below)):
        raise error(f"{name} is {value!r}: expected {expected}.")
    return number


def checked_rng(rng: Any) -> np.random.Generator:
    """Return a generator as it is.

    Raises:
        InvalidParameter: anything else, such as a seed.
    """
    if isinstance(rng, np.random.Generator):
        return rng
    raise InvalidParameter(f"rng is {rng!r}: expected a generator. Make one of a seed: `np.random.default_rng(0)`.")


def float_array(name: str, value: Any, expected: str, error: type[InvalidInput]) -> np.ndarray:
    """Return an array-like as a new float64 array.

    Raises:
        InvalidInput: of the class given, for anything that is not rows of numbers of one length.
    """
    try:
        if np.iscomplexobj(value):
            raise TypeError("complex numbers")  # NumPy would drop the imaginary part
        return np.array(value, dtype=np.float64)
    except (TypeError, ValueError) as reason:
        raise error(
            f"{name} is {type(value).__name__} that cannot be read as numbers ({reason}): expected {expected}."
        ) from reason
