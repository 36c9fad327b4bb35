"""Long walks through an environment whose table is complete, looking for a step that the table does not have.

The search compares an observation in a few inner states, and all of these lie near the start. An environment that counts its
steps to 50 and then ends is not found out by that: so walks of many steps are made, and each step is compared with the lines of
the table. Every other walk avoids what can end it, as far as the table knows. A step that is not in the table leads to the
proof: the state is tried in the inner state of that moment. Where resets are counted, what they draw has no list, and a number
that is drawn there may decide all that follows: then many walks are made, each from a reset of its own.
"""

import math
import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from irl_gym.tables.copies.snapshots import ConstantChanged
from irl_gym.tables.enumeration.explorer import Explorer
from irl_gym.tables.enumeration.outside import OutsideRandomness

STEPS = 2_000
"""Of all walks together."""
LONGEST = 1_000
"""Steps of one walk."""
SECONDS = 2.0
SHARE = 0.1
"""Walks take no more than so many seconds, or this share of the time that the search took, whichever is more."""
WALKS = 500
"""Walks at most, where they are short."""
RESETS, SHORT = 100, 200
"""Walks at least where resets are counted, whatever they take, and steps of one of them after STEPS."""


@dataclass(frozen=True)
class Step:
    """A step of a walk, and what came before it."""

    number: int
    """The state it was made in."""
    way: list[int]
    """The actions up to there."""
    possible: bool
    """Is it in the table?"""
    inner: Any
    """The inner state in which it was made, where that was asked for."""


def walk_on(explorer: Explorer, seconds: float) -> None:
    """Compare random walks with what an explorer has found.

    Args:
        explorer: a search that is complete.
        seconds: that it took.

    Raises:
        HiddenState: a step that the table does not have, made by an observation that hides something.
    """
    latest = time.monotonic() + max(SECONDS, SHARE * seconds)
    left, trials = STEPS, explorer.trials
    least = RESETS if explorer.explored.starts_counted else 0
    for walk in range(WALKS):
        seed = [explorer.limits.seed, walk, len(explorer.explored.keys)]

        most = min(left, LONGEST) if left > 0 and time.monotonic() < latest else SHORT

        def run(seed: list[int] = seed, most: int = most) -> tuple[int, Step | None]:
            steps = 0
            for step in _steps(explorer, seed, None):
                steps += 1
                if not step.possible:
                    return steps, step
                if steps >= most or (steps >= SHORT and time.monotonic() > latest):
                    break
            return steps, None

        truncated = trials.truncated
        steps, contradiction = trials.walked(seed, run)
        explorer.explored.counted["truncated"] += trials.truncated - truncated
        if contradiction is not None:
            _prove(explorer, seed, contradiction)
        left -= max(steps, 1)
        explorer.explored.resets = walk + 1 if least else 0
        if walk + 1 >= least and (left <= 0 or time.monotonic() > latest):
            return


def _steps(explorer: Explorer, seed: list[int], keep: int | None) -> Iterator[Step]:
    """A walk from a reset to its end, or to an observation that the table does not begin with."""
    explored, trials = explorer.explored, explorer.trials
    rng = np.random.default_rng(seed)
    number, way = explored.ids.get(explorer.key(trials.reset()()[0])), []
    careful = seed[1] % 2 == 1
    while number is not None:
        lines = explored.lines_of(number)
        safe = sorted(set(range(explorer.n_actions)) - {line[0] for line in lines if line[1] < 0}) if careful else []
        action = int(rng.choice(safe)) if safe else int(rng.integers(explorer.n_actions))
        inner = trials.snapshots.take() if keep == len(way) else None
        observation, reward, ended, truncated = trials.move(action)
        key = explorer.key(observation)
        known = explored.ends.get(key) if ended else explored.ids.get(key)
        successor = None if known is None else -1 - known if ended else known
        sure = number * explorer.n_actions + action not in explored.sampled
        possible = not sure or any(_is(line, action, successor, reward) for line in lines)
        yield Step(number, list(way) if not possible else way, possible, inner)
        way.append(action)
        number = None if ended or truncated else known


def _is(line: tuple[int, int, float, float], action: int, successor: int | None, reward: float) -> bool:
    return line[0] == action and line[1] == successor and math.isclose(line[3], reward, rel_tol=1e-6, abs_tol=1e-9)


def _prove(explorer: Explorer, seed: list[int], contradiction: Step) -> None:
    """Raise what explains the contradiction."""
    trials, at = explorer.trials, len(contradiction.way)
    changed = trials.snapshots.changed_constants()
    if changed:
        raise ConstantChanged(changed[0])

    def run() -> Step | None:
        for i, step in enumerate(_steps(explorer, seed, at)):
            if i == at:
                return step
        return None

    step = trials.seeded(seed, run)
    if step is None or step.possible or step.number != contradiction.number:
        raise OutsideRandomness  # the same seeds gave another walk
    if explorer.tell_apart(step.number, step.inner, lambda: contradiction.way, []):
        raise OutsideRandomness  # the inner state does what the table says: something else made the difference
