"""Sampled values of policies, feature by feature, and which of the expert's episodes they can be taken from.

Axes: N episodes, K features.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from irl_gym.errors import InvalidDemonstrations, a_type
from irl_gym.mdp.episodes import Episode, seen_parts


@dataclass(frozen=True, eq=False)
class Estimate:
    """V^ of a policy (Ng & Russell 2000, equation (11)) and the error of the mean. One episode tells no error: it is NaN."""

    mean: np.ndarray
    """(K,)."""
    factor: np.ndarray
    """(r, K) F with F'F the covariance of the mean, r the smaller of N and K."""

    @classmethod
    def of(cls, sums: np.ndarray) -> "Estimate":
        """From the (N, K) sums of episodes."""
        n, K = sums.shape
        if n == 1:
            return cls(sums[0], np.full((1, K), np.nan))
        centred = (sums - sums.mean(axis=0)) / np.sqrt(n * (n - 1))
        return cls(sums.mean(axis=0), centred if n <= K else np.asarray(np.linalg.qr(centred, mode="r")))

    def variance(self, alpha: np.ndarray) -> float:
        """Of alpha . mean."""
        return float(((self.factor @ alpha) ** 2).sum())

    @property
    def variances(self) -> np.ndarray:
        """(K,) of each feature's mean."""
        return (self.factor**2).sum(axis=0)


@dataclass(frozen=True, eq=False)
class Usable:
    """The expert's episodes that can be compared with a policy's, and where both are cut."""

    episodes: list[Episode]
    """Those that ended, or go on to the horizon."""
    horizon: int
    """H, steps."""
    dropped: int
    """Episodes that broke off before it."""


def usable(episodes: Iterable[Episode], asked: int, limit: int | None) -> Usable:
    """Which episodes to take, and the horizon.

    An episode that did not end and is shorter than the horizon was cut. Where the time limit cut it, which many share, the
    horizon comes down to the limit, for policies too; where it broke off for itself, as the last one of a recording that was
    stopped, it is dropped: it says nothing of what comes after. An episode whose last observation was not recorded ends with
    the one before.

    Args:
        episodes: the expert's.
        asked: H, as wanted.
        limit: steps after which the world cuts episodes; None if it does not, or it is not known.

    Raises:
        InvalidDemonstrations: no episodes, other things than episodes, or none that can be taken.
    """
    given = checked_episodes(episodes)
    every = seen_parts(given)
    if not every:
        raise InvalidDemonstrations(
            f"all {len(given)} episodes have one step, and what it led to was not recorded: expected two states of one. "
            "Give the next observations when they are imported."
        )
    cuts = [len(one) for one in every if not one.terminated and len(one) < asked]
    shared = max(cuts, key=lambda length: (cuts.count(length), length), default=0)  # the most frequent
    if limit is None and (cuts.count(shared) > 1 or len(cuts) == len(every)):
        limit = shared
    horizon = asked if limit is None else min(asked, limit)
    kept = [one for one in every if one.terminated or len(one) >= horizon]
    if not kept:
        raise InvalidDemonstrations(
            f"all {len(every)} episodes break off before step {horizon}, most after {shared} steps, and none ended: "
            f"expected some that ended or go on. Ask for a shorter horizon, such as {shared}."
        )
    return Usable(kept, horizon, len(given) - len(kept))


def checked_episodes(episodes: Any) -> list[Episode]:
    """The episodes, as a list.

    Raises:
        InvalidDemonstrations: no episodes, or other things.
    """
    if isinstance(episodes, Episode | str) or not isinstance(episodes, Iterable):
        raise InvalidDemonstrations(
            f"the expert is {a_type(episodes)}: expected its episodes, such as `read_minari(dataset)` gives."
        )
    every = list(episodes)
    if not every:
        raise InvalidDemonstrations("there are no episodes: expected at least one of the expert's.")
    for one in every:
        if not isinstance(one, Episode):
            raise InvalidDemonstrations(
                f"the expert's episodes hold {a_type(one)}: expected episodes, such as `read_minari(dataset)` gives."
            )
    return every


def nearest(distances: Sequence[float], errors: Sequence[float], patience: int) -> tuple[int, bool]:
    """Which of the rounds so far is the answer, from 0, and whether to stop.

    The answer is the round with the least distance to the expert. To stop, the newest distance is no more than its error, or so
    many rounds as `patience` have not come nearer.
    """
    best = int(np.argmin(distances))
    return best, bool(distances[-1] <= errors[-1]) or len(distances) - 1 - best >= patience
