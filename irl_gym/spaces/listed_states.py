"""The numbering of states that were found one by one: an enumeration's, or a dataset's.

The rows are the observations in increasing order of their numbers, whatever order they were found in. A space may have
more elements than can be counted (a picture of 19 x 19 x 3 bytes), so a row is looked up by a 64-bit hash of the numbers,
and compared.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from gymnasium import spaces

from irl_gym.checks import any_array
from irl_gym.errors import InvalidMDP, UnknownObservation
from irl_gym.records import Record
from irl_gym.spaces.integer_spaces import checked_members, first_of, from_numbers, ranges
from irl_gym.spaces.states import Numbering


@dataclass(frozen=True, eq=False)
class ListedStates(Record, Numbering):
    """A one-to-one map between some observations of a space and the rows of a table.

    Raises:
        InvalidMDP: no state, numbers that are not strictly increasing or not as many as the space's observations have, or
            terminal copies that do not stand behind the ordinary rows.
        UnknownObservation: numbers of no member of the space.
    """

    space: spaces.Space
    """The environment's observation space."""
    numbers: np.ndarray
    """(n, k) integers, the observations' numbers as `irl_gym.spaces.integer_spaces` has them; rows increase
    lexicographically."""
    terminal_copies: Mapping[int, int] = field(default_factory=dict)
    """Row of a state -> row of its terminal copy, for states entered both with and without `terminated`; copies come last."""

    def __post_init__(self) -> None:
        numbers = any_array("numbers", self.numbers, "(n, k) integers", InvalidMDP)
        if numbers.ndim != 2 or not numbers.size or numbers.dtype.kind not in "iub":
            raise InvalidMDP(
                f"numbers have shape {numbers.shape} and dtype {numbers.dtype}: expected (n, k) integers, n at least 1."
            )
        width = len(ranges(self.space))
        if numbers.shape[1] != width:
            raise InvalidMDP(f"numbers have shape {numbers.shape}: expected (n, {width}), as many as {self.space} has.")
        checked_members(self.space, numbers)
        different = numbers[1:] != numbers[:-1]
        first = different.argmax(axis=1)
        rows = np.arange(len(first))
        unordered = np.flatnonzero(~different.any(axis=1) | (numbers[1:][rows, first] < numbers[:-1][rows, first]))
        if unordered.size:
            raise InvalidMDP(
                f"numbers of row {unordered[0] + 1} are {numbers[unordered[0] + 1].tolist()}: expected more than the row "
                "before, in lexicographic order. Sort them, each once."
            )
        small = np.result_type(np.min_scalar_type(numbers.min()), np.min_scalar_type(numbers.max()))
        compact = numbers.astype(np.int64 if small.kind == "f" else small)  # NumPy joins int8 and uint64 to a float
        compact.setflags(write=False)
        object.__setattr__(self, "numbers", compact)
        self.check_copies()

    @property
    def n_ordinary(self) -> int:
        """Number of observations listed."""
        return len(self.numbers)

    @cached_property
    def usual(self) -> Any:
        """An observation that shows in each place what is shown there most often, of 5,000 states at most."""
        some = self.numbers[:: 1 + len(self.numbers) // 5_000].astype(np.int64)
        counted = [np.unique(column, return_counts=True) for column in some.T]
        numbers = np.array([[values[counts.argmax()] for values, counts in counted]])
        return first_of(self.space, from_numbers(self.space, numbers))

    @cached_property
    def _hashed(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Odd weights (k,), the hashes of all rows in increasing order, and the rows in that order."""
        for attempt in range(100):
            random = np.random.default_rng(attempt).integers(2**63, size=self.numbers.shape[1], dtype=np.uint64)
            weights = random * np.uint64(2) + np.uint64(1)
            hashes = _hash(self.numbers, weights)
            order = np.argsort(hashes, kind="stable")
            if (np.diff(hashes[order]) != 0).all():
                return weights, hashes[order], order
        raise InvalidMDP(f"the {len(self.numbers)} states have no hash without collisions: report them.")  # pragma: no cover

    def rows_of(self, numbers: np.ndarray) -> np.ndarray:
        """(N,) rows of observations, given as numbers (N, k).

        Raises:
            UnknownObservation: one that is not listed.
        """
        weights, hashes, order = self._hashed
        found = np.minimum(np.searchsorted(hashes, _hash(numbers, weights)), len(hashes) - 1)
        rows = order[found]
        unknown = np.flatnonzero((self.numbers[rows] != numbers).any(axis=1))
        if unknown.size:
            values = numbers[unknown[0]].tolist()
            shown = values[0] if len(values) == 1 else values if len(values) <= 12 else f"{values[:12]}..."
            raise UnknownObservation(
                f"observation {shown} is not a state of this table: expected one of its {len(self.numbers)}. If the table was "
                "counted, count it again with more samples; one that was enumerated has all that its environment shows."
            )
        return rows

    def numbers_of(self, rows: np.ndarray) -> np.ndarray:
        """(N, k) numbers of ordinary rows."""
        return self.numbers[rows].astype(np.int64)


def _hash(numbers: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """(N,) the sum of numbers times weights, modulo 2^64."""
    return (numbers.astype(np.int64).astype(np.uint64) * weights).sum(axis=1, dtype=np.uint64)


def usual_observation(states: Any) -> Any:
    """What most of the states that are listed show in each place; None for other numberings, whose observations are short."""
    return states.usual if isinstance(states, ListedStates) else None


def in_order(numbers: np.ndarray) -> np.ndarray:
    """(n,) the order that sorts rows of numbers (n, k) lexicographically."""
    return np.lexsort(numbers.T[::-1])
