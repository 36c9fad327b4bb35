"""Is a copy of an environment apart from it: does nothing in it lead back to what was copied?

`copy.deepcopy` leaves functions and weak references as they are. What a function closes over, or a weak reference leads to, is
the original's in the copy too: what is written through it is never read from the copy's own, and a table would be wrong.
"""

import enum
import gc
import sys
import types
import weakref
from collections.abc import Iterable, Iterator
from typing import Any

import gymnasium as gym
import numpy as np

from irl_gym.copies.object_graphs import ATOMS, CODE, GENERATORS, SHARED, attributes, children
from irl_gym.copies.replacing import held_by
from irl_gym.copies.shared_memory import extent, holds_memory, overlap, shared
from irl_gym.errors import NotCopied


def check_apart(made: list[gym.Env], copied: list[gym.Env], memo: dict[int, Any], cells: Iterable[Any]) -> None:
    """Check that copies of layers do not lead to what was copied, and that all memory that is shared was copied together.

    Args:
        made: copies of layers.
        copied: the layers.
        memo: of `copy.deepcopy`: the id of what was copied -> the copy.
        cells: of functions that were made anew.

    Raises:
        NotCopied: an attribute does; it is named.
    """
    anew = {id(cell) for cell in cells}
    for name, one in _reached(made):
        if id(one) in anew or (memo.get(id(one), one) is not one and not isinstance(one, _FIXED)):
            raise _leads_back(name, one)
    memories = []
    for name, one in _reached(copied):
        if type(one) in weakref.ProxyTypes:
            raise _leads_back(name, one)
        if holds_memory(type(one)):
            memories.append((name, one))
    for where, apart in (pair for pair in memories if id(pair[1]) not in memo):
        for name, one in memories:
            if one is not apart and overlap(extent(one), extent(apart)):
                raise shared(one, apart, f" in {name}", f" in {where}")


def held_outside(layers: list[gym.Env]) -> list[tuple[str, Any]]:
    """Class attributes and globals that methods name, but for `__init__`, and of which the layers hold a part: names, values.

    A deep copy of `self.board = BOARD` parts the two. So they are not copied, and have to stay as they are.
    """
    found = {}
    for kind in dict.fromkeys(kind for layer in layers for kind in type(layer).__mro__):
        methods = [getattr(one, "__func__", one) for name, one in vars(kind).items() if name != "__init__"]
        names = {name for one in methods if isinstance(one, types.FunctionType) for name in one.__code__.co_names}
        for where, values in ((kind.__module__, vars(sys.modules.get(kind.__module__, kind))), (kind.__name__, vars(kind))):
            for name in names & values.keys():
                found |= dict.fromkeys(map(id, inside(values[name])), (f"{where}.{name}", values[name]))
    parts = [found[id(one)] for _, one in _reached(layers) if id(one) in found] if found else []
    return list({id(value): (name, value) for name, value in parts}.values())


def inside(value: Any) -> list[Any]:
    """A value and the objects inside it that can be changed."""
    waiting, seen = [value], {id(value): value}
    while waiting:
        for part in children(waiting.pop()):
            if type(part) not in ATOMS and id(part) not in seen:
                seen[id(part)] = part
                waiting.append(part)
    return [one for one in seen.values() if type(one) not in ATOMS and not isinstance(one, _OWN)]


def _leads_back(name: str, one: Any) -> NotCopied:
    return NotCopied(
        f"{name} leads to a {type(one).__name__} of the environment that it was copied from, as through a function's "
        "variable or a weak reference, which copies share: expected all that changes in attributes alone. Make the "
        "function a method that uses `self`; or give the environment get_state() and set_state(state)."
    )


def _reached(layers: list[gym.Env]) -> Iterator[tuple[str, Any]]:
    """Every object that layers hold, but code and what describes them, and the attribute that leads there."""
    seen = {id(layer) for layer in layers}
    waiting = [
        (f"{type(layer).__name__}.{name}", value)
        for layer in layers
        for name, value in attributes(layer).items()
        if name not in SHARED
    ]
    while waiting:
        name, one = waiting.pop()
        if type(one) not in ATOMS and id(one) not in seen:
            seen.add(id(one))
            yield name, one
            waiting += [(name, part) for part in _referents(one)]


_FIXED = (*CODE, tuple, frozenset, np.generic, np.dtype, types.CodeType)
_DESCRIBED = (property, staticmethod, classmethod, types.MethodType, types.BuiltinMethodType)
_OWN = (*_FIXED, *_DESCRIBED, gym.Space, gym.Env, *GENERATORS, enum.Enum)
"""What is code, has no contents that change, or is looked after elsewhere."""


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
