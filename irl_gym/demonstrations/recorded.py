"""The environment that a dataset was recorded in, made anew: by its id, and by nothing else that the file names.

A dataset is a file. The spec that it holds has entry points: names that `gymnasium.make` imports and calls, whatever they are.
So of a spec are taken its id, plain arguments, its time limit, and wrappers that are known; what is made is what is registered
under that id in this process. Anything else its user has to name, or to trust, and is told what would have been run.
"""

import contextlib
import importlib
import json
from dataclasses import replace
from typing import Any, NoReturn

import gymnasium as gym
import minari
from gymnasium.envs.registration import EnvSpec, WrapperSpec

from irl_gym.environments.watching_wrappers import WATCHING
from irl_gym.errors import DatasetMismatch, NotTrusted, UnknownEnvironment

OURS, NAMESPACE = "irl_gym_envs", "irl_gym/"
"""The package that comes with this library, and how the ids begin that importing it registers."""
OF_GYMNASIUM = frozenset({
    "AddRenderObservation", "ClipAction", "ClipReward", "DelayObservation", "DiscretizeAction", "DiscretizeObservation",
    "DtypeObservation", "FilterObservation", "FlattenObservation", "FrameStackObservation", "GrayscaleObservation",
    "MaxAndSkipObservation", "NormalizeObservation", "NormalizeReward", "RepeatAction", "RescaleAction", "RescaleObservation",
    "ReshapeObservation", "ResizeObservation", "StickyAction", "TimeAwareObservation",
})  # fmt: skip
"""Wrappers of Gymnasium that a file may ask for: arithmetic on what is seen, done or paid. None takes a function, writes a
file, opens a window or imports what an argument names; those that do, such as TransformReward and RecordVideo, are not here."""
OF_IRL_GYM = frozenset({"irl_gym.environments.reveal:Reveal", "irl_gym.environments.seeded_starts:SeededStarts"})
"""Wrappers of this library that a file may ask for: they read attributes, and reset with seeds."""
NAMING = frozenset(":/\\")
"""A text with one of these may name a module or a file, which is no plain argument."""
SHOWN = 240
"""Characters of what would have been run that an error shows."""


def recorded_environment(dataset: minari.MinariDataset, *, trust: bool = False) -> gym.Env:
    """The environment that a dataset was recorded in, made anew.

    Args:
        dataset: an open one.
        trust: import and call whatever its spec names, as `dataset.recover_environment()` does. Else what is made is what is
            registered under its id, with plain arguments and known wrappers.

    Raises:
        DatasetMismatch: the dataset does not say, or what it says cannot be made here.
        UnknownEnvironment: an environment that is not registered here, or a wrapper that another version of irl_gym had.
        NotTrusted: arguments that are not plain, or wrappers that are not known.
    """
    name, spec = dataset.spec.dataset_id, dataset.env_spec
    if spec is None:
        raise DatasetMismatch(
            f"dataset {name!r} does not say where it was recorded: expected an environment. Name one with --env-id."
        )
    found = spec if trust else _registered(name, spec)
    try:
        return gym.make(found)
    except (ImportError, AttributeError, gym.error.Error) as error:
        raise UnknownEnvironment(
            f"environment {spec.id!r}, in which dataset {name!r} was recorded, is unknown here ({error}): expected one that "
            "can be imported. Install or import the package that registers it, or name an environment with --env-id."
        ) from error
    except Exception as error:  # a constructor's own, of arguments that it was not written for
        raise DatasetMismatch(
            f"environment {spec.id!r}, in which dataset {name!r} was recorded, cannot be made here ({type(error).__name__}: "
            f"{error}): expected it to take {_shown(spec.kwargs)}. Is it another version? Name an environment with --env-id."
        ) from error


