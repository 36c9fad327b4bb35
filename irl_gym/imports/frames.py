"""Demonstrations from tables: a pandas DataFrame, a CSV file or a Parquet file with a row for each step.

    episode,step,observation,action,reward,terminated
    0,0,0,1,0.0,False
    0,1,4,1,0.0,False
    0,2,8,2,1.0,True
    1,0,0,2,0.0,False

Nothing is done row by row in Python, so a million rows take seconds. Axes: n rows, N episodes.
"""

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces

from irl_gym.demonstrations import Episode
from irl_gym.errors import InvalidDemonstrations, InvalidParameter
from irl_gym.imports.expected import expect
from irl_gym.imports.files import read_frame
from irl_gym.imports.members import Name, numbers
from irl_gym.imports.rows import Last, Rows, check_last, truths

_SIGNS = str.maketrans({sign: " " for sign in "()[]{},;"})
_WORDS = {"True": 1.0, "False": 0.0, "true": 1.0, "false": 0.0}


def from_frame(
    source: Any,
    *,
    episode: str | None = "episode",
    step: str | None = "step",
    observation: Any = "observation",
    action: str = "action",
    reward: str | None = "reward",
    terminated: str | None = "terminated",
    truncated: str | None = "truncated",
    next_observation: Any = None,
    last: Last = "drop",
    space: spaces.Space | None = None,
    n_actions: int | None = None,
    action_space: spaces.Space | None = None,
    env: gym.Env | None = None,
) -> list[Episode]:
    """Episodes from a table; the arguments say which column is what, and None that there is none.

    The columns of observations are a name, a list of names (the numbers of a vector, or the parts of a Tuple, each a name or a
    list), or a dictionary of these for a Dict space. A single column may hold lists, or text such as
    "(13, 10, 0)" or "[1 2 3]".

        from_frame("log.csv", observation=["x", "y"], reward=None, terminated="done", env=env)

    Args:
        source: a DataFrame, or the path of a file that ends in .csv, .tsv, .parquet or .pq, with a header.
        episode: id of the episode; its rows may stand anywhere. None: a row that is terminated or truncated ends an episode.
        step: its rows are sorted by it; it goes up by 1 from any number. None: they are in order.
        observation: what was seen before the action.
        action: whole numbers.
        reward: 0.0 where there is none, or no column "reward": no learner reads them; a report pays such an expert by the
            table.
        terminated: true in the last row of an episode that the environment ended. An episode without counts as truncated. Like
            reward and truncated it may be missing where it is not named.
        truncated: true in the last row of an episode that a time limit ended.
        next_observation: like `observation`: what was seen after the action.
        last: what to do without `next_observation`: "drop" the last action of each episode, "repeat" its last observation, or
            "row", the last row of each is an observation only, and its action is left empty; see `irl_gym.imports.rows`.
        space: of the observations.
        n_actions: A; the actions count from 0.
        action_space: Discrete; the actions count from its start.
        env: has both spaces.

    Returns:
        In the order in which the episodes first appear.

    Raises:
        InvalidDemonstrations: a column that is missing, or a row that cannot be right; the first is named, counted from 1
            without the header, with its line in a CSV file.
        DatasetMissing: no such file.
        InvalidParameter: spaces that are missing, or another kind of source.
        NotInstalled: no pandas, or no pyarrow for a Parquet file.
        NotDiscrete: continuous actions.
    """
    check_last(last)
    expected = expect(space, n_actions, action_space, env)
    roles = {"episode": episode, "step": step, "action": action, "reward": reward}
    roles |= {"terminated": terminated, "truncated": truncated}
    named = {key: value for key, value in roles.items() if value is not None}
    for key, value in {"action": action, **named}.items():
        if not isinstance(value, str):
            raise InvalidParameter(f"{key} is {value!r}: expected the name of a column.")
    seen = {f"observation {i}" if i else "observation": one for i, one in enumerate(_names(observation))}
    after = {
        f"next_observation {i}" if i else "next_observation": one
        for i, one in enumerate(_names(next_observation) if next_observation else [])
    }
    path = Path(source) if isinstance(source, str | os.PathLike) else source
    optional = frozenset(one for one in ("reward", "terminated", "truncated") if named.get(one) == one)
    frame, name = read_frame(path, {**named, **seen, **after}, optional)
    if not len(frame):
        raise InvalidDemonstrations("there are no rows: expected at least one step.")
    columns = {key: frame[value].to_numpy() for key, value in named.items() if key not in optional or value in frame.columns}
    order, offsets = _order(columns, len(frame), name)

    def sorted_name(row: int) -> str:
        return name(int(order[row]))

    values = {key: value[order] for key, value in columns.items()}

    def gathered(names: Any, what: str) -> Any:
        return _gathered(frame, order, expected.space, names, what, sorted_name)

    return Rows(
        expected, gathered(observation, "observation"), values["action"], offsets, sorted_name, rewards=values.get("reward"),
        terminated=values.get("terminated"), truncated=values.get("truncated"),
        next_observations=None if next_observation is None else gathered(next_observation, "next observation"), last=last,
    ).episodes()  # fmt: skip


