"""What never changes in an environment: large parts that its inner state refers to and does not hold.

A part is an attribute, or what an attribute holds (`world['map']`, `track.rows`): a map of thousands of cells beside the path
that grows. It is a constant if its contents outlast a walk of random steps; a reset may build it anew. That walk is no proof,
so constants are guarded: a snapshot looks at what stands in their places, and from time to time their contents are compared
with what they were.
"""

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import gymnasium as gym

from irl_gym.copies.calls import called, seeded_globals, stepped
from irl_gym.copies.layer_state import LayerState
from irl_gym.copies.object_graphs import ABSENT, ATOMS, CODE, REFUSALS, References, Steps, anew, attributes, reached
from irl_gym.copies.stripped import GENERATORS, layers, replace_generators
from irl_gym.errors import NotEnumerable, NotTabular

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


@dataclass(frozen=True, eq=False)
class Constant:
    """A part that is held to be constant."""

    home: Home
    state: LayerState
    """Of its layer."""
    value: Any
    digest: str | None
    """Of its contents; None where it has no pickle, and is guarded by being the same object alone."""
    size: int = 0
    """Bytes of its pickle."""

    def now(self) -> Any:
        """What stands in its place."""
        return reached(self.state.layer, self.home.steps)

    def of(self, names: frozenset[str]) -> bool:
        """Is it named here, or part of what is?"""
        return any(self.home.name == name or self.home.name.startswith((f"{name}[", f"{name}.")) for name in names)


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
        one = Constant(home, states[home.layer], None, None)
        value = one.now()
        if value is not ABSENT and id(value) not in met:
            met.add(id(value))
            yield Constant(home, states[home.layer], value, *_known(value, references))


def digest_of(value: Any, references: References) -> str | None:
    """What the contents of a value are known by; None where it has no pickle."""
    return _known(value, references)[0]


def _known(value: Any, references: References) -> tuple[str | None, int]:
    """The digest of a value's contents and the bytes of its pickle; None and 0 where it has none."""
    try:
        data = references.dumps(value)
    except (*REFUSALS, NotTabular, NotEnumerable):
        return None, 0
    return hashlib.sha256(data).hexdigest(), len(data)


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
