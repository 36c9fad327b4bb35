"""Numbers, booleans and batches of them, out of whatever was given. Axes: n rows.

A batch of observations is an array, or a dictionary or tuple of batches.
"""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import scipy.sparse as sp

from irl_gym.errors import InvalidDemonstrations

Name = Callable[[int], str]
"""Says where a row stands, in the words of the source: `row 17 (line 18 of log.csv)`."""

NO_WORDS = "Put a number in place of each word, or read another column."


def first_part(batch: Any) -> Any:
    """An array of a batch that may be a tuple or dictionary of them."""
    while isinstance(batch, Mapping | tuple) and len(batch):
        batch = next(iter(batch.values())) if isinstance(batch, Mapping) else batch[0]
    return batch


def as_array(raw: Any, what: str) -> np.ndarray:
    """Any array, of any type.

    Raises:
        InvalidDemonstrations: rows of several lengths.
    """
    try:
        return np.asarray(raw)
    except ValueError as error:
        raise InvalidDemonstrations(f"the {what} are rows of several lengths: expected rows of one length.") from error


def is_list(raw: Any) -> bool:
    """Has it a length and positions, as arrays, lists and tuples have?"""
    sized = hasattr(raw, "__len__") and hasattr(raw, "__getitem__") and not isinstance(raw, str | bytes | Mapping | type)
    return sized and getattr(raw, "shape", None) != () and not sp.issparse(raw)  # which has a length that it does not tell


def numbers(raw: Any, what: str, name: Name, expected: str | None = None) -> np.ndarray:
    """Rows of numbers as an array of integers or floats; booleans count as 0 and 1.

    Raises:
        InvalidDemonstrations: rows of different shapes, or a value that is no number, named by its row.
    """
    try:
        array = np.asarray(raw)
        if array.dtype.kind == "O" and array.ndim == 1 and len(array) and np.ndim(array[0]):
            array = np.asarray(array.tolist())  # an array of arrays
    except (ValueError, TypeError) as error:
        raise _ragged(raw, what, name) from error
    if array.dtype.kind == "b":
        return array.astype(np.int64)
    if array.dtype.kind in "iuf":
        return array
    try:
        if array.dtype.kind not in "OUST":
            raise TypeError(array.dtype)
        return array.astype(np.float64)
    except (ValueError, TypeError, OverflowError) as error:
        rows = array if array.ndim else array[None]
        for row, value in enumerate(rows):
            if not _is_numeric(value):
                wanted = expected or (f"numbers. {NO_WORDS}" if isinstance(value, str) else "numbers.")
                raise InvalidDemonstrations(f"{name(row)} has {what} {shown(value)}: expected {wanted}") from error
        raise _ragged(rows, what, name) from error


def whole_numbers(raw: Any, what: str, name: Name) -> np.ndarray:
    """(n,) int64.

    Raises:
        InvalidDemonstrations: something else, named by its row.
    """
    array = numbers(raw, what, name)
    if array.ndim != 1:
        raise InvalidDemonstrations(f"the {what}s have shape {array.shape}: expected whole numbers (n,).")
    wrong = np.flatnonzero(~((array > -(2**53)) & (array < 2**53) & (array == np.floor(array))))
    if wrong.size:
        value = array[wrong[0]].item()
        raise InvalidDemonstrations(
            f"{name(int(wrong[0]))} has {what} {value}: expected a whole number between -2^53 and 2^53."
        )
    return array.astype(np.int64)


def _is_numeric(value: Any) -> bool:
    try:
        array = np.asarray(value)
        if array.dtype.kind in "OUST":
            array.astype(np.float64)
    except (ValueError, TypeError, OverflowError):
        return False
    return array.dtype.kind in "biufOUST"


def _ragged(raw: Any, what: str, name: Name) -> InvalidDemonstrations:
    shapes = []
    for row, value in enumerate(raw):
        try:
            shapes.append(np.shape(value))
        except ValueError:
            return InvalidDemonstrations(f"{name(row)} has {what} {shown(value)}: expected rows of one length.")
        if shapes[-1] != shapes[0]:
            return InvalidDemonstrations(
                f"{name(row)} has {what} {shown(value)} of shape {shapes[-1]}: expected shape {shapes[0]}, as in {name(0)}."
            )
    return InvalidDemonstrations(f"the {what}s cannot be read as rows of numbers: expected one row a step.")


def truths(raw: Any, what: str, name: Name) -> np.ndarray:
    """Booleans, which may be written as 0 and 1 or as text: a new array (n,).

    Raises:
        InvalidDemonstrations: something else, named by its row.
    """
    values = as_array(raw, f"{what} flags")
    if values.dtype.kind in "OUT" and values.ndim:  # a file's column in which one value is no boolean, such as an empty one
        words = {"true": 1, "false": 0}
        values = [words.get(one.lower(), one) if isinstance(one, str) else one for one in values]
    array = numbers(values, what, name, "true or false.")
    if array.ndim != 1 and array.shape[1:] != (1,):
        raise InvalidDemonstrations(f"the {what} flags have shape {array.shape}: expected (n,), one a row.")
    array = array.reshape(-1)
    odd = np.flatnonzero((array != 0) & (array != 1))
    if odd.size:
        raise InvalidDemonstrations(f"{name(int(odd[0]))} has {what} {array[odd[0]].item()}: expected true or false.")
    return array.astype(bool)


def shown(value: Any) -> str:
    """A value on one short line."""
    text = " ".join(repr(value.tolist() if isinstance(value, np.ndarray | np.generic) else value).split())
    return text if len(text) <= 80 else text[:77] + "..."
