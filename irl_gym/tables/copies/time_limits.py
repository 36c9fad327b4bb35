"""Wrappers that read a time limit inside them: the limit is then part of what the environment does.

Else a table has no time limit: copies are made without TimeLimit, so that a state is no state for every count of steps. A
wrapper around it that shows how much time is left, ends the episode where it is cut, or pays for it, is another one without it.
It is found by its class, or by what it does: each wrapper is run with limits of a few steps, and without. Then copies keep the
limit, and an episode that it cuts ends there (`AtLimit`).
"""

import copy
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import gymnasium as gym
from gymnasium.wrappers import TimeAwareObservation, TimeLimit

from irl_gym.errors import EnvironmentFailed, NotTabular
from irl_gym.tables.copies.calls import called, seeded_globals, stepped
from irl_gym.tables.copies.object_graphs import Pairs
from irl_gym.tables.copies.stripped import layers, looked_through, without_watchers

SHORT, RESETS = (1, 2, 4), 3
"""Limits in steps that are tried, and episodes under each."""


@dataclass(frozen=True)
class Reader:
    """A wrapper that reads a time limit inside it."""

    wrapper: str
    """Its class."""
    limit: int
    """In steps."""
    what: str
    """What it does with it, in words that follow its name."""


class AtLimit(gym.Wrapper):
    """Says `terminated` where a time limit inside cuts an episode: nothing comes after."""

    def step(self, action: Any) -> Any:
        """A step."""
        observation, reward, terminated, truncated, info = self.env.step(action)
        cut = any(vars(one)["_elapsed_steps"] >= vars(one)["_max_episode_steps"] for one in _limits(self.env))
        return observation, reward, terminated or cut, truncated and not cut, info


def with_limits(env: gym.Env) -> gym.Env:
    """A copy as `without_watchers` makes it, in which episodes end where a TimeLimit inside cuts them.

    Raises:
        NotCopied: an attribute cannot be copied; it is named.
    """
    return AtLimit(without_watchers(env, limits=True))


def reader_of(env: gym.Env) -> Reader | None:
    """The first wrapper, the innermost first, that shows the time under a limit inside it, or does otherwise without it.

    Raises:
        NotTabular: one shows the time as a share of the limit; or the environment cannot be copied.
    """
    limit, wrappers = limited(env)
    for wrapper in wrappers:
        name = type(wrapper).__name__
        if isinstance(wrapper, TimeAwareObservation):
            if wrapper.normalize_time:
                raise NotTabular(
                    f"the wrapper {name} shows the time as a share of {limit} steps, a float: expected whole numbers. Make it "
                    "with `normalize_time=False`."
                )
            return Reader(name, limit, f"shows how many of the {limit} steps are taken that the TimeLimit inside it allows")
    for wrapper in wrappers:
        free = [_walked(without_watchers(wrapper)) for _ in range(2)]
        if _same(*free) and not _same(free[0], _walked(without_watchers(wrapper, limits=True))):
            what = f"does something else where the TimeLimit inside it cuts an episode, after {limit} steps"
            return Reader(type(wrapper).__name__, limit, what)
    return None


def check_unread(env: gym.Env) -> None:
    """Check that no wrapper reads a time limit inside it, for who has no use for one.

    Raises:
        NotTabular: one does.
    """
    reader = reader_of(env)
    if reader is not None:
        raise NotTabular(
            f"the wrapper {reader.wrapper} {reader.what}: expected wrappers that do not read it, since a table that is counted "
            "has no time limit. Enumerate, with `by=None`; leave the wrapper out; or learn from episodes alone, with "
            "TrajectoryLP."
        )


def _limits(env: gym.Env) -> list[TimeLimit]:
    return [layer for layer in layers(env) if isinstance(layer, TimeLimit)]


def limited(env: gym.Env) -> tuple[int, list[gym.Env]]:
    """The least time limit in an environment, and the wrappers around it that are part of what it does, the innermost first."""
    chain = layers(env)
    found = [i for i, layer in enumerate(chain) if isinstance(layer, TimeLimit)]
    if not found:
        return 0, []
    limit = min(int(getattr(chain[i], "_max_episode_steps")) for i in found)  # noqa: B009 (a private name of Gymnasium's)
    return limit, [layer for layer in chain[: found[-1]] if not looked_through(layer)][::-1]


Shown = tuple[int, Any]
"""Steps of the environment itself that a step of its wrappers made, and what they showed, paid and ended, or raised."""


def _walked(env: gym.Env) -> list[list[Shown]]:
    """What seeded episodes of a few steps did."""
    with seeded_globals([0]), _counted(env.unwrapped) as made:
        return [_episode(env, steps, seed, made) for steps in SHORT for seed in range(RESETS)]


def _episode(env: gym.Env, steps: int, seed: int, made: list[int]) -> list[Shown]:
    for layer in _limits(env):
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
