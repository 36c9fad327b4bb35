"""What TrajectoryLP proves of a reward, from the sampled values alone. Axes: K features, k policies found before."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from irl_gym.facts import Fact, plain
from irl_gym.learners.linear_programs.proofs.feature_proof import features_told
from irl_gym.learners.linear_programs.proofs.proven import Proven

TIED = "R ties the expert with every policy found, to two standard errors"
UNKNOWN = "one episode tells no noise"
"""In place of a standard error that there is none of."""


@dataclass(frozen=True, eq=False)
class TrajectoryProof(Proven):
    """What TrajectoryLP proves of a reward alpha . phi, the expert and the policies found."""

    gaps: np.ndarray
    """(k,) alpha . (V^expert - V^_j): how much better the expert is than each policy found before, under R; (12) wants >= 0."""
    gap_errors: np.ndarray
    """(k,) their standard errors."""
    regret: float
    """alpha . (V^new - V^expert): how much better a policy planned for R is than the expert, under R. At most 0, but for
    noise, where the expert is optimal."""
    regret_error: float
    """Its standard error."""
    distance: float
    """||V^expert - V^new||_1: no reward with |alpha_i| <= 1 tells the two apart by more on these trajectories."""
    distance_error: float
    """Sum of the standard errors of its K terms: what is left of it when the two policies are the same."""
    objective: float
    """sum_j p(gap_j) - l1 ||alpha||_1, recomputed."""
    dual_bound: float
    """No alpha has a larger objective."""
    penalty: float
    """Slope of p below 0."""
    gap_cap: float | None
    """What each gap counts up to; None for all of it."""
    l1: float
    """Price of ||alpha||_1."""
    alpha_l1_norm: float
    """||alpha||_1."""
    rank: int
    """Rank of the rows V^expert - V^_j."""
    n_features: int
    """K."""
    horizon: int
    """H, steps after which trajectories were cut."""
    truncation: float
    """What cutting changes a value by at most while no reward is larger than R_max: gamma^(H+1) R_max / (1 - gamma), R_max the
    largest ||phi||_1 that the expert met."""
    zero: bool
    """Is alpha zero?"""
    round: int
    """The round that found alpha."""
    rounds: int | None
    """Rounds made, of which that was the best; None where it was not chosen among them."""

    @property
    def expert_optimal(self) -> bool:
        """Is the expert as good as the planned policy, and as each one found before, to two standard errors?

        Where one episode tells no error, the sampled values are compared as they are.
        """
        errors = np.nan_to_num(np.append(self.gap_errors, self.regret_error))
        return bool((np.append(self.gaps, -self.regret) >= -2 * errors - 1e-9).all())

    @property
    def fell_short(self) -> bool:
        """Is the planned policy worse than the expert under the reward it was planned for? Then planning failed."""
        return self.regret < -2 * self.regret_error - 1e-9

    @property
    def degenerate(self) -> bool:
        """Is R zero, or does it tie the expert with all policies found before?"""
        return self.zero or bool((np.abs(self.gaps) <= 2 * self.gap_errors).all())

    def _facts(self) -> Iterator[Fact]:
        among = f", of {self.gaps.size} policies found before and the one planned for it"
        told = "yes" if np.isnan(self.regret_error) else "yes, to two standard errors"
        told = f"{told}{among}" if self.expert_optimal else f"no: {self._better()}"
        good = "good" if self.expert_optimal and not self.degenerate else "bad"
        yield Fact("expert best by its episodes", told, good)
        if self.degenerate:
            yield Fact("degenerate by its episodes", "R is zero" if self.zero else TIED, "bad")
        yield Fact("value gaps", f"{self.gaps.min():.4g} to {self.gaps.max():.4g}; {_noise(float(self.gap_errors.max()))}")
        short = f"; the planner fell short of the expert by {-self.regret:.3g}" if self.fell_short else ""
        gain = f"{self.regret:.4g} under R; {_noise(self.regret_error)}{short}"
        yield Fact("planned policy's gain", gain, "bad" if short else "plain")
        if self.rounds is not None:
            yield Fact("best round", f"{self.round} of {self.rounds}, by its policy's distance to the expert")
        noise = UNKNOWN if np.isnan(self.distance_error) else f"noise alone makes about {self.distance_error:.2g}"
        most = "no reward with |alpha_i| <= 1 tells the two apart by more on these trajectories"
        yield Fact("distance to the expert", f"{self.distance:.4g} in the features; {noise}; {most}")
        yield from super()._facts()
        yield features_told(self.n_features, self.rank)
        cut = f"cut after {self.horizon} steps, which changes a value under R by {self.truncation:.2g} at most"
        yield Fact("trajectories", cut)

    def _better(self) -> str:
        """Which policy beats the expert under R, and by how much."""
        if -self.regret >= -2 * np.nan_to_num(self.regret_error) - 1e-9:
            worst = int(np.argmin(self.gaps + 2 * np.nan_to_num(self.gap_errors)))
            return f"a policy found before gains {-self.gaps[worst]:.3g} over it; {_noise(float(self.gap_errors[worst]))}"
        return f"the policy planned for it gains {self.regret:.3g} over the expert; {_noise(self.regret_error)}"

    def to_json(self) -> dict[str, Any]:
        """As json holds it: NaN and infinity become None."""
        return plain(self, "expert_optimal", "fell_short", "duality_gap", "degenerate")


def _noise(error: float) -> str:
    """A standard error in words; NaN where there is none."""
    return UNKNOWN if np.isnan(error) else f"standard error {error:.2g}"
