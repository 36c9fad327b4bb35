"""Rewards that are linear in features, R = alpha . phi (Ng & Russell 2000, equation (8)), and files that hold any reward."""

import os
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np

from irl_gym.checks import float_array
from irl_gym.errors import InvalidFeatures, InvalidReward, a_type
from irl_gym.features.bases import Fourier, Polynomial, RadialBasis
from irl_gym.features.feature_maps import (
    FeatureMap,
    OneHot,
    Table,
    Unravel,
    as_features,
    blocks,
    check_length,
    checked_features,
    over_rows,
)
from irl_gym.mdp.rewards import TabularReward, read_archive, write_archive
from irl_gym.mdp.shaping import ShapedReward
from irl_gym.records import Record
from irl_gym.spaces.batches import batch_size, take
from irl_gym.spaces.states import States

FORMAT = "irl_gym.LinearReward/1"
_KINDS = {kind.__name__: kind for kind in (OneHot, Table, RadialBasis, Fourier, Polynomial, Unravel)}


@dataclass(frozen=True, eq=False)
class LinearReward(Record):
    """R(s) = alpha . phi(s), paid on arrival. Immutable.

    Raises:
        InvalidReward: weights of another number than the features, or not finite.
        InvalidFeatures: features that are neither a map nor a table (S, K).
    """

    alpha: np.ndarray
    """(K,) float64 weights."""
    features: FeatureMap
    """phi, of observations; of the rows of a table where it was learned on rows."""
    note: Mapping[str, Any] = field(default_factory=dict)
    """Where it comes from; anything json can hold."""

    def __post_init__(self) -> None:
        features = as_features(self.features)
        alpha = float_array("alpha", self.alpha, "(K,) numbers", InvalidReward)
        if alpha.shape != (features.n_features,) or not np.isfinite(alpha).all():
            raise InvalidReward(
                f"alpha has shape {alpha.shape}: expected ({features.n_features},) finite weights, one a feature."
            )
        alpha.setflags(write=False)
        object.__setattr__(self, "alpha", alpha)
        object.__setattr__(self, "features", features)

    def __reduce__(self) -> tuple:
        return type(self), (self.alpha, self.features, dict(self.note))

    def __repr__(self) -> str:
        used = int((self.alpha != 0).sum())
        return f"LinearReward({type(self.features).__name__}, {used} of {self.alpha.size} weights not 0)"

    def of(self, observations: Any) -> np.ndarray:
        """(N,) rewards of arriving in a batch of observations.

        Raises:
            InvalidFeatures: the map does not take them.
        """
        n = batch_size(observations)
        if n * self.alpha.size <= 1 << 20:
            return checked_features(self.features, observations) @ self.alpha
        return np.concatenate(
            [checked_features(self.features, take(observations, b)) @ self.alpha for b in blocks(n, self.alpha.size)]
        )

    def pay(self, states: Any, actions: Any, next_states: Any) -> Any:
        """The reward of steps (s, a, s'): batches (N, ...) of what the features are of, or single integers."""
        if not isinstance(next_states, dict | tuple) and np.ndim(next_states) == 0:
            return self.of(np.asarray(next_states)[None])[0]
        return self.of(next_states)

    def tabular(self, states: States | int) -> TabularReward:
        """The same reward in a table (S,).

        Args:
            states: turns rows into the observations that the features are of; or the number of rows, where they are of rows.
        """
        n = states if isinstance(states, int) else states.n_states
        decode = _rows if isinstance(states, int) else states.decode_batch
        if isinstance(states, int):
            check_length(self.features, n)
        values = np.empty(n)
        for part in blocks(n, self.alpha.size):
            values[part] = over_rows(self.features, decode, np.arange(n)[part]) @ self.alpha
        return TabularReward.learned(values, self.note) if "learner" in self.note else TabularReward(values, self.note)

    def save(self, path: str | os.PathLike) -> None:
        """Write an npz without pickle. Beside first, then renamed.

        Raises:
            InvalidFeatures: features that are code of the caller's, which no file can hold.
        """
        arrays: dict[str, np.ndarray] = {"alpha": self.alpha}
        packed = _pack(self.features, "features", arrays)
        write_archive(path, {"format": FORMAT, "features": packed, "note": dict(self.note)}, arrays)

    @classmethod
    def load(cls, path: str | os.PathLike) -> "LinearReward":
        """Read what `save` wrote. Nothing is unpickled.

        Raises:
            FileNotFoundError: no such file.
            InvalidReward: the file holds no such reward.
        """
        header, arrays = read_archive(path, (FORMAT,))
        try:
            return cls(arrays["alpha"], _unpack(header["features"], arrays), header.get("note", {}))
        except (KeyError, TypeError, AttributeError, InvalidFeatures, InvalidReward) as error:
            raise InvalidReward(f"{path} holds no reward ({error}): expected a file written by LinearReward.save.") from error


def check_savable(features: Any) -> None:
    """Check, before anything is learned, that a file can hold features; None is fine.

    Raises:
        InvalidFeatures: code of the caller's.
    """
    if features is not None:
        _pack(features, "features", {})


def load_reward(path: str | os.PathLike) -> TabularReward | LinearReward:
    """Read a reward of either kind.

    Raises:
        FileNotFoundError: no such file.
        InvalidReward: the file holds no reward.
    """
    header, _ = read_archive(path, (FORMAT, *TabularReward.FORMATS))
    return LinearReward.load(path) if header["format"] == FORMAT else TabularReward.load(Path(path))


def load_payment(path: str | os.PathLike) -> TabularReward | LinearReward | ShapedReward:
    """Read what an agent can be paid: a reward of either kind, or a shaped one.

    Raises:
        FileNotFoundError: no such file.
        InvalidReward: the file holds none.
    """
    header, _ = read_archive(path, (FORMAT, *TabularReward.FORMATS, *ShapedReward.FORMATS))
    return ShapedReward.load(path) if header["format"] in ShapedReward.FORMATS else load_reward(path)


def _rows(rows: np.ndarray) -> np.ndarray:
    return rows


def _pack(value: Any, name: str, arrays: dict[str, np.ndarray]) -> Any:
    """What json can hold of a feature map; its arrays go into `arrays`."""
    if isinstance(value, np.ndarray):
        arrays[name] = value
        return {"array": name}
    if type(value).__name__ in _KINDS and type(value) is _KINDS[type(value).__name__]:
        parts = {one.name: _pack(getattr(value, one.name), f"{name}.{one.name}", arrays) for one in fields(value) if one.init}
        return {"type": type(value).__name__, "fields": parts}
    if isinstance(value, tuple | list):
        return [_pack(one, f"{name}.{i}", arrays) for i, one in enumerate(value)]
    if isinstance(value, int | float | str | None):
        return value
    if isinstance(value, np.generic):
        return value.item()
    raise InvalidFeatures(
        f"{name} is {a_type(value)}, code that no file can hold: expected one of {', '.join(_KINDS)}. Save "
        "`reward.tabular(states)`, the same reward in a table."
    )


def _unpack(packed: Any, arrays: Mapping[str, np.ndarray]) -> Any:
    if isinstance(packed, list):
        return tuple(_unpack(one, arrays) for one in packed)
    if isinstance(packed, dict):
        if "array" in packed:
            return arrays[packed["array"]]
        return _KINDS[packed["type"]](**{name: _unpack(value, arrays) for name, value in packed["fields"].items()})
    return packed
