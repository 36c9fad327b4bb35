"""Samples that a distance is computed from, where there is no table.

`Transitions` come from the coverage distribution D: from episodes, from a log, or from a sampler of the caller's. A
`FreshSample` is what EPIC's canonical form draws on its own: states from D_S and actions from D_A.
Observations are batches as vector environments stack them: arrays, or dicts and tuples of arrays. Axes: N transitions, M draws.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from irl_gym.checks import checked_number, checked_rng
from irl_gym.errors import InvalidDemonstrations, InvalidParameter, UndefinedDistance, a_type
from irl_gym.mdp.episodes import Episode, seen_parts
from irl_gym.mdp.tabular_mdp import check_discount
from irl_gym.spaces.batches import batch_size, by_part, take

FLAGS = ("terminated", "terminal")
"""Parts of a sample that say yes or no."""
OPTIONAL = (*FLAGS, "groups")
"""Parts of a sample that may be None."""


@dataclass(frozen=True, eq=False)
class Transitions:
    """N transitions (s, a, s') from a coverage distribution.

    Raises:
        InvalidParameter: parts that are not arrays, lengths that do not fit together, or flags of another kind.
        UndefinedDistance: fewer than two transitions.
    """

    observations: Any
    """N observations s, stacked."""
    actions: np.ndarray
    """(N, ...) what was done in each."""
    next_observations: Any
    """N observations s'."""
    terminated: np.ndarray | None = None
    """(N,) is s' terminal? None: never. Not by a time limit."""
    groups: np.ndarray | None = None
    """(N,) integers: transitions of one group, such as an episode, depend on each other. None: independent, or in order."""

    def __post_init__(self) -> None:
        n = _checked_lengths(self, ("observations", "next_observations", "terminated", "groups"))
        if n < 2:
            raise UndefinedDistance(f"there are {n} transitions: expected at least 2, and for an error of the distance many.")

    def __len__(self) -> int:
        return len(self.actions)

    @property
    def ended(self) -> np.ndarray:
        """(N,) is s' terminal?"""
        return np.zeros(len(self), dtype=bool) if self.terminated is None else np.asarray(self.terminated, dtype=bool)

    @classmethod
    def from_episodes(cls, episodes: Iterable[Episode]) -> "Transitions":
        """Every step of some episodes whose successor is known; an episode is a group.

        Raises:
            InvalidDemonstrations: something else than episodes.
            UndefinedDistance: fewer than two steps.
        """
        kept = list(episodes) if isinstance(episodes, Iterable) else [episodes]
        for wrong in (one for one in kept if not isinstance(one, Episode)):
            raise InvalidDemonstrations(
                f"there is {a_type(wrong)} where an episode is expected: give Episodes, such as those of `collect`."
            )
        kept = seen_parts(kept)
        if not kept:
            raise UndefinedDistance("there are no episodes: expected at least one, with two transitions or more.")
        return cls(
            joined([take(one.observations, slice(None, -1)) for one in kept]),
            np.concatenate([one.taken(f"episode {i}") for i, one in enumerate(kept)]),
            joined([take(one.observations, slice(1, None)) for one in kept]),
            np.concatenate([(np.arange(len(one)) == len(one) - 1) & one.terminated for one in kept]),
            np.repeat(np.arange(len(kept)), [len(one) for one in kept]),
        )

    def blocks(self, most: int) -> np.ndarray:
        """(N,) numbers from 0 of at most `most` blocks, each of whole groups, or of consecutive transitions."""
        if self.groups is None:
            return np.arange(len(self)) * min(most, len(self)) // len(self)
        _, number = np.unique(np.asarray(self.groups), return_inverse=True)
        count = int(number.max()) + 1
        if count < 2:
            raise UndefinedDistance(
                "all transitions are of one group: expected at least 2 groups, or the error is not known. Give more episodes; "
                "or, without it, groups=None for transitions in order."
            )
        return number * min(most, count) // count


@dataclass(frozen=True, eq=False)
class FreshSample:
    """M draws of a state from D_S and an action from D_A, and the discount: what EPIC's canonical form needs.

    Raises:
        InvalidParameter: parts that are not arrays, lengths that do not fit together, or fewer than 2 draws.
        InvalidDiscount: gamma outside (0, 1).
    """

    gamma: float
    """Discount."""
    states: Any
    """M observations from D_S, stacked."""
    actions: np.ndarray
    """(M, ...) actions from D_A, independent of the states."""
    terminal: np.ndarray | None = None
    """(M,) is the state terminal? None: none is."""

    def __post_init__(self) -> None:
        check_discount(self.gamma)
        n = _checked_lengths(self, ("states", "terminal"))
        if n < 2:
            raise InvalidParameter(f"there are {n} draws: expected at least 2, and for a small error of the distance many.")

    def __len__(self) -> int:
        return len(self.actions)

    @property
    def ended(self) -> np.ndarray:
        """(M,) is the state terminal?"""
        return np.zeros(len(self), dtype=bool) if self.terminal is None else np.asarray(self.terminal, dtype=bool)

    @classmethod
    def from_transitions(
        cls, transitions: Transitions, gamma: float, *, n: int = 256, rng: np.random.Generator
    ) -> "FreshSample":
        """Draw M next states and, independently, M actions of transitions: D_S and D_A are those of the data.

        Raises:
            InvalidParameter: n that is not a whole number of at least 2, or an rng that is none.
            InvalidDiscount: gamma outside (0, 1).
        """
        if not isinstance(transitions, Transitions):
            raise InvalidParameter(
                f"transitions is {a_type(transitions)}: expected Transitions, such as `Transitions.from_episodes(episodes)`."
            )
        rng = checked_rng(rng)
        n = int(checked_number("n", n, "a whole number of at least 2", least=2, whole=True))
        states, actions = rng.integers(len(transitions), size=(2, n))
        return cls(gamma, take(transitions.next_observations, states), transitions.actions[actions], transitions.ended[states])


def _checked_lengths(sample: Any, names: tuple[str, ...]) -> int:
    """The number of actions of a sample, whose other parts, where they are given, have to be as many."""
    given = {name: getattr(sample, name) for name in ("actions", *names)}
    counts = {name: _length(name, part) for name, part in given.items() if part is not None or name not in OPTIONAL}
    n = counts.pop("actions")
    wrong = {name: count for name, count in counts.items() if count != n}
    if wrong:
        raise InvalidParameter(f"there are {n} actions and {wrong}: expected as many of each.")
    for name in counts.keys() & set(OPTIONAL):
        part = np.asarray(given[name])
        if part.ndim != 1:
            raise InvalidParameter(
                f"{name} has shape {part.shape}: expected ({n},), one for each. Of shape ({n}, 1) it is `{name}.ravel()`."
            )
        odd = part[~np.isin(part, (0, 1))] if name in FLAGS else part[:0]
        if odd.size:
            raise InvalidParameter(f"{name} holds {odd[0]}: expected True and False, or 1 and 0.")
    return n


def _length(name: str, batch: Any) -> int:
    def check(part: Any) -> None:
        if not (isinstance(part, np.ndarray) and part.ndim):
            raise InvalidParameter(
                f"{name} is {a_type(part)}: expected an array, or a dict or tuple of arrays, with one entry for each. "
                "Stack a list with `np.array`."
            )

    by_part(check, batch)
    return batch_size(batch)


def joined(batches: Sequence[Any]) -> Any:
    """Batches of observations, one after the other."""
    first = batches[0]
    if isinstance(first, dict):
        return {key: joined([one[key] for one in batches]) for key in first}
    if isinstance(first, tuple):
        return tuple(joined([one[i] for one in batches]) for i in range(len(first)))
    return np.concatenate(batches)
