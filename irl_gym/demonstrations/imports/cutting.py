"""Many episodes in each layout of arrays, as `LogColumns`. Axes: N episodes, T steps, n rows.

`columns` are what a log has, by the names of the fields of `LogColumns`: observations, actions, and perhaps rewards,
terminated, truncated, next_observations. Here the flags may also be one an episode, and observations one more than actions in
each.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from irl_gym.demonstrations.imports.members import members
from irl_gym.demonstrations.imports.reading import Reading
from irl_gym.demonstrations.imports.rows import LogColumns
from irl_gym.demonstrations.imports.values import Name, as_array, first_part, is_list, numbers, whole_numbers
from irl_gym.errors import InvalidDemonstrations
from irl_gym.mdp.episodes import Episode
from irl_gym.spaces.batches import batch_size, by_part

FLAGS = ("terminated", "truncated")


def cut(how: Reading, columns: Mapping[str, Any], offsets: np.ndarray, name: Name | None = None) -> list[Episode]:
    """Episodes of one long array, cut at offsets (N + 1,).

    Args:
        how: what is checked against, and the rule for a missing last observation.
        columns: n observations, or n + N; (n,) of the others; the flags may also be a boolean or (N,).
        offsets: row at which each episode starts, and n.
        name: says where a row stands, if there are n observations; None for episode and step.

    Raises:
        InvalidDemonstrations: rows that cannot be right.
    """
    n, N = int(offsets[-1]), len(offsets) - 1
    columns = {key: _rowwise(key, value, offsets) if key in FLAGS else value for key, value in columns.items()}
    part = first_part(columns["observations"])
    if columns.get("next_observations") is None and is_list(part) and len(part) == n + N:
        for key, value in columns.items():
            if value is None or key == "observations":
                continue
            array = as_array(value, key)
            if array.shape[:1] != (n,):
                raise InvalidDemonstrations(f"the {key} have shape {array.shape}: expected ({n},), one a step.")
            columns[key] = np.insert(array, offsets[1:], 0, axis=0)
        how, offsets, name = replace(how, last="row"), offsets + np.arange(N + 1), None
    return LogColumns(how, offsets, name or _steps_of(offsets, how.noun), **columns).episodes()


def _steps_of(offsets: np.ndarray, noun: str) -> Name:
    """Names rows by episode and step."""

    def name(row: int) -> str:
        number = int(np.searchsorted(offsets, row, side="right")) - 1
        return f"{noun} {number}, step {row - int(offsets[number])} (from 0)"

    return name


def _rowwise(what: str, flags: Any, offsets: np.ndarray) -> Any:
    """Flags an episode as flags a row."""
    n, N = int(offsets[-1]), len(offsets) - 1
    if flags is None or as_array(flags, f"{what} flags").shape[:1] == (n,):
        return flags
    array = numbers(flags, f"{what} flag", lambda row: f"episode {row} (from 0)")
    if array.shape not in ((), (N,)):
        raise InvalidDemonstrations(
            f"the {what} flags have shape {array.shape}: expected one boolean, {N}, one an episode, or {n}, one a step."
        )
    rows = np.zeros(n, dtype=array.dtype)
    rows[offsets[1:] - 1] = array
    return rows


def from_padded(how: Reading, columns: Mapping[str, Any], counts: np.ndarray) -> list[Episode]:
    """Episodes of arrays (N, T, ...), of which the first `counts` steps are read.

    Raises:
        InvalidDemonstrations: rows that cannot be right.
    """
    longest = columns["actions"].shape[1]
    if (counts > longest).any():
        wrong = int(np.argmax(counts > longest))
        raise InvalidDemonstrations(
            f"episode {wrong} (from 0) has {counts[wrong]} steps: expected at most {longest}, as padded."
        )
    complete = as_array(first_part(columns["observations"]), "observations").shape[1:2] == (longest + 1,)
    flat = dict(columns)
    for key, value in columns.items():
        if value is None or (key in FLAGS and as_array(value, key).ndim < 2):
            continue  # one flag an episode is spread by `cut`
        more = complete and key == "observations"
        flat[key] = _unpadded(key, value, np.arange(longest + more) < counts[:, None] + more)
    return cut(how, flat, offsets_of(counts))


def _unpadded(what: str, raw: Any, mask: np.ndarray) -> Any:
    def unpadded(part: Any) -> np.ndarray:
        array = as_array(part, what)
        if array.shape[:2] != mask.shape:
            raise InvalidDemonstrations(f"the {what} have shape {array.shape}: expected {mask.shape} to begin with, as padded.")
        return array[mask]

    return by_part(unpadded, raw)


def from_lists(how: Reading, columns: Mapping[str, Any]) -> list[Episode]:
    """Episodes of lists that hold an array for each episode.

    Raises:
        InvalidDemonstrations: rows that cannot be right.
    """
    noun, states_only = how.noun, columns["actions"] is None
    if states_only:
        seen = enumerate(columns["observations"])
        counts = np.array([batch_size(_part(how, "observations", one, number)) - 1 for number, one in seen])
    else:
        counts = np.array([len(one) if is_list(one) else 0 for one in columns["actions"]])
    if (counts <= 0).any():
        number = int(np.argmin(counts))
        expected = "at least two observations" if states_only else "at least one action"
        raise InvalidDemonstrations(f"{noun} {number} (from 0) has no steps: expected {expected}. Leave it out.")
    flat = dict(columns)
    for key, value in columns.items():
        if value is None or (key in FLAGS and depth(value) < 2):
            continue  # one flag an episode is spread by `cut`
        if not is_list(value) or len(value) != len(counts):
            shown = f"{len(value)} {key}" if is_list(value) else f"{key} in {type(value).__name__}"
            raise InvalidDemonstrations(
                f"there are {shown} for {len(counts)} {noun}s of actions: expected a list of {len(counts)} arrays."
            )
        parts = [_part(how, key, one, number) for number, one in enumerate(value)]
        (_check_observed if key == "observations" else _check_even)(key, parts, counts, noun)
        flat[key] = by_part(lambda *arrays: np.concatenate(arrays), *parts)
    return cut(how, flat, offsets_of(counts))


def _part(how: Reading, key: str, raw: Any, number: int) -> Any:
    """What a list holds for one episode."""
    what = key.removesuffix("s").replace("_", " ")

    def name(row: int) -> str:
        return f"{how.noun} {number}, step {row} (from 0)"

    return members(how.space, raw, what, name) if key.endswith("observations") else numbers(raw, what, name)


def _check_observed(key: str, parts: list[Any], counts: np.ndarray, noun: str) -> None:
    surplus = np.array([batch_size(one) for one in parts]) - counts
    wrong = np.flatnonzero((surplus != surplus[0]) | ((surplus != 0) & (surplus != 1)))
    if wrong.size:
        i = int(wrong[0])
        raise InvalidDemonstrations(
            f"{noun} {i} (from 0) has {batch_size(parts[i])} {key} and {counts[i]} actions: expected one observation more than "
            f"actions in every {noun}, or as many in every one."
        )


def _check_even(key: str, parts: list[Any], counts: np.ndarray, noun: str) -> None:
    shapes = [np.shape(first_part(one)) for one in parts]
    for i, shape in enumerate(shapes):
        if shape[:1] != (counts[i],):
            raise InvalidDemonstrations(f"{noun} {i} (from 0) has {key} of shape {shape}: expected ({counts[i]},).")
    if len({shape[1:] for shape in shapes}) > 1:
        raise InvalidDemonstrations(f"the {key} have several shapes: expected (T,) in each {noun}.")


def depth(value: Any) -> int:
    """0 for a number, 1 for an array of numbers, more for a list of arrays."""
    if not is_list(value):
        return 0
    return 2 if len(value) and is_list(next(iter(value))) else 1


def counts_of(lengths: Any) -> np.ndarray:
    """(N,) numbers of steps, int64.

    Raises:
        InvalidDemonstrations: one that is not a whole number of at least 1.
    """
    counts = whole_numbers(lengths, "length", lambda row: f"episode {row} (from 0)")
    if (counts < 1).any():
        wrong = int(np.argmax(counts < 1))
        raise InvalidDemonstrations(
            f"episode {wrong} (from 0) has {counts[wrong]} steps: expected at least 1. Leave empty episodes out."
        )
    return counts


def offsets_of(counts: np.ndarray) -> np.ndarray:
    """(N + 1,) the row at which each episode starts, and n."""
    return np.concatenate([[0], np.cumsum(counts)])


def offsets_at(ends: np.ndarray) -> np.ndarray:
    """(N + 1,) where episodes start that end in the rows that `ends` (n,) marks, and n."""
    n = len(ends)
    return np.unique(np.concatenate([[0], np.flatnonzero(ends) + 1, [n]])).astype(np.int64)
