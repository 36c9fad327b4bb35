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
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces

from irl_gym.demonstrations.choices import Last
from irl_gym.demonstrations.imports.cutting import FLAGS, offsets_at
from irl_gym.demonstrations.imports.files import read_frame
from irl_gym.demonstrations.imports.reading import reading
from irl_gym.demonstrations.imports.rows import LogColumns
from irl_gym.demonstrations.imports.values import NO_WORDS, Name, numbers, shown, truths, whole_numbers
from irl_gym.errors import InvalidDemonstrations, InvalidParameter
from irl_gym.mdp.episodes import Episode

_SIGNS = str.maketrans({sign: " " for sign in "()[]{},;"})
_WORDS = {"True": 1.0, "False": 0.0, "true": 1.0, "false": 0.0}


def from_frame(
    source: Any,
    *,
    episode: str | None = "episode",
    step: str | None = "step",
    observation: Any = "observation",
    action: str | None = "action",
    reward: str | None = "reward",
    terminated: str | None = "terminated",
    truncated: str | None = "truncated",
    next_observation: Any = None,
    last: Last = "keep",
    space: spaces.Space | None = None,
    n_actions: int | None = None,
    action_space: spaces.Space | None = None,
    env: gym.Env | None = None,
) -> list[Episode]:
    """Episodes from a table; the arguments say which column is what, and None that there is none.

    The columns of observations are a name, a list of names (the numbers of a vector, or the parts of a Tuple, each a name or a
    list), or a dictionary of these for a Dict space. A single column may hold lists, or text as "(13, 10, 0)" or "[1 2 3]".

        from_frame("log.csv", observation=["x", "y"], reward=None, terminated="done", env=env)

    Args:
        source: a DataFrame, or the path of a file that ends in .csv, .tsv, .parquet or .pq, with a header.
        episode: id of the episode; its rows may stand anywhere. None: a row that is terminated or truncated ends an episode.
        step: its rows are sorted by it; it goes up by 1 from any number. None: they are in order.
        observation: what was seen before the action.
        action: whole numbers; None: only the states are known, and the last row of an episode is its last observation.
        reward: 0.0 where there is none, or no column "reward": no learner reads them, and a report pays by the table.
        terminated: true in the last row of an episode that the environment ended. An episode without counts as truncated. Like
            reward and truncated it may be missing where it is not named.
        truncated: true in the last row of an episode that a time limit ended.
        next_observation: like `observation`: what was seen after the action.
        last: without `next_observation`, "keep" the last action of each episode, whose successor is then not known, "drop" it,
            "repeat" the last observation, or "row": each last row is an observation only; see
            `irl_gym.demonstrations.imports.rows`.
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
        NotInstalled: no pyarrow for a Parquet file.
        NotDiscrete: continuous actions.
    """
    how = reading(space, n_actions, action_space, env, last)
    roles = dict(episode=episode, step=step, action=action, reward=reward, terminated=terminated, truncated=truncated)
    table, offsets = _sorted(source, roles, observation, next_observation)
    others = {key: table.role(roles[key]) for key in FLAGS} | {"rewards": table.role(reward)}
    seen = table.gathered(how.space, observation, "observation")
    following = None if next_observation is None else table.gathered(how.space, next_observation, "next observation")
    return LogColumns(how, offsets, table.name, seen, table.role(action), next_observations=following, **others).episodes()


def _sorted(source: Any, roles: dict[str, str | None], observation: Any, next_observation: Any) -> tuple["_Table", np.ndarray]:
    """The columns that are named, sorted by episode and step, and (N + 1,) where each episode starts."""
    named = {key: value for key, value in roles.items() if value is not None}
    for key, value in named.items():
        if not isinstance(value, str):
            raise InvalidParameter(f"{key} is {value!r}: expected the name of a column.")
    wanted = named | _roles("observation", observation)
    if next_observation is not None:
        wanted |= _roles("next_observation", next_observation)
    path = Path(source) if isinstance(source, str | os.PathLike) else source
    optional = frozenset(one for one in ("reward", *FLAGS) if named.get(one) == one)
    frame, name = read_frame(path, wanted, optional)
    if not len(frame):
        raise InvalidDemonstrations("there are no rows: expected at least one step.")
    order, offsets = _order({key: frame[one].to_numpy() for key, one in named.items() if one in frame}, len(frame), name)
    columns = {one: frame[one].to_numpy()[order] for one in wanted.values() if one in frame}
    return _Table(columns, lambda row: name(int(order[row]))), offsets


def _roles(what: str, names: Any) -> dict[str, str]:
    """What each column of the observations is called in a message -> its name."""
    return {f"{what} {i}" if i else what: one for i, one in enumerate(_names(names))}


