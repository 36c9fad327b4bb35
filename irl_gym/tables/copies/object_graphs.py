"""Objects that hold objects, and comparisons that name what differs.

`Pairs` compares two values part by part, and gives the dotted name of each part that differs; two graphs are alike only if they
also share their parts alike.
"""

import copy
import enum
import functools
import pickle
import random
import types
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

Twin = Callable[[Any], Any | None]
Steps = tuple[tuple[bool, Any], ...]
"""From an object to a part of it: is it an item, or an attribute; its key or name."""
ATOMS = frozenset({int, float, bool, complex, str, bytes, type(None)})
SHARED = frozenset({"spec", "metadata", "_metadata", "_cached_spec", "_saved_kwargs"})
"""Attributes of a layer that describe it and never change: neither copied nor part of a state."""
CODE = (type, types.FunctionType, types.ModuleType, np.ufunc)
"""Code is no state: functions, classes and modules are shared, as copy.deepcopy shares them."""
GENERATORS = (np.random.Generator, np.random.RandomState, np.random.BitGenerator, random.Random)
REFUSALS = (TypeError, ValueError, AttributeError, RuntimeError, pickle.PicklingError, copy.Error)
"""What an object raises that will not be copied, pickled or compared. Anything else on that way is a bug of its class."""
SEQUENCES = (list, tuple, deque)
ABSENT = object()


def attributes(holder: Any) -> dict[str, Any]:
    """The attributes that an object itself holds, in `__dict__` and in `__slots__`."""
    own = dict(getattr(holder, "__dict__", ()))
    for name in slots(type(holder)):
        if hasattr(holder, name):
            own[name] = getattr(holder, name)
    return own


@functools.cache
def slots(kind: type) -> tuple[str, ...]:
    """The names of the `__slots__` of a class and its bases, as attributes are called."""
    names = []
    for base in kind.__mro__:
        own = base.__dict__.get("__slots__", ())
        for name in (own,) if isinstance(own, str) else own:
            private = name.startswith("__") and not name.endswith("__")
            names.append(f"_{base.__name__.lstrip('_')}{name}" if private else name)
    return tuple(name for name in names if name not in ("__dict__", "__weakref__"))


def children(holder: Any) -> Iterator[Any]:
    """The objects that an object holds: keys, values, elements and attributes. Code and atoms hold none."""
    if type(holder) in ATOMS or isinstance(holder, CODE):
        return
    if isinstance(holder, dict):
        yield from holder
        yield from holder.values()
    elif isinstance(holder, (*SEQUENCES, set, frozenset)):
        yield from holder
    elif isinstance(holder, np.ndarray) and holder.dtype == object:
        yield from holder.flat
    yield from attributes(holder).values()


@dataclass(frozen=True, eq=False)
class Difference:
    """A part that two graphs do not share."""

    name: str
    """As a person writes it: `grid.grid[14].is_open`."""
    steps: Steps
    """That lead there; to the array or tuple that it is in, whose parts cannot be set one by one."""
    first: Any
    """In one graph; ABSENT where it is not there."""
    second: Any
    """In the other."""
    more: int = 0
    """Other elements of the same array that differ."""
    said: str = ""
    """In the place of the two values."""

    def __str__(self) -> str:
        told = self.said or f"{shown(self.first)} against {shown(self.second)}"
        return f"{self.name}: {told}" + (f", and {self.more} more" if self.more else "")


class Pairs:
    """A comparison of two graphs of objects, that remembers which object stands for which."""

    def __init__(self):
        self._forth: dict[int, int] = {}
        self._back: dict[int, int] = {}

    def unlike(self, name: str, a: Any, b: Any, steps: Steps = ()) -> Iterator[Difference]:
        """What differs between a and b, part by part."""
        if a is b:
            return
        if type(a) is not type(b) or type(a) in ATOMS or isinstance(a, np.generic | enum.Enum):
            if type(a) is not type(b) or not (a == b or (a != a and b != b)):
                yield Difference(name, steps, a, b)
            return
        if not isinstance(a, tuple | frozenset):
            if id(a) in self._forth or id(b) in self._back:
                if self._forth.get(id(a)) != id(b) or self._back.get(id(b)) != id(a):
                    yield Difference(name, steps, a, b, said="the same object as another attribute's, in one state only")
                return
            self._forth[id(a)], self._back[id(b)] = id(b), id(a)
        yield from self._inside(name, a, b, steps)

    def _inside(self, name: str, a: Any, b: Any, steps: Steps) -> Iterator[Difference]:
        own, other = attributes(a), attributes(b)
        if isinstance(a, dict):
            for key in dict.fromkeys([*a, *b]):
                yield from self.unlike(f"{name}[{key!r}]", a.get(key, ABSENT), b.get(key, ABSENT), (*steps, (True, key)))
        elif isinstance(a, SEQUENCES) and len(a) == len(b):
            for place, (x, y) in enumerate(zip(a, b, strict=True)):
                within = steps if isinstance(a, tuple) else (*steps, (True, place))
                yield from self.unlike(f"{name}[{place}]", x, y, within)
        elif isinstance(a, np.ndarray):
            yield from self._arrays(name, a, b, steps)
        elif isinstance(a, (*SEQUENCES, set, frozenset)) or not (own or other):
            if not _equal(a, b):
                yield Difference(name, steps, a, b)
        for key in dict.fromkeys([*own, *other]):
            yield from self.unlike(f"{name}.{key}", own.get(key, ABSENT), other.get(key, ABSENT), (*steps, (False, key)))

    def _arrays(self, name: str, a: np.ndarray, b: np.ndarray, steps: Steps) -> Iterator[Difference]:
        if a.dtype != b.dtype or a.shape != b.shape:
            said = f"{a.dtype} of shape {a.shape} against {b.dtype} of shape {b.shape}"
            yield Difference(name, steps, a, b, said=said)
        elif a.dtype == object:
            for place, x in np.ndenumerate(a):
                yield from self.unlike(f"{name}[{', '.join(map(str, place))}]", x, b[place], steps)
        elif a.tobytes() != b.tobytes():
            bytewise = (np.frombuffer(one.tobytes(), np.uint8).reshape(*one.shape, one.itemsize) for one in (a, b))
            places = np.argwhere(np.not_equal(*bytewise).any(axis=-1))
            first = tuple(places[0].tolist())
            within = f"{name}[{', '.join(map(str, first))}]" if first else name
            yield Difference(within, steps, a[first], b[first], more=len(places) - 1)


def reached(value: Any, steps: Steps) -> Any:
    """What steps lead to; ABSENT where they lead nowhere."""
    for item, key in steps:
        try:
            value = value[key] if item else getattr(value, key)
        except (LookupError, AttributeError, TypeError):
            return ABSENT
    return value


def put(value: Any, steps: Steps, part: Any) -> None:
    """Put a part where steps lead, in place; ABSENT takes away what is there. Raises what an object raises that refuses it."""
    holder, (item, key) = reached(value, steps[:-1]), steps[-1]
    if part is ABSENT and item:
        del holder[key]
    elif part is ABSENT:
        delattr(holder, key)
    elif item:
        holder[key] = part
    else:
        setattr(holder, key, part)


def shown(value: Any) -> str:
    """A value as one short line of text."""
    if value is ABSENT:
        return "absent"
    text = " ".join(repr(value).split())
    return text if len(text) <= 60 else f"{text[:57]}..."


def _equal(a: Any, b: Any) -> bool:
    try:
        return bool(a == b) or pickle.dumps(a) == pickle.dumps(b)
    except REFUSALS:  # no comparison and no pickle: nothing shows that they are alike
        return False
