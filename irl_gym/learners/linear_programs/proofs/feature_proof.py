"""What FeatureLP proves of its program, recomputed from the rows of (10) and alpha alone.

The bound above every objective is Lagrange's (`weights.Rows.bound`), valid for any duals. What the reward says of the expert in
*every* reachable state of a table, not in the sample only, is `optimality`'s to say; of a generative model there are only the
rows of the sample, with their standard errors. Axes: K features.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from irl_gym._typing import Indices
from irl_gym.facts import Fact, counted, plain
from irl_gym.learners.linear_programs.proofs.proven import Proven, cap_told


@dataclass(frozen=True, eq=False)
class FeatureProof(Proven):
    """What FeatureLP proves of a reward alpha . phi."""

    objective: float
    """sum over S_0 of p(margin), minus l1 ||alpha||_1, recomputed."""
    dual_bound: float
    """No alpha has a larger objective."""
    penalty: float
    """Slope of p below 0."""
    margin_cap: float | None
    """Cap tau on margins; None in the paper's program."""
    l1: float
    """Price of ||alpha||_1."""
    alpha_l1_norm: float
    """||alpha||_1."""
    states: int
    """States of S_0 that count: those with a row which is not trivial."""
    trivial: int
    """States of S_0 that do not: every other action has the expert's successors."""
    rank: int
    """Rank of the rows: how many directions of alpha they say anything about."""
    n_features: int
    """K."""
    expressible: bool
    """Does some reward in the span of the features satisfy (10) in all of S_0, other than one that ties everything?"""
    zero: bool
    """Is alpha zero?"""
    unbreakable_rows: np.ndarray
    """(u, 2) state and action of each row of (10) that no weights that satisfy (10) in all of S_0 make strict, as a program
    found. Without a cap none asks: empty."""

    @property
    def unbreakable(self) -> Indices:
        """States of S_0 with such a row."""
        return np.unique(self.unbreakable_rows[:, 0])

    def _facts(self) -> Iterator[Fact]:
        yield from super()._facts()
        yield cap_told(self.margin_cap)
        yield features_told(self.n_features, self.rank)
        told = f"{counted(self.states)} in which actions are compared; {self.trivial:,} more have none to compare"
        yield Fact("sample", told)
        if not self.expressible:
            told = "no: no reward in the span of the features makes the expert optimal. More or other features (--features) may"
            yield Fact("expressible", told, "bad")
        if len(self.unbreakable_rows):
            told = f"{counted(len(self.unbreakable_rows), 'action')} in {counted(self.unbreakable.size)}"
            why = "no reward in the span of the features that makes the expert optimal prefers its own"
            yield Fact("always tied", f"{told}: {why}", "open")

    def to_json(self) -> dict[str, Any]:
        """As json holds it: NaN and infinity become None."""
        return plain(self, "duality_gap", "unbreakable")


@dataclass(frozen=True, eq=False)
class SampledFeatureProof(FeatureProof):
    """The same of a generative model, where all that is known of the expert is in the rows of the sample."""

    expert_optimal: bool
    """Does (10) hold in all of S_0, to two standard errors?"""
    worst_violation: float
    """The largest violation of (10), in units of value; 0 when none."""
    margin: np.ndarray
    """(|S_0|,) smallest margin of the expert over another action, over the rows not listed as unbreakable; NaN where there is
    none."""
    violated: Indices
    """Numbers in S_0 of the states in which another action is better than the expert's."""
    indifferent: bool
    """Is the expert tied, to rounding, with every action in every state of S_0?"""
    standard_error: float | None
    """The largest standard error of a row of (10) under R; None where the rows are exact or had one rollout."""

    @property
    def degenerate(self) -> bool:
        """Does R say nothing: is the expert tied with every action in every state of S_0, as under R = 0?"""
        return self.zero or self.indifferent

    def _facts(self) -> Iterator[Fact]:
        told = "yes, to two standard errors in S_0" if self.expert_optimal else "no, (10) is violated in S_0"
        yield Fact("expert optimal in the sample", told, "good" if self.expert_optimal and not self.degenerate else "bad")
        if self.degenerate:
            yield Fact("degenerate", "R is zero" if self.zero else "R ties the expert with every action", "bad")
        finite = self.margin[np.isfinite(self.margin)]
        span = f"{finite.min():.3g} to {finite.max():.3g} in {counted(finite.size)}" if finite.size else "none"
        error = "" if self.standard_error is None else f"; the standard error of a row is at most {self.standard_error:.2g}"
        yield Fact("margins", f"{span}{error}")
        if self.violated.size:
            yield Fact("violated", f"(10) in {counted(self.violated.size)}, by at most {self.worst_violation:.3g}", "bad")
        yield from super()._facts()

    def to_json(self) -> dict[str, Any]:
        """As json holds it: NaN and infinity become None."""
        return super().to_json() | {"degenerate": self.degenerate}


def features_told(n_features: int, rank: int) -> Fact:
    """How many features there are, and how much of them the rows say anything about."""
    return Fact("features", f"{n_features:,}; the rows have rank {rank:,}: so many directions of alpha they say anything about")
