"""Observations that are whole numbers or words, in a space that does not say so: what shows them as integers.

Many environments have a Box of float32 whose entries are whole numbers, a grid of 0s and 1s, or name their states by words.
Such a space has no finite number of members, but the observations can be shown as integers, by one of Gymnasium's wrappers.
"""

from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces

from irl_gym.errors import IrlGymError, NotDiscrete
from irl_gym.tables.copies.calls import called, seeded_globals, stepped
from irl_gym.tables.copies.stripped import without_watchers

STEPS = 200
"""Random steps of a copy that are looked at."""
MOST_WORDS = 100
BOUND = 2**31
"""Of whole numbers for which the space has no bounds."""


def as_integers(env: gym.Env, error: NotDiscrete) -> NotDiscrete:
    """The error for observations that are not made of integers, with the wrapper that shows them so, where one does."""
    try:
        seen = _seen(env)
        shown = _integers(env.observation_space, seen, "o", "env.observation_space")
    except (IrlGymError, LookupError, TypeError, ValueError):  # not copied, not stepped, or not of its space: other errors
        return error
    if shown is None:
        return error
    function, space = shown
    return NotDiscrete(
        f"{env.observation_space} is not made of integers, but what {len(seen)} random steps showed can be: expected Discrete, "
        "MultiDiscrete, MultiBinary, an integer Box, or a Tuple or Dict of these. Show them so, with "
        f"`gymnasium.wrappers.TransformObservation(env, lambda o: {function}, {space})`."
    )


def _seen(env: gym.Env) -> list[Any]:
    """Observations of a seeded walk of a copy."""
    own = without_watchers(env)
    with seeded_globals([0]):
        seen = [called(lambda: own.reset(seed=0))[0]]
        own.action_space.seed(0)
        for _ in range(STEPS):
            observation, _, terminated, truncated = stepped(own, own.action_space.sample())
            seen.append(observation)
            if terminated or truncated:
                seen.append(called(own.reset)[0])
    return seen


def _integers(space: spaces.Space, seen: list[Any], name: str, place: str) -> tuple[str, str] | None:
    """Code that shows an observation `name` as integers, and the space of these; None where nothing does."""
    if isinstance(space, spaces.Tuple | spaces.Dict):
        keys = space.spaces if isinstance(space, spaces.Dict) else range(len(space.spaces))
        within: Any = space
        parts = [_integers(within[key], [one[key] for one in seen], f"{name}[{key!r}]", f"{place}[{key!r}]") for key in keys]
        if None in parts or not parts:
            return None
        functions, kinds = zip(*(part for part in parts if part is not None), strict=True)
        if isinstance(space, spaces.Tuple):
            return f"({', '.join(functions)},)", f"gymnasium.spaces.Tuple([{', '.join(kinds)}])"
        named = [", ".join(f"{key!r}: {part}" for key, part in zip(keys, each, strict=True)) for each in (functions, kinds)]
        return f"{{{named[0]}}}", f"gymnasium.spaces.Dict({{{named[1]}}})"
    if isinstance(space, spaces.Text):
        words = sorted({str(one) for one in seen})
        return (f"{words}.index({name})", f"gymnasium.spaces.Discrete({len(words)})") if len(words) <= MOST_WORDS else None
    if not isinstance(space, spaces.Box) or not space.low.size:
        return (name, place) if isinstance(space, spaces.Discrete | spaces.MultiDiscrete | spaces.MultiBinary) else None
    if space.dtype.kind in "iub":
        return name, place
    numbers = np.array(seen, dtype=np.float64)
    if not (np.abs(numbers) < BOUND).all() or (numbers != np.rint(numbers)).any():
        return None
    finite = (np.abs(space.low) <= BOUND).all() and (np.abs(space.high) <= BOUND).all()
    low, high = (int(np.floor(space.low.min())), int(np.ceil(space.high.max()))) if finite else (-BOUND, BOUND)
    return f"numpy.int64({name})", f"gymnasium.spaces.Box({low}, {high}, {space.shape}, numpy.int64)"
