"""Snapshots: the inner state of any Gymnasium environment, taken and restored fast and exactly.

What an environment is between two steps is what its layers hold: the attributes of the unwrapped environment and of each
wrapper. A snapshot is one pickle of them all, so that what two attributes share stays shared. Not in it, but referred to:
layers, spaces, code (functions, classes), random generators (their stand-ins, once `Snapshots` is made), and constants:
large attributes (a published table, a map) that a walk of random steps left alone. Constants are guarded: `take` notices
one that is bound anew, `changed_constants` one that was changed inside. The bytes never leave the process.

Not seen: state in class attributes, modules and closures; that two arrays are views of one memory. An object that says
itself how it is pickled (`__getstate__`, `__reduce__`) is restored as it says.
"""

import copy
import dataclasses
import hashlib
import random
from collections.abc import Iterable, Iterator
from typing import Any

import gymnasium as gym
import numpy as np

from irl_gym.copies.calls import called, stepped
from irl_gym.copies.object_graphs import ABSENT, ATOMS, CODE, REFUSALS, Pairs, References, Twin, anew, attributes, slots
from irl_gym.copies.stripped import SHARED, awaken_generators, duplicate, layers, replace_generators
from irl_gym.errors import InvalidParameter, NotEnumerable, NotTabular

SPACES = frozenset({"observation_space", "action_space", "_observation_space", "_action_space"})
LEFT_OUT = SHARED | SPACES | {"env", "render_mode", "_np_random_seed"}
GENERATORS = (np.random.Generator, np.random.RandomState, np.random.BitGenerator, random.Random)
LARGE = 1024
"""Bytes of a pickle above which an attribute that does not change is held to be constant."""
REHEARSAL = 300
"""Random steps, on a copy, that a constant must survive unchanged."""


class ConstantChanged(Exception):
    """A signal to the caller, no error of the user's: a constant is bound to another object. `include` it and start again."""

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
        unchanging = set() if rehearsal is None else _unchanging(rehearsal)
        self._stand_ins = replace_generators(env, twin)
        self._references = References(twin, (*CODE, gym.Space))
        self._guard = References(twin, (*CODE, gym.Space))
        self._refuses_pickle = False
        self._places = [_Place(layer) for layer in self._layers if layer is not self._own]
        self._refer_to_parts(self._guard)
        self._refer_to_parts(self._references)
        self._constants = [constant for place in self._places for constant in self._found(place, unchanging)]
        self._begin()

    def take(self) -> Any:
        """The state now.

        Raises:
            ConstantChanged: a constant is bound to another object: `include` it, and start again.
            NotTabular: the environment made a new generator, or holds what cannot be copied.
        """
        for one in self._constants:
            if one.place.layer.__dict__.get(one.name) is not one.value:
                raise ConstantChanged(one.called)
        held = [place.read() for place in self._places]
        if self._own is not None:
            held.append({"state": called(self._own.get_state)})
        if not self._refuses_pickle:
            try:
                return self._references.dumps(held)
            except (NotTabular, NotEnumerable):  # a uniform number that is kept is none to be copied
                raise
            except REFUSALS:
                self._refuses_pickle = True
        return self._copied(held)

    def restore(self, state: Any) -> None:
        """Make the environment what it was when this state was taken."""
        held = called(lambda: self._references.loads(state)) if isinstance(state, bytes) else self._copied(state.held).held
        for place, values in zip(self._places, held, strict=False):
            place.write(values)
        if self._own is not None:
            called(lambda: self._own.set_state(held[-1]["state"]))

    def same(self, a: Any, b: Any) -> bool:
        """The same inner state? Equal bytes are; else the contents decide: orders in a set, or shared strings, do not count."""
        return a is b or (isinstance(a, bytes) and a == b) or next(self._unlike(a, b), None) is None

    def differences(self, a: Any, b: Any) -> list[str]:
        """What differs between two states, for a person: `["step_count: 3 against 7"]`, the first state's value first."""
        return list(self._unlike(a, b))

    def changed_constants(self) -> list[str]:
        """The constants that are none: their object or its contents changed. `include` them, in snapshots of a fresh copy."""
        return [
            one.called
            for one in self._constants
            if one.place.layer.__dict__.get(one.name) is not one.value or self._digest(one.value) != one.digest
        ]

    def include(self, names: Iterable[str]) -> None:
        """Put these attributes into the state from now on: earlier states do not hold them, so forget those.

        Raises:
            InvalidParameter: a name that no layer holds.
        """
        known = {place.prefix + name: (place, name) for place in self._places for name in attributes(place.layer)}
        for asked in names:
            if asked not in known:
                raise InvalidParameter(f"name={asked!r} is no attribute: expected one of {', '.join(sorted(known))}.")
            place, name = known[asked]
            place.left_out.discard(name)
            self._constants = [one for one in self._constants if one.called != asked]
        self._begin()

    def _begin(self) -> None:
        """Refer to what is not in the state: also to each object inside a constant, which an attribute may share."""
        self._references.forget()
        self._refer_to_parts(self._references)
        for constant in self._constants:
            constant.place.left_out.add(constant.name)
            self._references.refer_inside(constant.value)

    def _refer_to_parts(self, references: References) -> None:
        for one in [*self._layers, *self._stand_ins]:
            references.refer(one)

    def _found(self, place: "_Place", unchanging: set[str]) -> Iterator["_Constant"]:
        for name, value in place.read().items():
            if place.prefix + name in unchanging or not self._can_be_copied(value):
                yield _Constant(place, name, value, self._digest(value))

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

    def _digest(self, value: Any) -> str | None:
        try:
            return hashlib.sha256(self._guard.dumps(value)).hexdigest()
        except (*REFUSALS, NotTabular, NotEnumerable):  # no pickle, no digest: such a constant is guarded by identity alone
            return None

    def _copied(self, held: Any) -> "_Copy":
        memo = {id(one): one for one in self._references.objects}
        try:
            return _Copy(copy.deepcopy(held, memo))
        except REFUSALS as error:
            if self._own is not None:
                return _Copy(held)  # a handle of the environment's own, which only set_state understands
            raise NotTabular(
                f"the inner state can neither be pickled nor copied ({error}): expected attributes that copy.deepcopy copies. "
                "Give the environment get_state() and set_state(state)."
            ) from error

    def _unlike(self, a: Any, b: Any) -> Iterator[str]:
        first, second = (self._references.loads(one) if isinstance(one, bytes) else one.held for one in (a, b))
        pairs = Pairs()
        prefixes = [*(place.prefix for place in self._places), ""]
        for prefix, x, y in zip(prefixes, first, second, strict=False):
            for name in dict.fromkeys([*x, *y]):
                yield from pairs.unlike(prefix + name, x.get(name, ABSENT), y.get(name, ABSENT))