def _names(observation: Any) -> list[str]:
    """Every column that observations are read from."""
    if isinstance(observation, str):
        return [observation]
    if isinstance(observation, Mapping):
        return [name for part in observation.values() for name in _names(part)]
    if isinstance(observation, Sequence) and len(observation):
        return [name for part in observation for name in _names(part)]
    raise InvalidParameter(
        f"observation is {observation!r}: expected a column's name, a list of names or a dictionary of them."
    )


def _order(columns: dict[str, np.ndarray], n: int, name: Name) -> tuple[np.ndarray, np.ndarray]:
    """(n,) rows sorted by episode and step, and (N + 1,) where each episode starts among them."""
    import pandas as pd

    if "episode" in columns:
        try:
            codes, _ = pd.factorize(columns["episode"])
        except TypeError as error:
            raise InvalidDemonstrations(f"the column of episodes holds lists ({error}): expected numbers or names.") from error
        if (codes < 0).any():
            raise InvalidDemonstrations(f"{name(int(np.argmax(codes < 0)))} has no episode: expected an id. Is the row empty?")
    else:
        flags = [truths(columns[key], key, name) for key in ("terminated", "truncated") if key in columns]
        ended = np.any(flags, axis=0) if flags else np.zeros(n, dtype=bool)
        codes = np.concatenate([[0], np.cumsum(ended)[:-1]])
    steps = None
    order = np.argsort(codes, kind="stable")
    if "step" in columns:
        steps = numbers(columns["step"], "step", name)
        if steps.ndim > 1:
            raise InvalidDemonstrations("the column of steps holds lists: expected whole numbers.")
        wrong = np.flatnonzero(~((steps > -(2**53)) & (steps < 2**53) & (steps == np.floor(steps))))
        if wrong.size:
            raise InvalidDemonstrations(
                f"{name(int(wrong[0]))} has step {steps[wrong[0]].item()}: expected a whole number between -2^53 and 2^53."
            )
        order = np.lexsort((steps, codes))
    codes = codes[order]
    same = codes[1:] == codes[:-1]
    if steps is not None:
        steps = steps[order].astype(np.int64)
        wrong = np.flatnonzero(same & (np.diff(steps) != 1))
        if wrong.size:
            at = int(wrong[0])
            before, here = int(order[at]), int(order[at + 1])
            what = (
                f"step {steps[at + 1]} again, as {name(before)} has" if steps[at] == steps[at + 1] else f"step {steps[at + 1]}"
            )
            raise InvalidDemonstrations(
                f"{name(here)} has {what}: expected step {steps[at] + 1} after step {steps[at]} of its episode. Pass step=None "
                "if the rows are in order and the column is no counter."
            )
    return order, np.concatenate([[0], np.flatnonzero(~same) + 1, [n]]).astype(np.int64)


def _gathered(frame: Any, order: np.ndarray, space: spaces.Space, names: Any, what: str, name: Name) -> Any:
    """The columns of observations, in a layout that `members` takes."""
    if isinstance(names, Mapping):
        parts = space.spaces if isinstance(space, spaces.Dict) else {}
        if set(names) != set(parts):
            raise InvalidParameter(f"{what} names the columns of {sorted(names)}: expected those of {space}.")
        return {key: _gathered(frame, order, parts[key], one, f"{what}[{key!r}]", name) for key, one in names.items()}
    if isinstance(space, spaces.Dict):
        raise InvalidParameter(f"{what} is {names!r}: expected a dictionary with columns for each key of {space}.")
    if not isinstance(names, str) and isinstance(space, spaces.Tuple):
        if len(names) != len(space.spaces):
            raise InvalidParameter(
                f"{what} names {len(names)} columns: expected {len(space.spaces)}, one for each part of {space}."
            )
        parts = zip(space.spaces, names, strict=True)
        return tuple(_gathered(frame, order, part, one, f"{what}[{i}]", name) for i, (part, one) in enumerate(parts))
    if isinstance(names, str):
        column = frame[names].to_numpy()[order]
        texts = column.dtype.kind in "OUT" and isinstance(column[0], str)
        return _parsed(column, what, name) if texts else column
    return np.stack([numbers(frame[one].to_numpy()[order], f"{what} {one!r}", name) for one in names], axis=1)


def _parsed(column: np.ndarray, what: str, name: Name) -> np.ndarray:
    """(n, k) numbers out of texts; each different text is read once."""
    import pandas as pd

    codes, texts = pd.factorize(column)
    if (codes < 0).any():
        raise InvalidDemonstrations(f"{name(int(np.argmax(codes < 0)))} has no {what}: expected one. Is the row empty?")
    rows = []
    for i, text in enumerate(texts):
        try:
            rows.append([_WORDS[word] if word in _WORDS else float(word) for word in text.translate(_SIGNS).split()])
        except (ValueError, AttributeError) as error:
            row = int(np.argmax(codes == i))
            raise InvalidDemonstrations(f"{name(row)} has {what} {text!r}: expected numbers, such as '(13, 10, 0)'.") from error
        if len(rows[-1]) != len(rows[0]):
            row = int(np.argmax(codes == i))
            raise InvalidDemonstrations(f"{name(row)} has {what} {text!r}: expected {len(rows[0])} numbers, as in {name(0)}.")
    return np.array(rows)[codes]
