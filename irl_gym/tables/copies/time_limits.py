"""Wrappers that read a time limit inside them: none that a table can have.

A table has no time limit: copies are made without TimeLimit, so that a state is no state for every count of steps. A wrapper
around it that shows how much time is left, ends the episode where it is cut, or pays for it, then does something else. It is
found by its class, or by what it does: each wrapper is run with limits of a few steps, and without.
"""

import copy
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import gymnasium as gym
from gymnasium.wrappers import TimeAwareObservation, TimeLimit

from irl_gym.errors import EnvironmentFailed, NotTabular
from irl_gym.tables.copies.calls import called, seeded_globals, stepped
from irl_gym.tables.copies.object_graphs import Pairs
from irl_gym.tables.copies.stripped import layers, looked_through, without_watchers

SHORT, RESETS = (1, 2, 4), 3
"""Limits in steps that are tried, and episodes under each."""


def check_times(env: gym.Env) -> None:
    """Check that no wrapper shows how many steps of a time limit are taken.

    Raises:
        NotTabular: one does.
    """
    limit, wrappers = limited(env)
    for wrapper in wrappers:
        if isinstance(wrapper, TimeAwareObservation):
            raise _reads(wrapper, f"shows how many of the {limit} steps are taken that the TimeLimit inside it allows")


def check_limits(env: gym.Env) -> None:
    """Check that no wrapper does something else where a time limit inside it cuts an episode.

    Raises:
        NotTabular: one does; or the environment cannot be copied.
    """
    limit, wrappers = limited(env)
    for wrapper in wrappers:
        free = [_walked(without_watchers(wrapper)) for _ in range(2)]
        if _same(*free) and not _same(free[0], _walked(without_watchers(wrapper, limits=True))):
            raise _reads(wrapper, f"does something else where the TimeLimit inside it cuts an episode, after {limit} steps")


def limited(env: gym.Env) -> tuple[int, list[gym.Env]]:
    """The least time limit in an environment, and the wrappers around it that are part of what it does, the innermost first."""
    chain = layers(env)
    found = [i for i, layer in enumerate(chain) if isinstance(layer, TimeLimit)]
    if not found:
        return 0, []
    limit = min(int(getattr(chain[i], "_max_episode_steps")) for i in found)  # noqa: B009 (a private name of Gymnasium's)
    return limit, [layer for layer in chain[: found[-1]] if not looked_through(layer)][::-1]


def _reads(wrapper: gym.Env, what: str) -> NotTabular:
    return NotTabular(
        f"the wrapper {type(wrapper).__name__} {what}: expected wrappers that do not read it, since a table has no time limit. "
        "Leave the wrapper out; or learn from episodes alone, with TrajectoryLP."
    )


Shown = tuple[int, Any]
"""Steps of the environment itself that a step of its wrappers made, and what they showed, paid and ended, or raised."""


def _walked(env: gym.Env) -> list[list[Shown]]:
    """What seeded episodes of a few steps did."""
    with seeded_globals([0]), _counted(env.unwrapped) as made:
        return [_episode(env, steps, seed, made) for steps in SHORT for seed in range(RESETS)]


def _episode(env: gym.Env, steps: int, seed: int, made: list[int]) -> list[Shown]:
    for layer in layers(env):
        if isinstance(layer, TimeLimit):
            layer._max_episode_steps = steps
    seen: list[Shown] = []
    before = len(made)
    try:
        seen.append((0, copy.deepcopy(called(lambda: env.reset(seed=seed))[0])))
        env.action_space.seed(seed)
        for _ in range(steps):
            before = len(made)
            observation, reward, terminated, _ = stepped(env, env.action_space.sample())
            seen.append((len(made) - before, (copy.deepcopy(observation), reward, terminated)))
            if terminated:
                break
    except EnvironmentFailed as error:
        seen.append((len(made) - before, str(error)))
    return seen


@contextmanager
def _counted(base: Any) -> Iterator[list[int]]:
    """Note each step of an environment, for a while."""
    made: list[int] = []
    step = base.step

    def counting(action: Any) -> Any:
        made.append(0)
        return step(action)

    base.step = counting
    try:
        yield made
    finally:
        del base.step


def _same(a: list[list[Shown]], b: list[list[Shown]]) -> bool:
    """Do episodes do the same, up to where a wrapper that makes several steps at once is cut among them?"""
    for one, other in zip(a, b, strict=True):
        for (made, shown), (made_too, shown_too) in zip(one, other, strict=False):
            if made != made_too:
                break
            if next(Pairs().unlike("", shown, shown_too), None) is not None:
                return False
    return True
