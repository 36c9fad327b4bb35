"""Demonstrations of the package `imitation`, and of the D4RL collection, in the layouts that they keep them in."""

import os
from collections.abc import Container, Iterable, Mapping
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces

from irl_gym.demonstrations.choices import Last
from irl_gym.demonstrations.imports.arrays import episodes_of
from irl_gym.demonstrations.imports.cutting import from_lists
from irl_gym.demonstrations.imports.files import closest
from irl_gym.demonstrations.imports.reading import reading
from irl_gym.demonstrations.imports.values import as_array, is_list
from irl_gym.errors import DatasetMissing, InvalidDemonstrations, a_type
from irl_gym.files.hdf5_files import BROKEN, check_hdf5
from irl_gym.mdp.episodes import Episode


def from_imitation(
    trajectories: Iterable[Any],
    *,
    space: spaces.Space | None = None,
    n_actions: int | None = None,
    action_space: spaces.Space | None = None,
    env: gym.Env | None = None,
) -> list[Episode]:
    """Episodes from trajectories of `imitation`, or from anything laid out like them.

    Each is an object or a dictionary with `obs` (T + 1 observations), `acts` (T,), and where known `rews` (T,), `terminal` (one
    boolean) and `infos` (T dictionaries). There `terminal` is also true when a time limit ended the episode; then the last of
    `infos` says `TimeLimit.truncated`, and the episode counts as truncated. Without `terminal` it counts as truncated, too.

        from_imitation([{"obs": [0, 4, 8], "acts": [1, 1], "terminal": True}], env=env)

    Args:
        trajectories: at least one.
        space: of the observations.
        n_actions: A; the actions count from 0.
        action_space: Discrete; the actions count from its start.
        env: has both spaces.

    Raises:
        InvalidDemonstrations: rows that cannot be right; the first is named by trajectory and step, counted from 0.
        InvalidParameter: spaces that are missing.
        NotDiscrete: continuous actions.
    """
    how = reading(space, n_actions, action_space, env, noun="trajectory")
    every = [trajectories] if hasattr(trajectories, "acts") or isinstance(trajectories, Mapping) else trajectories
    if not isinstance(every, Iterable) or (isinstance(every, np.ndarray) and not every.ndim):
        raise InvalidDemonstrations(f"the trajectories are {type(every).__name__}: expected a list of them.")
    every = list(every)
    if not every:
        raise InvalidDemonstrations("there are no trajectories: expected at least one.")
    fields = [{key: _field(one, key, i) for key in ("obs", "acts", "rews", "terminal", "infos")} for i, one in enumerate(every)]
    rewards = [one["rews"] for one in fields]
    unpaid = [i for i, one in enumerate(rewards) if one is None]
    if 0 < len(unpaid) < len(rewards):
        raise InvalidDemonstrations(
            f"trajectory {unpaid[0]} (from 0) has no rews, but others have: expected them in all or in none. Drop the rewards."
        )
    stopped = np.array([_timed_out(one["infos"]) for one in fields])
    ended = np.array([_flag(one["terminal"], i) for i, one in enumerate(fields)])
    observations = [one["obs"] for one in fields]  # where they are dictionaries, imitation wraps them
    columns = {
        "observations": [one.unwrap() if hasattr(one, "unwrap") else one for one in observations],
        "actions": [one["acts"] for one in fields],
        "rewards": None if unpaid else rewards,
        "terminated": ended & ~stopped,
        "truncated": stopped,
    }
    return from_lists(how, columns)


def _field(trajectory: Any, key: str, number: int) -> Any:
    value = trajectory.get(key) if isinstance(trajectory, Mapping) else getattr(trajectory, key, None)
    if value is None and key in ("obs", "acts"):
        raise InvalidDemonstrations(
            f"trajectory {number} (from 0) is {a_type(trajectory)} without {key!r}: expected obs and acts, as "
            "attributes or keys."
        )
    return value


def _flag(value: Any, number: int) -> bool:
    if value is None:
        return False
    if not isinstance(value, bool | np.bool | int | np.ndarray) or as_array(value, "flags").ndim or value not in (True, False):
        raise InvalidDemonstrations(f"trajectory {number} (from 0) has terminal {value!r}: expected True or False.")
    return bool(value)


