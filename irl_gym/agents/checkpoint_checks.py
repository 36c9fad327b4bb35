"""Is what a checkpoint holds the state of this training? Each number is looked at before it is given to SB3, torch or NumPy.

These take a generator's place outside of its numbers, moments of another shape or a weight that is not finite as they come, and
stumble, or read beyond their memory, steps later. Axes: N copies, S states.
"""

import copy
from collections.abc import Mapping
from typing import Any

import numpy as np
import torch

from irl_gym.errors import DamagedFile

LARGEST = 1e15
"""Of a weight or a payment; products of a few stay finite."""
MOST = 2**53
"""Of a count."""
DRAWN = 624
"""Numbers that NumPy's old generator holds; its place is one of them, or at their end."""


def count(name: str, value: Any) -> int:
    """A whole number of at least 0.

    Raises:
        DamagedFile: it is none.
    """
    if type(value) is not int or not 0 <= value <= MOST:
        raise DamagedFile(f"its {name} is {value!r:.60}: expected a whole number from 0 to 2^53")
    return value


def counter(name: str, value: Any, now: float | int) -> float | int:
    """A counter of an algorithm: whole if it is so now, else a share.

    Raises:
        DamagedFile: it is none.
    """
    if type(now) is int:
        return count(name, value)
    numbers({name: np.array(value)}, name, (), "iuf", -1.0, 1.0)
    return value


def copies_stand(moment: Mapping[str, np.ndarray], N: int, S: int) -> Mapping[str, np.ndarray]:
    """Where the copies of a table stand, as it is.

    Raises:
        DamagedFile: they are not N, or some stand outside of the table.
    """
    numbers(moment, "returns", (N,))
    numbers(moment, "rows", (N,), "iu", 0, S - 1)
    numbers(moment, "elapsed", (N,), "iu", 0, MOST)
    return moment


def numbers(
    found: Mapping[str, np.ndarray], name: str, shape: tuple[int | None, ...], kinds: str = "f", least: float = -LARGEST,
    most: float = LARGEST,
) -> np.ndarray:  # fmt: skip
    """An array of a file.

    Args:
        found: the file's arrays.
        name: which.
        shape: that it has; None where any length will do.
        kinds: of its dtype.
        least: no number is below.
        most: or above; NaN is neither.

    Raises:
        DamagedFile: it is not there, or another.
    """
    one = found.get(name)
    if one is None:
        raise DamagedFile(f"it has no {name}")
    fits = one.ndim == len(shape) and all(n in (None, m) for n, m in zip(shape, one.shape, strict=True))
    if not fits or one.dtype.kind not in kinds or not ((one >= least) & (one <= most)).all():
        raise DamagedFile(
            f"its {name} has shape {one.shape} and dtype {one.dtype}: expected {shape} of {least:.4g} to {most:.4g}"
        )
    return one


def same_shapes(name: str, kept: Mapping[str, np.ndarray], now: Mapping[str, Any]) -> None:
    """Check that arrays are as those of a new model, and finite.

    Raises:
        DamagedFile: one is another, missing, or too many.
    """
    if kept.keys() != now.keys():
        other = sorted(kept.keys() ^ now.keys())[0]
        raise DamagedFile(f"its {name} are {sorted(kept)[:5]}: expected {other!r:.60} to be there, as in the model, or not")
    for key, one in now.items():
        squares = "sq" in key or key == "step"  # means of squares, and steps
        numbers(kept, key, tuple(np.shape(one)), "biuf", 0.0 if squares else -LARGEST, LARGEST**2 if squares else LARGEST)


def moments_of(optimizer: torch.optim.Optimizer) -> dict[int, dict[str, Any]]:
    """What an optimiser notes of each parameter once it has made a step, by the parameter's number; none is made of it."""
    twin = copy.deepcopy(optimizer)
    for group in twin.param_groups:
        for parameter in group["params"]:
            parameter.grad = torch.zeros_like(parameter)
    twin.step()
    return twin.state_dict()["state"]


def old_generator(told: Any) -> tuple[Any, ...]:
    """The state of NumPy's old generator, which believes where it is said to stand in its numbers.

    Raises:
        DamagedFile: it is none.
    """
    kind, keys, place, has, other = told
    whole = len(keys) == DRAWN and all(type(one) is int and 0 <= one < 2**32 for one in keys)
    if kind != "MT19937" or not whole or count("numpy", place) > DRAWN or has not in (0, 1) or not abs(float(other)) < LARGEST:
        raise DamagedFile(f"its numpy is {str(told)[:60]}: expected the state of a generator")
    return kind, np.array(keys, dtype=np.uint32), place, has, float(other)
