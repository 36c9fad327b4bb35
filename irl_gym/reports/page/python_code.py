"""Python that makes the experiment of a configuration again, or uses its reward; and what no configuration holds.

A configuration names the class of each part, and lists small arrays. Of a large array it has a digest, of a function its name,
of a class of the user's own nothing but that: in their places stands `...`.
"""

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import MISSING, fields, is_dataclass
from keyword import iskeyword
from typing import Any

from gymnasium import spaces

from irl_gym.agents.expert_files import FromFile
from irl_gym.agents.planners import SB3, ValueIteration
from irl_gym.environments.reveal import OBSERVATION
from irl_gym.errors import with_article
from irl_gym.features.bases import Fourier, Polynomial, RadialBasis
from irl_gym.features.feature_maps import Functions, OneHot, Table, Unravel
from irl_gym.learners.linear_programs.feature import FeatureLP
from irl_gym.learners.linear_programs.finite import FiniteLP
from irl_gym.learners.linear_programs.trajectory import TrajectoryLP
from irl_gym.mdp.rewards import plain_json
from irl_gym.runs.choices import KNOWN
from irl_gym.runs.experiment import Experiment
from irl_gym.runs.identity import NEW_FOLDER
from irl_gym.spaces.states import StateIndex, States
from irl_gym.tables.counted.counting import Counting, Interaction
from irl_gym.tables.enumeration.table import Enumeration

KINDS: Mapping[str, Any] = {
    kind.__name__: kind
    for kind in (
        FiniteLP, FeatureLP, TrajectoryLP, ValueIteration, SB3, FromFile, Enumeration, Interaction, Counting,
        OneHot, Table, Unravel, Functions, RadialBasis, Fourier, Polynomial,
    )
}  # fmt: skip
"""Classes that a configuration may name."""
PARTS = ("table", "counting", "expert", "learner", "features", "coordinates", "inner", "retrain")
"""Entries that hold an object; a "type" elsewhere, as in env_kwargs, is the user's own word."""
CALLED = (*PARTS, "function")
"""Entries that are never text: a text there is the name of a function."""
WRITTEN = {"values": "np.array({})", "centres": "np.array({})", "sigma": "np.array({})", "shape": "tuple({})"}
"""Fields whose lists were something else, and how that is made of them."""
ASKED = frozenset(Experiment.__dataclass_fields__)
"""Entries that are written as Python; any other key is none of an experiment's, and could be any text."""
NOT_HERE = "..."
"""In place of what a configuration does not hold; Python reads it as a value."""


def is_part(key: str, value: Any) -> bool:
    """Does an entry of a configuration hold an object, with its class's name?"""
    return key in PARTS and isinstance(value, Mapping) and isinstance(value.get("type"), str)


def usual() -> dict[str, Any]:
    """The configuration of an experiment that leaves everything as it is."""
    return Experiment(env_id="any", gamma=0.5).to_json()


def defaults(kind: str) -> dict[str, Any]:
    """The defaults of a class's fields, as a configuration has them; fields without one are left out."""
    if kind not in KINDS:
        return {}
    found = {}
    for one in fields(KINDS[kind]):
        if one.init and (one.default is not MISSING or one.default_factory is not MISSING):
            value: Any = one.default if one.default_factory is MISSING else one.default_factory()
            own = is_dataclass(value)
            found[one.name] = (
                {"type": type(value).__name__, **defaults(type(value).__name__)}
                if own
                else json.loads(json.dumps(value, default=plain_json))
            )
    return found


def python_lines(config: Mapping[str, Any]) -> str:
    """Python that makes the experiment of a configuration and runs it."""
    plain, used = usual(), set[str]()
    told = [
        f"    {key}={_python(key, value, used)},"
        for key, value in config.items()
        if key in ASKED and (key in ("env_id", "gamma") or (value is not None and value != plain.get(key, MISSING)))
    ]
    imports = sorted(f"from {KINDS[name].__module__} import {name}" for name in used)
    if any("np.array(" in line for line in told):
        imports.insert(0, "import numpy as np")
    return "\n".join(
        ["from irl_gym import Experiment, recover_and_retrain", *imports, "", "asked = Experiment(", *told, ")",
         f"report = recover_and_retrain(asked, {NEW_FOLDER!r})"]
    )  # fmt: skip


