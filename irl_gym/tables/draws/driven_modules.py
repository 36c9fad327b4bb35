"""The functions of the modules `random` and `numpy.random`, driven for a while.

They are methods of one generator each, that all of a process shares and no environment holds. An environment that calls them
by their modules, `np.random.rand()`, is answered by a stand-in while it runs, as its own generators are. What was imported by
name, `from random import choice`, is out of reach. Only the thread that drives is answered so; another that wants to drive
waits for it.
"""

import random
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np

ALIASES = {"ranf": "random_sample", "sample": "random_sample", "seed": "seed"}
"""Functions of numpy.random that are no methods, and the methods that they call."""
_ONE_AT_A_TIME = threading.RLock()
"""All threads share the modules: who drives them has what it put there until it is done."""


class DrivenModules:
    """What stands in the place of the modules' functions.

    Args:
        stand_ins: of the generators that the modules share, by their classes.
    """

    def __init__(self, stand_ins: Mapping[type, Any]):
        self._thread: int | None = None
        self._functions: list[tuple[Any, str, Callable[..., Any]]] = []
        with _ONE_AT_A_TIME:
            self._find(stand_ins)

    def _find(self, stand_ins: Mapping[type, Any]) -> None:
        numpys: Any = np.random
        for module, base, shared in (
            (random, random.Random, getattr(random.random, "__self__", None)),
            (numpys, np.random.RandomState, getattr(numpys.rand, "__self__", None)),
        ):
            for name, real in list(vars(module).items()):
                method = ALIASES.get(name, name) if module is numpys else name
                if getattr(real, "__self__", None) is shared or (module is numpys and name in ALIASES):
                    ours = getattr(stand_ins[base], method, None)
                    if callable(real) and ours is not None:
                        self._functions.append((module, name, self._chosen(real, ours)))

    def _chosen(self, real: Callable[..., Any], ours: Callable[..., Any]) -> Callable[..., Any]:
        def function(*args: Any, **kwargs: Any) -> Any:
            return (ours if threading.get_ident() == self._thread else real)(*args, **kwargs)

        return function

    @contextmanager
    def driven(self) -> Iterator[None]:
        """Have the stand-ins answer. What stood there before stands there again afterwards, whatever is raised."""
        with _ONE_AT_A_TIME:
            stood = [(module, name, getattr(module, name)) for module, name, _ in self._functions]
            before, self._thread = self._thread, threading.get_ident()
            try:
                for module, name, ours in self._functions:
                    setattr(module, name, ours)
                yield
            finally:
                self._thread = before  # also for what was imported by name meanwhile, and is kept
                for module, name, one in stood:
                    setattr(module, name, one)
