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

from irl_gym.errors import NotCopied, a_type
from irl_gym.tables.copies.object_graphs import ATOMS, CODE, GENERATORS, SHARED, attributes, children
from irl_gym.tables.copies.own_dictionaries import rejoinable
from irl_gym.tables.copies.replacing import held_by
from irl_gym.tables.copies.shared_memory import extent, holds_memory, mapped, of_a_file, overlap, shared


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
            raise leads_back(name, one)
    memories = []
    for name, one in _reached(copied):
        if type(one) in weakref.ProxyTypes or isinstance(one, _attaching()):
            raise leads_back(name, one)
        if mapped(one):
            raise of_a_file(one, name)
        if holds_memory(type(one)):
            memories.append((name, one))
    for where, apart in (pair for pair in memories if id(pair[1]) not in memo):
        for name, one in memories:
            if one is not apart and overlap(extent(one), extent(apart)):
                raise shared(one, apart, f" in {name}", f" in {where}")


def joined(layers: list[gym.Env]) -> list[Any]:
    """The objects of which something else that layers hold holds the `__dict__` too.

    Raises:
        NotCopied: copies of one could not be joined so: a layer, one of two with the same, one that says how it is copied.
    """
    dictionaries = set[int]()
    owners: dict[int, tuple[str, Any]] = {id(vars(layer)): ("", layer) for layer in layers}
    for name, one in _reached(layers):
        if isinstance(one, dict):
            dictionaries.add(id(one))
        if (own := _own_dictionary(one)) is not None and owners.setdefault(id(own), (name, one))[1] is not one:
            raise _two_ways(name, one)
    found = [owners[twice] for twice in owners.keys() & dictionaries]
    for name, one in found:
        if not rejoinable(type(one)):
            raise _two_ways(name, one)
    return [one for _, one in found]


def held_outside(layers: list[gym.Env]) -> list[tuple[str, Any]]:
    """Class attributes and globals that code of the layers names, and of which they hold a part: names, values.

    A deep copy of `self.board = BOARD` parts the two. So they are not copied, and have to stay as they are. The code is that of
    methods, but for `__init__`, of functions that the layers hold, and of functions of their modules that these name.
    """
    reached = [*_reached(layers)]
    kinds = dict.fromkeys(kind for layer in layers for kind in type(layer).__mro__)
    methods = [
        one for kind in kinds for name, method in vars(kind).items() if name != "__init__" for one in _functions_in(method)
    ]
    functions = _with_named([*methods, *(one for _, one in reached if isinstance(one, types.FunctionType))])
    spoken = {name for names in functions.values() for name in names}
    places = [(one.__module__, one.__globals__, names) for one, names in functions.items()]
    places += [(kind.__name__, vars(kind), spoken) for kind in kinds]
    found: dict[int, tuple[str, Any]] = {}
    for where, values, names in places:
        for name in names & values.keys():
            if id(values[name]) not in found:
                found |= dict.fromkeys(map(id, inside(values[name])), (f"{where}.{name}", values[name]))
    parts = [found[id(one)] for _, one in reached if id(one) in found] if found else []
    return list({id(value): (name, value) for name, value in parts}.values())


def _functions_in(method: Any) -> Iterator[types.FunctionType]:
    """The functions of an attribute of a class: itself, or what a property or a static method is made of."""
    for one in (method, *(getattr(method, name, None) for name in ("__func__", "fget", "fset", "func"))):
        if isinstance(one, types.FunctionType):
            yield one


def _with_named(functions: Iterable[types.FunctionType]) -> dict[types.FunctionType, set[str]]:
    """Functions, and those of their own modules that they name, with the names in the code of each."""
    found: dict[types.FunctionType, set[str]] = {}
    waiting = list(functions)
    while waiting:
        one = waiting.pop()
        if one not in found:
            found[one] = _names(one.__code__)
            named = (one.__globals__.get(name) for name in found[one])
            waiting += [
                other for other in named if isinstance(other, types.FunctionType) and other.__module__ == one.__module__
            ]
    return found


def _names(code: types.CodeType) -> set[str]:
    """The names in code and in the functions that it makes."""
    return {*code.co_names}.union(*(_names(one) for one in code.co_consts if isinstance(one, types.CodeType)))


def inside(value: Any) -> list[Any]:
    """A value and the objects inside it that can be changed."""
    waiting, seen = [value], {id(value): value}
    while waiting:
        for part in children(waiting.pop()):
            if type(part) not in ATOMS and id(part) not in seen:
                seen[id(part)] = part
                waiting.append(part)
    return [one for one in seen.values() if type(one) not in ATOMS and not isinstance(one, _OWN)]


def leads_back(name: str, one: Any) -> NotCopied:
    """The error for what leads to an original from a copy, and the attribute by which it does."""
    return NotCopied(
        f"{name} leads to {a_type(one)} of the environment that it was copied from, as through a function's "
        "variable or a weak reference, which copies share: expected all that changes in attributes alone. Make the "
        "function a method that uses `self`; or give the environment get_state() and set_state(state)."
    )


def _two_ways(name: str, one: Any) -> NotCopied:
    return NotCopied(
        f"{name or type(one).__name__} leads to {a_type(one)} whose __dict__ is held in another way too, by which its "
        "attributes could change, and in copies could not: expected that it alone holds it. Hold the object, and write "
        "vars(...) of it where that is needed; give a dictionary a __getattr__ in the place of `self.__dict__ = self`; or "
        "give the environment get_state() and set_state(state)."
    )


def _attaching() -> tuple[type, ...]:
    """Types whose copies are of the same memory."""
    module: Any = sys.modules.get("multiprocessing.shared_memory")  # whoever holds one has imported it
    return (module.SharedMemory,) if module is not None else ()


def _own_dictionary(one: Any) -> Any:
    """The `__dict__` of an object that has one of its own; None of code, and where there is none."""
    return vars(one) if type(one).__dictoffset__ and not isinstance(one, (*CODE, *_DESCRIBED)) else None


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
    own = _own_dictionary(one)
    return (
        gc.get_referents(one) if own is None else [*(part for part in gc.get_referents(one) if part is not own), *own.values()]
    )
