"""Snapshots: the inner state of any Gymnasium environment, taken and restored fast and exactly.

What an environment is between two steps is what its layers hold: the attributes of the unwrapped environment and of each
wrapper. A snapshot is one pickle of them all, so that what two attributes share stays shared. Not in it, but referred to:
layers, spaces, code (functions, classes), random generators (their stand-ins, once `Snapshots` is made), and `constants`:
large parts (a published table, a map) that a walk of random steps left alone. They are guarded: `check`, asked after every
step since one may change back what another changed, notices one with something else in its place or inside. The bytes never
leave the process.

What functions close over, and classes and modules share with attributes, is in no state either, and refused when it changes.
Not seen: other state in class attributes and modules. An object that says itself how it is pickled is restored as it says.
"""

import copy
import dataclasses
import types
import weakref
from collections.abc import Iterable, Iterator
from typing import Any

import gymnasium as gym

from irl_gym.errors import InvalidParameter, NotCopied, NotEnumerable, NotTabular
from irl_gym.tables.copies.apart import held_outside, joined, leads_back
from irl_gym.tables.copies.calls import called
from irl_gym.tables.copies.constants import Constant, Held, Home, found_in, unchanging
from irl_gym.tables.copies.contents import objects_in
from irl_gym.tables.copies.layer_state import LayerState
from irl_gym.tables.copies.object_graphs import (
    ABSENT,
    CODE,
    REFUSALS,
    Difference,
    Pairs,
    Twin,
    attributes,
    put,
    reached,
)
from irl_gym.tables.copies.own_dictionaries import rejoin
from irl_gym.tables.copies.references import References, twins
from irl_gym.tables.copies.replacing import held_by, replace_generators
from irl_gym.tables.copies.shared_memory import alive, copied, extent, mapped, of_a_file, overlap
from irl_gym.tables.copies.stripped import awaken_generators, duplicate, layers


class ConstantChanged(Exception):
    """A signal to the caller, no error of the user's: a constant is none. `include` it and start again."""

    def __init__(self, name: str):
        super().__init__(name)
        self.name = name


