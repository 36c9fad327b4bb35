"""What never changes in an environment: large parts that its inner state refers to and does not hold.

A part is an attribute, or what an attribute holds (`world['map']`, `track.rows`): a map of thousands of cells beside the path
that grows. It is a constant if its contents outlast a walk of random steps; a reset may build it anew. That walk is no proof,
so constants are guarded: after every step what stands in their places, and their contents, are compared with what they were.
"""

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import gymnasium as gym

from irl_gym.errors import NotEnumerable, NotTabular
from irl_gym.tables.copies.calls import called, seeded_globals, stepped
from irl_gym.tables.copies.contents import Contents
from irl_gym.tables.copies.layer_state import LayerState
from irl_gym.tables.copies.object_graphs import ABSENT, ATOMS, CODE, GENERATORS, REFUSALS, Steps, attributes, reached
from irl_gym.tables.copies.references import References, anew
from irl_gym.tables.copies.replacing import replace_generators
from irl_gym.tables.copies.shared_memory import Extent, extent
from irl_gym.tables.copies.stripped import layers

LARGE = 1024
"""Bytes of a pickle above which a part that does not change is held to be constant."""
REHEARSAL = 300
"""Random steps, on a copy, that a constant must outlast."""
DEEPEST, FEW = 3, 64
"""So deep inside an attribute constants are looked for, in what holds no more than so many parts."""


@dataclass(frozen=True)
class Home:
    """Where a part is found."""

    layer: int
    """Of the chain, the outermost first."""
    name: str
    """As a person writes it, such as `FrameStack.world['map']`."""
    steps: Steps
    """From the layer to the part."""


class Constant:
    """A part that is held to be constant.

    Args:
        home: its place.
        state: of its layer.
        references: pickle it, and what stands in its place.
    """

    def __init__(self, home: Home, state: LayerState, references: References):
        self.home, self._state, self._references = home, state, references
        self.value = self.now()
        self.extents: list[Extent] = []
        """The memory of its arrays, and of those of what stands in its place now."""
        self._seen: list[tuple[Any, Contents]] = []
        self.digest = self._read(self.value)
        """Of its contents; None where it has no pickle, and is guarded by being the same object alone."""

    def now(self) -> Any:
        """What stands in its place."""
        return reached(self._state.layer, self.home.steps)

    def unchanged(self) -> bool:
        """Does it, and what stands in its place, hold what it held? Fast where nothing was put in the place of anything."""
        now = self.now()
        if self.digest is None:
            return now is self.value
        seen = all([contents.unchanged() for _, contents in self._seen])
        return (seen and any(now is one for one, _ in self._seen)) or self._same(now)

    def outlasted(self) -> bool:
        """The same, by its pickle, which also tells 1 from True."""
        return self._same(self.now()) if self.digest is not None else self.unchanged()

    def _same(self, now: Any) -> bool:
        self.extents, self._seen = [], []
        return all([self._read(one) == self.digest for one in {id(one): one for one in (self.value, now)}.values()])

    def _read(self, one: Any) -> str | None:
        """What contents are known by, which are looked at from now on."""
        try:
            data = self._references.dumps(one)
        except (*REFUSALS, NotTabular, NotEnumerable):
            return None
        self.extents += [extent(memory) for memory in self._references.memories]
        self._seen.append((one, Contents(one, self._references)))
        return hashlib.sha256(data).hexdigest()

    def of(self, names: frozenset[str]) -> bool:
        """Is it named here, or part of what is?"""
        return any(self.home.name == name or self.home.name.startswith((f"{name}[", f"{name}.")) for name in names)


class Held:
    """What a function, a class or a module holds, and no state does: it has to stay as it is."""

    def __init__(self, what: str, value: Any, references: References):
        self._what, self._contents = what, Contents(value, references)

    def check(self) -> None:
        """Raises NotTabular: it has changed."""
        if not self._contents.unchanged():
            raise NotTabular(
                f"a step or reset changes {self._what}, which all copies share: expected all that changes in attributes. Keep "
                "it in one that __init__ or reset makes; make a function that needs it a method that uses `self`."
            )


def unchanging(rehearsal: gym.Env) -> list[Home]:
    """The large parts whose contents resets and random steps leave alone, found on a copy that is thrown away.

    Raises:
        NotTabular: it raises an error, or a generator turns up that was not there after the reset with a seed.
    """
    chain = layers(rehearsal)
    states = [LayerState(layer) for layer in chain]
    references = References(lambda _: None, (*CODE, gym.Space, *GENERATORS))
    for layer in chain:
        references.refer(layer)

    def large() -> dict[Home, str]:
        return dict(found for i, state in enumerate(states) for found in _large(i, state, references))

    constants = large()
    with seeded_globals([0]):
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
    found = dict(constants.items() & large().items())
    within = {(home.layer, home.steps) for home in found}
    return [home for home in found if not any((home.layer, home.steps[:k]) in within for k in range(1, len(home.steps)))]


def found_in(states: list[LayerState], homes: list[Home], references: References) -> Iterator[Constant]:
    """The constants of an environment at these homes, each object once."""
    met: set[int] = set()
    for home in homes:
        value = reached(states[home.layer].layer, home.steps)
        if value is not ABSENT and id(value) not in met:
            met.add(id(value))
            yield Constant(home, states[home.layer], references)


def _large(layer: int, state: LayerState, references: References) -> Iterator[tuple[Home, str]]:
    """The large parts of a layer, and the digests of their contents."""
    waiting = [(Home(layer, state.prefix + name, ((False, name),)), value) for name, value in state.read().items()]
    seen: set[int] = set()
    while waiting:
        home, value = waiting.pop()
        if type(value) in ATOMS or id(value) in seen:
            continue
        seen.add(id(value))
        try:
            data = references.dumps(value)
        except REFUSALS:  # not large but strange: Snapshots tries such an attribute itself
            data = b""
        if data and len(data) <= LARGE:
            continue
        if data:
            yield home, hashlib.sha256(data).hexdigest()
        if len(home.steps) < DEEPEST:
            waiting += [(Home(layer, home.name + said, (*home.steps, step)), part) for said, step, part in _parts(value)]


def _parts(holder: Any) -> Iterator[tuple[str, tuple[bool, Any], Any]]:
    """What an object holds: how it is written, the step that leads there, the part."""
    if isinstance(holder, dict | list | tuple) and len(holder) <= FEW:
        for key, part in holder.items() if isinstance(holder, dict) else enumerate(holder):
            if type(key) in ATOMS:
                yield f"[{key!r}]", (True, key), part
    for name, part in attributes(holder).items():
        yield f".{name}", (False, name), part


def _generators(env: gym.Env) -> list[Any]:
    return replace_generators(env, lambda one: one if isinstance(one, GENERATORS) else None)
