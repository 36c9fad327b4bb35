"""What an agent is shown in place of observations: numbers of states, or observations that were normalised.

Stable-Baselines3 takes numbers from 0 and arrays of floats. On a table with other observations an agent is trained on the rows
of the states, and `PPO.load` of its zip alone would take an observation for a row. So `Agent.save` writes what the agent is
shown beside its zip, and `load_agent` reads it:
    agent.zip          the agent
    agent.shown.npz    `how`, a sentence; space, numbers (n, k) or low and counts (k,), copies: the rows of observations
                       or mean, var, clip, epsilon: what Stable-Baselines3's VecNormalize did to them
A zip that was trained under VecNormalize needs its statistics: `read_statistics` takes them from what `VecNormalize.save`
wrote, a pickle, without unpickling it.
Axes: n states of k numbers.
"""

import base64
import math
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium import spaces
from minari.serialization import serialize_space

from irl_gym.errors import DamagedFile, InvalidInput, InvalidParameter
from irl_gym.files.archives import read_arrays
from irl_gym.files.own_files import write_arrays
from irl_gym.files.pickles import PickledCall, as_numbers, read_pickle
from irl_gym.spaces.integer_spaces import ranges
from irl_gym.spaces.listed_states import ListedStates
from irl_gym.spaces.space_json import told_space
from irl_gym.spaces.states import StateIndex, States

BY_HAND = "np.savez('statistics.npz', mean=venv.obs_rms.mean, var=venv.obs_rms.var, clip=venv.clip_obs, epsilon=venv.epsilon)"
"""How statistics are written as numbers by who has the VecNormalize `venv`."""
ROWS = (
    "The agent was trained on rows of states: the row of an observation is its place among `numbers` (n, k), in the order of "
    "the file; without them np.ravel_multi_index(observation - low, counts), its numbers one after the other."
)
NORMALISED = "The agent was trained on np.clip((observation - mean) / np.sqrt(var + epsilon), -clip, clip), as float32."


@dataclass(frozen=True, eq=False)
class Normaliser:
    """What VecNormalize does to observations.

    Raises:
        InvalidParameter: statistics that are not finite numbers, deviations below 0, or a clip or epsilon that is not above 0.
    """

    mean: Mapping[str, np.ndarray]
    """Of each part of the observations that is normalised; "" for an observation that is one array."""
    var: Mapping[str, np.ndarray]
    """The same, variances."""
    clip: float
    """Deviations up to which a number counts."""
    epsilon: float
    """Added to variances."""

    def __post_init__(self) -> None:
        fine = self.clip > 0 and self.epsilon > 0 and self.mean.keys() == self.var.keys() and len(self.mean) > 0
        for key, mean in self.mean.items():
            var = self.var.get(key, np.zeros(0))
            fine = fine and mean.shape == var.shape and bool(np.isfinite(mean).all() and np.isfinite(var).all())
            fine = fine and bool((var >= 0).all())
        if not fine:
            raise InvalidParameter(
                f"the statistics of observations have parts {sorted(self.mean)}, clip {self.clip} and epsilon {self.epsilon}: "
                "expected finite means and variances of one shape, and a clip and epsilon above 0. Write them with "
                f"{BY_HAND}."
            )

    def __call__(self, observation: Any) -> Any:
        """One observation, or a batch, as the agent was shown it."""
        if "" in self.mean:
            return self._of("", observation)
        return {key: self._of(key, one) if key in self.mean else one for key, one in observation.items()}

    def _of(self, key: str, raw: Any) -> np.ndarray:
        mean, seen = self.mean[key], np.asarray(raw, dtype=np.float64)
        return np.clip((seen - mean) / np.sqrt(self.var[key] + self.epsilon), -self.clip, self.clip).astype(np.float32)

    def check(self, space: spaces.Space) -> None:
        """Check that these are statistics of the observations of an agent.

        Raises:
            InvalidParameter: they are of others.
        """
        parts = space.spaces if isinstance(space, spaces.Dict) else {"": space}
        for key, mean in self.mean.items():
            if key not in parts or parts[key].shape != mean.shape:
                raise InvalidParameter(
                    f"the statistics are of observations {key or ''}{mean.shape}: expected those of {space}, which the agent "
                    "was trained on. Are they another agent's?"
                )

    def arrays(self) -> dict[str, np.ndarray]:
        """As a file holds it."""
        found = {name: getattr(self, name) for name in ("mean", "var")}
        told = {f"{name}{key and '.'}{key}": one for name, parts in found.items() for key, one in parts.items()}
        return told | {"clip": np.array(self.clip), "epsilon": np.array(self.epsilon)}

    @classmethod
    def of_arrays(cls, found: Mapping[str, np.ndarray]) -> "Normaliser":
        """What `arrays` gave."""
        parts: dict[str, dict[str, np.ndarray]] = {"mean": {}, "var": {}}
        for name, value in found.items():
            kind, _, key = name.partition(".")
            if kind in parts:
                parts[kind][key] = np.asarray(value, dtype=np.float64)
        return cls(parts["mean"], parts["var"], float(found["clip"]), float(found["epsilon"]))


def beside(path: str | os.PathLike) -> Path:
    """The file that says what the agent in a zip is shown."""
    return Path(path).with_suffix(".shown.npz")


