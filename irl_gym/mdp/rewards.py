"""Rewards, and files that hold them.

A reward on states is paid on *arrival*: a step from s to s' pays R(s'), also when it ends the episode. Ng & Russell's
V = R + gamma P V pays it at s; with W = P (R + gamma W), what an agent collects, V = R + gamma W, so the same policies are
greedy for both, and a terminal goal is paid exactly once. A reward on steps (S, A) pays R(s, a).
"""

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, Protocol, runtime_checkable

import numpy as np

from irl_gym._typing import Matrix
from irl_gym.checks import checked_number, float_array
from irl_gym.errors import DamagedFile, InvalidReward
from irl_gym.files.archives import json_in, read_arrays
from irl_gym.files.own_files import write_arrays
from irl_gym.mdp.tabular_mdp import TransitionTable, checked_mdp
from irl_gym.records import Record

FORMAT = "irl_gym.TabularReward/1"
SOLVED_WITHIN = 1e-6
"""Share of the largest |R| that solvers of linear programs leave of differences of action values."""


@runtime_checkable
class RewardFunction(Protocol):
    """What a step pays, in rows of a state index."""

    def pay(self, states: Any, actions: Any, next_states: Any) -> Any:
        """The reward of steps (s, a, s'): scalars or arrays (N,) in, the same shape out."""
        ...


@dataclass(frozen=True, eq=False)
class TabularReward(Record):
    """A reward in a table: (S,) paid on arrival, or (S, A) paid for the step. Immutable.

    Raises:
        InvalidReward: neither one nor two axes, or a value that is not finite.
    """

    FORMATS: ClassVar[tuple[str, ...]] = (FORMAT,)
    alpha: ClassVar[None] = None
    """No weights: it is of rows, not of observations (`irl_gym.features.linear_reward.LinearReward`)."""

    values: np.ndarray
    """(S,) or (S, A) float64."""
    note: Mapping[str, Any] = field(default_factory=dict)
    """Where it comes from; anything json can hold."""
    tolerance: float = 0.0
    """What the solver of a learned reward left open of each difference of action values, in units of value; 0 for a reward that
    is given."""

    def __post_init__(self) -> None:
        values = float_array("the reward", self.values, "(S,) or (S, A) numbers", InvalidReward)
        if values.ndim not in (1, 2) or values.size == 0:
            raise InvalidReward(f"the reward has shape {values.shape}: expected (S,) or (S, A).")
        wrong = np.argwhere(~np.isfinite(values))
        if wrong.size:
            where = tuple(int(i) for i in wrong[0])
            raise InvalidReward(f"R{list(where)} is {values[where]}: a reward is a finite number.")
        checked_number("tolerance", self.tolerance, "a number of at least 0, in units of value", least=0, error=InvalidReward)
        values.setflags(write=False)
        object.__setattr__(self, "values", values)

    @classmethod
    def learned(cls, values: np.ndarray, note: Mapping[str, Any]) -> "TabularReward":
        """A reward that a solver found, with the tolerance of its solution."""
        return cls(values, note, SOLVED_WITHIN * float(np.abs(values).max(initial=0.0)))

    def __reduce__(self) -> tuple:
        return type(self), (self.values, dict(self.note), self.tolerance)

    def __repr__(self) -> str:
        kind = "on arrival" if self.on_states else "for the step"
        return f"TabularReward({self.values.shape} paid {kind}, {self.values.min():.3g} to {self.values.max():.3g})"

    @property
    def n_states(self) -> int:
        """Number of states S."""
        return self.values.shape[0]

    @property
    def on_states(self) -> bool:
        """Is this a reward on states, paid on arrival?"""
        return self.values.ndim == 1

    def tabular(self, states: Any) -> "TabularReward":
        """Itself: a reward of rows is in a table, whatever the rows stand for."""
        return self

    def of_rows(self, rows: np.ndarray) -> "TabularReward":
        """The same reward on some of the states only, renumbered in the order given."""
        return TabularReward(self.values[rows], self.note, self.tolerance)

    def in_units(self) -> tuple["TabularReward", int]:
        """The same reward, and its tolerance, in units of 2^k, and k: the largest number is then 1 to 2, and no sum overflows.

        Nothing is rounded but numbers 10^300 times smaller than the largest.
        """
        exponent = int(np.frexp(max(float(np.abs(self.values).max()), self.tolerance, np.finfo(float).tiny))[1]) - 1
        values, tolerance = np.ldexp(self.values, -exponent), float(np.ldexp(self.tolerance, -exponent))
        return TabularReward(values, self.note, tolerance), exponent

    def pay(self, states: Any, actions: Any, next_states: Any) -> Any:
        """The reward of steps (s, a, s'): scalars or arrays (N,) in, the same shape out."""
        return self.values[next_states] if self.on_states else self.values[states, actions]

    def expected(self, table: TransitionTable) -> Matrix:
        """(S, A) the expected reward of a step; 0 in terminal states, which take none.

        Raises:
            InvalidReward: a reward for another number of states or actions.
        """
        if not isinstance(table, TransitionTable):
            checked_mdp(table)  # refuses what only holds one
        shape = (table.n_states, table.n_actions)
        if self.values.shape != shape[: self.values.ndim]:
            raise InvalidReward(
                f"the reward has shape {self.values.shape}: expected ({shape[0]},) or {shape}. Is it another table's?"
            )
        if self.on_states:
            return (table.P @ self.values).reshape(shape)
        return np.where(table.terminal[:, None], 0.0, self.values)

    def largest(self, table: TransitionTable) -> float:
        """The largest |R| that can be paid: of states that are reached, or of steps that are taken in them.

        Tolerances are shares of it: a number in a row that no episode reads must not widen them.
        """
        self.expected(table)  # checks the shape
        read = table.reachable if self.on_states else table.reachable & ~table.terminal
        return float(np.abs(self.values[read]).max(initial=0.0))

    def save(self, path: str | os.PathLike) -> None:
        """Write an npz without pickle: `values` and `note` (json). Beside first, then renamed."""
        header = {"format": FORMAT, "note": dict(self.note), "tolerance": self.tolerance}
        write_archive(path, header, {"values": self.values})

    @classmethod
    def load(cls, path: str | os.PathLike) -> "TabularReward":
        """Read what `save` wrote. Nothing is unpickled.

        Raises:
            FileNotFoundError: no such file.
            InvalidReward: the file holds no reward.
        """
        header, arrays = read_archive(path, cls.FORMATS)
        if "values" not in arrays:
            raise InvalidReward(f"{path} has no values: expected a file written by TabularReward.save.")
        note = header.get("note", {})
        if "tolerance" not in header and "learner" in note:  # a file from before tolerances were kept
            return cls.learned(arrays["values"], note)
        return cls(arrays["values"], note, header.get("tolerance", 0.0))