class _Place:
    """One layer, as the attributes that belong to its state."""

    def __init__(self, layer: gym.Env):
        self.layer = layer
        self.prefix = f"{type(layer).__name__}." if isinstance(layer, gym.Wrapper) else ""
        self.left_out = set(LEFT_OUT)
        self.slots = [name for name in slots(type(layer)) if name not in LEFT_OUT]

    def read(self) -> dict[str, Any]:
        left_out = self.left_out
        values = {name: value for name, value in self.layer.__dict__.items() if name not in left_out}
        for name in self.slots:
            if hasattr(self.layer, name):
                values[name] = getattr(self.layer, name)
        return values

    def write(self, values: dict[str, Any]) -> None:
        own, left_out = self.layer.__dict__, self.left_out
        for name in [name for name in own if name not in values and name not in left_out]:
            del own[name]
        for name in self.slots:
            if name in values:
                setattr(self.layer, name, values.pop(name))
            elif hasattr(self.layer, name):
                delattr(self.layer, name)
        own.update(values)


@dataclasses.dataclass(frozen=True, eq=False)
class _Constant:
    place: _Place
    name: str
    value: Any
    digest: str | None

    @property
    def called(self) -> str:
        return self.place.prefix + self.name


@dataclasses.dataclass(frozen=True, eq=False)
class _Copy:
    """A state that could not be pickled."""

    held: Any


def _unchanging(rehearsal: gym.Env) -> set[str]:
    """The large attributes that resets and random steps leave alone, found on a copy that is thrown away.

    Raises:
        NotTabular: it raises an error, or a generator turns up that was not there after the reset with a seed.
    """
    places = [_Place(layer) for layer in layers(rehearsal)]
    references = References(lambda _: None, (*CODE, gym.Space, *GENERATORS))
    for place in places:
        references.refer(place.layer)

    def large() -> dict[str, tuple[int, str]]:
        return {name: digest for place in places for name, digest in _large(place, references)}

    constants = large()
    called(lambda: rehearsal.reset(seed=0))
    rehearsal.action_space.seed(0)
    known = _generators(rehearsal)
    for step in range(REHEARSAL):
        if step % 50 == 0:
            constants = dict(constants.items() & large().items())
        _, _, terminated, truncated = stepped(rehearsal, rehearsal.action_space.sample())
        if terminated or truncated:
            called(rehearsal.reset)
    new = [one for one in _generators(rehearsal) if not any(one is old for old in known)]
    if new:
        raise anew(new[0])
    return set(dict(constants.items() & large().items()))


def _large(place: _Place, references: References) -> Iterator[tuple[str, tuple[int, str]]]:
    for name, value in place.read().items():
        if type(value) in ATOMS:
            continue
        try:
            data = references.dumps(value)
        except REFUSALS:  # not large but strange: Snapshots tries such an attribute itself
            continue
        if len(data) > LARGE:
            yield place.prefix + name, (id(value), hashlib.sha256(data).hexdigest())


def _generators(env: gym.Env) -> list[Any]:
    return replace_generators(env, lambda one: one if isinstance(one, GENERATORS) else None)
