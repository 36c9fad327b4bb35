"""Spaces made of integers: any observation as a few integers, and back.

Discrete, MultiDiscrete, MultiBinary, integer Box, and Tuple or Dict of these are products of finite ranges, so an observation
is a vector of k integers, its *numbers*. Batches are stacked as vector environments
stack them. Axes: N observations, k numbers.
"""

from collections.abc import Callable, Hashable, Iterable
from functools import singledispatch
from typing import Any

import numpy as np
from gymnasium import spaces

from irl_gym.errors import NotDiscrete, UnknownObservation


@singledispatch
def ranges(space: spaces.Space) -> np.ndarray:
    """The finite ranges of a space: (n, 2) rows of lowest value and count."""
    mend = "Discretise the environment first."
    if type(space).__name__ == "MissionSpace":
        mend = "MiniGrid's environments have their whole state as integers in `irl_gym_envs:irl_gym/MiniGrid-v0`."
    elif isinstance(space, spaces.Text):
        mend = "Leave text out, with a wrapper that shows the rest."
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
    if space.dtype.kind not in "iub":
        raise NotDiscrete(
            f"{space} holds floats: expected integers. Discretise the environment first, with `discretize(env, gamma=..., "
            "bins=...)` if its state can be set."
        )
    low, high = space.low.ravel().astype(np.int64), space.high.ravel().astype(np.int64)
    if (high.astype(float) - low.astype(float)).max(initial=0.0) > 2**62:  # the count would wrap around
        raise NotDiscrete(f"{space} has more than 2^62 elements: too many to number. Give it narrower bounds.")
    return np.stack([low, high - low + 1], axis=1)


@ranges.register
def _(space: spaces.Tuple) -> np.ndarray:
    return np.concatenate([ranges(part) for part in space.spaces])


@ranges.register
def _(space: spaces.Dict) -> np.ndarray:
    return np.concatenate([ranges(part) for part in space.spaces.values()])


@singledispatch
def to_numbers(space: spaces.Space, batch: Any) -> np.ndarray:
    """A batch of observations as integers: (N, n)."""
    array = np.asarray(batch)
    if array.dtype.kind not in "iub":
        raise UnknownObservation(f"observation {batch!r} has dtype {array.dtype}: expected integers of {space}.")
    shape = space.shape or ()
    if array.shape[1:] != shape:
        raise UnknownObservation(f"observation of shape {array.shape[1:]}: expected {shape}, a member of {space}.")
    return array.reshape(len(array), -1).astype(np.int64)


@to_numbers.register
def _(space: spaces.Tuple, batch: Any) -> np.ndarray:
    if len(batch) != len(space.spaces):
        raise UnknownObservation(f"observation has {len(batch)} parts: expected {len(space.spaces)}, a member of {space}.")
    return np.concatenate([to_numbers(part, batch[i]) for i, part in enumerate(space.spaces)], axis=1)


@to_numbers.register
def _(space: spaces.Dict, batch: Any) -> np.ndarray:
    missing = sorted(set(space.spaces) - set(batch))
    if missing:
        raise UnknownObservation(f"observation has no key {missing[0]!r}: expected the keys {sorted(space.spaces)}.")
    return np.concatenate([to_numbers(part, batch[key]) for key, part in space.spaces.items()], axis=1)


@singledispatch
def from_numbers(space: spaces.Space, numbers: np.ndarray) -> Any:
    """The inverse of `to_numbers`: a batch of observations."""
    return numbers.reshape(len(numbers), *(space.shape or ())).astype(space.dtype)


@from_numbers.register
def _(space: spaces.Tuple, numbers: np.ndarray) -> Any:
    ends = np.cumsum([len(ranges(part)) for part in space.spaces])[:-1]
    parts = zip(space.spaces, np.split(numbers, ends, axis=1), strict=True)
    return tuple(from_numbers(part, columns) for part, columns in parts)


@from_numbers.register
def _(space: spaces.Dict, numbers: np.ndarray) -> Any:
    ends = np.cumsum([len(ranges(part)) for part in space.spaces.values()])[:-1]
    parts = zip(space.spaces.items(), np.split(numbers, ends, axis=1), strict=True)
    return {key: from_numbers(part, columns) for (key, part), columns in parts}


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
    """Is this an array of observations of a space, not a single one?"""
    if isinstance(space, spaces.Dict):
        name, part = next(iter(space.spaces.items()))
        return is_batch(part, observation[name])
    if isinstance(space, spaces.Tuple):
        return bool(space.spaces) and is_batch(space.spaces[0], observation[0])
    return space.shape is not None and np.ndim(observation) == len(space.shape) + 1


@singledispatch
def key_of(space: spaces.Space) -> Callable[[Any], Hashable]:
    """What gives the key of an observation: equal for equal observations, and fast. `numbers_of_keys` reads it back."""
    dtype = np.dtype(space.dtype)

    def key(observation: Any) -> bytes:
        array = np.asarray(observation)
        if array.dtype != dtype:
            if array.dtype.kind not in "iub":
                raise UnknownObservation(f"observation {observation!r} has dtype {array.dtype}: expected integers of {space}.")
            array = array.astype(dtype)
        return array.tobytes()

    return key


@key_of.register
def _(space: spaces.Discrete) -> Callable[[Any], Hashable]:
    return int


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
def _(space: spaces.Tuple, keys: list[Any]) -> np.ndarray:
    columns = zip(space.spaces, zip(*keys, strict=True), strict=True)
    return np.concatenate([numbers_of_keys(part, list(column)) for part, column in columns], axis=1)


@numbers_of_keys.register
def _(space: spaces.Dict, keys: list[Any]) -> np.ndarray:
    columns = zip(space.spaces.values(), zip(*keys, strict=True), strict=True)
    return np.concatenate([numbers_of_keys(part, list(column)) for part, column in columns], axis=1)


@singledispatch
def keys_of_numbers(space: spaces.Space, numbers: np.ndarray) -> list[Any]:
    """The keys of observations given as numbers (N, k): the inverse of `numbers_of_keys`."""
    return [row.tobytes() for row in numbers.astype(space.dtype)]


@keys_of_numbers.register
def _(space: spaces.Discrete, numbers: np.ndarray) -> list[Any]:
    return numbers[:, 0].tolist()


@keys_of_numbers.register
def _(space: spaces.Tuple, numbers: np.ndarray) -> list[Any]:
    return _keys_of_parts(space.spaces, numbers)


@keys_of_numbers.register
def _(space: spaces.Dict, numbers: np.ndarray) -> list[Any]:
    return _keys_of_parts(space.spaces.values(), numbers)


def _keys_of_parts(parts: Iterable[spaces.Space], numbers: np.ndarray) -> list[Any]:
    parts = list(parts)
    ends = np.cumsum([len(ranges(part)) for part in parts])[:-1]
    columns = [keys_of_numbers(part, one) for part, one in zip(parts, np.split(numbers, ends, axis=1), strict=True)]
    return list(zip(*columns, strict=True))


def checked_members(space: spaces.Space, numbers: np.ndarray) -> np.ndarray:
    """Numbers (N, k), all within a space.

    Raises:
        UnknownObservation: naming the first that is not.
    """
    low, count = ranges(space).T
    wrong = np.flatnonzero(((numbers < low) | (numbers >= low + count)).any(axis=1))
    if wrong.size:
        values = numbers[wrong[0]].tolist()
        raise UnknownObservation(
            f"observation {values[0] if len(values) == 1 else values} is outside {space}: expected one of its "
            "members. Is it another environment's, or are the space's bounds wrong?"
        )
    return numbers
