"""Randomness that is not driven: generators that an environment draws from and does not hold.

Enumeration drives the generators that an environment holds in its attributes, and where it draws from those of the modules
random and numpy.random, their functions too (`driven_modules`). Draws from elsewhere are none of its outcomes, so no table is
exact where they occur, whether or not they have mattered yet. Watched are

    random, numpy.random    the generators that Python and NumPy share
    of the classes          generators that are attributes of the environment's classes and wrappers, names of the modules that
                            define them, or variables that their methods close over

A clock, the system's entropy or a generator elsewhere leaves no mark: it is found where the same draws give another outcome.
"""

import random
import sys
from collections.abc import Callable, Iterator
from ctypes import string_at
from typing import Any

import gymnasium as gym
import numpy as np

from irl_gym.tables.copies.object_graphs import GENERATORS
from irl_gym.tables.copies.stripped import layers

UNSEEN = "a clock, or a generator that nothing of the environment's holds"
PYTHONS, NUMPYS = "the module random", "the module numpy.random"
SUSPECTS, RARELY = 20, 100
"""Times that is looked at who draws from it, which is slow; of later times, each hundredth."""
WORDS = 4 * 625
"""Bytes of a Mersenne Twister: its words, and the place among them."""


class OutsideRandomness(Exception):
    """Internal: something is random that is not driven; its arguments name what."""

    def __init__(self, *names: str):
        self.names = names or (UNSEEN,)
        self.what = " and ".join(sorted(self.names))
        super().__init__(self.what)

    @property
    def of_modules(self) -> bool:
        """Are all of them the generators of modules, whose functions can be driven?"""
        return {*self.names} <= {PYTHONS, NUMPYS}


class Watch:
    """The generators that an environment can draw from and that are not driven.

    Args:
        env: the environment.
    """

    def __init__(self, env: gym.Env):
        self._held = dict(_held(env))
        self._names = (PYTHONS, NUMPYS, *self._held)
        self._suspects = 0
        self.begin()

    def begin(self) -> None:
        """Forget what has been drawn so far."""
        self._mark = self._now()

    def look(self, again: Callable[[], Any]) -> None:
        """Has one of them been drawn from since the last look?

        Args:
            again: makes once more what was done since then. Python's `random` is drawn from by beartype too, where annotations
                are checked while the environment runs: so who draws is looked at.

        Raises:
            OutsideRandomness: the environment has.
        """
        before, self._mark = self._mark, self._now()
        moved = {name for name, old, new in zip(self._names, before, self._mark, strict=True) if old != new}
        if PYTHONS in moved:
            self._suspects += 1
            rarely = self._suspects > SUSPECTS and self._suspects % RARELY
            if rarely or not _draws(again):
                moved.remove(PYTHONS)
            self.begin()
        if moved:
            raise OutsideRandomness(*moved)

    def _now(self) -> tuple[Any, ...]:
        return (*shared_mark(), *map(_state, self._held.values()))


def _draws(run: Callable[[], Any]) -> bool:
    """Does a call draw from Python's shared generator, but for beartype's choice of an item to check?"""
    shared, seen = getattr(random.random, "__self__", None), []

    def look(frame: Any, event: str, function: Any) -> None:
        if event == "c_call" and getattr(function, "__self__", None) is shared:
            seen.append(not frame.f_code.co_filename.startswith("<@beartype"))

    before = sys.getprofile()
    sys.setprofile(look)
    try:
        run()
    finally:
        sys.setprofile(before)
    return any(seen)


def _held(env: gym.Env) -> Iterator[tuple[str, Any]]:
    """Names and generators of the classes of an environment and its wrappers."""
    for kind in dict.fromkeys(kind for layer in layers(env) for kind in type(layer).__mro__):
        module = sys.modules.get(kind.__module__)
        for name, value in (*vars(kind).items(), *(vars(module).items() if module is not None else ())):
            if isinstance(value, GENERATORS):
                yield f"{kind.__module__}.{name}" if name not in vars(kind) else f"{kind.__name__}.{name}", value
        for method in vars(kind).values():
            function = getattr(method, "fget", None) or getattr(method, "__func__", method)
            cells = zip(getattr(getattr(function, "__code__", None), "co_freevars", ()), _cells(function), strict=False)
            yield from ((f"{kind.__name__}'s {name}", value) for name, value in cells if isinstance(value, GENERATORS))


def _cells(function: Any) -> Iterator[Any]:
    for cell in getattr(function, "__closure__", None) or ():
        try:
            yield cell.cell_contents
        except ValueError:  # not assigned yet
            yield None


def _state(generator: Any) -> str:
    """What a draw from a generator changes."""
    if isinstance(generator, random.Random):
        return "" if isinstance(generator, random.SystemRandom) else str(generator.getstate())
    if isinstance(generator, np.random.Generator):
        return repr(generator.bit_generator.state)
    return repr(generator.get_state() if isinstance(generator, np.random.RandomState) else generator.state)


def shared_mark() -> tuple[Any, Any]:
    """What a draw from the generators of `random` and of `numpy.random` changes, read fast: once for each state of a search.

    The second of two normal numbers of `np.random.randn` comes from a store and changes nothing here.
    """
    _, plain, stored = random.getstate()
    module: Any = np.random  # whose stubs lack it
    shared = module.get_bit_generator()
    if type(shared) is np.random.MT19937:
        return (plain[0], plain[-1], stored), string_at(shared.ctypes.state_address, WORDS)
    return (plain[0], plain[-1], stored), repr(shared.state)
