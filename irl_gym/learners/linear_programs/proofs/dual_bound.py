"""Lagrange's bound on the LP of Ng & Russell (2000), section 3.2: valid for any multipliers, whatever a solver did.

For *any* y >= 0 on the rows of (4)
    D(y) = sum_s T (1 - sum_a y(s, a))+  +  R_max sum_i (|c_i| - l1)+
is above every objective, where sum_a is over the rows that count, T bounds a margin (the cap, or 2 R_max by the effective
horizon) and c is the gradient of sum y margins with respect to R. So D(y) - objective bounds what a reward falls short of the
optimum.
Axes: S states, A actions, n rows of (4).
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from irl_gym.mdp.optimality_rows import Comparisons
from irl_gym.mdp.planning.discounted import Discounted
from irl_gym.mdp.tabular_mdp import TabularMDP
from irl_gym.mdp.time_expanded import Repeated


@dataclass(frozen=True, eq=False)
class DualBound:
    """Lagrange's bound for one program."""

    mdp: TabularMDP
    comparisons: Comparisons
    discounted: Discounted
    on_states: bool
    counted: np.ndarray
    """(n,) rows whose margins count: in the objective each state has the least of its own."""
    r_max: float
    l1: float
    cap: float | None
    tie: Repeated | None = None
    """Of a reward that is the same in several rows: c is then its gradient."""

    def bound(self, y: np.ndarray | None) -> float:
        """The least D(y)."""
        return float("nan") if y is None else min(map(self.at, self._signed(y)))

    def _signed(self, y: np.ndarray) -> list[np.ndarray]:
        """Y >= 0 on the inequalities, with either sign on the equalities, whose sign solvers leave open."""
        equal, positive = self.comparisons.equal, np.maximum(y, 0.0)
        return [np.where(equal, sign * y, positive) for sign in ((1.0, -1.0) if equal.any() else (1.0,))]

    def at(self, y: np.ndarray) -> float:
        """D(y), for y >= 0 on the inequalities."""
        mdp, comparisons = self.mdp, self.comparisons
        most = 2 * self.r_max * mdp.effective_horizon if self.cap is None else self.cap
        states, of_row = np.unique(comparisons.states[self.counted], return_inverse=True)
        per_state = np.bincount(of_row, weights=y[self.counted], minlength=states.size)
        slack = most * float(np.maximum(1 - per_state, 0.0).sum())
        return slack + self.r_max * float(np.maximum(np.abs(self.gradient(y)) - self.l1, 0.0).sum())

    def least_l1_norm(self, y: np.ndarray | None) -> float:
        """Lagrange's bound below every ||R||_1 with all margins at the cap: cap sum(y) - R_max sum_i (|c_i| - 1)+."""
        if y is None or self.cap is None:
            return float("nan")
        bounds = []
        for signed in self._signed(y):
            beyond = np.maximum(np.abs(self.gradient(signed)) - 1, 0.0).sum()
            bounds.append(self.cap * float(signed[self.counted].sum()) - self.r_max * float(beyond))
        return max(bounds)

    def gradient(self, y: np.ndarray) -> np.ndarray:
        """c, the gradient of sum y margins with respect to R: (S,) or (S*A,), by one transposed solve."""
        each = self._of_entries(y)
        return each if self.tie is None else self.tie.at.T @ each

    def _of_entries(self, y: np.ndarray) -> np.ndarray:
        mdp, comparisons = self.mdp, self.comparisons
        if self.on_states:
            return self.discounted.solve_transposed(comparisons.rows.T @ y)
        stacked = comparisons.states * mdp.n_actions + comparisons.actions
        on_V = np.bincount(comparisons.states, weights=y, minlength=mdp.n_states)
        on_V = on_V - mdp.gamma * (sp.csr_array(mdp.P[stacked]).T @ y)
        u = self.discounted.solve_transposed(on_V)
        c = mdp.mixing(comparisons.distribution).T @ u - np.bincount(stacked, weights=y, minlength=mdp.P.shape[0])
        return np.where(np.repeat(mdp.terminal, mdp.n_actions), 0.0, c)
