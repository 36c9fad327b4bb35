"""A new layout at each reset becomes one MDP: the layouts of a few seeds.

Environments such as MiniGrid draw their whole world at each reset, so their episodes come from as many MDPs as there are
layouts. With the seeds fixed, the layouts are a finite set, and which one it is becomes part of where an episode starts.
Two generators stay apart: `chooser` picks the seed, and the environment's own generator makes the chance of its steps, which a
layout's seed would otherwise tie to that layout.
"""

import numbers
from collections.abc import Sequence
from typing import Any

import gymnasium as gym
import numpy as np

from irl_gym.errors import InvalidParameter


class SeededStarts(gym.Wrapper, gym.utils.RecordConstructorArgs):
    """Every episode starts as the environment does when it is reset with one of these seeds, each as likely.

    Rewards, steps and observations stay as they are. With one seed every episode starts the same, and nothing is drawn.

    Args:
        env: any environment.
        seeds: whole numbers from 0; a seed that is listed twice is twice as likely.

    Raises:
        InvalidParameter: no seeds, or anything but whole numbers from 0.
    """

    def __init__(self, env: gym.Env, seeds: Sequence[int] = (0,)):
        self.seeds: tuple[int, ...] = _checked_seeds(seeds)
        gym.utils.RecordConstructorArgs.__init__(self, seeds=list(self.seeds))
        gym.Wrapper.__init__(self, env)
        self.chooser: np.random.Generator = np.random.default_rng()
        """Picks the seed of an episode, by one draw; `reset(seed=...)` seeds it."""

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begin an episode with the layout of one of the seeds.

        Args:
            seed: of the chooser and of the chance of later steps; None goes on with both as they are.
            options: passed on.

        Raises:
            InvalidParameter: a seed that is not a whole number from 0.
        """
        base = self.env.unwrapped
        if seed is None:
            before = base.np_random
        else:
            _check_seed("seed", seed)
            of_choice, of_steps = np.random.SeedSequence(int(seed)).spawn(2)
            self.chooser, before = np.random.default_rng(of_choice), np.random.default_rng(of_steps)
        chosen = 0 if len(self.seeds) == 1 else int(self.chooser.integers(len(self.seeds)))
        result = self.env.reset(seed=self.seeds[chosen], options=options)
        base.np_random = before  # the seed made the layout; it shall not make the steps too
        return result


def _checked_seeds(seeds: Any) -> tuple[int, ...]:
    if isinstance(seeds, str | bytes) or not isinstance(seeds, Sequence | np.ndarray) or not getattr(seeds, "ndim", 1):
        raise InvalidParameter(f"seeds is {seeds!r}: expected a list of whole numbers, such as [0, 1, 2].")
    if not len(seeds):
        raise InvalidParameter("seeds is empty: expected at least one whole number. One seed is one layout.")
    for i, seed in enumerate(seeds):
        _check_seed(f"seeds[{i}]", seed)
    return tuple(int(seed) for seed in seeds)


def _check_seed(name: str, seed: Any) -> None:
    if isinstance(seed, bool) or not isinstance(seed, numbers.Integral) or seed < 0:
        raise InvalidParameter(f"{name} is {seed!r}: expected a whole number from 0, as `reset(seed=...)` takes.")
