"""Demonstrations as Minari datasets: written so that plain Minari opens them, read from any with discrete actions.

Minari keeps datasets under a root folder, `MINARI_DATASETS_PATH` or its own default. A dataset is written under a hidden
folder of the root and renamed, so a broken one never carries an id; an id that is taken is refused, never overwritten.
"""

import contextlib
import hashlib
import json
import os
from collections.abc import Iterable, Iterator
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import gymnasium as gym
import minari
from gymnasium import spaces
from minari.storage.datasets_root_dir import get_dataset_path

from irl_gym.demonstrations.choices import AfterEnd
from irl_gym.demonstrations.dataset_files import check_told
from irl_gym.demonstrations.endings import checked_after_end
from irl_gym.demonstrations.minari_episodes import MinariEpisodes, broken
from irl_gym.demonstrations.minari_files import Description, check_free, check_id, identity, publish, told, write_files
from irl_gym.demonstrations.minari_formats import DataFormat
from irl_gym.errors import (
    DatasetMismatch,
    DatasetMissing,
    InvalidDemonstrations,
    InvalidParameter,
    NotDiscrete,
)
from irl_gym.files.hdf5_files import BROKEN
from irl_gym.files.own_files import digest, scratch
from irl_gym.mdp.episodes import Episode
from irl_gym.spaces.states import States

_ROOT = "MINARI_DATASETS_PATH"


@contextlib.contextmanager
def minari_root(root: str | os.PathLike | None) -> Iterator[Path]:
    """Let Minari look under another root for a while; None leaves it as it is."""
    before = os.environ.get(_ROOT)
    if root is not None:
        os.environ[_ROOT] = str(Path(root).absolute())
    try:
        yield get_dataset_path()
    finally:
        if before is None:
            os.environ.pop(_ROOT, None)
        else:
            os.environ[_ROOT] = before


def write_minari(
    episodes: Iterable[Episode],
    dataset_id: str,
    env: gym.Env | None,
    *,
    root: str | os.PathLike | None = None,
    algorithm: str,
    author: str = "irl_gym",
    author_email: str = "none given",
    description: str = "Demonstrations recorded with irl_gym.",
    code_permalink: str | None = None,
    random_return: float | None = None,
    expert_return: float | None = None,
    observation_space: spaces.Space | None = None,
    action_space: spaces.Space | None = None,
    data_format: DataFormat = "hdf5",
) -> minari.MinariDataset:
    """Write episodes as a Minari dataset, one at a time: a generator of a million is never held in memory.

    Args:
        episodes: at least one; they may come from a generator.
        dataset_id: `namespace/name-v0`, as Minari has it.
        env: where they were recorded; its spec is kept, so that `recover_environment()` works. None when it is not known: then
            give both spaces.
        root: Minari's root folder; None for the one in force.
        algorithm: what acted.
        author: who made it.
        author_email: how to reach them.
        description: a sentence.
        code_permalink: where the code is that recorded them.
        random_return: mean return of a random policy (Minari's `ref_min_score`).
        expert_return: mean return of the expert (`ref_max_score`).
        observation_space: of the episodes; None for the environment's.
        action_space: of the episodes; None for the environment's.
        data_format: hdf5, or arrow, which needs the extra `data` and is a folder an episode.

    Raises:
        InvalidParameter: a malformed id, a space missing or one that Minari cannot keep, a spec that is not json, a root that
            cannot be written, or a format that is not installed.
        DatasetExists: the id is taken.
        InvalidDemonstrations: no episode.
    """
    metadata: dict[str, Any] = {
        "algorithm_name": algorithm, "author": {author}, "author_email": {author_email}, "description": description,
        "code_permalink": code_permalink, "ref_min_score": random_return, "ref_max_score": expert_return,
    }  # fmt: skip
    about = described(dataset_id, env, observation_space, action_space, data_format, metadata)
    with writable_root(root) as base:
        check_free(base, dataset_id)
        with scratch(base) as beside:
            write_files(beside, about, episodes)
            publish(beside, base, dataset_id)
        return minari.load_dataset(dataset_id)


def described(
    dataset_id: str,
    env: gym.Env | None,
    observation_space: spaces.Space | None,
    action_space: spaces.Space | None,
    data_format: DataFormat,
    metadata: dict[str, Any],
) -> Description:
    """What a dataset says of itself; arguments as `write_minari`, and metadata of which None is left out.

    Raises:
        InvalidParameter: as `write_minari`.
    """
    if env is not None:
        observation_space = env.observation_space if observation_space is None else observation_space
        action_space = env.action_space if action_space is None else action_space
    if observation_space is None or action_space is None:
        missing = "observation_space" if observation_space is None else "action_space"
        raise InvalidParameter(f"env and {missing} are None: expected an environment, or both its spaces. Give {missing}.")
    known = {name: value for name, value in metadata.items() if value is not None}
    return Description(dataset_id, observation_space, action_space, None if env is None else env.spec, data_format, known)


@contextlib.contextmanager
def writable_root(root: str | os.PathLike | None) -> Iterator[Path]:
    """As `minari_root`, of a folder that can be written.

    Raises:
        InvalidParameter: it cannot.
    """
    with contextlib.ExitStack() as stack:
        try:
            base = stack.enter_context(minari_root(root))
            writable = os.access(base, os.W_OK | os.X_OK)
        except OSError as error:
            raise InvalidParameter(f"root is {root}: expected a folder, or a place for one ({error}). Name another.") from error
        if not writable:
            raise InvalidParameter(f"root is {base}, which cannot be written: expected a folder of yours. Name another.")
        yield base


