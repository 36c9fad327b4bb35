"""Spaces made of integers: any observation as a few integers, and back.

Discrete, MultiDiscrete, MultiBinary, integer Box, and Tuple or Dict of these are products of finite ranges, so an observation
is a vector of k integers, its *numbers*. Batches are stacked as vector environments stack them.
Axes: N observations, k numbers.
"""

from collections.abc import Callable, Hashable, Iterable, Mapping
from functools import singledispatch
from typing import Any

import numpy as np
from gymnasium import spaces

from irl_gym.errors import NotDiscrete, UnknownObservation


@singledispatch
def ranges(space: spaces.Space) -> np.ndarray:
    """The finite ranges of a space: (k, 2) rows of lowest value and count.

    Raises:
        NotDiscrete: a part that is not made of integers, is empty, or has more values than 64 bits can number.
    """
    mend = "Show the same as one of these, with `gymnasium.wrappers.TransformObservation`."
    if type(space).__name__ == "MissionSpace":
        mend = "MiniGrid's environments have their whole state as integers in `irl_gym_envs:irl_gym/MiniGrid-v0`."
    elif isinstance(space, spaces.Text):
        mend = "Leave text out, with a wrapper that shows the rest, as `gymnasium.wrappers.FilterObservation(env, ('key',))`."
    raise NotDiscrete(
        f"{space} is not made of integers: expected Discrete, MultiDiscrete, MultiBinary, an integer Box, or a Tuple or "
        f"Dict of these. {mend}"
    )


@ranges.register
def _(space: spaces.Discrete) -> np.ndarray:
    return np.array([[int(space.start), int(space.n)]])


@ranges.register
def _(space: spaces.MultiDiscrete) -> np.ndarray:
    return np.stack([space.start.ravel(), space.nvec.ravel()], axis=1).astype(np.int64)


@ranges.register
def _(space: spaces.MultiBinary) -> np.ndarray:
    return np.tile([0, 2], (int(np.prod(space.shape)), 1))


@ranges.register
def _(space: spaces.Box) -> np.ndarray:
    if not space.low.size:
        raise _nothing(space)
    if space.dtype.kind not in "iub":
        raise NotDiscrete(
            f"{space} holds floats: expected integers. Discretise the environment first, with `discretize(env, gamma=..., "
            "bins=...)` if its state can be set."
        )
    low, high = space.low.ravel(), space.high.ravel()
    # As 64-bit integers the bounds of an unsigned Box, or the count, would wrap around.
    if (high.astype(float) - low.astype(float)).max() > 2**62 or int(high.max()) >= 2**63:
        raise NotDiscrete(f"{space} has more than 2^62 elements, or larger ones: too many to number. Give it narrower bounds.")
    low, high = low.astype(np.int64), high.astype(np.int64)
    return np.stack([low, high - low + 1], axis=1)


@ranges.register
def _(space: spaces.Tuple | spaces.Dict) -> np.ndarray:
    parts = _parts(space)
    if not parts:
        raise _nothing(space)
    return np.concatenate([ranges(part) for part in parts])


def _nothing(space: spaces.Space) -> NotDiscrete:
    mend = "Leave it out, with a wrapper that shows the rest, as `gymnasium.wrappers.FilterObservation(env, ('key',))`."
    return NotDiscrete(f"{space} is empty: expected at least one number. {mend}")


def _parts(space: spaces.Tuple | spaces.Dict) -> list[spaces.Space]:
    return list(space.spaces.values() if isinstance(space, spaces.Dict) else space.spaces)


def _columns(space: spaces.Tuple | spaces.Dict, numbers: np.ndarray) -> Iterable[tuple[spaces.Space, np.ndarray]]:
    """The parts of a space, each with its columns of numbers (N, k)."""
    parts = _parts(space)
    ends = np.cumsum([len(ranges(part)) for part in parts])[:-1]
    return zip(parts, np.split(numbers, ends, axis=1), strict=True)


