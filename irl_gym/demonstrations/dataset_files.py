"""The files of a Minari dataset from anybody, looked through before Minari opens them.

    data/metadata.json                           what it is of: its spaces, ids, counts
    data/main_data.hdf5                          its episodes, or
    data/N/part-0.arrow, data/N/metadata.json    a folder an episode

Minari believes them: counts become arrays, links are followed, and where a space is missing it makes whatever environment the
file names.
"""

import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from gymnasium import spaces
from minari.dataset.minari_dataset import parse_dataset_id

from irl_gym.demonstrations.minari_formats import known_actions, mask
from irl_gym.errors import DamagedFile
from irl_gym.files.arrow_files import check_arrow, check_parquet
from irl_gym.files.hdf5_files import check_hdf5, read_attributes
from irl_gym.spaces.space_json import told_space

HDF5 = "main_data.hdf5"
MOST_TOLD = 64 << 20
"""Bytes of a metadata.json, which may list the bounds of large observations."""
_TEXTS = ("dataset_id", "data_format", "minari_version")


def check_told(folder: Path) -> None:
    """Check what a dataset says of itself.

    Args:
        folder: `data` in the dataset's.

    Raises:
        OSError: a file that is not there, or cannot be opened.
        DamagedFile: one that says what no dataset does, or leads out of the folder.
        ValueError, TypeError: Minari's, of a malformed id.
    """
    inside(folder, folder / "metadata.json")
    told = read_told(folder / "metadata.json")
    for name in _TEXTS:
        if not isinstance(told.get(name), str):
            raise DamagedFile(f"its metadata have the {name} {told.get(name)!r:.80}, which is no text")
    parse_dataset_id(told["dataset_id"])
    for name in ("observation_space", "action_space"):
        if name not in told:
            raise DamagedFile(
                f"there is no {name} in its metadata.json, and no environment that a file names is made to see it: add it, as "
                "minari.serialization.serialize_space writes it"
            )
        told_space(name, told.get(name))
    for name in ("env_spec", "eval_env_spec"):
        _check_spec(name, told.get(name))
    for name in ("author", "author_email", "combined_datasets", "requirements"):
        if not isinstance(told.get(name, []), list) or not all(isinstance(one, str) for one in told.get(name, [])):
            raise DamagedFile(f"its metadata have the {name} {told[name]!r:.80}, which is no list of texts")
    for name in ("total_episodes", "total_steps"):
        if type(told.get(name)) is not int or not 0 <= told[name] <= 1 << 48:
            raise DamagedFile(f"its metadata have the {name} {told.get(name)!r:.80}, which is no count")
    if told["data_format"] not in ("hdf5", "arrow", "parquet"):
        raise DamagedFile(f"its data_format is {told['data_format'][:80]!r}, and none of hdf5, arrow and parquet")
    held = os.path.getsize(folder / HDF5) if told["data_format"] == "hdf5" else sum(1 for _ in os.scandir(folder))
    if told["total_episodes"] > held:
        raise DamagedFile(f"its metadata tell of {told['total_episodes']} episodes, for which it has no room")


def check_episodes(folder: Path, data_format: str, numbers: Iterator[int]) -> None:
    """Check the episodes of a dataset; as `check_told`.

    Args:
        folder: `data` in the dataset's.
        data_format: hdf5, arrow or parquet.
        numbers: of the episodes.
    """
    if data_format == "hdf5":
        inside(folder, folder / HDF5)
        check_hdf5(folder / HDF5)
        with h5py.File(folder / HDF5, "r") as file:
            for number in numbers:
                seed = read_attributes(file, f"episode_{number}").get("seed", np.int64(0))  # Minari makes 1 of 1.5
                if not isinstance(seed, np.integer | np.floating) or not 0 <= seed < np.inf or int(seed) != seed:
                    raise _no_seed(f"episode {number}", seed)
        return
    for number in numbers:
        inside(folder, folder / str(number), of_files=False)
        for one in sorted((folder / str(number)).iterdir()):
            inside(folder, one)
            if one.name != "metadata.json" and not one.name.startswith(("_", ".")):
                (check_parquet if data_format == "parquet" else check_arrow)(one)


