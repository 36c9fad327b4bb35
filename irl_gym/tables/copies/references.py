"""Pickles that refer to some objects by number.

A pickle of an environment's attributes would copy what must stay the very same object: the environment itself, its random
generators, its functions. `References` numbers those, and writes the number in the place of the object. Arrays that share
memory share it in what is loaded.
"""

import copyreg
import io
import pickle
import types
import weakref
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np

from irl_gym.errors import NotTabular
from irl_gym.tables.copies.object_graphs import ATOMS, Twin, children
from irl_gym.tables.copies.own_dictionaries import own, reduced
from irl_gym.tables.copies.replacing import changeable, held_by
from irl_gym.tables.copies.shared_memory import Sharing, blocks, holds_memory, written_as_another


def anew(generator: Any) -> NotTabular:
    """The error for a generator that nobody drives."""
    return NotTabular(
        f"the environment made a new {type(generator).__name__} while it ran, whose draws cannot be driven: expected the "
        "generators that it had after its first reset. Count what it does instead, with `irl_gym.tabulate(env, gamma=gamma, "
        "by=irl_gym.tables.counted.counting.Interaction())`; or, in the environment, make it in __init__, "
        "and anew in reset only for a seed."
    )


class References:
    """Pickles in which some objects are numbers: on loading, the very same objects come back.

    Args:
        twin: tells a generator, which has to be referred to before it is met, from any other object (None).
        kinds: types of objects that are referred to when they are met first.
    """

    def __init__(self, twin: Twin, kinds: tuple[type, ...]):
        self.objects: list[Any] = []  # only grows: earlier pickles still find what they refer to
        self._numbers: dict[int, int] = {}
        self._twin, self._kinds = twin, kinds
        self._plain: set[type] = set()
        self._holding: dict[type, bool] = {}
        self.memories: list[Any] = []
        """What held memory in the last value that was pickled, arrays above all; but for what is referred to."""

        methods = {**copyreg.dispatch_table, types.MethodType: lambda one: (types.MethodType, (one.__func__, one.__self__))}
        methods |= dict.fromkeys((np.void, np.record), lambda one: (np.ndarray.__getitem__, (np.array(one).copy(), ())))
        methods[weakref.ref] = self._weak
        parts = {"persistent_id": staticmethod(self._lookup()), "dispatch_table": methods}  # by name it may be another method
        self._methods = methods
        self.joined: set[type] = set()
        """Types of objects whose `__dict__` may be held in another way too."""

        self.functions: list[types.FunctionType] = []
        """Functions that were met and that hold objects, none of which is in a pickle."""

        self._pickler = type("Pickler", (pickle.Pickler,), parts)
        self._sharing = type("Sharing", (self._pickler,), {"reducer_override": lambda pickler, one: pickler.reduced(one)})
        self._unpickler = type("Unpickler", (pickle.Unpickler,), {"persistent_load": self.objects.__getitem__})

    def dumps(self, value: Any) -> bytes:
        """The pickle of a value. Raises what its objects raise, and NotTabular for a generator not referred to."""
        self.memories.clear()
        buffer = io.BytesIO()
        self._pickler(buffer, 5).dump(value)
        found = blocks(self.memories) if len(self.memories) > 1 else []
        if found:
            buffer = io.BytesIO()
            pickler: Any = self._sharing(buffer, 5)
            pickler.reduced = Sharing(found)
            pickler.dump(value)
        return buffer.getvalue()

    def loads(self, data: bytes) -> Any:
        """The value of a pickle made by `dumps`: new objects, but for those referred to."""
        return self._unpickler(io.BytesIO(data)).load()

    def refer(self, one: Any) -> int:
        """Number an object; pickles refer to it from now on."""
        self._numbers[id(one)] = len(self.objects)
        self.objects.append(one)
        return len(self.objects) - 1

    def join(self, kind: type) -> None:
        """Have what is loaded of objects of this type hold, as their `__dict__`, the very dictionary that others hold."""
        self.joined.add(kind)
        self._methods[kind] = reduced

    def meet(self, one: types.FunctionType) -> None:
        """Refer to a function, as if a pickle had met it."""
        if not self.knows(one):
            self._first_met(one, type(one))

    def knows(self, one: Any) -> bool:
        """Do pickles refer to an object?"""
        return id(one) in self._numbers

    def refer_inside(self, value: Any) -> None:
        """Number a value and every object inside it that could be changed or told apart."""
        waiting, seen = [value], {id(value)}
        while waiting:
            one = waiting.pop()
            if id(one) in self._numbers:
                continue
            if one is value or (type(one) not in ATOMS and not isinstance(one, tuple | frozenset | np.generic)):
                self.refer(one)
            for part in (*children(one), *held_by(one), *own(one, self.joined)):
                if type(part) not in ATOMS and id(part) not in seen:
                    seen.add(id(part))
                    waiting.append(part)

    @contextmanager
    def standing_for(self, known: Mapping[int, Any]) -> Iterator[None]:
        """For a while, refer to these objects, given by their ids, as to the known ones that they stand for."""
        added = {one: self._numbers[id(other)] for one, other in known.items() if id(other) in self._numbers}
        self._numbers.update(added)
        try:
            yield
        finally:
            for one in added:
                del self._numbers[one]

    def memo(self) -> dict[int, Any]:
        """For `copy.deepcopy`: what is referred to is not copied."""
        return {id(one): one for one in self.objects} | {one: self.objects[number] for one, number in self._numbers.items()}

    def forget(self) -> None:
        """Refer to nothing any more."""
        self._numbers.clear()

    def _lookup(self) -> Callable[[Any], int | None]:
        """The pickler asks this for every object that it writes: a closure, since it is the inner loop of a snapshot."""
        number_of, atoms, plain, met = self._numbers.get, ATOMS, self._plain, self._first_met

        def persistent_id(one: Any) -> int | None:
            kind = type(one)
            if kind in atoms:
                return None
            number = number_of(id(one))
            return number if number is not None or kind in plain else met(one, kind)

        return persistent_id

    def _weak(self, one: weakref.ref) -> tuple[Any, ...]:
        """How a weak reference to what is referred to, as to a layer, is written; no other can be."""
        held = one()
        if one.__callback__ is not None or held is None or not self.knows(held):
            raise TypeError("cannot pickle a weak reference to what is not referred to")
        return weakref.ref, (held,)

    def _first_met(self, one: Any, kind: type) -> int | None:
        if isinstance(one, types.BuiltinFunctionType):
            return self.refer(one) if isinstance(one.__self__, types.ModuleType | None) else None
        if isinstance(one, types.FunctionType):
            if changeable(one, self.knows):
                self.functions.append(one)
            return self.refer(one)
        if isinstance(one, self._kinds) or kind is object or (isinstance(one, np.dtype) and one.isbuiltin):
            return self.refer(one)
        if self._twin(one) is not None:
            raise anew(one)
        if kind not in self._holding:
            self._holding[kind] = holds_memory(kind) and not written_as_another(kind)
        if self._holding[kind]:
            self.memories.append(one)
        else:
            self._plain.add(kind)
        return None


def twins(one: Any, other: Any, joined: Collection[type]) -> dict[int, Any] | None:
    """The id of each object inside a value -> what is in its place inside another; None where that is built otherwise."""
    found, waiting = {id(one): other}, [(one, other)]
    while waiting:
        first, second = ([*children(value), *own(value, joined)] for value in waiting.pop())
        if len(first) != len(second):
            return None
        for a, b in zip(first, second, strict=True):
            if a is not b and type(a) not in ATOMS and id(a) not in found:
                found[id(a)] = b
                waiting.append((a, b))
    return found
