"""Distances between rewards that are functions R(observations, actions, next_observations), from samples.

    sampled_pearson, sampled_spearman   on the rewards as they are, or with EPIC's canonical form
    sampled_epic                        transitions, and states and actions drawn afresh
    sampled_dard, sampled_starc         in `sampled_models`: they need a model to draw successors from
Each gives a value with a standard error (see `jackknife`). The canonical form of EPIC is itself a mean over M draws, the same
for all transitions; its scatter is part of the error, and M bounds how small the error can get. Axes: N transitions, M draws.
"""

from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np

from irl_gym._typing import Numbers
from irl_gym.errors import InvalidParameter, InvalidReward, a_type
from irl_gym.judging.distances.comparing import numbers
from irl_gym.judging.distances.jackknife import Distance, correlation_distance, jackknife
from irl_gym.judging.distances.transitions import FreshSample, Transitions
from irl_gym.spaces.batches import batch_size, take

RewardCall = Callable[[Any, np.ndarray, Any], Any]
"""R(observations, actions, next_observations) -> (N,) numbers."""

Sample = TypeVar("Sample", Transitions, FreshSample)

BLOCKS = 50
"""Blocks of transitions left out in turn."""
ROWS = 20_000
"""Transitions that a reward or a model is asked about at once, if they are copies made here."""
DRAW_BLOCKS = 20
"""Blocks of fresh draws left out in turn."""


class Payer:
    """A reward function whose answers are checked, and how large and how precise they were so far.

    Raises:
        InvalidReward: no function.
    """

    def __init__(self, reward: RewardCall):
        if not callable(reward):
            raise InvalidReward(
                f"the reward is {a_type(reward)}: expected a function of (observations, actions, next observations), "
                "such as the `pay` of a TabularReward where observations are rows of its table."
            )
        self.reward, self.largest, self.precision = reward, 0.0, 0.0

    def __call__(self, observations: Any, actions: np.ndarray, next_observations: Any) -> Numbers:
        """(N,) what it says of transitions.

        Raises:
            InvalidReward: it gives another shape, or a value that is not finite or beyond 1e300.
        """
        given = self.reward(observations, actions, next_observations)
        values, precision = numbers("what the reward function returns", given, "(N,) numbers")
        if values.shape != (len(actions),):
            raise InvalidReward(
                f"the reward function gives shape {values.shape} for {len(actions)} transitions: expected ({len(actions)},)."
            )
        self.largest = max(self.largest, float(np.abs(values).max(initial=0.0)))
        self.precision = max(self.precision, precision)
        return values

    @property
    def rounding(self) -> float:
        """How far sums of its answers can be off."""
        return self.precision * self.largest


def checked_sample(sample: Any, kind: type[Sample]) -> Sample:
    """Return a sample as it is.

    Raises:
        InvalidParameter: it is of another kind.
    """
    if isinstance(sample, kind):
        return sample
    made = "from_episodes(episodes)" if kind is Transitions else "from_transitions(transitions, gamma, rng=rng)"
    raise InvalidParameter(f"the sample is {a_type(sample)}: expected {kind.__name__}, such as `{kind.__name__}.{made}`.")


def sampled_epic(first: RewardCall, second: RewardCall, transitions: Transitions, fresh: FreshSample) -> Distance:
    """EPIC distance of two reward functions: N * M evaluations of each.

    Args:
        first: R(observations, actions, next_observations) -> (N,).
        second: the other.
        transitions: from the coverage distribution D.
        fresh: states from D_S, actions from D_A, and gamma.

    Raises:
        InvalidReward: a function that gives another shape, or a value that is not finite.
        InvalidParameter: something else than transitions or fresh draws.
        UndefinedDistance: a canonical reward that is constant on the transitions.
    """
    return _correlated(first, second, transitions, checked_sample(fresh, FreshSample), ranked=False)


def sampled_pearson(first: RewardCall, second: RewardCall, transitions: Transitions, fresh: FreshSample | None) -> Distance:
    """Pearson distance of two reward functions.

    Args:
        first: R(observations, actions, next_observations) -> (N,).
        second: the other.
        transitions: from the coverage distribution D.
        fresh: for EPIC's canonical form, as `pearson` has it where nothing is said; None for the rewards as they are.

    Raises:
        InvalidReward: a function that gives another shape, or a value that is not finite.
        InvalidParameter: something else than transitions or fresh draws.
        UndefinedDistance: a reward that is constant on the transitions.
    """
    return _correlated(first, second, transitions, fresh, ranked=False)