def check_episode(episode: Any, metadata: dict[str, Any], observations: spaces.Space, actions: Any) -> None:
    """Check that what Minari gives of an episode is of the dataset's own spaces; whether it fits together, the reader says.

    Raises:
        DamagedFile: naming the episode, and the first thing that is not.
    """
    here, taken = f"episode {episode.id}", np.asarray(episode.actions)
    if taken.dtype.kind not in "iu" or taken.ndim != 1:
        raise DamagedFile(f"{here} has actions of shape {taken.shape} and dtype {taken.dtype}, and no whole numbers (T,)")
    wrong = np.flatnonzero((taken < int(actions.start)) | (taken > int(actions.start) + int(actions.n) - 1))
    if wrong.size and known_actions(taken, int(actions.start)) is not None:
        some = ": it is masked, and others are not" if taken[wrong[0]] == mask(int(actions.start)) else ""
        raise DamagedFile(f"{here}, step {wrong[0]} has action {taken[wrong[0]]}, which is not of {actions}{some}")
    for name in ("rewards", "terminations", "truncations"):
        one = np.asarray(getattr(episode, name))
        if one.dtype.kind not in "biuf" or one.ndim != 1:
            raise DamagedFile(f"{here} has {name} of shape {one.shape} and dtype {one.dtype}, and no numbers (T,)")
    seed = metadata.get("seed")
    if seed is not None and (type(seed) is not int or seed < 0):
        raise _no_seed(here, seed)
    _check_observed(here, episode.observations, observations)


def _no_seed(here: str, seed: Any) -> DamagedFile:
    return DamagedFile(f"{here} has the seed {seed!s:.80}, and no whole number of at least 0")


def _check_observed(here: str, found: Any, space: Any) -> None:
    """Check observations part by part: of the space's shape, numbers where it has numbers, and none that is NaN."""
    if isinstance(space, spaces.Dict | spaces.Tuple):
        parts: Any = space.spaces
        keys = list(space.spaces) if isinstance(space, spaces.Dict) else range(len(space.spaces))
        if len(found) != len(keys):
            raise DamagedFile(f"{here} has observations of {len(found)} parts: expected {len(keys)}, as {space} has")
        for key in keys:
            _check_observed(here, found[key], parts[key])
        return
    array, text = np.asarray(found), isinstance(space, spaces.Text)
    kinds = "UO" if text else "biuf" if np.dtype(space.dtype).kind == "f" else "biu"
    if array.dtype.kind not in kinds or (not text and array.shape[1:] != (space.shape or ())) or not array.ndim:
        raise DamagedFile(f"{here} has observations of shape {array.shape} and dtype {array.dtype}, which are not of {space}")
    if array.dtype.kind == "f" and np.isnan(array).any():
        raise DamagedFile(f"{here} has an observation that is NaN at step {np.argwhere(np.isnan(array))[0][0]}")


def inside(folder: Path, path: Path, *, of_files: bool = True) -> None:
    """Check that a file is a regular one, or a folder one of `of_files=False`, and in a folder, wherever links lead.

    Raises:
        DamagedFile: it leads out of it, or is something else.
    """
    if path.is_symlink() and not path.resolve().is_relative_to(folder.resolve()):
        raise DamagedFile(f"{path.name} leads out of the dataset's folder, where nothing is read")
    if path.exists() and not (path.is_file() if of_files else path.is_dir()):
        raise DamagedFile(f"{path.name} is no regular {'file' if of_files else 'folder'}")


def read_told(path: Path) -> dict[str, Any]:
    """A json object of a dataset.

    Raises:
        OSError: it cannot be opened.
        DamagedFile: it is something else, or larger than any.
    """
    if path.stat().st_size > MOST_TOLD:
        raise DamagedFile(f"{path.name} has {path.stat().st_size:,} bytes, more than {MOST_TOLD:,}")
    try:
        told = json.loads(path.read_text(encoding="utf-8"))
    except (ValueError, RecursionError) as error:
        raise DamagedFile(f"{path.name} is no json: {str(error)[:200]}") from error
    if not isinstance(told, dict):
        raise DamagedFile(f"{path.name} holds {told!r:.80}, and no object")
    return told


def _check_spec(name: str, told: Any) -> None:
    """Check that a spec is a text of an object; what it names is not looked at here."""
    if told is None:
        return
    try:
        spec = json.loads(told) if isinstance(told, str) else None
    except (ValueError, RecursionError) as error:
        raise DamagedFile(f"its {name} is no json: {str(error)[:200]}") from error
    if not isinstance(spec, dict) or not isinstance(spec.get("id"), str):
        raise DamagedFile(f"its {name} is {told!r:.80}, and no spec of an environment")
    if not isinstance(spec.get("kwargs", {}), dict):
        raise DamagedFile(
            f"its {name} has the arguments {spec['kwargs']!a:.80}: expected names and values; or take {name} out of its "
            "metadata.json"
        )