class Snapshots:
    """Inner states of one environment.

    A state is bytes, or where something inside refuses to be pickled a deep copy; it never changes, and the same snapshot
    can be restored any number of times. Reset the environment without a seed from here on: a seed makes a new generator.

    Args:
        env: the caller's own copy (from `without_watchers`), already reset once; its generators are replaced here.
        twin: maps a random generator to its driven stand-in, any other object to None.

    Raises:
        NotTabular: an attribute cannot be copied, or the environment raises an error or makes new generators while it runs.
    """

    def __init__(self, env: gym.Env, twin: Twin):
        self._layers = layers(env)
        awaken_generators(env)
        rehearsal = duplicate(env)
        self._own: Any = env.unwrapped if rehearsal is None else None  # speaks for itself, by get_state and set_state
        homes = [] if rehearsal is None else unchanging(rehearsal)
        self._stand_ins = replace_generators(env, twin)
        self._references = References(twin, (*CODE, gym.Space))
        self._guard = References(twin, (*CODE, gym.Space))
        for one in [] if rehearsal is None else joined(self._layers):
            self._guard.join(type(one))
            self._references.join(type(one))
        self._refuses_pickle = False
        self._places = [LayerState(layer) for layer in self._layers if layer is not self._own]
        self._refer_to_parts(self._guard)
        self._refer_to_parts(self._references)
        self._constants = [*found_in(self._places, homes, self._guard)]
        self._constants += self._uncopied()
        self._held_outside: dict[int, Held] = {}
        self._begin()

    def take(self) -> Any:
        """The state now.

        Raises:
            ConstantChanged: something else is in the place of a constant, or shares its memory: `include` it, and start again.
            NotTabular: the environment made a new generator, or holds what cannot be copied.
            NotCopied: it holds memory of a file.
        """
        again: dict[int, Any] = {}
        for one in self._constants:
            now = one.now()
            if now is not one.value:
                again |= self._again(one, now)
        with self._references.standing_for(again):
            state, memories = self._taken()
            if self._hold():
                state, memories = self._taken()
        for memory in memories:
            if mapped(memory):
                raise of_a_file(memory)
            at = extent(memory)
            for one in self._constants:
                if any(overlap(at, other) for other in one.extents):
                    raise ConstantChanged(one.home.name)
        return state

    def check(self) -> None:
        """Do the constants hold what they held?

        Raises:
            ConstantChanged: one does not: `include` it, and start again.
            NotTabular: what a function, a class or a module holds does not.
        """
        for one in self._constants:
            if not one.unchanged():
                raise ConstantChanged(one.home.name)
        for one in self._held_outside.values():
            one.check()

    def _hold(self) -> bool:
        """Refer to what functions hold that were met for the first time: no state holds it. Were there any?"""
        found, self._references.functions = self._references.functions, []
        for function in found:
            names = ", ".join(function.__code__.co_freevars) or "its defaults"
            what = f"what the function {function.__qualname__} holds ({names})"
            self._held_outside[id(function)] = Held(what, function, self._guard)
            self._references.refer_inside([*held_by(function)])
        return bool(found)

    def _again(self, one: Constant, now: Any) -> dict[int, Any]:
        """What a constant that was built anew with the same contents stands for, part by part."""
        found = twins(now, one.value, self._references.joined) if one.unchanged() else None
        if found is None:
            raise ConstantChanged(one.home.name)
        return found

    def _taken(self) -> tuple[Any, list[Any]]:
        """The state, and what holds memory in it."""
        held = [place.read() for place in self._places]
        if self._own is not None:
            held.append({"state": called(self._own.get_state)})
        if not self._refuses_pickle:
            try:
                return self._references.dumps(held), self._references.memories
            except (NotTabular, NotEnumerable):  # a uniform number that is kept is none to be copied
                raise
            except REFUSALS:
                self._refuses_pickle = True
        inside = {id(one): one for one in objects_in(held, self._references)}
        for one in inside.values():
            if isinstance(one, types.FunctionType):
                self._references.meet(one)
            elif isinstance(one, weakref.ref) and id(one()) in inside and one() is not None:
                raise leads_back("a state", one())
        return self._copied(held)

    def restore(self, state: Any) -> None:
        """Make the environment what it was when this state was taken."""
        held = self._held(state)
        for place, values in zip(self._places, held, strict=False):
            place.write(values)
        if self._own is not None:
            called(lambda: self._own.set_state(held[-1]["state"]))

    def same(self, a: Any, b: Any) -> bool:
        """The same inner state? Equal bytes are; else the contents decide: orders in a set, or shared strings, do not count."""
        return a is b or (isinstance(a, bytes) and a == b) or next(self._unlike(a, b), None) is None

    def differences(self, a: Any, b: Any) -> list[Difference]:
        """What differs between two states, in words `step_count: 3 against 7`, the first state's value first."""
        return list(self._unlike(a, b))

    def crossed(self, a: Any, b: Any, part: Difference) -> Any | None:
        """The first state with one part of the second; None where it cannot be put there."""
        first, second = self._held(a), self._held(b)
        try:
            put(first, part.steps, reached(second, part.steps))
            return self._references.dumps(first) if isinstance(a, bytes) else self._copied(first)[0]
        except (LookupError, NotEnumerable, NotTabular, *REFUSALS):
            return None

    def changed_constants(self) -> list[str]:
        """The constants that are none, since contents changed. `include` them, in snapshots of a fresh copy."""
        return [one.home.name for one in self._constants if not one.outlasted()]

    def include(self, names: Iterable[str]) -> None:
        """Put attributes, or constants inside them, into the state from now on: earlier states do not hold them.

        Raises:
            InvalidParameter: a name that no layer holds.
        """
        known = {place.prefix + name for place in self._places for name in attributes(place.layer)}
        asked = frozenset(names)
        for name in asked:
            if name not in known and not name.startswith(tuple(f"{one}{mark}" for one in known for mark in "[.")):
                raise InvalidParameter(f"name={name!r} is no attribute: expected one of {', '.join(sorted(known))}.")
        self._constants = [one for one in self._constants if not one.of(asked)]
        self._begin()

    def _begin(self) -> None:
        """Refer to what is not in the state: also to each object inside a constant, which an attribute may share."""
        self._references.forget()
        self._refer_to_parts(self._references)
        for constant in self._constants:
            self._references.refer_inside(constant.value)
        for name, value in held_outside(self._layers):
            self._held_outside[id(value)] = Held(name, value, self._guard)
            self._references.refer_inside(value)

    def _refer_to_parts(self, references: References) -> None:
        for one in [*self._layers, *self._stand_ins]:
            references.refer(one)

    def _uncopied(self) -> Iterator[Constant]:
        """Attributes that can neither be pickled nor copied: they stay, whatever they are."""
        for i, place in enumerate(self._places):
            for name, value in place.read().items():
                if not self._can_be_copied(value):
                    yield Constant(Home(i, place.prefix + name, ((False, name),)), place, self._guard)

    def _can_be_copied(self, value: Any) -> bool:
        try:
            self._guard.dumps(value)
        except NotTabular:
            raise
        except REFUSALS:
            try:
                self._copied(value)
            except NotTabular:
                return False
        return True

    def _copied(self, held: Any) -> tuple["_Copy", list[Any]]:
        """A deep copy as a state, and what holds memory in it."""
        try:
            made, memories, memo = copied(lambda memo: copy.deepcopy(held, memo), self._references.memo())
            rejoin((one for one in alive(memo) if type(one) in self._references.joined), memo)
        except NotCopied:
            raise
        except REFUSALS as error:
            if self._own is not None:
                return _Copy(held), []  # a handle of the environment's own, which only set_state understands
            raise NotTabular(
                f"the inner state can neither be pickled nor copied ({error}): expected attributes that copy.deepcopy copies. "
                "Make it in __init__ or reset, and give the environment get_state() and set_state(state)."
            ) from error
        return _Copy(made), memories

    def _held(self, state: Any) -> list[dict[str, Any]]:
        """What a state holds, as new objects."""
        return called(lambda: self._references.loads(state)) if isinstance(state, bytes) else self._copied(state.held)[0].held

    def _unlike(self, a: Any, b: Any) -> Iterator[Difference]:
        first, second = (self._references.loads(one) if isinstance(one, bytes) else one.held for one in (a, b))
        pairs = Pairs()
        prefixes = [*(place.prefix for place in self._places), ""]
        for i, (prefix, x, y) in enumerate(zip(prefixes, first, second, strict=False)):
            for name in dict.fromkeys([*x, *y]):
                steps = ((True, i), (True, name))
                yield from pairs.unlike(prefix + name, x.get(name, ABSENT), y.get(name, ABSENT), steps)


@dataclasses.dataclass(frozen=True, eq=False)
class _Copy:
    """A state that could not be pickled."""

    held: Any
