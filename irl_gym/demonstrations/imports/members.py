"""Are these observations members of the space? Checked for all rows at once, and the first that is not is named.

Observations come in many layouts: a list of what an environment returned, arrays stacked as vector environments stack them, a
matrix with a column for each number. All become the stacked layout, in the space's dtype. Axes: n rows.
"""

from collections.abc import Mapping
from functools import singledispatch
from typing import Any

import numpy as np
from gymnasium import spaces

from irl_gym.demonstrations.imports.values import Name, is_list, numbers, shown
from irl_gym.errors import InvalidDemonstrations, NotDiscrete
from irl_gym.spaces.batches import batch_size


@singledispatch
def _bounds(space: spaces.Space) -> tuple[Any, Any]:
    """Lowest and highest value of a space that is one array."""
    raise NotDiscrete(
        f"{space} cannot be read from arrays: expected Discrete, MultiDiscrete, MultiBinary, Box, or a Tuple or Dict of these."
    )


@_bounds.register
def _(space: spaces.Discrete) -> tuple[Any, Any]:
    return space.start, space.start + space.n - 1


@_bounds.register
def _(space: spaces.MultiDiscrete) -> tuple[Any, Any]:
    return space.start, space.start + space.nvec - 1


@_bounds.register
def _(space: spaces.MultiBinary) -> tuple[Any, Any]:
    return 0, 1


@_bounds.register
def _(space: spaces.Box) -> tuple[Any, Any]:
    return space.low, space.high


def width(space: spaces.Space) -> int:
    """How many numbers an observation is made of."""
    parts = getattr(space, "spaces", None)
    if parts is None:
        return int(np.prod(space.shape or ()))
    return sum(map(width, parts.values() if isinstance(parts, Mapping) else parts))


@singledispatch
def members(space: spaces.Space, raw: Any, what: str, name: Name) -> Any:
    """Observations as a batch in the space's layout and dtype.

    Args:
        space: that they have to be members of.
        raw: a list of observations, a stacked batch, or (n, width) numbers.
        what: what a message calls one of them.
        name: says where a row stands.

    Raises:
        InvalidDemonstrations: a row outside the space, named with its value.
        NotDiscrete: a space that is made of something else than numbers.
    """
    low, high = _bounds(space)
    array, shape = numbers(raw, what, name), space.shape or ()
    if array.ndim and array.shape[1:] != shape and array.ndim <= 2 and array[:1].size == (len(array) > 0) * width(space):
        array = array.reshape(len(array), *shape)
    if array.ndim == 0 or (array.shape[1:] != shape and len(array)):
        raise InvalidDemonstrations(
            f"the {what}s have shape {array.shape}: expected {('n', *shape)}, one row for each member of {space}."
        )
    with np.errstate(over="ignore", invalid="ignore"):
        whole = np.dtype(space.dtype).kind in "iub"
        typed = array if whole else array.astype(space.dtype)  # float32 spaces are compared in float32
        fine = np.isfinite(typed) & (typed >= low) & (typed <= high)
        if whole and array.dtype.kind == "f":
            fine &= array == np.round(array)
    wrong = np.flatnonzero(~fine.all(axis=tuple(range(1, fine.ndim))))
    if wrong.size:
        row = int(wrong[0])
        raise InvalidDemonstrations(
            f"{name(row)} has {what} {shown(array[row])}: expected a member of {space}. Was it recorded in another "
            "environment, or is a value missing?"
        )
    return typed.astype(space.dtype, copy=False)


@members.register
def _(space: spaces.Tuple, raw: Any, what: str, name: Name) -> Any:
    parts = space.spaces
    if not isinstance(raw, tuple):
        raw = _columns_of_tuples(space, raw, what, name)
    if len(raw) != len(parts):
        raise InvalidDemonstrations(f"the {what}s have {len(raw)} parts: expected {len(parts)}, as {space} has.")
    batch = tuple(members(part, raw[i], f"{what}[{i}]", name) for i, part in enumerate(parts))
    _check_even(batch, what)
    return batch


def _columns_of_tuples(space: spaces.Tuple, raw: Any, what: str, name: Name) -> tuple:
    """A list of tuples, or a matrix, as a tuple of columns."""
    if isinstance(raw, np.ndarray) and raw.dtype.kind != "O":
        if raw.ndim != 2 or raw.shape[1] != width(space):
            raise InvalidDemonstrations(
                f"the {what}s have shape {raw.shape}: expected (n, {width(space)}), the numbers of {space} in columns."
            )
        return tuple(np.split(raw, np.cumsum([width(part) for part in space.spaces])[:-1], axis=1))
    rows = list(raw) if is_list(raw) else [raw]
    for row, one in enumerate(rows):
        if not is_list(one) or len(one) != len(space.spaces):
            raise InvalidDemonstrations(
                f"{name(row)} has {what} {shown(one)}: expected {len(space.spaces)} parts, a member of {space}."
            )
    return tuple([one[i] for one in rows] for i in range(len(space.spaces)))


@members.register
def _(space: spaces.Dict, raw: Any, what: str, name: Name) -> Any:
    if not isinstance(raw, Mapping):
        rows = list(raw) if is_list(raw) else [raw]
        for row, one in enumerate(rows):
            if not isinstance(one, Mapping) or set(one) != set(space.spaces):
                raise InvalidDemonstrations(
                    f"{name(row)} has {what} {shown(one)}: expected the keys {list(space.spaces)}, a member of {space}."
                )
        raw = {key: [one[key] for one in rows] for key in space.spaces}
    if set(raw) != set(space.spaces):
        raise InvalidDemonstrations(f"the {what}s have the keys {sorted(map(str, raw))}: expected {list(space.spaces)}.")
    batch = {key: members(part, raw[key], f"{what}[{key!r}]", name) for key, part in space.spaces.items()}
    _check_even(batch, what)
    return batch


def _check_even(batch: Any, what: str) -> None:
    counts = [batch_size(part) for part in (batch.values() if isinstance(batch, dict) else batch)]
    if len(set(counts)) > 1:
        raise InvalidDemonstrations(f"the parts of the {what}s have {counts} rows: expected as many in each.")