@singledispatch
def to_numbers(space: spaces.Space, batch: Any) -> np.ndarray:
    """A batch of observations as integers: (N, k).

    Raises:
        UnknownObservation: no batch of the space's observations, by its dtype, shape, parts or keys.
    """
    try:
        array = np.asarray(batch)
    except ValueError as error:
        raise UnknownObservation(f"observations {_shown(batch)} differ in shape: expected members of {space}.") from error
    if array.dtype.kind not in "iub":
        raise UnknownObservation(f"observation {_shown(batch)} has dtype {array.dtype}: expected integers of {space}.")
    if not array.ndim:
        raise UnknownObservation(f"observation {_shown(batch)} is no batch: expected (N, ...) of {space}. `encode` takes one.")
    if array.shape[1:] != (shape := space.shape or ()):
        raise UnknownObservation(f"observation of shape {array.shape[1:]}: expected {shape}, a member of {space}.")
    if array.dtype == np.uint64 and array.size and array.max() > np.iinfo(np.int64).max:  # it would wrap around
        raise UnknownObservation(f"observation holds {array.max()}: expected a member of {space}.")
    return array.reshape(len(array), int(np.prod(shape))).astype(np.int64)


def _shown(value: Any) -> str:
    """The beginning of what was given, on one line."""
    return " ".join(repr(value).split())[:90]


@to_numbers.register
def _(space: spaces.Tuple, batch: Any) -> np.ndarray:
    if not isinstance(batch, list | tuple | np.ndarray) or not getattr(batch, "ndim", 1):
        raise UnknownObservation(f"observation {_shown(batch)}: expected a tuple, a member of {space}.")
    if len(batch) != len(space.spaces):
        raise UnknownObservation(f"observation has {len(batch)} parts: expected {len(space.spaces)}, a member of {space}.")
    return _side_by_side([to_numbers(part, batch[i]) for i, part in enumerate(space.spaces)], space)


@to_numbers.register
def _(space: spaces.Dict, batch: Any) -> np.ndarray:
    if not isinstance(batch, Mapping):
        raise UnknownObservation(f"observation {_shown(batch)}: expected a dict, a member of {space}.")
    missing = sorted(set(space.spaces) - set(batch))
    if missing:
        raise UnknownObservation(f"observation has no key {missing[0]!r}: expected the keys {sorted(space.spaces)}.")
    return _side_by_side([to_numbers(part, batch[key]) for key, part in space.spaces.items()], space)


def _side_by_side(columns: list[np.ndarray], space: spaces.Space) -> np.ndarray:
    if len(lengths := {len(one) for one in columns}) > 1:
        raise UnknownObservation(f"parts of observations are {sorted(lengths)} long: expected one length, members of {space}.")
    return np.concatenate(columns, axis=1)


@singledispatch
def from_numbers(space: spaces.Space, numbers: np.ndarray) -> Any:
    """The inverse of `to_numbers`: a batch of observations."""
    return numbers.reshape(len(numbers), *(space.shape or ())).astype(space.dtype)


@from_numbers.register
def _(space: spaces.Tuple, numbers: np.ndarray) -> Any:
    return tuple(from_numbers(*one) for one in _columns(space, numbers))


@from_numbers.register
def _(space: spaces.Dict, numbers: np.ndarray) -> Any:
    return {key: from_numbers(*one) for key, one in zip(space.spaces, _columns(space, numbers), strict=True)}


@singledispatch
def as_batch(space: spaces.Space, observation: Any) -> Any:
    """One observation as a batch of one."""
    return np.asarray(observation)[None]


@as_batch.register
def _(space: spaces.Tuple, observation: Any) -> Any:
    if len(observation) != len(space.spaces):
        raise IndexError(f"{len(observation)} parts")
    return tuple(as_batch(part, observation[i]) for i, part in enumerate(space.spaces))


@as_batch.register
def _(space: spaces.Dict, observation: Any) -> Any:
    return {key: as_batch(part, observation[key]) for key, part in space.spaces.items() if key in observation}


@singledispatch
def first_of(space: spaces.Space, batch: Any) -> Any:
    """The first observation of a batch."""
    return batch[0]


@first_of.register
def _(space: spaces.Box, batch: Any) -> Any:
    return np.asarray(batch[0])  # also where the shape is (): a Box has arrays only


@first_of.register
def _(space: spaces.Tuple, batch: Any) -> Any:
    return tuple(first_of(part, columns) for part, columns in zip(space.spaces, batch, strict=True))


@first_of.register
def _(space: spaces.Dict, batch: Any) -> Any:
    return {key: first_of(part, batch[key]) for key, part in space.spaces.items()}