def reward_lines(config: Mapping[str, Any], file: str, states: States | None) -> str | None:
    """Python that pays a run's reward in its environment, in the folder of the run.

    Args:
        config: of the run.
        file: that the reward is in.
        states: the numbering of its table; None where the reward is of observations.

    Returns:
        The lines; None where the environment is a dataset's or made of cells, or a digest stands for what it was made with.
    """
    env_id, kwargs = config.get("env_id"), config.get("env_kwargs") or {}
    if env_id is None or config.get("bins") is not None or missing({"env_kwargs": kwargs}):
        return None
    imports, made = ["from irl_gym import LearnedReward"], f"gym.make({repr(env_id) + _arguments(kwargs)})"
    seeds, shown = config.get("start_seeds"), config.get("reveal", KNOWN)
    space = getattr(states, "space", None)
    added = isinstance(space, spaces.Dict) and OBSERVATION in space.spaces  # by Reveal
    if seeds or added or shown not in (KNOWN, {}):
        more = {"start_seeds": seeds or [], "reveal": shown}
        imports.append("from irl_gym.runs.named_parts import environment_of")
        made = f"environment_of({env_id!r}, {_python('', kwargs, set())}{_arguments(more)})"
    else:
        imports.insert(0, "import gymnasium as gym")
    if states is None or (isinstance(states, StateIndex) and not states.terminal_copies):
        return "\n".join([*imports, "", f"env = LearnedReward({made}, {file!r})"])
    imports.append("from irl_gym.tables.table_files import TABLE, load_table")
    numbered = "load_table(TABLE, env.observation_space).states"
    return "\n".join([*imports, "", f"env = {made}", f"env = LearnedReward(env, {file!r}, {numbered})"])


def _arguments(given: Mapping[str, Any]) -> str:
    """Keyword arguments behind the first one."""
    if not all(name.isidentifier() and not iskeyword(name) for name in given):
        return f", **{_python('', given, set())}" if given else ""
    return "".join(f", {name}={_python('', value, set())}" for name, value in given.items())


def missing(config: Mapping[str, Any]) -> list[str]:
    """What a configuration does not hold, by its dotted name."""
    return [one for key, value in config.items() for one in _missing(key, value, key)]


def _missing(key: str, value: Any, name: str) -> Iterator[str]:
    """As `missing`, of one entry."""
    if (absent := _absent(key, value)) is not None:
        yield f"{name}, {absent}"
    elif isinstance(value, Mapping):
        for inner, one in value.items():
            yield from _missing(inner if is_part(key, value) else "", one, f"{name}.{inner}")
    elif isinstance(value, list):
        for place, one in enumerate(value):
            yield from _missing("", one, f"{name}[{place}]")


def _absent(key: str, value: Any) -> str | None:
    """What an entry stands for and does not hold; None where it holds all."""
    if isinstance(value, Mapping) and set(value) == {"array", "sha256"}:
        return f"an array of {' x '.join(f'{n:,}' for n in value['array'])} numbers"
    if isinstance(value, Mapping) and set(value) == {"object", "sha256"}:
        return with_article(value["object"])
    if key in CALLED and isinstance(value, str):
        return f"which is {value}"
    return with_article(value["type"]) if is_part(key, value) and value["type"] not in KINDS else None


def _python(key: str, value: Any, used: set[str]) -> str:
    """A value as Python writes it; a part by its class, with the fields that are not its defaults."""
    if _absent(key, value) is not None:
        return NOT_HERE
    if is_part(key, value):
        used.add(value["type"])
        own = defaults(value["type"])
        told = (
            f"{name}={_python(name, one, used)}"
            for name, one in value.items()
            if name.isidentifier() and name != "type" and one != own.get(name, MISSING)
        )
        return f"{value['type']}({', '.join(told)})"
    if isinstance(value, Mapping) and value.get("float") in ("inf", "-inf", "nan"):
        return f"float({value['float']!r})"
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{name!r}: {_python('', one, used)}" for name, one in value.items()) + "}"
    if isinstance(value, list):
        listed = f"[{', '.join(_python('', one, used) for one in value)}]"
        return WRITTEN.get(key, "{}").format(listed)
    return repr(value) if not isinstance(value, float) or math.isfinite(value) else f"float({str(value)!r})"