def _names(observation: Any) -> list[str]:
    """Every column that observations are read from."""
    if isinstance(observation, str):
        return [observation]
    if isinstance(observation, Mapping | Sequence) and len(observation):
        parts = observation.values() if isinstance(observation, Mapping) else observation
        return [name for part in parts for name in _names(part)]
    raise InvalidParameter(
        f"observation is {observation!r}: expected a column's name, a list of names or a dictionary of them."
    )


def _order(columns: dict[str, np.ndarray], n: int, name: Name) -> tuple[np.ndarray, np.ndarray]:
    """(n,) rows sorted by episode and step, and (N + 1,) where each episode starts among them."""
    if "episode" in columns:
        codes, _ = _factorized(columns["episode"], "episode", name)
    else:
        flags = [truths(columns[key], key, name) for key in FLAGS if key in columns]
        codes = np.cumsum(np.any(flags, axis=0)) - np.any(flags, axis=0) if flags else np.zeros(n, dtype=np.int64)
    steps = whole_numbers(columns["step"], "step", name) if "step" in columns else np.zeros(n, dtype=np.int64)
    order = np.lexsort((steps, codes))
    codes, steps = codes[order], steps[order]
    same = codes[1:] == codes[:-1]
    wrong = np.flatnonzero(same & (np.diff(steps) != 1)) if "step" in columns else []
    if len(wrong):
        at = int(wrong[0])
        again = f" again, as {name(int(order[at]))} has" if steps[at] == steps[at + 1] else ""
        mend = "Give each of two episodes an id of its own, or pass" if again else "Pass"
        raise InvalidDemonstrations(
            f"{name(int(order[at + 1]))} has step {steps[at + 1]}{again}: expected step {steps[at] + 1} after step {steps[at]} "
            f"of its episode. {mend} step=None if the rows are in order and the column is no counter."
        )
    return order, offsets_at(np.append(~same, True))


def _factorized(column: np.ndarray, what: str, name: Name) -> tuple[np.ndarray, Any]:
    """(n,) numbers of the different values of a column, in the order in which they appear, and these."""
    import pandas as pd

    try:
        codes, values = pd.factorize(column)
    except TypeError as error:
        raise InvalidDemonstrations(f"the column of {what}s holds lists ({error}): expected numbers or text.") from error
    if (codes < 0).any():
        raise InvalidDemonstrations(
            f"{name(int(np.argmax(codes < 0)))} has no {what}: expected one. Fill it in, or leave the row out."
        )
    return codes, values


@dataclass(frozen=True, eq=False)
class _Table:
    """The columns that are read, sorted."""

    columns: dict[str, np.ndarray]
    """(n,) by name."""
    name: Name
    """Says where a row stands in the source."""

    def role(self, column: str | None) -> np.ndarray | None:
        """(n,) a column; None where there is none."""
        return None if column is None else self.columns.get(column)

    def gathered(self, space: spaces.Space, names: Any, what: str) -> Any:
        """The columns of observations, in a layout that `members` takes."""
        if isinstance(names, Mapping):
            parts = space.spaces if isinstance(space, spaces.Dict) else {}
            if set(names) != set(parts):
                raise InvalidParameter(f"{what} names the columns of {sorted(names)}: expected those of {space}.")
            return {key: self.gathered(parts[key], one, f"{what}[{key!r}]") for key, one in names.items()}
        if isinstance(space, spaces.Dict):
            raise InvalidParameter(f"{what} is {names!r}: expected a dictionary with columns for each key of {space}.")
        if isinstance(names, str):
            return self._single(names, what)
        if isinstance(space, spaces.Tuple):
            if len(names) != len(space.spaces):
                raise InvalidParameter(
                    f"{what} names {len(names)} columns: expected {len(space.spaces)}, one for each part of {space}."
                )
            parts = zip(space.spaces, names, strict=True)
            return tuple(self.gathered(part, one, f"{what}[{i}]") for i, (part, one) in enumerate(parts))
        return np.stack([numbers(self.columns[one], f"{what} {one!r}", self.name) for one in names], axis=1)

    def _single(self, column: str, what: str) -> np.ndarray:
        """(n,) or (n, k) values of one column; texts of numbers are read, each different text once."""
        import pandas as pd

        values = self.columns[column]
        if pd.api.types.infer_dtype(values, skipna=True) != "string":
            return values
        codes, texts = _factorized(values, what, self.name)
        rows = []
        for i, text in enumerate(texts):
            try:
                rows.append([_WORDS[word] if word in _WORDS else float(word) for word in text.translate(_SIGNS).split()])
            except ValueError:
                rows.append([])
            if not rows[-1] or len(rows[-1]) != len(rows[0]):
                where = self.name(int(np.argmax(codes == i)))
                even = f"{len(rows[0])} numbers, as in {self.name(0)}."
                wanted = even if rows[-1] else f"numbers, such as '(13, 10, 0)'. {NO_WORDS}"
                raise InvalidDemonstrations(f"{where} has {what} {shown(text)}: expected {wanted}")
        return np.array(rows)[codes]