def is_batch(space: spaces.Space, observation: Any) -> bool:
    """Is this an array of observations of a space, not a single one? What is neither, and `to_numbers` refuses, is none."""
    try:
        if isinstance(space, spaces.Dict):
            name, part = next(iter(space.spaces.items()))
            return is_batch(part, observation[name])
        if isinstance(space, spaces.Tuple):
            return bool(space.spaces) and is_batch(space.spaces[0], observation[0])
        return space.shape is not None and np.ndim(observation) == len(space.shape) + 1
    except (TypeError, IndexError, KeyError, ValueError):
        return False


@singledispatch
def key_of(space: spaces.Space) -> Callable[[Any], Hashable]:
    """What gives the key of an observation: equal for equal observations, and fast. `numbers_of_keys` reads it back."""
    dtype, shape = np.dtype(space.dtype), space.shape or ()

    def key(observation: Any) -> bytes:
        array = np.asarray(observation)
        if array.shape != shape or array.dtype.kind not in "iub":
            to_numbers(space, array[None])  # says what is wrong
        if array.dtype != dtype:
            given, array = array, array.astype(dtype)
            if (array != given).any():  # 256 as a byte would be the key of 0
                raise UnknownObservation(f"observation {_shown(observation)} is not of {dtype}: expected a member of {space}.")
        return array.tobytes()

    return key


@key_of.register
def _(space: spaces.Discrete) -> Callable[[Any], Hashable]:
    def key(observation: Any) -> int:
        number = int(observation)
        if number != observation:  # 2.5 would be the key of 2
            raise UnknownObservation(f"observation {_shown(observation)} is no integer: expected a member of {space}.")
        return number

    return key


@key_of.register
def _(space: spaces.Tuple) -> Callable[[Any], Hashable]:
    parts = [key_of(part) for part in space.spaces]
    return lambda observation: tuple([part(one) for part, one in zip(parts, observation, strict=True)])


@key_of.register
def _(space: spaces.Dict) -> Callable[[Any], Hashable]:
    parts = [(name, key_of(part)) for name, part in space.spaces.items()]
    return lambda observation: tuple([part(observation[name]) for name, part in parts])


@singledispatch
def numbers_of_keys(space: spaces.Space, keys: list[Any]) -> np.ndarray:
    """(N, k) int64, the numbers of the observations that gave these keys."""
    return np.frombuffer(b"".join(keys), dtype=space.dtype).reshape(len(keys), -1).astype(np.int64)


@numbers_of_keys.register
def _(space: spaces.Discrete, keys: list[Any]) -> np.ndarray:
    return np.array(keys, dtype=np.int64)[:, None]


@numbers_of_keys.register
def _(space: spaces.Tuple | spaces.Dict, keys: list[Any]) -> np.ndarray:
    columns = zip(_parts(space), zip(*keys, strict=True), strict=True)
    return np.concatenate([numbers_of_keys(part, list(column)) for part, column in columns], axis=1)


@singledispatch
def keys_of_numbers(space: spaces.Space, numbers: np.ndarray) -> list[Any]:
    """The keys of observations given as numbers (N, k): the inverse of `numbers_of_keys`."""
    return [row.tobytes() for row in numbers.astype(space.dtype)]


@keys_of_numbers.register
def _(space: spaces.Discrete, numbers: np.ndarray) -> list[Any]:
    return numbers[:, 0].tolist()


@keys_of_numbers.register
def _(space: spaces.Tuple | spaces.Dict, numbers: np.ndarray) -> list[Any]:
    return list(zip(*[keys_of_numbers(part, columns) for part, columns in _columns(space, numbers)], strict=True))


def checked_members(space: spaces.Space, numbers: np.ndarray) -> np.ndarray:
    """Numbers (N, k), all within a space.

    Raises:
        UnknownObservation: naming the first that is not.
    """
    low, count = ranges(space).T
    wrong = np.flatnonzero(((numbers < low) | (numbers > low + (count - 1))).any(axis=1))  # low + count may wrap around
    if wrong.size:
        values = numbers[wrong[0]].tolist()
        raise UnknownObservation(
            f"observation {values[0] if len(values) == 1 else values} is outside {space}: expected one of its "
            "members. Is it another environment's, or are the space's bounds wrong?"
        )
    return numbers
