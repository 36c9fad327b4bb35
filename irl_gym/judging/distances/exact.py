"""Distances between rewards of a table, exact.

A distance is a frozen record of its choices. `standard(mdp, reward)` is a reward in its standard form, (n,) numbers on the
transitions of the coverage distribution, and the distance of two rewards is half the norm of the difference of theirs:
    Pearson    canonical, mean 0, variance 1        = sqrt((1 - rho) / 2)
    Spearman   the same with the ranks of the canonical values
    STARC      canonical, divided by its norm; 0 where that is 0
The functions `epic`, `dard`, `starc`, `pearson` and `spearman` make the record and use it once.

Rewards are (S,) paid on arrival, (S, A), (S, A, S) or a TabularReward; the two may have different forms.
Axes: S states, A actions, n transitions.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from irl_gym._typing import Numbers, Vector
from irl_gym.errors import InvalidParameter, InvalidReward, a_type
from irl_gym.judging.distances.canonical import Canonical, FreshDraws, ModelDraws, ValueAdjustedLevelling
from irl_gym.judging.distances.comparing import ROUNDING, half_difference, norm, ranks, standardised
from irl_gym.judging.distances.coverage import Coverage, coverage_of
from irl_gym.judging.distances.payments import payments
from irl_gym.mdp.tabular_mdp import TabularMDP

NORMS = (1, 2, np.inf)


class RewardDistance:
    """What distances share: a canonical form, and the distance of standard forms."""

    coverage: Any

    @property
    def order(self) -> float:
        """Of the norm of a difference."""
        return 2.0

    def form(self) -> Canonical:
        """The canonical form that is compared."""
        raise NotImplementedError

    def standard(self, mdp: TabularMDP, reward: Any, name: str = "the reward") -> Numbers:
        """(n,) a reward in standard form, on the transitions of the coverage distribution.

        Raises:
            InvalidMDP, InvalidReward: no table; a reward of the wrong shape or not finite.
            InvalidParameter: a distribution of the wrong shape, that does not sum to 1, or that misses all transitions.
            UndefinedDistance: a canonical reward that is constant, where a correlation is asked for.
        """
        return self._standard(mdp, reward, name, coverage_of(mdp, self.coverage))

    def _standard(self, mdp: TabularMDP, reward: Any, name: str, coverage: Coverage) -> Numbers:
        given = payments(mdp, reward, name)
        form = self.form()
        values = form.values(mdp, given, coverage)
        return self._scaled(values, coverage.weights, form.rounding(mdp, given, coverage), name)

    def distance(self, mdp: TabularMDP, first: Any, second: Any) -> float:
        """The distance of two rewards, between 0 and 1 (STARC with two different norms: at least 0).

        Raises:
            InvalidMDP, InvalidReward: no table; a reward of the wrong shape or not finite.
            InvalidParameter: a distribution of the wrong shape, that does not sum to 1, or that misses all transitions.
            UndefinedDistance: a canonical reward that is constant, where a correlation is asked for.
        """
        coverage = coverage_of(mdp, self.coverage)
        one = self._standard(mdp, first, "the first reward", coverage)
        other = self._standard(mdp, second, "the second reward", coverage)
        return half_difference(one, other, coverage.weights, self.order)

    def _scaled(self, values: Numbers, weights: Numbers, rounding: float, name: str) -> Numbers:
        raise NotImplementedError


class Correlation(RewardDistance):
    """A distance that is sqrt((1 - rho) / 2), whatever the canonical form."""

    def _scaled(self, values: Numbers, weights: Numbers, rounding: float, name: str) -> Numbers:
        return standardised(values, weights, rounding, name)


@dataclass(frozen=True, eq=False)
class Pearson(Correlation):
    """sqrt((1 - rho) / 2), rho the correlation of canonical rewards over the coverage distribution."""

    canonical: Canonical = field(default_factory=FreshDraws)
    """EPIC's where none is given; `AsGiven()` for the raw rewards."""
    coverage: np.ndarray | None = None
    """(S, A) or (S, A, S) distribution; None for uniform over pairs of states that act, s' from P."""

    def __post_init__(self) -> None:
        _check_canonical(self.canonical)

    def form(self) -> Canonical:
        """The canonical form."""
        return self.canonical


@dataclass(frozen=True, eq=False)
class Spearman(Pearson):
    """Pearson's distance of the ranks of the canonical rewards: also blind to any increasing change of canonical values."""

    def _scaled(self, values: Numbers, weights: Numbers, rounding: float, name: str) -> Numbers:
        return standardised(ranks(values, weights, rounding), weights, ROUNDING, name)


@dataclass(frozen=True, eq=False)
class EPIC(Correlation):
    """The Equivalent-Policy Invariant Comparison of Gleave et al. (2021, definition 4.6)."""

    coverage: np.ndarray | None = None
    """(S, A) or (S, A, S) distribution D; None for uniform over pairs of states that act, s' from P."""
    states: Vector | None = None
    """(S,) D_S of the canonical form; None for uniform."""
    actions: np.ndarray | None = None
    """(A,) D_A; None for uniform."""

    def form(self) -> Canonical:
        """The canonical form."""
        return FreshDraws(self.states, self.actions)


@dataclass(frozen=True, eq=False)
class DARD(Correlation):
    """The Dynamics-Aware Reward Distance of Wulfe et al. (2022)."""

    coverage: np.ndarray | None = None
    """(S, A) or (S, A, S) distribution D; None for uniform over pairs of states that act, s' from P."""
    actions: np.ndarray | None = None
    """(A,) D_A; None for uniform."""

    def form(self) -> Canonical:
        """The canonical form."""
        return ModelDraws(self.actions)


