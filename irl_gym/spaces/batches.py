"""Batches of observations, stacked as vector environments stack them: dicts and tuples of arrays, taken part by part."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np


def batch_size(observations: Any) -> int:
    """Number of observations in a stacked batch, whose parts are dicts and tuples of arrays."""
    while isinstance(observations, dict | tuple):
        observations = next(iter(observations.values())) if isinstance(observations, dict) else observations[0]
    return len(observations)


def batch_sizes(observations: Any) -> list[int]:
    """The same, of each part of the batch."""
    sizes: list[int] = []
    by_part(lambda part: sizes.append(len(part)), observations)
    return sizes


def by_part(function: Callable[..., Any], *batches: Any) -> Any:
    """Call a function on the arrays of batches that are laid out alike, part by part."""
    first = batches[0]
    if isinstance(first, Mapping):
        return {key: by_part(function, *(one[key] for one in batches)) for key in first}
    if isinstance(first, tuple):
        return tuple(by_part(function, *parts) for parts in zip(*batches, strict=True))
    return function(*batches)


def take(observations: Any, which: Any) -> Any:
    """Some observations of a stacked batch, by a slice or an array of positions."""
    return by_part(lambda part: part[which], observations)


def batch_of_one(observation: Any) -> Any:
    """One observation, stacked as a batch of one."""
    return by_part(lambda part: np.asarray(part)[None], observation)
