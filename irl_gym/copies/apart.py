"""Is a copy of an environment apart from it: does nothing in it lead back to what was copied?

`copy.deepcopy` leaves functions and weak references as they are. What a function closes over, or a weak reference leads to, is
the original's in the copy too: what is written through it is never read from the copy's own, and a table would be wrong.
"""

import gc
import types
import weakref
from collections.abc import Iterable
from typing import Any

import gymnasium as gym
import numpy as np

from irl_gym.copies.object_graphs import ATOMS, CODE, SHARED, attributes
from irl_gym.copies.replacing import held_by
from irl_gym.errors import NotCopied


def check_apart(layers: list[gym.Env], originals: Iterable[Any]) -> None:
    """Check that copied layers do not lead to originals.

    Raises:
        NotCopied: an attribute does; it is named.
    """
    copied = {id(one): one for one in originals if not isinstance(one, _FIXED)}
    seen = {id(layer) for layer in layers}
    waiting = [
        (f"{type(layer).__name__}.{name}", value)
        for layer in layers
        for name, value in attributes(layer).items()
        if name not in SHARED
    ]
    while waiting:
        name, one = waiting.pop()
        if type(one) in ATOMS or id(one) in seen:
            continue
        seen.add(id(one))
        if id(one) in copied:
            raise NotCopied(
                f"{name} leads to a {type(one).__name__} of the environment that it was copied from, as through a function's "
                "variable or a weak reference, which copies share: expected all that changes in attributes alone. Make the "
                "function a method that uses `self`; or give the environment get_state() and set_state(state)."
            )
        waiting += [(name, part) for part in _referents(one)]


_FIXED = (*CODE, tuple, frozenset, np.generic, types.CodeType)


def _referents(one: Any) -> Iterable[Any]:
    if isinstance(one, types.FunctionType):
        return [*(one.__closure__ or ()), *held_by(one)]
    if isinstance(one, CODE):
        return ()
    if isinstance(one, weakref.ref):
        return [one()]
    if isinstance(one, np.ndarray):
        return [*one.flat] if one.dtype == object else ()
    return gc.get_referents(one)