def load_minari(dataset_id: str, *, root: str | os.PathLike | None = None) -> minari.MinariDataset:
    """Open a Minari dataset by its id.

    Raises:
        InvalidParameter: a malformed id.
        DatasetMissing: no dataset of that id under the root; those that are there are named.
        InvalidDemonstrations: a dataset that Minari cannot read.
    """
    if root is not None and not (isinstance(root, str | os.PathLike) and Path(root).is_dir()):
        raise DatasetMissing(f"{root} is no folder: expected Minari's root, under which {dataset_id!r} is. Name another.")
    with minari_root(root) as base:
        check_id(dataset_id)
        if not (base / dataset_id).exists():
            found = _ids(base)
            close = get_close_matches(dataset_id, found, 5)
            near = (
                f"Name one of these: {', '.join(close or found[:5])}; or the root" if found else "There is none: name the root"
            )
            raise DatasetMissing(
                f"dataset {dataset_id!r} is not under {base}: expected one of the datasets there. {near} folder that it "
                "is under, or set MINARI_DATASETS_PATH to that."
            )
        try:
            check_told(base / dataset_id / "data")
            return minari.load_dataset(dataset_id)
        except BROKEN as error:
            raise broken(dataset_id, error) from error


def digest_of(dataset: minari.MinariDataset) -> str:
    """The sha256 of all files of a dataset together, by their names, in hexadecimal digits."""
    folder = Path(dataset.storage.data_path)
    there = (one for one in folder.rglob("*") if one.is_symlink() or one.is_file())
    told = {one.relative_to(folder).as_posix(): os.readlink(one) if one.is_symlink() else digest(one) for one in there}
    return hashlib.sha256(json.dumps(told, sort_keys=True).encode()).hexdigest()


def _ids(base: Path) -> list[str]:
    """The ids of the datasets under a root. Minari's own listing stumbles over a folder whose name is no id."""
    found = []
    for place, folders, _ in os.walk(base):
        if "data" in folders and Path(place) != base:
            folders.clear()
            with contextlib.suppress(InvalidParameter):
                found.append(check_id(Path(place).relative_to(base).as_posix()))
        folders[:] = [one for one in folders if not one.startswith(".")]
    return sorted(found)


def read_minari(
    dataset: minari.MinariDataset | str,
    *,
    states: States | None = None,
    env: gym.Env | None = None,
    root: str | os.PathLike | None = None,
    after_end: AfterEnd = "refuse",
) -> MinariEpisodes:
    """The episodes of a Minari dataset with discrete actions: a sequence that reads one at a time, whenever it is asked for.

    Args:
        dataset: a dataset, or the id of one under `root`.
        states: refuse a dataset whose observations are not this index's.
        env: refuse a dataset recorded in another environment, by id and arguments. Where the dataset does not say where it was
            recorded, or in one that is not registered here, its spaces are compared.
        root: Minari's root folder; None for the one in force.
        after_end: what to do with an episode that goes on after a step that is terminated or truncated, or has not as many
            flags, rewards or observations as steps: "refuse" it, or "cut" it there; see `irl_gym.demonstrations.endings`.

    Raises:
        FileNotFoundError: no dataset of that id.
        NotDiscrete: continuous actions.
        DatasetMismatch: recorded in another environment, or one with other observations.
        InvalidDemonstrations: no episode. When they are read: one without steps or that goes on after its end, a reward that
            is not finite, or a file that cannot be read.
        InvalidParameter: another word for `after_end`.
    """
    checked_after_end(after_end)
    if isinstance(dataset, str):
        dataset = load_minari(dataset, root=root)
    actions: Any = dataset.spec.action_space
    if not isinstance(actions, spaces.Discrete):
        raise NotDiscrete(
            f"dataset {dataset.spec.dataset_id!r} has actions {actions}: expected Discrete, since irl_gym learns from finitely "
            "many. Read it with Minari, give each action a number, and the episodes to "
            "`irl_gym.demonstrations.imports.from_arrays`."
        )
    if states is not None and dataset.spec.observation_space != states.space:
        raise DatasetMismatch(
            f"dataset {dataset.spec.dataset_id!r} was recorded in an environment with observations "
            f"{dataset.spec.observation_space}: expected {states.space}. Give the states of that environment's table, or the "
            "dataset of another."
        )
    if env is not None:
        _check_recorded(dataset, env)
    if not dataset.total_episodes:
        raise InvalidDemonstrations(
            f"dataset {dataset.spec.dataset_id!r} has no episodes: expected at least one. Record some, or name another."
        )
    return MinariEpisodes(dataset, dataset.episode_indices, after_end)


def _check_recorded(dataset: minari.MinariDataset, env: gym.Env) -> None:
    """Was a dataset recorded in this environment, as far as it can be told?"""
    name, spec = dataset.spec.dataset_id, dataset.env_spec
    if spec is not None and (spec.id in gym.registry or (env.spec is not None and env.spec.id == spec.id)):
        if identity(spec) != identity(env.spec):
            raise DatasetMismatch(
                f"dataset {name!r} was recorded in {told(spec)}: expected {told(env.spec)}. Leave --env-id and --env-kwargs "
                "out; in Python, make the environment with `irl_gym.demonstrations.recorded.recorded_environment(dataset)`."
            )
        return
    for what in ("observation", "action"):
        found, wanted = getattr(dataset.spec, f"{what}_space"), getattr(env, f"{what}_space")
        if found != wanted:
            raise DatasetMismatch(
                f"dataset {name!r} has {what}s of {found}: expected {wanted}, as the environment has. Name the one that it was "
                "recorded in, or one with its spaces."
            )
