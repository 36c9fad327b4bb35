"""Many episodes of one environment at a time, so that a policy acts on batches.

Where the environment's id has a vector entry point (CartPole, ours) thousands of copies step in NumPy; else a few dozen copies
step one after the other, and only the policy gains. Episode i is reset with the seed of its batch. Axes: N episodes, T steps.
"""

import copy
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode, SyncVectorEnv, VectorEnv

from irl_gym.checks import checked_number
from irl_gym.environments.closing import close
from irl_gym.errors import InvalidParameter
from irl_gym.mdp.episodes import Episode
from irl_gym.mdp.policies import Policy
from irl_gym.spaces.batches import by_part, take

TOGETHER = 4096
"""Copies at most, where a vector entry point steps them."""
APART = 32
"""Copies at most, where each is stepped by itself."""


@dataclass(frozen=True, eq=False)
class BatchMoment:
    """What the episodes that still go on see at one time, and the step that led there."""

    time: int
    """Steps made since the start."""
    who: np.ndarray
    """(m,) numbers of the episodes, 0 to N - 1."""
    observations: Any
    """(m, ...) what they show now."""
    actions: np.ndarray
    """(m,) actions that led here, counted from 0; empty at the start."""
    rewards: np.ndarray
    """(m,) what these were paid; empty at the start."""
    terminated: np.ndarray
    """(m,) did the episode end here?"""
    truncated: np.ndarray
    """(m,) did a time limit?"""


def moments_of(
    env: gym.Env, policy: Policy, n: int, *, seed: int = 0, most: int | None = None, deterministic: bool = True
) -> Iterator[BatchMoment]:
    """Run a policy for n episodes, many at once, and yield what they see, time by time, batch by batch.

    Args:
        env: made anew from its spec, or copied where that cannot be done; itself neither stepped nor reset.
        policy: with SB3's `predict`, of batches; actions count from 0.
        n: N, at least 1.
        seed: of the first batch; each batch has its own.
        most: steps after which an episode is cut; None for no other cut than the environment's time limit.
        deterministic: passed to `predict`.

    Raises:
        InvalidParameter: fewer than 1 episodes or steps, a negative seed, or no cut where the environment has no time limit
            either.
    """
    checked_number("n", n, "a number of episodes of at least 1", least=1, whole=True)
    checked_number("seed", seed, "a whole number of at least 0", least=0, whole=True)
    if most is not None:
        checked_number("most", most, "a number of steps of at least 1", least=1, whole=True)
    elif env.spec is None or env.spec.max_episode_steps is None:
        raise InvalidParameter(f"most is None, and {env} has no time limit: expected a number of steps. Give `most`.")
    return _batches(env, policy, int(n), int(seed), most, deterministic)  # NumPy's integers do not seed Gymnasium


def _batches(env: gym.Env, policy: Policy, n: int, seed: int, most: int | None, deterministic: bool) -> Iterator[BatchMoment]:
    copies = min(n, TOGETHER if _vectorised(env) else APART)
    vector = _vector(env, copies)
    try:
        for begin in range(0, n, copies):
            yield from _batch(vector, policy, np.arange(begin, min(begin + copies, n)), seed + begin, most, deterministic)
    finally:
        close(vector)


def _batch(
    vector: VectorEnv, policy: Policy, numbers: np.ndarray, seed: int, most: int | None, deterministic: bool
) -> Iterator[BatchMoment]:
    first = int(getattr(vector.single_action_space, "start", 0))
    observations, _ = vector.reset(seed=seed)
    going = np.arange(numbers.size)
    nothing, no = np.zeros(0), np.zeros(numbers.size, dtype=bool)
    yield BatchMoment(0, numbers, take(observations, going), nothing, nothing, no, no)
    elapsed = 0
    while going.size:
        chosen, _ = policy.predict(observations, deterministic=deterministic)
        actions = np.asarray(chosen).astype(np.int64)
        observations, rewards, terminated, truncated, _ = vector.step(actions + first)
        elapsed += 1
        cut = (truncated | (elapsed == most)) & ~terminated
        here = take(observations, going)
        yield BatchMoment(
            elapsed, numbers[going], here, actions[going], np.asarray(rewards, float)[going], terminated[going], cut[going]
        )
        going = going[~(terminated | cut)[going]]


def _vectorised(env: gym.Env) -> bool:
    spec = env.spec
    return spec is not None and spec.vector_entry_point is not None and not spec.additional_wrappers


def _vector(env: gym.Env, copies: int) -> VectorEnv:
    if _vectorised(env):
        spec: Any = env.spec
        made = gym.make_vec(spec, num_envs=copies, vectorization_mode="vector_entry_point", **_quiet(env))
        if made.metadata.get("autoreset_mode", AutoresetMode.NEXT_STEP) == AutoresetMode.NEXT_STEP:
            return made
        close(made)
    return SyncVectorEnv([maker_of(env)] * copies)


def maker_of(env: gym.Env) -> Callable[[], gym.Env]:
    """Makes environments like this one: from its spec, or copies where it has none, or wrappers that a spec cannot hold."""
    spec: Any = env.spec
    if spec is None or any(wrapper.kwargs is None for wrapper in spec.additional_wrappers):
        return lambda: copy.deepcopy(env)
    return lambda: gym.make(spec, **_quiet(env))


def _quiet(env: gym.Env) -> dict[str, Any]:
    """What turns rendering off, where the environment was made with it."""
    return {"render_mode": None} if env.spec is not None and "render_mode" in env.spec.kwargs else {}


def run_episodes(
    env: gym.Env, policy: Policy, n: int, *, seed: int = 0, most: int | None = None, deterministic: bool = True
) -> list[Episode]:
    """Episodes of a policy, many at once: what `collect` gives one at a time; arguments as `moments_of`.

    Their `seed` is None: episodes of one batch share its generator.
    """
    moments = moments_of(env, policy, n, seed=seed, most=most, deterministic=deterministic)
    found: list[list[BatchMoment]] = [[] for _ in range(n)]
    places: list[list[int]] = [[] for _ in range(n)]
    for moment in moments:
        for place, number in enumerate(moment.who.tolist()):
            found[number].append(moment)
            places[number].append(place)
    return [_episode(moments, where) for moments, where in zip(found, places, strict=True)]


def _episode(moments: list[BatchMoment], places: list[int]) -> Episode:
    steps = list(zip(moments, places, strict=True))
    last, place = steps[-1]
    return Episode(
        by_part(lambda *parts: np.concatenate(parts), *(take(moment.observations, np.array([i])) for moment, i in steps)),
        np.array([moment.actions[i] for moment, i in steps[1:]]),
        np.array([moment.rewards[i] for moment, i in steps[1:]]),
        bool(last.terminated[place]),
        bool(last.truncated[place]),
    )
