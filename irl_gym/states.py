"""One numbering of the states: observations to rows and back.

Any space made of integers is a product of finite ranges, so an observation is a number in mixed radix: its *code*. When
every code is a state, row = code; when only some are (an enumeration found them), `codes` lists them in increasing order.
A state that is reachable both as an ordinary and as a terminal state has two rows: the ordinary one, and a terminal copy
at the end of the table, which `encode(..., terminated=True)` finds. `States` is the interface, which other numberings share.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property, singledispatch
from typing import Any, Protocol, runtime_checkable

import numpy as np
from gymnasium import spaces

from irl_gym.errors import NotDiscrete, UnknownObservation


@runtime_checkable
class States(Protocol):
    """A numbering of states: what a StateIndex offers, and whatever can stand in its place, such as cells of a grid."""

    @property
    def space(self) -> spaces.Space:
        """The observation space."""
        ...

    @property
    def n_states(self) -> int:
        """Number of rows, terminal copies included."""
        ...

    @property
    def terminal_copies(self) -> Mapping[int, int]:
        """Row of a state -> row of its terminal copy, for states entered both with and without `terminated`."""
        ...

    def is_batch(self, observation: Any) -> bool:
        """Is this an array of observations, not a single one?"""
        ...

    def encode(self, observation: Any, *, terminated: bool = False) -> int:
        """The row of an observation."""
        ...

    def encode_batch(self, observations: Any, *, terminated: np.ndarray | None = None) -> np.ndarray:
        """The rows of a batch of observations: (N,) int64."""
        ...

    def decode_batch(self, rows: Any) -> Any:
        """Observations of rows, stacked as vector environments stack them."""
        ...

    def decode(self, row: int) -> Any:
        """The observation of a row."""
        ...


@singledispatch
def _ranges(space: spaces.Space) -> np.ndarray:
    """The finite ranges of a space: (n, 2) rows of lowest value and count."""
    raise NotDiscrete(
        f"{space} is not made of integers: expected Discrete, MultiDiscrete, MultiBinary, an integer Box, or a Tuple or "
        "Dict of these. Discretise the environment first."
    )


@_ranges.register
def _(space: spaces.Discrete) -> np.ndarray:
    return np.array([[int(space.start), int(space.n)]])


@_ranges.register
def _(space: spaces.MultiDiscrete) -> np.ndarray:
    return np.stack([space.start.ravel(), space.nvec.ravel()], axis=1).astype(np.int64)


@_ranges.register
def _(space: spaces.MultiBinary) -> np.ndarray:
    return np.tile([0, 2], (int(np.prod(space.shape)), 1))


@_ranges.register
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


@_ranges.register
def _(space: spaces.Tuple) -> np.ndarray:
    return np.concatenate([_ranges(part) for part in space.spaces])


@_ranges.register
def _(space: spaces.Dict) -> np.ndarray:
    return np.concatenate([_ranges(part) for part in space.spaces.values()])


@singledispatch
def _to_numbers(space: spaces.Space, batch: Any) -> np.ndarray:
    """A batch of observations as integers: (N, n)."""
    array = np.asarray(batch)
    if array.dtype.kind not in "iub":
        raise UnknownObservation(f"observation {batch!r} has dtype {array.dtype}: expected integers of {space}.")
    shape = space.shape or ()
    if array.shape[1:] != shape:
        raise UnknownObservation(f"observation of shape {array.shape[1:]}: expected {shape}, a member of {space}.")
    return array.reshape(len(array), -1).astype(np.int64)


@_to_numbers.register
def _(space: spaces.Tuple, batch: Any) -> np.ndarray:
    if len(batch) != len(space.spaces):
        raise UnknownObservation(f"observation has {len(batch)} parts: expected {len(space.spaces)}, a member of {space}.")
    return np.concatenate([_to_numbers(part, batch[i]) for i, part in enumerate(space.spaces)], axis=1)


@_to_numbers.register
def _(space: spaces.Dict, batch: Any) -> np.ndarray:
    missing = sorted(set(space.spaces) - set(batch))
    if missing:
        raise UnknownObservation(f"observation has no key {missing[0]!r}: expected the keys {sorted(space.spaces)}.")
    return np.concatenate([_to_numbers(part, batch[key]) for key, part in space.spaces.items()], axis=1)


@singledispatch
def _from_numbers(space: spaces.Space, numbers: np.ndarray) -> Any:
    """The inverse of `_to_numbers`: a batch of observations."""
    return numbers.reshape(len(numbers), *(space.shape or ())).astype(space.dtype)


@_from_numbers.register
def _(space: spaces.Tuple, numbers: np.ndarray) -> Any:
    ends = np.cumsum([len(_ranges(part)) for part in space.spaces])[:-1]
    parts = zip(space.spaces, np.split(numbers, ends, axis=1), strict=True)
    return tuple(_from_numbers(part, columns) for part, columns in parts)


@_from_numbers.register
def _(space: spaces.Dict, numbers: np.ndarray) -> Any:
    ends = np.cumsum([len(_ranges(part)) for part in space.spaces.values()])[:-1]
    parts = zip(space.spaces.items(), np.split(numbers, ends, axis=1), strict=True)
    return {key: _from_numbers(part, columns) for (key, part), columns in parts}


@singledispatch
def _batched(space: spaces.Space, observation: Any) -> Any:
    """One observation as a batch of one."""
    return np.asarray(observation)[None]


@_batched.register
def _(space: spaces.Tuple, observation: Any) -> Any:
    if len(observation) != len(space.spaces):
        raise IndexError(f"{len(observation)} parts")
    return tuple(_batched(part, observation[i]) for i, part in enumerate(space.spaces))


@_batched.register
def _(space: spaces.Dict, observation: Any) -> Any:
    return {key: _batched(part, observation[key]) for key, part in space.spaces.items() if key in observation}


@singledispatch
def _first(space: spaces.Space, batch: Any) -> Any:
    """The first observation of a batch."""
    return batch[0]


@_first.register
def _(space: spaces.Box, batch: Any) -> Any:
    return np.asarray(batch[0])  # also where the shape is (): a Box has arrays only


@_first.register
def _(space: spaces.Tuple, batch: Any) -> Any:
    return tuple(_first(part, columns) for part, columns in zip(space.spaces, batch, strict=True))


@_first.register
def _(space: spaces.Dict, batch: Any) -> Any:
    return {key: _first(part, batch[key]) for key, part in space.spaces.items()}


@dataclass(frozen=True, eq=False)
class StateIndex:
    """A one-to-one map between observations and the rows of a table.

    Raises:
        NotDiscrete: the space is not made of integers, or has more elements than 64-bit codes can number.
    """

    space: spaces.Space
    """The environment's observation space."""
    codes: np.ndarray | None = None
    """(n,) int64, increasing: the codes that are states; None when all are."""
    terminal_copies: dict[int, int] = field(default_factory=dict)
    """Row of a state -> row of its terminal copy, for states entered both with and without `terminated`."""

    def __post_init__(self) -> None:
        if float(np.prod(self._ranges[:, 1].astype(float))) > 2**62:
            raise NotDiscrete(f"{self.space} has more than 2^62 elements: too many to number. List the states in `codes`.")

    @cached_property
    def _ranges(self) -> np.ndarray:
        return _ranges(self.space)

    @cached_property
    def _place_values(self) -> np.ndarray:
        counts = self._ranges[:, 1]
        return np.append(np.cumprod(counts[:0:-1])[::-1], 1).astype(np.int64)

    @cached_property
    def _originals(self) -> np.ndarray:
        """Row -> row of the ordinary state (itself, but for terminal copies)."""
        rows = np.arange(self.n_states)
        for row, copy in self.terminal_copies.items():
            rows[copy] = row
        return rows

    @property
    def n_states(self) -> int:
        """Number of rows, terminal copies included."""
        ordinary = int(np.prod(self._ranges[:, 1])) if self.codes is None else len(self.codes)
        return ordinary + len(self.terminal_copies)

    def is_batch(self, observation: Any) -> bool:
        """Is this an array of observations, not a single one?"""
        space = self.space
        if isinstance(space, spaces.Dict):
            key, space = next(iter(space.spaces.items()))
            observation = observation[key]
        return space.shape is not None and np.ndim(observation) == len(space.shape) + 1

    def encode(self, observation: Any, *, terminated: bool = False) -> int:
        """The row of an observation; of its terminal copy if it has one and `terminated` is true.

        Raises:
            UnknownObservation: not a member of the space, or not a state of the table.
        """
        try:
            batch = _batched(self.space, observation)
        except (TypeError, IndexError, KeyError, ValueError) as error:
            raise UnknownObservation(f"observation {observation!r}: expected a member of {self.space}.") from error
        row = int(self.encode_batch(batch)[0])
        return self.terminal_copies.get(row, row) if terminated else row

    def encode_batch(self, observations: Any, *, terminated: np.ndarray | None = None) -> np.ndarray:
        """The rows of a batch of observations: (N,) int64.

        Args:
            observations: a stacked batch, in the layout of Gymnasium's and SB3's vector environments.
            terminated: (N,) booleans; where true, the row of the terminal copy, if the state has one.

        Raises:
            UnknownObservation: not members of the space, or not states of the table.
        """
        numbers = _to_numbers(self.space, observations)
        low, count = self._ranges[:, 0], self._ranges[:, 1]
        wrong = np.flatnonzero(((numbers < low) | (numbers >= low + count)).any(axis=1))
        if wrong.size:
            values = numbers[wrong[0]].tolist()
            raise UnknownObservation(
                f"observation {values[0] if len(values) == 1 else values} is outside {self.space}: expected one of its "
                "members. Was it recorded in another environment?"
            )
        rows = (numbers - low) @ self._place_values
        if self.codes is not None:
            found = np.searchsorted(self.codes, rows)
            known = self.codes[np.minimum(found, len(self.codes) - 1)] == rows
            if not known.all():
                raise UnknownObservation(
                    f"observation {numbers[np.argmin(known)].tolist()} is not a state of this table: the table was made "
                    "without it. Enumerate the environment again with a larger limit."
                )
            rows = found
        if terminated is not None and self.terminal_copies:
            for row, copy in self.terminal_copies.items():
                rows[(rows == row) & terminated] = copy
        return rows

    def decode_batch(self, rows: Any) -> Any:
        """The observations of rows, stacked as vector environments stack them."""
        originals = self._originals[np.asarray(rows)]
        codes = originals if self.codes is None else self.codes[originals]
        low, count = self._ranges[:, 0], self._ranges[:, 1]
        return _from_numbers(self.space, codes[:, None] // self._place_values % count + low)

    def decode(self, row: int) -> Any:
        """The observation of a row."""
        return _first(self.space, self.decode_batch(np.array([row])))