def _timed_out(infos: Any) -> bool:
    final = infos[-1] if is_list(infos) and len(infos) else None
    return isinstance(final, Mapping) and bool(final.get("TimeLimit.truncated", False))


def from_d4rl(
    source: Mapping[str, Any] | str | os.PathLike,
    *,
    last: Last = "keep",
    space: spaces.Space | None = None,
    n_actions: int | None = None,
    action_space: spaces.Space | None = None,
    env: gym.Env | None = None,
) -> list[Episode]:
    """Episodes from D4RL's flat arrays: `observations, actions, rewards, terminals, timeouts`, and maybe `next_observations`.

    A row in which `terminals` is true ends an episode by termination, one in which `timeouts` is true by truncation, and what
    follows the last of them is an unfinished episode. `timeouts` and `rewards` may be missing.

        from_d4rl({"observations": [0, 4, 0], "actions": [1, 1, 2], "terminals": [False, True, True]}, env=env)

    Args:
        source: a dictionary of arrays, or the path of an HDF5 file that holds them.
        last: what to do where there are no `next_observations`: "keep" the last action of each episode, whose successor is then
            not known, "drop" it, or "repeat" the last observation; see `irl_gym.demonstrations.imports.rows`.
        space: of the observations.
        n_actions: A; the actions count from 0.
        action_space: Discrete; the actions count from its start.
        env: has both spaces.

    Raises:
        DatasetMissing: no such file.
        InvalidDemonstrations: an array that is missing, a file that is not HDF5, rows that cannot be right.
        InvalidParameter: spaces that are missing.
        NotDiscrete: continuous actions.
    """
    how = reading(space, n_actions, action_space, env, last)  # before a large file is read
    if not isinstance(source, Mapping | str | os.PathLike):
        raise InvalidDemonstrations(f"the source is {a_type(source)}: expected a dictionary of arrays, or a path.")
    arrays = source if isinstance(source, Mapping) else _read_hdf5(Path(source))
    for key in ("observations", "actions", "terminals"):
        if key not in arrays:
            close = closest(key, map(str, arrays))
            mend = f"Rename {close!r}." if close else "Is it a D4RL dataset?"
            raise InvalidDemonstrations(f"there is no {key!r} among {sorted(map(str, arrays))}: expected D4RL's arrays. {mend}")
    columns = {key: arrays.get(key) for key in ("observations", "rewards", "next_observations")}
    columns |= {"actions": as_array(arrays["actions"], "actions")}
    columns |= {"terminated": arrays["terminals"], "truncated": arrays.get("timeouts")}
    return episodes_of(how, columns, {"ends": _either(arrays["terminals"], arrays.get("timeouts"))})


def _either(terminals: Any, timeouts: Any) -> np.ndarray:
    ended = as_array(terminals, "terminals").reshape(-1)
    stopped = ended if timeouts is None else as_array(timeouts, "timeouts").reshape(-1)
    if ended.shape != stopped.shape:
        raise InvalidDemonstrations(f"there are {len(ended)} terminals and {len(stopped)} timeouts: expected as many.")
    return (ended != 0) | (stopped != 0)


def _read_hdf5(path: Path) -> dict[str, Any]:
    import h5py

    if not path.is_file():
        raise DatasetMissing(f"{path} is not a file: expected an HDF5 file with D4RL's arrays.")
    try:
        check_hdf5(path)
        with h5py.File(path, "r") as file:
            return _read_group(file, ("observations", "next_observations"))
    except BROKEN as error:
        raise InvalidDemonstrations(f"{path} cannot be read ({error}): expected an HDF5 file with D4RL's arrays.") from error


def _read_group(group: Any, groups: Container[str]) -> dict[str, Any]:
    """Arrays by name, and of some groups: observations of a Dict space are one. Others are only about the collection."""
    named = {key: value for key, value in group.items() if key in groups or not hasattr(value, "items")}
    return {key: _read_group(one, one) if hasattr(one, "items") else one[()] for key, one in named.items()}