def write_archive(path: str | os.PathLike, header: Mapping[str, Any], arrays: Mapping[str, np.ndarray]) -> None:
    """Write arrays and a json header as an npz without pickle. Beside first, then renamed."""
    write_arrays(path, {**arrays, "header": np.array(json.dumps(header, sort_keys=True, default=plain_json))})


def read_archive(path: str | os.PathLike, formats: tuple[str, ...]) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Header and arrays of a file that `write_archive` wrote. Nothing is unpickled.

    Args:
        path: the file.
        formats: those that are understood, such as "irl_gym.TabularReward/1".

    Raises:
        FileNotFoundError: no such file.
        InvalidReward: another file, or one of another format.
    """
    kinds = [_kind(one) for one in formats]
    what = "reward" if all(kind.endswith("Reward") for kind in kinds) else " or ".join(kinds)
    saved = f"a file that {' or '.join(f'{kind}.save' for kind in kinds)} wrote"
    try:
        arrays = read_arrays(path)
        header = json_in(arrays, "header")
    except FileNotFoundError as error:
        told = f"{path} does not exist: expected {saved}. Save one there, or name another file."
        raise FileNotFoundError(told) from error
    except (DamagedFile, OSError) as error:
        why = error.strerror if isinstance(error, OSError) else error
        raise InvalidReward(f"{path} holds no {what} ({why}): expected {saved}.") from error
    if not isinstance(header, dict) or not isinstance(header.get("format"), str) or header["format"] not in formats:
        raise _another_format(path, header, formats)
    if not isinstance(header.get("note", {}), dict):
        raise InvalidReward(f"{path} has the note {header['note']!r:.80}: expected an object, in {saved}.")
    return header, {name: one for name, one in arrays.items() if name != "header"}


def _kind(file_format: str) -> str:
    """The class that a format is of: TabularReward of irl_gym.TabularReward/1."""
    return file_format.removeprefix("irl_gym.").partition("/")[0]


def _another_format(path: str | os.PathLike, header: Any, formats: tuple[str, ...]) -> InvalidReward:
    """The error of an archive that holds another kind of thing, or one of another version."""
    found = header.get("format") if isinstance(header, dict) else header
    kind, kinds = _kind(str(found)), [_kind(one) for one in formats]
    if str(found).startswith("irl_gym.") and kind not in kinds:
        told = f"{path} holds a {kind}: expected a {' or a '.join(kinds)}. Read it with {kind}.load, or name another file."
        return InvalidReward(told)
    expected = " or ".join(map(repr, formats))
    return InvalidReward(f"{path} has format {found!r:.80}: expected {expected}. Was it written by a newer version?")


def as_reward(reward: Any) -> TabularReward:
    """A TabularReward as it is, or one made of an array (S,) or (S, A).

    Raises:
        InvalidReward: an array of another shape, or with values that are not finite; or what only holds a reward.
    """
    check_reward_itself(reward)
    return reward if isinstance(reward, TabularReward) else TabularReward(reward)


def in_table(reward: Any, states: Any) -> TabularReward:
    """A reward of any kind in a table.

    Args:
        reward: what has `tabular`, or an array (S,) or (S, A).
        states: what rows stand for, or how many there are.

    Raises:
        InvalidReward: an array of another shape, or with values that are not finite.
    """
    return reward.tabular(states) if hasattr(reward, "tabular") else as_reward(reward)


def check_reward_itself(reward: Any) -> None:
    """Check that this is no outcome or table, which hold a reward.

    Raises:
        InvalidReward: it is.
    """
    if hasattr(reward, "reward"):
        raise InvalidReward(
            f"the reward is of type {type(reward).__name__}: expected the reward that it holds. Give its `reward`."
        )


def plain_json(value: Any) -> Any:
    """NumPy's numbers and arrays as json has them."""
    return value.tolist() if hasattr(value, "tolist") else str(value)
