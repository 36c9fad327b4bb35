"""Others in the places of random generators and of functions, wherever an environment holds them.

A deep copy takes functions as they are: `self.moves = {0: lambda: self.go(0)}` of a copy moves the original. So a function that
closes over what was copied, or over a space made of it, or has it as default, is made anew over the copy.
"""

import copy
import sys
import types
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import suppress
from dis import get_instructions
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces

from irl_gym.tables.copies.object_graphs import ATOMS, CODE, GENERATORS, SHARED, Twin, attributes


def replace_generators(env: gym.Env, twin: Twin) -> list[Any]:
    """Put a stand-in in the place of every random generator that can be reached from the environment's attributes.

    Attributes of each layer, of nested objects and of spaces are searched, through dicts, lists, tuples, sets, deques and
    arrays of objects; a bound method of a generator (`self.draw = rng.random`) becomes that of its stand-in. Generators
    that only a closure, a class attribute or a module holds are not seen.

    Args:
        env: the caller's own copy; it is changed.
        twin: maps a generator to its stand-in, any other object to None; asked once for each generator.

    Returns:
        The stand-ins, one a generator.
    """
    search = _Replacing(twin)
    search.value(env)
    while search.waiting:
        search.inside(search.waiting.pop())
    return list(search.stand_ins.values())


class _Replacing:
    """A walk over everything that an environment holds; `value` says what belongs in a place, `inside` puts it there."""

    def __init__(self, twin: Twin):
        self.twin = twin
        self.stand_ins: dict[int, Any] = {}
        self.originals: list[Any] = []  # kept alive, so that no other object takes the id of a replaced generator
        self.seen: set[int] = set()
        self.waiting: list[Any] = []

    def value(self, value: Any) -> Any:
        if type(value) in ATOMS:
            return value
        if id(value) in self.stand_ins:
            return self.stand_ins[id(value)]
        if isinstance(value, CODE):
            return self.code(value)
        if isinstance(value, tuple | frozenset):
            return self._rebuilt(value)
        if isinstance(value, types.BuiltinMethodType | types.MethodType):
            owner = self.value(value.__self__)
            if isinstance(value, types.MethodType) and (function := self.value(value.__func__)) is not value.__func__:
                return types.MethodType(function, owner)
            return value if owner is value.__self__ else getattr(owner, value.__name__)
        if id(value) in self.seen:
            return value
        stand_in = None if isinstance(value, dict | list | set | deque) else self.twin(value)
        if stand_in is not None:
            self.originals.append(value)
            self.stand_ins[id(value)] = stand_in
            self.seen.add(id(stand_in))
            return stand_in
        self.seen.add(id(value))
        self.originals.append(value)
        self.waiting.append(value)
        return value

    def code(self, value: Any) -> Any:
        return value

    def _rebuilt(self, value: Any) -> Any:
        parts = [part if type(part) in ATOMS else self.value(part) for part in value]
        if all(new is old for new, old in zip(parts, value, strict=True)):
            return value
        kind: Any = type(value)
        return kind(*parts) if hasattr(kind, "_fields") else kind(parts)

    def inside(self, holder: Any) -> None:
        if isinstance(holder, dict | list | deque):
            for key, old in list(holder.items() if isinstance(holder, dict) else enumerate(holder)):
                if type(old) not in ATOMS and (new := self.value(old)) is not old:
                    holder[key] = new
        elif isinstance(holder, set):
            new = {self.value(part) for part in holder}
            if new != holder:
                holder.clear()
                holder.update(new)
        elif isinstance(holder, np.ndarray) and holder.dtype == object:
            for place in np.ndindex(holder.shape):
                holder[place] = self.value(holder[place])
        for name, old in attributes(holder).items():
            if not (isinstance(holder, gym.Env) and name in SHARED) and (new := self.value(old)) is not old:
                object.__setattr__(holder, name, new)


