"""Does an object still hold what it held? Asked after every step, so it has to be fast.

A pickle would answer, and takes long. Here every object inside that can be changed is looked at beside a list of what it held:
where nothing was put in the place of anything, the elements are the same objects, which Python sees by their addresses. What
else is found is a change for whoever asks to look into: the new part may have the same contents.
"""

import array
import copyreg
import enum
import marshal
import types
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import Any

import gymnasium as gym
import numpy as np

from irl_gym.errors import NotEnumerable, NotTabular
from irl_gym.tables.copies.object_graphs import ATOMS, GENERATORS, REFUSALS, attributes, children, slots
from irl_gym.tables.copies.references import References
from irl_gym.tables.copies.replacing import held_by

Look = Callable[[Any], Any]
_NUMBERS = (np.number, np.bool_, np.character, np.datetime64)  # a row of a structured array can be written to
_LEAVES = (*GENERATORS, gym.Space, type, types.ModuleType, np.ufunc, *_NUMBERS, np.dtype, enum.Enum, range)
_MARSHALLED = frozenset({dict, list, tuple, set, frozenset})
MANY = 300
"""Containers inside above which plain ones are compared by what `marshal` writes of all of them, which is faster then."""
_CONTAINERS = (np.ndarray, np.void, bytearray, array.array, dict, list, deque, set, tuple, frozenset, types.FunctionType)


class Contents:
    """What a value held.

    Args:
        value: any object.
        references: have pickled it, and know what it refers to and does not hold.
    """

    def __init__(self, value: Any, references: References):
        objects = [*objects_in(value, references)]
        if len(objects) > MANY and all(type(one) in _MARSHALLED for one in objects):
            with suppress(ValueError):  # something else is in it, or it holds itself
                self._held: list[Any] = [(_marshalled, value, _marshalled(value))]
                return
        self._held = [(look, one, look(one)) for one in objects for look in _looks(one, references)]

    def unchanged(self) -> bool:
        """Does it hold the same now? False also where that cannot be compared."""
        try:
            return all([look(one) == held for look, one, held in self._held])
        except Exception:  # whatever a comparison of somebody else's objects raises
            return False


def objects_in(value: Any, references: References) -> Iterator[Any]:
    """A value and every object inside it, but for what is referred to."""
    waiting, seen = [value], {id(value)}
    while waiting:
        one = waiting.pop()
        yield one
        for part in () if _opaque(one) else (*children(one), *held_by(one)):
            if not (type(part) in ATOMS or isinstance(part, _LEAVES) or id(part) in seen or references.knows(part)):
                seen.add(id(part))
                waiting.append(part)


def _looks(one: Any, references: References) -> Iterator[Look]:
    """How an object's own contents are read, without what is inside its parts."""
    kind = type(one)
    if isinstance(one, types.FunctionType):
        yield _held
        return
    if isinstance(one, np.ndarray):
        yield from (_form, _elements if one.dtype == object else np.ndarray.tobytes)
    elif isinstance(one, bytearray | array.array):
        yield bytes
    elif isinstance(one, np.void):
        yield np.void.tobytes
    elif isinstance(one, dict):
        yield from (list, _values)
    elif isinstance(one, list | deque):
        yield list
    elif isinstance(one, set):
        yield set
    elif _opaque(one):
        yield lambda one: _told(one, references)
        return
    if slots(kind):
        yield attributes
    elif hasattr(one, "__dict__"):
        yield _own


def _opaque(one: Any) -> bool:
    """Is it an object that says itself how it is pickled, so that its attributes need not be all that it holds?"""
    if isinstance(one, _CONTAINERS):
        return False
    kind = type(one)
    own = any(getattr(kind, name) is not getattr(object, name) for name in ("__reduce_ex__", "__reduce__", "__getstate__"))
    return own or kind in copyreg.dispatch_table


def _marshalled(one: Any) -> bytes:
    return marshal.dumps(one, 2)  # the last version that does not depend on who else refers to a part


def _told(one: Any, references: References) -> bytes | None:
    try:
        return references.dumps(one)
    except (*REFUSALS, NotTabular, NotEnumerable):  # a lock, a window: nothing shows what is in it
        return None


def _held(one: types.FunctionType) -> list[Any]:
    return [*held_by(one)]


def _form(one: np.ndarray) -> tuple[Any, ...]:
    return one.shape, one.strides, one.dtype


def _elements(one: np.ndarray) -> list[Any]:
    return [*one.flat]


def _values(one: dict[Any, Any]) -> list[Any]:
    return [*one.values()]


def _own(one: Any) -> dict[str, Any]:
    return {**one.__dict__}