def sampled_spearman(first: RewardCall, second: RewardCall, transitions: Transitions, fresh: FreshSample | None) -> Distance:
    """Spearman distance of two reward functions: that of the ranks. See `sampled_pearson`."""
    return _correlated(first, second, transitions, fresh, ranked=True)


def _correlated(
    first: RewardCall, second: RewardCall, transitions: Transitions, fresh: FreshSample | None, *, ranked: bool
) -> Distance:
    transitions = checked_sample(transitions, Transitions)
    fresh = None if fresh is None else checked_sample(fresh, FreshSample)
    forms = [_Canonical(reward, transitions, fresh) for reward in (first, second)]
    x, y = (form.values(None) for form in forms)
    rounding = (forms[0].rounding, forms[1].rounding)
    value = correlation_distance(x, y, rounding, ranked=ranked)
    block = transitions.blocks(BLOCKS)

    def without_block(b: int) -> float:
        return correlation_distance(x[block != b], y[block != b], rounding, ranked=ranked)

    def without_draws(g: int) -> float:
        return correlation_distance(forms[0].values(g), forms[1].values(g), rounding, ranked=ranked)

    variance = jackknife(without_block, int(block.max()) + 1)
    if fresh is not None:
        variance += jackknife(without_draws, forms[0].n_blocks)
    return Distance(value, float(np.sqrt(variance)), len(transitions))


class _Canonical:
    """The canonical values of a reward function on transitions, with any block of the fresh draws left out."""

    def __init__(self, reward: RewardCall, transitions: Transitions, fresh: FreshSample | None):
        here, following, pays = transitions.observations, transitions.next_observations, Payer(reward)
        self._given = pays(here, transitions.actions, following)
        self._fresh, self._going = fresh, ~transitions.ended
        self.rounding = 0.0
        if fresh is None:
            return
        self.n_blocks = min(DRAW_BLOCKS, len(fresh))
        self._block = np.arange(len(fresh)) * self.n_blocks // len(fresh)
        self._counts = np.bincount(self._block)
        self._here = self._sums(pays, here, fresh)
        self._next = self._sums(pays, following, fresh)
        self._at_draws = self._sums(pays, fresh.states, fresh) if transitions.ended.any() else None
        self.rounding = pays.rounding / (1 - fresh.gamma)

    def _sums(self, pays: Payer, observations: Any, fresh: FreshSample) -> np.ndarray:
        """(N, blocks) sums of R(s, A, S') over the draws of each block; `ROWS` evaluations at once."""
        n = batch_size(observations)
        sums = np.zeros((n, self.n_blocks))
        for b in range(self.n_blocks):
            draws = np.flatnonzero(self._block == b)
            many = max(1, ROWS // draws.size)
            for first in range(0, n, many):
                here = np.arange(first, min(first + many, n))
                every, drawn = np.repeat(here, draws.size), np.tile(draws, here.size)
                values = pays(take(observations, every), fresh.actions[drawn], take(fresh.states, drawn))
                sums[here, b] = values.reshape(here.size, draws.size).sum(axis=1)
        return sums

    def values(self, without: int | None) -> Numbers:
        """(N,) R + gamma W(s') - W(s); a constant that no correlation sees is left out where no transition ends."""
        if self._fresh is None:
            return self._given
        used = np.arange(self.n_blocks) != (-1 if without is None else without)
        gamma, count = self._fresh.gamma, self._counts[used].sum()
        here, following = self._here[:, used].sum(axis=1) / count, self._next[:, used].sum(axis=1) / count
        if self._at_draws is None:
            return self._given + gamma * following - here
        kept = used[self._block]
        acting = ~self._fresh.ended[kept]
        means = self._at_draws[kept][:, used].sum(axis=1) / count
        future = (means * acting).mean() / (1 - gamma * acting.mean())  # E[W(S')]
        return self._given + gamma * np.where(self._going, following + gamma * future, 0.0) - here - gamma * future
