"""What a reward learned from trajectories proves, from the sampled values alone. Axes: K features, k policies found before."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from irl_gym.proven import Proven, plain


@dataclass(frozen=True, eq=False)
class TrajectoryCertificate(Proven):
    """What a reward alpha . phi proves about the expert and the policies found."""

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

    def __str__(self) -> str:
        """The certificate in a few lines a person reads."""
        best = "yes, to two standard errors" if self.expert_optimal else "no"
        short = "; the planner fell short of the expert" if self.fell_short else ""
        noise = f"standard errors up to {self.gap_errors.max():.2g}"
        lines = [
            f"expert best under R      {best}, of {self.gaps.size} policies found before and the one planned for R",
            f"value gaps               {self.gaps.min():.4g} to {self.gaps.max():.4g}, {noise}",
            f"planned policy's gain    {self.regret:.4g} under R, standard error {self.regret_error:.2g}{short}",
            f"distance to the expert   {self.distance:.4g} in the features; noise alone makes about {self.distance_error:.2g}",
            self.optimality,
            f"features                 {self.n_features}; the rows have rank {self.rank}",
            f"trajectories             cut after {self.horizon} steps, which costs a value {self.truncation:.2g} at most",
        ]
        if self.degenerate:
            lines.append(f"degenerate               R {'is zero' if self.zero else 'ties the expert with every policy found'}")
        return "\n".join(lines)

    def to_json(self) -> dict[str, Any]:
        """The certificate as json holds it."""
        return plain(self, "expert_optimal", "fell_short", "duality_gap", "degenerate")
