"""Demonstrations as Minari datasets: written so that plain Minari opens them, read from any with discrete actions.

Minari keeps datasets under a root folder, `MINARI_DATASETS_PATH` or its own default. A dataset is written under a hidden
folder of the root and renamed, so a broken one never carries an id; an id that is taken is refused, never overwritten.
"""

import contextlib
import json
import os
import shutil
import tempfile
import warnings
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import gymnasium as gym
import minari
import numpy as np
from gymnasium import spaces
from gymnasium.envs.registration import EnvSpec
from minari.data_collector import EpisodeBuffer
from minari.dataset.minari_dataset import parse_dataset_id
from minari.storage.datasets_root_dir import get_dataset_path

from irl_gym.demonstrations import Episode
from irl_gym.errors import DatasetExists, DatasetMismatch, DatasetMissing, InvalidDemonstrations, InvalidParameter, NotDiscrete
from irl_gym.states import States

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
    env: gym.Env,
    *,
    root: str | os.PathLike | None = None,
    algorithm: str,
    author: str = "irl_gym",
    author_email: str = "none given",
    description: str = "Demonstrations recorded with irl_gym.",
    code_permalink: str | None = None,
    random_return: float | None = None,
    expert_return: float | None = None,
) -> minari.MinariDataset:
    """Write episodes as a Minari dataset.

    Args:
        episodes: at least one; they may come from a generator.
        dataset_id: `namespace/name-v0`, as Minari has it.
        env: where they were recorded; its spec is kept, so that `recover_environment()` works.
        root: Minari's root folder; None for the one in force.
        algorithm: what acted.
        author: who made it.
        author_email: how to reach them.
        description: a sentence.
        code_permalink: where the code is that recorded them.
        random_return: mean return of a random policy (Minari's `ref_min_score`).
        expert_return: mean return of the expert (`ref_max_score`).

    Raises:
        InvalidParameter: a malformed id.
        DatasetExists: the id is taken.
        InvalidDemonstrations: no episode.
    """
    try:
        namespace, *_ = parse_dataset_id(dataset_id)
    except (ValueError, TypeError) as error:
        raise InvalidParameter(f"dataset id {dataset_id!r} is malformed ({error}): expected namespace/name-v0.") from error
    with minari_root(root) as base:
        final = base / dataset_id
        if final.exists():
            raise DatasetExists(
                f"dataset {dataset_id!r} exists under {base}: Minari ids are never overwritten. Ask for the next version, "
                "such as -v1."
            )
        first_action = int(getattr(env.action_space, "start", 0))
        buffers = [_buffer(episode, first_action) for episode in episodes]
        if not buffers:
            raise InvalidDemonstrations("there are no episodes to write: expected at least one.")
        beside = Path(tempfile.mkdtemp(prefix=".writing-", dir=base))
        try:
            with minari_root(beside), warnings.catch_warnings():
                warnings.simplefilter("ignore", UserWarning)  # Minari's hints about optional metadata
                written = minari.create_dataset_from_buffers(
                    dataset_id, buffers, env=env, eval_env=env if env.spec is not None else None,
                    algorithm_name=algorithm, author=author, author_email=author_email,
                    code_permalink=code_permalink, description=description, num_episodes_average_score=len(buffers),
                    ref_min_score=random_return, ref_max_score=expert_return, data_format="hdf5", jpeg_encoding=False,
                )  # fmt: skip
                del written  # its storage is about to move
            final.parent.mkdir(parents=True, exist_ok=True)
            if namespace and not (base / namespace / "namespace_metadata.json").exists():
                shutil.copyfile(beside / namespace / "namespace_metadata.json", base / namespace / "namespace_metadata.json")
            os.replace(beside / dataset_id, final)
        finally:
            shutil.rmtree(beside, ignore_errors=True)
        return minari.load_dataset(dataset_id)


