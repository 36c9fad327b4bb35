"""Arrays of many episodes, in each of their layouts, as `Rows`. Axes: N episodes, T steps, n rows.

`columns` are what a log may have beside observations and actions: rewards, terminated, truncated, next_observations.
"""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from irl_gym.demonstrations import Episode
from irl_gym.errors import InvalidDemonstrations
from irl_gym.features import batch_size
from irl_gym.imports.expected import Expected
from irl_gym.imports.members import Name, as_array, is_list, members, numbers
from irl_gym.imports.rows import Last, Rows


def counts_of(lengths: Any) -> np.ndarray:
    """(N,) numbers of steps, int64.

    Raises:
        InvalidDemonstrations: one that is not a whole number of at least 1.
    """
    counts = numbers(lengths, "length", lambda row: f"episode {row} (from 0)")
    if counts.ndim != 1:
        raise InvalidDemonstrations(f"the lengths have shape {counts.shape}: expected (N,), one an episode.")
    wrong = np.flatnonzero(~((counts >= 1) & (counts < 2**53) & (counts == np.floor(counts))))
    if wrong.size:
        raise InvalidDemonstrations(
            f"episode {wrong[0]} (from 0) has {counts[wrong[0]].item()} steps: expected a whole number of at least 1. Leave "
            "empty episodes out."
        )
    return counts.astype(np.int64)


def cut(
    expected: Expected,
    observations: Any,
    actions: Any,
    columns: Mapping[str, Any],
    offsets: np.ndarray,
    last: Last,
    name: Name | None = None,
    noun: str = "episode",
) -> list[Episode]:
    """Episodes of one long array, cut at offsets (N + 1,).

    Args:
        expected: what is checked against.
        observations: n of them, or n + N.
        actions: (n,).
        columns: (n,) each; the flags may also be a boolean or (N,).
        offsets: row at which each episode starts, and n.
        last: the rule for a missing last observation.
        name: says where a row stands, if there are n observations; None for episode and step.
        noun: what a message calls an episode.

    Raises:
        InvalidDemonstrations: rows that cannot be right.
    """
    n, N = int(offsets[-1]), len(offsets) - 1
    flags = ("terminated", "truncated")
    columns = {key: _rowwise(key, value, offsets) if key in flags else value for key, value in columns.items()}
    part = first_part(observations)
    complete = columns.get("next_observations") is None and is_list(part) and len(part) == n + N
    if not complete:
        return Rows(expected, observations, actions, offsets, name or steps_of(offsets, noun), last=last, **columns).episodes()
    inner = {"actions": actions, **columns}
    for key, value in inner.items():
        array = None if value is None else as_array(value, key)
        if array is not None and array.shape[:1] != (n,):
            raise InvalidDemonstrations(f"the {key} have shape {array.shape}: expected ({n},), one a step.")
        inner[key] = None if array is None else np.insert(array, offsets[1:], 0, axis=0)
    offsets = offsets + np.arange(N + 1)
    return Rows(expected, observations, offsets=offsets, name=steps_of(offsets, noun), last="row", **inner).episodes()


def steps_of(offsets: np.ndarray, noun: str = "episode") -> Callable[[int], str]:
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


def from_padded(
    expected: Expected, observations: Any, actions: np.ndarray, columns: Mapping[str, Any], counts: np.ndarray, last: Last
) -> list[Episode]:
    """Episodes of arrays (N, T, ...), of which the first `counts` steps are read.

    Raises:
        InvalidDemonstrations: rows that cannot be right.
    """
    longest = actions.shape[1]
    if (counts > longest).any():
        wrong = int(np.argmax(counts > longest))
        raise InvalidDemonstrations(
            f"episode {wrong} (from 0) has {counts[wrong]} steps: expected at most {longest}, as padded."
        )
    reading = np.arange(longest) < counts[:, None]
    offsets = np.concatenate([[0], np.cumsum(counts)])
    complete = as_array(first_part(observations), "observations").shape[1:2] == (longest + 1,)
    seen = _unpadded("observations", observations, np.arange(longest + 1) < counts[:, None] + 1 if complete else reading)
    flat = dict(columns)
    for key, value in flat.items():
        if value is not None and (key not in ("terminated", "truncated") or as_array(value, key).ndim > 1):
            flat[key] = _unpadded(key, value, reading)
    return cut(expected, seen, actions[reading], flat, offsets, last)