def write_shown(path: Path, states: States | None, normaliser: Normaliser | None) -> None:
    """Write what an agent is shown beside its zip; nothing where it is shown observations as they are.

    A numbering of another kind than a StateIndex or ListedStates, such as a caller's own, is not written.
    """
    place = beside(path)
    if isinstance(states, StateIndex | ListedStates):
        listed = isinstance(states, ListedStates)
        low_count = np.zeros((0, 2)) if listed else ranges(states.space)
        arrays: dict[str, Any] = {
            "how": np.array(ROWS), "space": np.array(serialize_space(states.space)),
            "numbers": states.numbers if listed else np.zeros(0), "low": low_count[:, 0], "counts": low_count[:, 1],
            "copies": np.array(list(states.terminal_copies.items()), dtype=np.int64).reshape(-1, 2),
        }  # fmt: skip
    elif normaliser is not None:
        arrays = {"how": np.array(NORMALISED), **normaliser.arrays()}
    else:
        place.unlink(missing_ok=True)
        return
    write_arrays(place, arrays)


def read_shown(path: Path) -> tuple[States | None, Normaliser | None]:
    """What the agent in a zip is shown: rows of states, normalised observations, or neither.

    Raises:
        InvalidParameter: a file beside it that says something else.
    """
    place = beside(path)
    if not place.exists():
        return None, None
    found = _arrays(place)
    try:
        if "space" not in found:
            return None, Normaliser.of_arrays(found)
        space = told_space("observations", str(found["space"]))
        copies = dict(found["copies"].tolist())
        return (ListedStates(space, found["numbers"], copies) if found["numbers"].size else StateIndex(space, copies)), None
    except InvalidParameter:
        raise
    except (InvalidInput, KeyError, ValueError, TypeError, OverflowError) as error:
        raise InvalidParameter(
            f"{place} does not say what {path.name} is shown ({error}): expected what `save` wrote."
        ) from error


def _arrays(path: Path) -> dict[str, np.ndarray]:
    try:
        return read_arrays(path)
    except (OSError, DamagedFile) as error:
        raise InvalidParameter(f"{path} cannot be read ({error}): expected an npz of numbers. Write it again.") from error


def read_statistics(path: str | os.PathLike) -> Normaliser:
    """The statistics of observations of a VecNormalize: the pickle of its `save`, read as data, or an npz of its numbers.

    Raises:
        InvalidParameter: no such file, or one that holds no such statistics; the message says how they are written as numbers.
    """
    path = Path(path)
    if not path.is_file():
        raise InvalidParameter(f"{path} is no file: expected what VecNormalize's `save` wrote, or an npz of {BY_HAND}.")
    if path.suffix == ".npz":
        found = _arrays(path)
        missing = {"clip", "epsilon"} - found.keys()
        if missing:
            raise InvalidParameter(f"{path} has no {sorted(missing)[0]!r}: expected numbers written with {BY_HAND}.")
        try:
            return Normaliser.of_arrays(found)
        except (ValueError, TypeError) as error:
            if isinstance(error, InvalidParameter):
                raise
            raise InvalidParameter(f"{path} holds no such numbers ({error}): expected those of {BY_HAND}.") from error
    try:
        return _of_pickle(read_pickle(path.read_bytes()))
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        if isinstance(error, InvalidParameter):
            raise
        raise InvalidParameter(
            f"{path} holds no statistics of observations ({error}): expected what VecNormalize's `save` wrote with norm_obs. "
            f"Nothing in it was run. Write them as numbers: {BY_HAND}."
        ) from error


def _of_pickle(root: Any) -> Normaliser:
    if not isinstance(root, PickledCall) or not isinstance(root.args, tuple) or not isinstance(root.state, dict):
        raise ValueError("it is no VecNormalize")
    state = root.state
    if not state.get("norm_obs") or "obs_rms" not in state:
        raise ValueError("it did not normalise observations")
    rms = state["obs_rms"]
    parts = rms if isinstance(rms, dict) else {"": rms}
    mean = {str(key): as_numbers(one.state["mean"]).astype(np.float64) for key, one in parts.items()}
    var = {str(key): as_numbers(one.state["var"]).astype(np.float64) for key, one in parts.items()}
    return Normaliser(mean, var, float(as_numbers(state["clip_obs"])), float(as_numbers(state["epsilon"])))


@dataclass(frozen=True)
class Training:
    """What an agent's zip says of its training, read as data."""

    returns: tuple[float, ...] = ()
    """Of its last episodes, as Monitor noted them; none where nobody did, and where observations are not normalised."""
    normalised: bool = False
    """Is it known that it was under a VecNormalize, which normalises observations, rewards or both? DQN's zip does not say."""

    @classmethod
    def of(cls, settings: Mapping[str, Any]) -> "Training":
        """What the `data` of Stable-Baselines3's zip says; whatever cannot be read as data says nothing."""
        space = settings.get("observation_space")
        if not isinstance(space, Mapping) or not str(space.get(":type:", "")).endswith(("box.Box'>", "dict.Dict'>")):
            return cls()
        under = settings.get("_last_original_obs") is not None and "replay_buffer_class" not in settings
        kept = settings.get("ep_info_buffer")
        try:
            noted = read_pickle(base64.b64decode(kept[":serialized:"])) if isinstance(kept, Mapping) else None
            returns = tuple(float(as_numbers(one["r"])) for one in getattr(noted, "items", ()))
        except (ValueError, KeyError, TypeError):
            returns = ()
        return cls(returns if math.isfinite(sum(returns)) else (), under)  # a record holds no NaN