def _buffer(episode: Episode, first_action: int) -> EpisodeBuffer:
    ends = np.zeros((2, len(episode)), dtype=bool)
    ends[:, -1] = episode.terminated, episode.truncated
    columns: dict[str, Any] = {  # Minari asks for lists, and takes arrays
        "observations": episode.observations,
        "actions": episode.actions + first_action,
        "rewards": episode.rewards,
        "terminations": ends[0],
        "truncations": ends[1],
    }
    return EpisodeBuffer(seed=episode.seed, infos={}, **columns)


def load_minari(dataset_id: str, *, root: str | os.PathLike | None = None) -> minari.MinariDataset:
    """Open a Minari dataset by its id.

    Raises:
        InvalidParameter: a malformed id.
        DatasetMissing: no dataset of that id under the root; those that are there are named.
    """
    if root is not None and not Path(root).is_dir():
        raise DatasetMissing(f"{root} is no folder: expected Minari's root, under which {dataset_id!r} is. Name another.")
    with minari_root(root) as base:
        try:
            parse_dataset_id(dataset_id)
        except (ValueError, TypeError) as error:
            raise InvalidParameter(f"dataset id {dataset_id!r} is malformed ({error}): expected namespace/name-v0.") from error
        if not (base / dataset_id).exists():
            found = sorted(minari.list_local_datasets())
            there = f"There are {', '.join(found[:5])}." if found else "There is none."
            raise DatasetMissing(
                f"dataset {dataset_id!r} is not under {base}: expected one of the datasets there. {there} Name the root "
                "folder, or set MINARI_DATASETS_PATH."
            )
        return minari.load_dataset(dataset_id)


def read_minari(
    dataset: minari.MinariDataset | str,
    *,
    states: States | None = None,
    env: gym.Env | None = None,
    root: str | os.PathLike | None = None,
) -> Iterator[Episode]:
    """Read the episodes of a Minari dataset with discrete actions, one at a time.

    Args:
        dataset: a dataset, or the id of one under `root`.
        states: refuse a dataset whose observations are not this index's.
        env: refuse a dataset recorded in another environment, by id and arguments.
        root: Minari's root folder; None for the one in force.

    Raises:
        FileNotFoundError: no dataset of that id.
        NotDiscrete: continuous actions.
        DatasetMismatch: recorded in another environment, or one with other observations.
    """
    if isinstance(dataset, str):
        dataset = load_minari(dataset, root=root)
    actions: Any = dataset.spec.action_space
    if not isinstance(actions, spaces.Discrete):
        raise NotDiscrete(f"dataset {dataset.spec.dataset_id!r} has actions {actions}: expected Discrete.")
    if states is not None and dataset.spec.observation_space != states.space:
        raise DatasetMismatch(
            f"dataset {dataset.spec.dataset_id!r} was recorded in an environment with observations "
            f"{dataset.spec.observation_space}: expected {states.space}. Is it another environment's?"
        )
    if env is not None and _identity(dataset.env_spec) != _identity(env.spec):
        raise DatasetMismatch(
            f"dataset {dataset.spec.dataset_id!r} was recorded in {_identity(dataset.env_spec)}: expected "
            f"{_identity(env.spec)}. Make the environment with `dataset.recover_environment()`."
        )
    first = int(actions.start)
    described = dataset.storage.get_episode_metadata(dataset.episode_indices)
    for episode, metadata in zip(dataset.iterate_episodes(), described, strict=True):
        yield Episode(
            episode.observations, np.asarray(episode.actions, dtype=np.int64) - first, np.asarray(episode.rewards, float),
            bool(episode.terminations[-1]), bool(episode.truncations[-1]), metadata.get("seed"),
        )  # fmt: skip


def _identity(spec: EnvSpec | None) -> tuple[str, dict[str, Any]] | None:
    """What makes an environment this one: its id and arguments, but for how it is shown."""
    if spec is None:
        return None
    kwargs = json.loads(json.dumps(spec.kwargs))
    kwargs.pop("render_mode", None)
    return spec.id, kwargs