def _unpadded(what: str, raw: Any, mask: np.ndarray) -> Any:
    if isinstance(raw, Mapping):
        return {key: _unpadded(what, part, mask) for key, part in raw.items()}
    if isinstance(raw, tuple):
        return tuple(_unpadded(what, part, mask) for part in raw)
    array = as_array(raw, what)
    if array.shape[:2] != mask.shape:
        raise InvalidDemonstrations(f"the {what} have shape {array.shape}: expected {mask.shape} to begin with, as padded.")
    return array[mask]


def from_lists(
    expected: Expected, observations: Any, actions: Any, columns: Mapping[str, Any], last: Last, noun: str = "episode"
) -> list[Episode]:
    """Episodes of lists that hold an array for each episode.

    Raises:
        InvalidDemonstrations: rows that cannot be right.
    """
    counts = np.array([len(one) if is_list(one) else 0 for one in actions])
    if (counts == 0).any():
        number = int(np.argmin(counts))
        raise InvalidDemonstrations(f"{noun} {number} (from 0) has no steps: expected at least one action. Leave it out.")
    flat: dict[str, Any] = {"actions": actions, **columns}
    for key, value in flat.items():
        if value is None or (key in ("terminated", "truncated") and depth(value) < 2):
            continue  # one flag an episode is spread by `cut`
        _check_count(key, value, len(counts), noun)
        if key == "next_observations":
            flat[key] = _joined([_batch(expected, one, "next observation", i, noun) for i, one in enumerate(value)])
            continue
        parts = [numbers(one, key.removesuffix("s"), _steps_at(i, noun)) for i, one in enumerate(value)]
        for i, part in enumerate(parts):
            if part.shape[:1] != (counts[i],):
                raise InvalidDemonstrations(f"{noun} {i} (from 0) has {key} of shape {part.shape}: expected ({counts[i]},).")
        if len({part.shape[1:] for part in parts}) > 1:
            raise InvalidDemonstrations(f"the {key} have several shapes: expected (T,) in each {noun}.")
        flat[key] = np.concatenate(parts)
    _check_count("observations", observations, len(counts), noun)
    batches = [_batch(expected, one, "observation", i, noun) for i, one in enumerate(observations)]
    surplus = np.array([batch_size(one) for one in batches]) - counts
    wrong = np.flatnonzero((surplus != surplus[0]) | ((surplus != 0) & (surplus != 1)))
    if wrong.size:
        i = int(wrong[0])
        raise InvalidDemonstrations(
            f"{noun} {i} (from 0) has {batch_size(batches[i])} observations and {counts[i]} actions: expected one observation "
            f"more than actions in every {noun}, or as many in every one."
        )
    offsets = np.concatenate([[0], np.cumsum(counts)])
    return cut(expected, _joined(batches), flat.pop("actions"), flat, offsets, last, noun=noun)


def first_part(batch: Any) -> Any:
    """An array of a batch that may be a tuple or dictionary of them."""
    while isinstance(batch, Mapping | tuple) and len(batch):
        batch = next(iter(batch.values())) if isinstance(batch, Mapping) else batch[0]
    return batch


def depth(value: Any) -> int:
    """0 for a number, 1 for an array of numbers, more for a list of arrays."""
    if not is_list(value):
        return 0
    return 2 if len(value) and is_list(next(iter(value))) else 1


def _check_count(key: str, value: Any, wanted: int, noun: str) -> None:
    if not is_list(value) or len(value) != wanted:
        shown = f"{len(value)} {key}" if is_list(value) else f"{key} in {type(value).__name__}"
        raise InvalidDemonstrations(f"there are {shown} for {wanted} {noun}s of actions: expected a list of {wanted} arrays.")


def _steps_at(number: int, noun: str) -> Name:
    return lambda row: f"{noun} {number}, step {row} (from 0)"


def _batch(expected: Expected, raw: Any, what: str, number: int, noun: str) -> Any:
    return members(expected.space, raw, what, _steps_at(number, noun))


def _joined(batches: list[Any]) -> Any:
    first = batches[0]
    if isinstance(first, dict):
        return {key: _joined([one[key] for one in batches]) for key in first}
    if isinstance(first, tuple):
        return tuple(_joined([one[i] for one in batches]) for i in range(len(first)))
    return np.concatenate(batches)
