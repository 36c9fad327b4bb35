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

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from irl_gym._typing import Numbers, Vector
from irl_gym.distances.canonical import Canonical, FreshDraws, ModelDraws, ValueAdjustedLevelling
from irl_gym.distances.comparing import ROUNDING, half_difference, norm, ranks, standardised
from irl_gym.distances.coverage import coverage_of
from irl_gym.distances.payments import payments
from irl_gym.errors import InvalidParameter
from irl_gym.mdp import TabularMDP

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
            InvalidReward: wrong shape or not finite.
            InvalidParameter: a distribution of the wrong shape, that does not sum to 1, or that misses all transitions.
            UndefinedDistance: a canonical reward that is constant, where a correlation is asked for.
        """
        given = payments(mdp, reward, name)
        coverage = coverage_of(mdp, self.coverage)
        values = self.form().values(mdp, given, coverage)
        return self._scaled(values, coverage.weights, ROUNDING * given.size / (1 - mdp.gamma), name)

    def distance(self, mdp: TabularMDP, first: Any, second: Any) -> float:
        """The distance of two rewards, between 0 and 1 (STARC with two different norms: at least 0).

        Raises:
            InvalidReward: wrong shape or not finite.
            InvalidParameter: a distribution of the wrong shape, that does not sum to 1, or that misses all transitions.
            UndefinedDistance: a canonical reward that is constant, where a correlation is asked for.
        """
        one, other = self.standard(mdp, first, "the first reward"), self.standard(mdp, second, "the second reward")
        return half_difference(one, other, coverage_of(mdp, self.coverage).weights, self.order)

    def _scaled(self, values: Numbers, weights: Numbers, rounding: float, name: str) -> Numbers:
        raise NotImplementedError


@dataclass(frozen=True, eq=False)
class Pearson(RewardDistance):
    """sqrt((1 - rho) / 2), rho the correlation of canonical rewards over the coverage distribution."""

    canonical: Canonical = field(default_factory=FreshDraws)
    """EPIC's where none is given; `AsGiven()` for the raw rewards."""
    coverage: np.ndarray | None = None
    """(S, A) or (S, A, S) distribution; None for uniform over pairs of states that act, s' from P."""

    def form(self) -> Canonical:
        """The canonical form."""
        return self.canonical

    def _scaled(self, values: Numbers, weights: Numbers, rounding: float, name: str) -> Numbers:
        return standardised(values, weights, rounding, name)


@dataclass(frozen=True, eq=False)
class Spearman(Pearson):
    """Pearson's distance of the ranks of the canonical rewards: also blind to any increasing change of canonical values."""

    def _scaled(self, values: Numbers, weights: Numbers, rounding: float, name: str) -> Numbers:
        return standardised(ranks(values, weights, rounding), weights, ROUNDING, name)


@dataclass(frozen=True, eq=False)
class EPIC(RewardDistance):
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

    _scaled = Pearson._scaled


@dataclass(frozen=True, eq=False)
class DARD(RewardDistance):
    """The Dynamics-Aware Reward Distance of Wulfe et al. (2022)."""

    coverage: np.ndarray | None = None
    """(S, A) or (S, A, S) distribution D; None for uniform over pairs of states that act, s' from P."""
    actions: np.ndarray | None = None
    """(A,) D_A; None for uniform."""

    def form(self) -> Canonical:
        """The canonical form."""
        return ModelDraws(self.actions)

    _scaled = Pearson._scaled


@dataclass(frozen=True, eq=False)
class STARC(RewardDistance):
    """A Standardised Reward Comparison (Skalse et al. 2024, definition 2): m(s(R_1), s(R_2)) / 2 with s(R) = C(R) / n(C(R)).

    Norms are means over the coverage distribution, so they do not grow with the table; a reward that all policies earn alike
    has s(R) = 0. The half makes opposite rewards 1 apart, as they are with EPIC; the paper leaves it out.

    Raises:
        InvalidParameter: a norm that is not 1, 2 or infinite.
    """

    canonical: Canonical = field(default_factory=ValueAdjustedLevelling)
    """VAL with a uniformly random policy where none is given; `MinimalNorm()`; either with `levelled=False`."""
    norm: float = 2
    """n: 1, 2 or infinity."""
    metric: float = 2
    """m is a norm of the difference: 1, 2 or infinity."""
    coverage: np.ndarray | None = None
    """(S, A) or (S, A, S) distribution; None for uniform over pairs of states that act. The bounds on regret need all pairs."""

    def __post_init__(self) -> None:
        for name, value in (("norm", self.norm), ("metric", self.metric)):
            if isinstance(value, bool) or value not in NORMS:
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


def distance_matrix(distance: RewardDistance, mdp: TabularMDP, rewards: Mapping[str, Any] | Sequence[Any]) -> np.ndarray:
    """(k, k) all distances between k rewards; each is put into standard form once.

    Args:
        distance: one of this module's records.
        mdp: P and gamma.
        rewards: k rewards, or a mapping of names to them; the names appear in errors.

    Raises:
        InvalidReward: wrong shape or not finite.
        UndefinedDistance: a canonical reward that is constant, where a correlation is asked for.
    """
    named = rewards if isinstance(rewards, Mapping) else {f"reward {i}": one for i, one in enumerate(rewards)}
    weights = coverage_of(mdp, distance.coverage).weights
    standard = [distance.standard(mdp, one, name) for name, one in named.items()]
    return np.array([[half_difference(x, y, weights, distance.order) for y in standard] for x in standard])


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
    return STARC(canonical or ValueAdjustedLevelling(), norm, metric, coverage).distance(mdp, first, second)


def pearson(mdp: TabularMDP, first: Any, second: Any, *, canonical: Canonical | None = None, coverage: Any = None) -> float:
    """Pearson distance of two canonical rewards; see `Pearson`."""
    return Pearson(canonical or FreshDraws(), coverage).distance(mdp, first, second)


def spearman(mdp: TabularMDP, first: Any, second: Any, *, canonical: Canonical | None = None, coverage: Any = None) -> float:
    """Spearman distance of two canonical rewards; see `Spearman`."""
    return Spearman(canonical or FreshDraws(), coverage).distance(mdp, first, second)
