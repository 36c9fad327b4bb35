"""Steps and resets of an environment from a given inner state, in every outcome of their draws.

Draws are enumerated where they can be, and probabilities are exact; else the call is run many times, each with a seed of its
own, and counted. Both are the same again whenever they are made again, by their *script*.
"""

from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from itertools import islice
from typing import Any, TypeVar

import gymnasium as gym
import numpy as np

from irl_gym.errors import NotEnumerable
from irl_gym.tables.copies.calls import called, seeded_globals, stepped
from irl_gym.tables.copies.snapshots import Snapshots
from irl_gym.tables.draws.exact_draws import Draws
from irl_gym.tables.enumeration.explored import ScriptKey
from irl_gym.tables.enumeration.limits import Limits
from irl_gym.tables.enumeration.outside import OutsideRandomness, Watch

REPLAYED = 50
"""Each so many calls, one outcome is made twice: a difference comes from outside the environment's generators."""
MADE_AGAIN = 500
"""Outcomes of a call that are made again to see who draws from a generator that is shared."""
PULSE = 256
"""Runs of a call between two looks at the clock."""
MOST_REFUSALS = 5
"""Calls whose outcomes were too many to enumerate, after which all random calls are counted."""
ROUNDING = 1e-12

Result = tuple[Any, float, bool]
"""Observation, reward, terminated."""
Call = Callable[[], Result]
T = TypeVar("T")


@dataclass(frozen=True)
class CallOutcome:
    """One outcome of a call, and what was made of it while the environment was in it."""

    probability: float
    script: ScriptKey
    result: Result
    made: Any


@dataclass(frozen=True)
class Outcomes:
    """All outcomes of a call."""

    all: list[CallOutcome]
    runs: int
    """Runs that were counted; 0 where the outcomes were enumerated."""


class Trials:
    """Calls of one environment.

    Args:
        env: the caller's own copy, reset once.
        limits: outcomes and runs.
        always: names of attributes that belong to the inner state however large they are.
        counting: count every random call, since draws do not tell all.
        modules: drive the functions of the modules random and numpy.random too.
    """

    def __init__(self, env: gym.Env, limits: Limits, always: frozenset[str], counting: bool, modules: bool = False):
        space: Any = env.action_space
        self.env, self.limits, self.counting = env, limits, counting
        self.first_action = int(space.start)
        self.draws = Draws(limits.most_outcomes, modules=modules)
        self.snapshots = Snapshots(env, self.draws.twin)
        self.snapshots.include(always)
        self.fresh = self.snapshots.take()
        self.refusals = 0
        """Calls so far that could not be enumerated."""
        self.truncated = 0
        """Steps so far that the environment itself truncated."""
        self.pulse: Callable[[], None] = lambda: None
        """Called now and then while a call is run many times; it may raise."""
        self._calls, self._watch = 0, Watch(env)

    def reset(self) -> Call:
        """A reset, as a call."""

        def run() -> Result:
            self.snapshots.restore(self.fresh)
            observation = called(self.env.reset)[0]
            self.snapshots.check()
            return observation, 0.0, False

        return run

    def step(self, state: Any, action: int) -> Call:
        """A step from an inner state, as a call; actions count from 0."""

        def run() -> Result:
            self.snapshots.restore(state)
            observation, reward, terminated, _ = self.move(action)
            return observation, reward, terminated

        return run

    def move(self, action: int) -> tuple[Any, float, bool, bool]:
        """A step from where the environment is: observation, reward, terminated, truncated; actions count from 0."""
        moved = stepped(self.env, action + self.first_action)
        self.snapshots.check()
        self.truncated += moved[3]
        return moved

    def outcomes(self, call: Call, row: int, make: Callable[[Result], Any], *, runs: int) -> Outcomes:
        """Every outcome of a call; `make` is called while the environment is in it.

        Raises:
            OutsideRandomness: the same draws did not give the same.
            NotTabular: the environment raised an error.
        """
        self._calls += 1
        if not self.counting:
            checked = self._calls <= 2 * REPLAYED or self._calls % REPLAYED == 0
            try:
                found = self._enumerated(call, make)
                if found is not None:
                    if checked:
                        self._check(found[-1], call)
                    return Outcomes(found, 0)
            except NotEnumerable:
                self.refusals += 1
        found = []
        for i in range(runs):
            if i % PULSE == PULSE - 1:
                self.pulse()
            result = self.again(call, row, (-1, i))
            found.append(CallOutcome(1 / runs, (-1, i), result, make(result)))
        return Outcomes(found, runs)

    def look(self, *calls: Call) -> None:
        """Have the calls made since the last look drawn from outside the environment? Where all is counted they may.

        Raises:
            OutsideRandomness: they have.
        """
        if not self.counting:
            self._watch.look(lambda: [self._made_again(call) for call in calls])

    def _made_again(self, call: Call) -> None:
        """Once more the first outcomes of a call: enough to see who draws, where a reset has a hundred thousand."""
        with suppress(NotEnumerable):  # it is counted
            deque(islice(self.draws.outcomes(call), MADE_AGAIN), maxlen=0)

    def again(self, call: Call, row: int, script: ScriptKey) -> Result:
        """The outcome of a script."""
        if script[:1] != (-1,):
            return self.draws.replay(script, call)
        seed = [self.limits.seed, row + 1, script[1]]
        if not self.counting:
            return self.draws.seeded(seed, call)
        return self.seeded(seed, call)

    def seeded(self, seed: list[int], run: Callable[[], T]) -> T:
        """Run with real random numbers, also of the generators that NumPy and Python share."""
        with seeded_globals(seed):
            return self.draws.seeded(seed, run)

    def walked(self, seed: list[int], run: Callable[[], T]) -> T:
        """The same, and looked at.

        Raises:
            OutsideRandomness: it drew from generators that are not the environment's own.
        """
        with seeded_globals(seed):
            self._watch.begin()
            result = self.draws.seeded(seed, run)
            self._watch.look(lambda: self.draws.seeded(seed, run))
        self._watch.begin()
        return result

    def _enumerated(self, call: Call, make: Callable[[Result], Any]) -> list[CallOutcome] | None:
        """All outcomes; None for a random call after others had too many."""
        found = []
        for probability, script, result in self.draws.outcomes(call):
            found.append(CallOutcome(probability, script, result, make(result)))
            if len(found) % PULSE == 0:
                self.pulse()
            if self.refusals >= MOST_REFUSALS and probability < 1:
                return None
        return found

    def _check(self, last: CallOutcome, call: Call) -> None:
        before, paid, ended = last.result
        observation, reward, terminated = self.again(call, 0, last.script)
        if not _same(observation, before) or terminated != ended or abs(reward - paid) > ROUNDING:
            self.look(call)  # which knows its name
            raise OutsideRandomness


def _same(a: Any, b: Any) -> bool:
    """Are two observations the same?"""
    if isinstance(a, dict):
        return a.keys() == b.keys() and all(_same(part, b[name]) for name, part in a.items())
    if isinstance(a, tuple):
        return len(a) == len(b) and all(map(_same, a, b))
    return np.array_equal(np.asarray(a), np.asarray(b))
