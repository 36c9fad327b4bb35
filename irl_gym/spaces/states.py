"""One numbering of the states: observations to rows and back.

Any space made of integers is a product of finite ranges, so an observation is a number in mixed radix, and `StateIndex` takes
that number for the row. `irl_gym.spaces.listed_states.ListedStates` numbers only some observations, those that an enumeration
found. A state that is reachable both as an ordinary and as a terminal state has two rows: the ordinary one, and a terminal copy
at the end of the table, which `encode(..., terminated=True)` finds. `States` is the interface, which other numberings share.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Protocol, runtime_checkable

import numpy as np
from gymnasium import spaces

from irl_gym.checks import any_array
from irl_gym.errors import InvalidMDP, InvalidParameter, NotDiscrete, UnknownObservation
from irl_gym.records import Record
from irl_gym.spaces.integer_spaces import as_batch, checked_members, first_of, from_numbers, is_batch, ranges, to_numbers


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


class Numbering:
    """What the numberings of integer observations share; each says how numbers (N, k) become rows and back."""

    space: spaces.Space
    terminal_copies: Mapping[int, int]

    @property
    def n_ordinary(self) -> int:
        """Number of rows that are no terminal copies."""
        raise NotImplementedError

    def rows_of(self, numbers: np.ndarray) -> np.ndarray:
        """(N,) rows of members of the space, given as numbers (N, k)."""
        raise NotImplementedError

    def numbers_of(self, rows: np.ndarray) -> np.ndarray:
        """(N, k) numbers of ordinary rows."""
        raise NotImplementedError

    def check_copies(self) -> None:
        """Check that terminal copies are of ordinary rows, one each, and fill the rows behind those.

        Raises:
            InvalidMDP: they are not.
        """
        last, copies = self.n_ordinary - 1, self.terminal_copies
        for row in copies:
            if not 0 <= row <= last:
                raise InvalidMDP(f"terminal_copies has row {row}: expected ordinary rows, 0 to {last}.")
        if sorted(copies.values()) != list(range(last + 1, self.n_states)):
            raise InvalidMDP(
                f"terminal_copies leads to rows {sorted(copies.values())[:9]}: expected {last + 1} to {self.n_states - 1}, "
                "each once: they stand behind the ordinary ones."
            )

    @cached_property
    def _originals(self) -> np.ndarray:
        """(C,) rows of the ordinary states that the terminal copies are of, in the order of the copies."""
        return np.array(sorted(self.terminal_copies, key=self.terminal_copies.__getitem__), dtype=np.int64)

    @cached_property
    def _ended(self) -> np.ndarray:
        """Ordinary row -> row of its terminal copy; itself where there is none."""
        rows = np.arange(self.n_ordinary)
        rows[list(self.terminal_copies)] = list(self.terminal_copies.values())
        return rows

    @property
    def n_states(self) -> int:
        """Number of rows, terminal copies included."""
        return self.n_ordinary + len(self.terminal_copies)

    def is_batch(self, observation: Any) -> bool:
        """Is this an array of observations, not a single one?"""
        return is_batch(self.space, observation)

    def encode(self, observation: Any, *, terminated: bool = False) -> int:
        """The row of an observation; of its terminal copy if it has one and `terminated` is true.

        Raises:
            UnknownObservation: not a member of the space, or not a state of the table.
        """
        try:
            batch = as_batch(self.space, observation)
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
        rows = self.rows_of(checked_members(self.space, to_numbers(self.space, observations)))
        if terminated is not None and self.terminal_copies:
            if np.shape(terminated) != rows.shape:
                raise UnknownObservation(
                    f"terminated has shape {np.shape(terminated)}: expected {rows.shape}, a boolean an observation."
                )
            rows = np.where(terminated, self._ended[rows], rows)
        return rows

    def decode_batch(self, rows: Any) -> Any:
        """The observations of rows (N,), stacked as vector environments stack them.

        Raises:
            InvalidParameter: anything but rows of the table.
        """
        rows = self._checked_rows(rows)
        copies = rows >= self.n_ordinary
        if copies.any():
            rows = rows.copy()
            rows[copies] = self._originals[rows[copies] - self.n_ordinary]
        return from_numbers(self.space, self.numbers_of(rows))

    def _checked_rows(self, rows: Any) -> np.ndarray:
        found = any_array("rows", rows, "(N,) integers", InvalidParameter)
        found = found if found.size else found.astype(np.int64)
        if found.ndim != 1 or found.dtype.kind not in "iu":
            raise InvalidParameter(f"rows have shape {found.shape} and dtype {found.dtype}: expected (N,) integers.")
        wrong = np.flatnonzero((found < 0) | (found >= self.n_states))
        if wrong.size:
            raise InvalidParameter(f"row {found[wrong[0]]} is outside the table: expected 0 to {self.n_states - 1}.")
        return found.astype(np.int64)

    def decode(self, row: int) -> Any:
        """The observation of a row.

        Raises:
            InvalidParameter: no row of the table.
        """
        return first_of(self.space, self.decode_batch(any_array("row", [row], "an integer", InvalidParameter)))


@dataclass(frozen=True, eq=False)
class StateIndex(Record, Numbering):
    """A one-to-one map between all observations of a space and the rows of a table.

    Raises:
        NotDiscrete: the space is not made of integers, or has more elements than 64-bit integers can number.
        InvalidMDP: terminal copies that do not stand behind the ordinary rows.
    """

    space: spaces.Space
    """The environment's observation space."""
    terminal_copies: Mapping[int, int] = field(default_factory=dict)
    """Row of a state -> row of its terminal copy, for states entered both with and without `terminated`."""

    def __post_init__(self) -> None:
        if float(np.prod(self._ranges[:, 1].astype(float))) > 2**62:
            raise NotDiscrete(
                f"{self.space} has more than 2^62 elements: too many to number. Number those that occur, with ListedStates."
            )
        self.check_copies()

    @cached_property
    def _ranges(self) -> np.ndarray:
        return ranges(self.space)

    @cached_property
    def _place_values(self) -> np.ndarray:
        counts = self._ranges[:, 1]
        return np.append(np.cumprod(counts[:0:-1])[::-1], 1).astype(np.int64)

    @property
    def n_ordinary(self) -> int:
        """Number of members of the space."""
        return int(np.prod(self._ranges[:, 1]))

    def rows_of(self, numbers: np.ndarray) -> np.ndarray:
        """(N,) rows of members of the space, given as numbers (N, k)."""
        return (numbers - self._ranges[:, 0]) @ self._place_values

    def numbers_of(self, rows: np.ndarray) -> np.ndarray:
        """(N, k) numbers of ordinary rows."""
        low, count = self._ranges[:, 0], self._ranges[:, 1]
        return rows[:, None] // self._place_values % count + low
