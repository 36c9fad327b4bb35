"""The files of a Minari dataset, written an episode at a time.

Minari's own writer takes a list of all episodes. Here memory does not grow with their number; `minari_formats` puts each where
Minari looks for it. A dataset is written beside its place, its totals last, and renamed: a broken one never carries an id.
"""

import copy
import importlib.util
import inspect
import json
import os
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium as gym
import minari
from gymnasium import spaces
from gymnasium.envs.registration import EnvSpec, load_env_creator
from minari.dataset.minari_dataset import parse_dataset_id
from minari.dataset.minari_storage import MinariStorage
from minari.serialization import serialize_space

from irl_gym.demonstrations.minari_formats import WRITERS, DataFormat
from irl_gym.environments.watching_wrappers import WATCHING
from irl_gym.errors import DatasetExists, InvalidDemonstrations, InvalidParameter
from irl_gym.mdp.episodes import Episode
from irl_gym.mdp.rewards import plain_json

_NAMESPACE = "namespace_metadata.json"


@dataclass(frozen=True, eq=False)
class Description:
    """What a dataset says about itself.

    Raises:
        InvalidParameter: a malformed id, spaces that Minari cannot keep, an environment whose spec is not json, or a format
            that cannot be written here.
    """

    dataset_id: str
    """`namespace/name-v0`, as Minari has it."""
    observation_space: spaces.Space
    """Of the episodes."""
    action_space: spaces.Space
    """Of the episodes; Discrete."""
    spec: EnvSpec | None
    """Of the environment they were recorded in; None where it is not known."""
    data_format: DataFormat
    """hdf5 or arrow."""
    metadata: dict[str, Any]
    """What else is known, in Minari's words."""

    def __post_init__(self) -> None:
        check_id(self.dataset_id)
        if self.data_format not in WRITERS:
            raise InvalidParameter(f"data_format is {self.data_format!r}: expected 'hdf5' or 'arrow'.")
        if self.data_format == "arrow" and importlib.util.find_spec("pyarrow") is None:
            raise InvalidParameter(
                "data_format is 'arrow', but pyarrow is not installed: expected it, or 'hdf5'. Install it with "
                '`pip install "irl_gym[data]"`.'
            )
        for name in ("observation_space", "action_space"):
            try:
                serialize_space(getattr(self, name))
            except NotImplementedError as error:
                raise InvalidParameter(
                    f"{name} is {getattr(self, name)}: expected a space that Minari can keep. Wrap the environment in one that "
                    "shows Box, Discrete, MultiDiscrete, MultiBinary, Text, Tuple or Dict."
                ) from error
        spec_json(self.spec)


def spec_json(spec: EnvSpec | None) -> str | None:
    """An environment's spec as Minari keeps it; a class that made it is written as `module:Class`.

    Raises:
        InvalidParameter: it cannot be json.
    """
    if spec is None:
        return None
    named = copy.deepcopy(spec)
    named.additional_wrappers = tuple(one for one in spec.additional_wrappers if one.name not in WATCHING)  # as `identity`
    for name in ("entry_point", "vector_entry_point"):
        made_by: Any = getattr(named, name)
        if callable(made_by) and "<" not in getattr(made_by, "__qualname__", "<"):
            setattr(named, name, f"{made_by.__module__}:{made_by.__qualname__}")
    try:
        return named.to_json()
    except (TypeError, ValueError) as error:
        raise InvalidParameter(
            f"the spec of {spec.id} cannot be written as json ({error}): expected plain arguments and an importable class. "
            "Register it with entry_point='module:Class'; or give env=None and the two spaces, and the dataset will not say "
            "where it was recorded."
        ) from error


def unkept(spec: EnvSpec | None) -> str | None:
    """Why a dataset cannot say where it was recorded, in a sentence; None where it can."""
    try:
        spec_json(spec)
    except InvalidParameter as error:
        name = "" if spec is None else spec.id
        return f"The dataset does not say that it was recorded in {name}: the spec is no json ({error.__cause__})."
    return None


def identity(spec: EnvSpec | None) -> list[Any] | None:
    """What makes an environment this one: its id, arguments and wrappers, but for how it is shown and who watches it."""
    if spec is None:
        return None
    return json.loads(json.dumps(_named(spec, _defaults(spec.id) | spec.kwargs)), parse_constant=str)  # NaN is not equal to NaN


def _named(spec: EnvSpec, arguments: dict[str, Any]) -> tuple[Any, ...]:
    kwargs = _plain(arguments)
    kwargs.pop("render_mode", None)
    wrappers = [(one.name, one.entry_point, _plain(one.kwargs)) for one in spec.additional_wrappers if one.name not in WATCHING]
    return (spec.id, kwargs, wrappers) if wrappers else (spec.id, kwargs)