@dataclass(frozen=True, eq=False)
class STARC(RewardDistance):
    """A Standardised Reward Comparison (Skalse et al. 2024, section 3): m(s(R_1), s(R_2)) / 2 with s(R) = C(R) / n(C(R)).

    Norms are means over the coverage distribution, so they do not grow with the table; a reward that all policies earn alike
    has s(R) = 0. The half makes opposite rewards 1 apart, as they are with EPIC; the paper leaves it out.

    Raises:
        InvalidParameter: a norm that is not 1, 2 or infinite, or something else than a canonical form.
    """

    canonical: Canonical = field(default_factory=ValueAdjustedLevelling)
    """VAL with a uniformly random policy where none is given; `MinimalNorm()`; either with `levelled=False`."""
    norm: float = 2
    """n: 1, 2 or infinity."""
    metric: float = 2
    """m is a norm of the difference: 1, 2 or infinity."""
    coverage: np.ndarray | None = None
    """(S, A) or (S, A, S) distribution; None for uniform over pairs of states that act. The bounds on regret need all pairs. On
    few pairs many rewards are alike but for scale: on a single one any two are 0 or 1 apart, or one of them is 0 there."""

    def __post_init__(self) -> None:
        _check_canonical(self.canonical)
        for name, value in (("norm", self.norm), ("metric", self.metric)):
            if isinstance(value, bool | np.ndarray) or value not in NORMS:
                raise InvalidParameter(f"{name} is {value!r}: expected 1, 2 or infinity (`numpy.inf`).")

    @property
    def order(self) -> float:
        """Of the norm of a difference."""
        return float(self.metric)

    def form(self) -> Canonical:
        """The canonical form."""
        return self.canonical

    def _scaled(self, values: Numbers, weights: Numbers, rounding: float, name: str) -> Numbers:
        size = norm(values, weights, float(self.norm))
        return values / size if size > rounding else np.zeros_like(values)


def _check_canonical(canonical: Any) -> None:
    if isinstance(canonical, type) or not isinstance(canonical, Canonical):
        what = canonical.__name__ if isinstance(canonical, type) else repr(canonical)
        raise InvalidParameter(f"canonical is {what}: expected a canonical form, such as `MinimalNorm()`.")


def distance_matrix(distance: RewardDistance, mdp: TabularMDP, rewards: Mapping[str, Any] | Iterable[Any]) -> np.ndarray:
    """(k, k) all distances between k rewards; each is put into standard form once.

    Args:
        distance: one of this module's records.
        mdp: P and gamma.
        rewards: k rewards, or a mapping of names to them; the names appear in errors.

    Raises:
        InvalidMDP, InvalidReward: no table; a reward of the wrong shape or not finite, or no rewards at all.
        InvalidParameter: a distance that is no record, or with a distribution that is none of this table.
        UndefinedDistance: a canonical reward that is constant, where a correlation is asked for.
    """
    if not isinstance(distance, RewardDistance):
        what = getattr(distance, "__name__", repr(distance))
        raise InvalidParameter(f"distance is {what}: expected a record, such as `EPIC()`.")
    if not isinstance(rewards, Iterable):
        raise InvalidReward(f"rewards is {a_type(rewards)}: expected several rewards, or a mapping of names to them.")
    named = rewards if isinstance(rewards, Mapping) else {f"reward {i}": one for i, one in enumerate(rewards)}
    if not named:
        raise InvalidReward("rewards is empty: expected at least one reward.")
    coverage = coverage_of(mdp, distance.coverage)
    standard = [distance._standard(mdp, one, name, coverage) for name, one in named.items()]
    return np.array([[half_difference(x, y, coverage.weights, distance.order) for y in standard] for x in standard])


def epic(mdp: TabularMDP, first: Any, second: Any, *, coverage: Any = None, states: Any = None, actions: Any = None) -> float:
    """EPIC distance of two rewards; see `EPIC`."""
    return EPIC(coverage, states, actions).distance(mdp, first, second)


def dard(mdp: TabularMDP, first: Any, second: Any, *, coverage: Any = None, actions: Any = None) -> float:
    """DARD distance of two rewards; see `DARD`."""
    return DARD(coverage, actions).distance(mdp, first, second)


def starc(
    mdp: TabularMDP,
    first: Any,
    second: Any,
    *,
    canonical: Canonical | None = None,
    norm: float = 2,
    metric: float = 2,
    coverage: Any = None,
) -> float:
    """STARC distance of two rewards; see `STARC`."""
    return STARC(ValueAdjustedLevelling() if canonical is None else canonical, norm, metric, coverage).distance(
        mdp, first, second
    )


def pearson(mdp: TabularMDP, first: Any, second: Any, *, canonical: Canonical | None = None, coverage: Any = None) -> float:
    """Pearson distance of two canonical rewards; see `Pearson`."""
    return Pearson(FreshDraws() if canonical is None else canonical, coverage).distance(mdp, first, second)


def spearman(mdp: TabularMDP, first: Any, second: Any, *, canonical: Canonical | None = None, coverage: Any = None) -> float:
    """Spearman distance of two canonical rewards; see `Spearman`."""
    return Spearman(FreshDraws() if canonical is None else canonical, coverage).distance(mdp, first, second)