def _registered(name: str, spec: EnvSpec) -> EnvSpec:
    """What is registered here under the id of a dataset's spec, with that spec's arguments, time limit and wrappers."""
    if spec.id not in gym.registry and spec.id.startswith(NAMESPACE):
        with contextlib.suppress(ImportError):
            importlib.import_module(OURS)
    here = gym.registry.get(spec.id)  # not gym.spec or gym.make of the id, which import a module that it names
    if here is None:
        _refuse(
            UnknownEnvironment, name, spec, "which is not registered here",
            "Import the package that registers it, or name an environment with --env-id, as module:id",
        )  # fmt: skip
    for key, value in spec.kwargs.items():
        if not _plain(value) and _text(value) != _text(here.kwargs.get(key)):
            _refuse(
                NotTrusted, name, spec, f"with the argument {_shown(key)}, which may name a module or a file",
                "Name it yourself, with --env-id and --env-kwargs",
            )  # fmt: skip
    asked = {key: one for key, one in spec.kwargs.items() if (key, one) != ("render_mode", "human")}  # which opens a window
    limit = spec.max_episode_steps
    whole = isinstance(limit, int) and not isinstance(limit, bool) and limit > 0
    return replace(
        here, kwargs={**here.kwargs, **asked}, max_episode_steps=limit if whole else None,
        additional_wrappers=tuple(_wrapper(name, spec, one, here) for one in spec.additional_wrappers
                                  if one.name not in WATCHING),
    )  # fmt: skip


def _wrapper(name: str, spec: EnvSpec, asked: WrapperSpec, here: EnvSpec) -> WrapperSpec:
    """A wrapper that a file asks for, by our own name of it; it is refused unless it is known."""
    if asked in here.additional_wrappers:
        return asked
    module, _, kind = str(asked.entry_point).partition(":")
    plain = asked.kwargs is None or (isinstance(asked.kwargs, dict) and _plain(asked.kwargs))
    if plain and f"{module}:{kind}" in OF_IRL_GYM:
        return WrapperSpec(kind, f"{module}:{kind}", asked.kwargs)
    if plain and f"{module}.".startswith("gymnasium.wrappers.") and kind in OF_GYMNASIUM:
        return WrapperSpec(kind, f"gymnasium.wrappers:{kind}", asked.kwargs)
    if module.startswith("irl_gym.") and kind in (known := {one.partition(":")[2]: one for one in OF_IRL_GYM}):
        raise UnknownEnvironment(
            f"dataset {name!r} was recorded in {_shown(spec.id)} with the wrapper {_shown(asked.entry_point)}, of another "
            f"version of irl_gym: expected {known[kind]}, as it is called here. Put that in its place in data/metadata.json."
        )
    _refuse(NotTrusted, name, spec, f"with the wrapper {_shown(asked.entry_point)}", "Record it without that wrapper")


def _plain(value: Any) -> bool:
    """Is this what json holds, without a text that may name a module or a file?"""
    if isinstance(value, dict):
        return all(map(_plain, value)) and all(map(_plain, value.values()))
    if isinstance(value, list):
        return all(map(_plain, value))
    return value is None or isinstance(value, bool | int | float) or (isinstance(value, str) and not NAMING & set(value))


def _text(value: Any) -> str:
    """A value as json holds it, to compare it."""
    return json.dumps(value, sort_keys=True, default=repr)


def _shown(value: Any) -> str:
    """A value out of a file on a screen: without what a terminal would obey, and not too long."""
    text = ascii(value)
    return text if len(text) <= SHOWN else f"{text[:SHOWN]}..."


def _refuse(kind: type[Exception], name: str, spec: EnvSpec, what: str, mend: str) -> NoReturn:
    told = f"{spec.entry_point}, with {spec.kwargs}"
    told = "; then ".join([told, *(f"{one.entry_point}, with {one.kwargs}" for one in spec.additional_wrappers)])
    raise kind(
        f"dataset {name!r} was recorded in {_shown(spec.id)}, {what}: expected an environment that is registered here, with "
        f"plain arguments and known wrappers. Nothing was run; what would have been is {_shown(told)}. {mend}; or, if you "
        "trust who made the dataset, add --trust-dataset (trust_dataset=True)."
    )