def _defaults(env_id: str) -> dict[str, Any]:
    """The arguments that an environment takes where none are given: its constructor's, and those it is registered with."""
    here = gym.registry.get(env_id)
    if here is None:
        return {}
    try:
        maker = load_env_creator(here.entry_point) if isinstance(here.entry_point, str) else here.entry_point
        taken = inspect.signature(maker).parameters if maker is not None else {}
    except (ImportError, AttributeError, TypeError, ValueError):
        taken = {}
    return {name: one.default for name, one in taken.items() if one.default is not one.empty} | here.kwargs


def told(spec: EnvSpec | None) -> str:
    """An environment's identity in words: FrozenLake-v1 with map_name='8x8'."""
    if spec is None:
        return "an environment without a spec"
    env_id, kwargs, *more = _named(spec, spec.kwargs)
    words = [f"{name}={value!r}" for name, value in kwargs.items()]
    words += [f"the wrapper {one[0]}" for wrappers in more for one in wrappers]
    return f"{env_id} with {', '.join(words)}" if words else str(env_id)


def _plain(value: Any) -> Any:
    """As json gives it back: lists for tuples."""
    return json.loads(json.dumps(value, default=plain_json))


def check_id(dataset_id: str) -> str:
    """Check that Minari takes an id, and return it.

    Raises:
        InvalidParameter: it is malformed.
    """
    try:
        parse_dataset_id(dataset_id)
    except (ValueError, TypeError) as error:
        why = f" ({error})" if isinstance(error, ValueError) else ""  # the other is Minari's stumble over a missing version
        raise InvalidParameter(f"dataset id {dataset_id!r} is malformed{why}: expected namespace/name-v0.") from error
    return dataset_id


def check_free(base: Path, dataset_id: str) -> None:
    """Check that an id can be given.

    Raises:
        DatasetExists: it is taken, or its namespace is a dataset.
    """
    final = base / dataset_id
    if final.exists():
        raise DatasetExists(
            f"dataset {dataset_id!r} exists under {base}: Minari ids are never overwritten. Ask for the next version, "
            "such as -v1."
        )
    for parent in final.parents[: len(Path(dataset_id).parts) - 1]:
        if (parent / "data").exists():
            taken = parent.relative_to(base).as_posix()
            raise DatasetExists(
                f"{taken!r} is a dataset under {base}: expected a namespace. Choose another for {dataset_id!r}."
            )


def write_files(
    folder: Path, about: Description, episodes: Iterable[Episode], on_episode: Callable[[int], None] | None = None
) -> None:
    """Write a dataset under a folder that takes the place of Minari's root.

    Args:
        folder: exists.
        about: the dataset's description.
        episodes: at least one.
        on_episode: told how many are written.

    Raises:
        InvalidDemonstrations: no episode.
        InvalidParameter: an episode too long for its format.
    """
    data = folder / about.dataset_id / "data"
    data.parent.mkdir(parents=True)
    storage = MinariStorage.new(
        data, about.observation_space, about.action_space, data_format=about.data_format, jpeg_encoding=False
    )
    first_action = int(getattr(about.action_space, "start", 0))
    written = steps = 0
    with WRITERS[about.data_format](data, about.observation_space, first_action) as add:
        for episode in episodes:
            add(written, episode)
            written, steps = written + 1, steps + len(episode)
            if on_episode is not None:
                on_episode(written)
    if not written:
        raise InvalidDemonstrations("there are no episodes to write: expected at least one.")
    spec = spec_json(about.spec)
    more: dict[str, Any] = {} if spec is None else {"env_spec": spec, "eval_env_spec": spec}
    if "ref_max_score" in about.metadata:
        more["num_episodes_average_score"] = written
    storage.update_metadata({
        **about.metadata, **more, "dataset_id": about.dataset_id, "minari_version": minari.__version__,
        "total_episodes": written, "total_steps": steps, "dataset_size": float(storage.get_size()),
    })  # fmt: skip


def publish(folder: Path, base: Path, dataset_id: str) -> None:
    """Give a dataset that was written under a folder its id, in one step.

    Raises:
        DatasetExists: it was taken meanwhile.
    """
    check_free(base, dataset_id)
    final = base / dataset_id
    final.parent.mkdir(parents=True, exist_ok=True)
    for parent in final.parents[: len(Path(dataset_id).parts) - 1]:  # each a namespace of Minari
        if not (parent / _NAMESPACE).exists():
            (folder / _NAMESPACE).write_text("{}")
            os.replace(folder / _NAMESPACE, parent / _NAMESPACE)
    os.replace(folder / dataset_id, final)


def dataset_name(env_id: str, of: str = "expert") -> str:
    """The Minari id under which a run's demonstrations are kept, or what else it recorded."""
    plain = re.sub(r"[^-\w]+", "-", env_id.split(":")[-1]).lower()
    return f"irl_gym/{plain}-{of}-v0"