def renew_functions(env: gym.Env, copies: dict[int, Any]) -> list[Any]:
    """Put functions of the copies in the place of those that hold what was copied: a layer, a table that is an attribute too.

    Args:
        env: the caller's own copy; it is changed.
        copies: the id of each object that was copied -> its copy: the memo of `copy.deepcopy`.

    Returns:
        The cells of functions that were made anew, which no other function may share.
    """
    search = _Renewing(copies)
    search.value(env)
    while search.waiting:
        search.inside(search.waiting.pop())
    return [old for old, _ in search.cells.values()]


def held_by(code: Any) -> Iterator[Any]:
    """What a function closes over, its defaults and what is set on it; or what a method is bound to, and of which function."""
    if isinstance(code, types.MethodType):
        yield from (code.__self__, code.__func__)
    elif isinstance(code, types.FunctionType) and not _of_a_module(code):
        for cell in code.__closure__ or ():
            with suppress(ValueError):  # not assigned yet
                yield cell.cell_contents
        yield from (*(code.__defaults__ or ()), *(code.__kwdefaults__ or {}).values(), *code.__dict__.values())


def changeable(function: types.FunctionType, known: Callable[[Any], bool]) -> bool:
    """Does a function hold what may change: variables that it sets, or objects that are neither code nor known?"""
    waiting: list[Any] = [function]
    seen = {id(function)}
    while waiting:
        one = waiting.pop()
        if (
            isinstance(one, types.FunctionType)
            and not _of_a_module(one)
            and any(step.opname == "STORE_DEREF" for step in get_instructions(one.__code__))
        ):
            return True
        for part in held_by(one):
            if isinstance(part, types.FunctionType | types.MethodType):
                if id(part) not in seen:
                    seen.add(id(part))
                    waiting.append(part)
            elif not (type(part) in ATOMS or isinstance(part, (*CODE, *GENERATORS)) or known(part)):
                return True
    return False


def _of_a_module(function: types.FunctionType) -> bool:
    """Is it found by its name? Then it is code, whatever a decorator keeps in it."""
    found: Any = sys.modules.get(function.__module__)
    for name in function.__qualname__.split("."):
        found = getattr(found, name, None)
    return found is function


class _Renewing(_Replacing):
    def __init__(self, copies: dict[int, Any]):
        super().__init__(lambda _: None)
        self.copies = copies
        self.cells: dict[int, tuple[Any, Any]] = {}

    def code(self, value: Any) -> Any:
        if not isinstance(value, types.FunctionType) or not self._holds_copied(value, set()):
            return value
        cells = tuple(self.cells.setdefault(id(old), (old, types.CellType()))[1] for old in value.__closure__ or ())
        made = types.FunctionType(value.__code__, value.__globals__, value.__name__, None, cells)
        self.stand_ins[id(value)] = made
        self.originals.append(value)
        for name in ("__module__", "__qualname__", "__doc__"):
            setattr(made, name, getattr(value, name))
        for old, new in zip(value.__closure__ or (), cells, strict=True):
            with suppress(ValueError):
                new.cell_contents = self._swapped(old.cell_contents)
        if value.__defaults__:
            made.__defaults__ = tuple(map(self._swapped, value.__defaults__))
        if value.__kwdefaults__:
            made.__kwdefaults__ = {name: self._swapped(one) for name, one in value.__kwdefaults__.items()}
        made.__dict__.update({name: self._swapped(one) for name, one in value.__dict__.items()})
        return made

    def _holds_copied(self, value: Any, seen: set[int]) -> bool:
        if self.copies.get(id(value), value) is not value:
            return True
        if id(value) in seen:
            return False
        seen.add(id(value))
        parts = value.spaces if isinstance(value, spaces.Tuple) else [*value.values()] if isinstance(value, spaces.Dict) else ()
        return any(self._holds_copied(one, seen) for one in (*parts, *held_by(value)))

    def _swapped(self, value: Any) -> Any:
        if isinstance(value, types.MethodType):
            return types.MethodType(self.value(value.__func__), self._swapped(value.__self__))
        if isinstance(value, spaces.Dict | spaces.Tuple) and self._holds_copied(value, set()):
            return copy.deepcopy(value, self.copies)
        return self.value(value) if isinstance(value, types.FunctionType) else self.copies.get(id(value), value)
