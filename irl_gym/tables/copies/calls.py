"""Calls of somebody else's environment: what it raises is told as its own.

A search steps an environment where its author never did, and meets errors that nobody has seen. Such an error is named in the
message and stays its cause, so that its own traceback is shown too. What passes as it is: errors of this library (a draw that
cannot be enumerated is one), and a lack of memory, which is no fault of the environment's.
"""

import random
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, TypeVar

import gymnasium as gym
import numpy as np

from irl_gym.errors import EnvironmentFailed, IrlGymError

T = TypeVar("T")


def called(run: Callable[[], T]) -> T:
    """What a call of an environment returns; `run` is to hold no more than that call.

    Raises:
        EnvironmentFailed: it raised an error of its own.
    """
    try:
        return run()
    except (IrlGymError, MemoryError):
        raise
    except Exception as error:
        raise EnvironmentFailed(
            f"the environment raised {type(error).__name__} ({error}): expected a reset, and every action in every state, to "
            "work. Mend the environment."
        ) from error


def stepped(env: gym.Env, action: Any) -> tuple[Any, float, bool, bool]:
    """One step of an environment: observation, reward, terminated, truncated.

    Raises:
        EnvironmentFailed: it raised an error, or did not return five values.
    """
    return called(lambda: _step(env, action))


def _step(env: gym.Env, action: Any) -> tuple[Any, float, bool, bool]:
    observation, reward, terminated, truncated, _ = env.step(action)
    return observation, float(reward), bool(terminated), bool(truncated)


@contextmanager
def seeded_globals(seed: list[int]) -> Iterator[None]:
    """Seed the generators that NumPy and Python share, for a while: some environments draw from them."""
    number = int(np.random.SeedSequence(seed).generate_state(1)[0])
    legacy, plain = np.random.get_state(), random.getstate()  # noqa: NPY002 (theirs, not ours)
    np.random.seed(number)  # noqa: NPY002
    random.seed(number)
    try:
        yield
    finally:
        np.random.set_state(legacy)  # noqa: NPY002
        random.setstate(plain)
