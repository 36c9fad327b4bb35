"""Spaces that a file tells, in the json of `minari.serialization`: of runs, and of Minari datasets."""

import json
from typing import Any

import numpy as np
from gymnasium import spaces
from minari.serialization import deserialize_space

from irl_gym.errors import DamagedFile

MOST = 1 << 24
"""Numbers in an observation."""
DTYPES = frozenset(
    "bool int8 int16 int32 int64 uint8 uint16 uint32 uint64 float16 float32 float64".split()  # no text, no objects
)
_SURPRISES = (
    ValueError, KeyError, TypeError, IndexError, AttributeError, AssertionError, ArithmeticError, RuntimeError, MemoryError,
)  # fmt: skip
"""What Minari and Gymnasium raise of a space that is none."""


def told_space(name: str, text: Any) -> spaces.Space:
    """The space of a text.

    Args:
        name: what it is called.
        text: as `serialize_space` gives it.

    Raises:
        DamagedFile: it tells no space, or one whose observations are larger than any.
    """
    try:
        if not isinstance(text, str):
            raise TypeError("it is no text")
        told = json.loads(text)
        _check(told)
        return deserialize_space(told)
    except _SURPRISES as error:
        raise DamagedFile(f"its {name} is {text!r:.80}, which tells no space: {str(error)[:200]}") from error


def _check(told: Any) -> None:
    """Check what would take memory, or make Gymnasium take text for numbers, before a space is made.

    Raises:
        TypeError, ValueError, KeyError: naming it.
    """
    kind, inner = told["type"], told.get("subspaces", ())
    if kind not in ("Box", "Discrete", "MultiDiscrete", "MultiBinary", "Text", "Tuple", "Dict"):
        raise ValueError(f"no space is a {kind!r:.40}")
    if told.get("dtype", "int64") not in DTYPES:
        raise ValueError(f"no space is of {told['dtype']!r:.40}")
    if kind in ("Tuple", "Dict"):
        if not isinstance(inner, dict if kind == "Dict" else list) or not inner:
            raise TypeError(f"the parts of a {kind} are {inner!r:.40}")
        for one in inner.values() if isinstance(inner, dict) else inner:
            _check(one)
    sizes = {"Box": told.get("shape"), "MultiBinary": told.get("n"), "Discrete": [1]}.get(kind, [])
    listed = sizes if isinstance(sizes, list) else [sizes]
    if not all(type(n) is int and 0 <= n <= MOST for n in listed) or np.prod(listed, dtype=float) > MOST:
        raise ValueError(f"observations of {sizes!r:.40} numbers")
