"""Values in extended precision: advantages that float64 would drown in rounding.

    A(s, a) = R(s, a) + gamma P_sa W - W(s)      what an action gains over any values W
At gamma = 0.999999 values are a million steps' pay, and float64 rounds them to more than a step may matter. W is held as a
constant plus differences, W = c + h, so that with d = sum(P_sa) - 1, which is found exactly,
    A(s, a) = (R(s, a) - (1 - gamma) c) + gamma c d + gamma P_sa h - h(s)
has the size of rewards and of differences, not of c. Sums are in `np.longdouble`, 64 bits on x86; where it is float64 itself
the bounds of rounding say so. Axes: S states, A actions, n pairs (s, a).
"""

from dataclasses import dataclass

import numpy as np

from irl_gym._typing import Actions, Matrix, Sparse, Vector
from irl_gym.mdp.planning.discounted import EPSILON, Discounted
from irl_gym.mdp.rewards import TabularReward
from irl_gym.mdp.tabular_mdp import TabularMDP, entry_rows

LONG = np.longdouble
EPSILON_LONG = float(np.finfo(LONG).eps)
REFINEMENTS = 4
UNIT = 2.0**52
"""Multiples of 1 / UNIT up to 2 add up exactly in float64."""


@dataclass(frozen=True, eq=False)
class Split:
    """Values W = constant + differences; those of terminal states are 0."""

    constant: float
    differences: np.ndarray
    """(S,) longdouble."""

    @property
    def values(self) -> Vector:
        """(S,) float64."""
        return (self.differences + LONG(self.constant)).astype(np.float64)


@dataclass(frozen=True, eq=False)
class Advantages:
    """What each action gains over some values."""

    values: np.ndarray
    """(S, A) longdouble; 0 in terminal states."""
    rounding: Matrix
    """(S, A) they are within this of the exact ones of the table's own numbers."""
    size: Matrix
    """(S, A) the sum of |terms| they are made of: what relative errors of the table's numbers would scale with."""
    defects: Matrix
    """(S, A) what of it is c d: no reward's doing, but that of rows which do not sum to 1."""

    @property
    def high(self) -> Matrix:
        """(S, A) at least the exact ones."""
        return _upwards(self.values.astype(np.float64)) + self.rounding


class PreciseTable:
    """A table and a reward, with backups in extended precision.

    Args:
        mdp: P and gamma.
        reward: of either kind, of the table's shape.
    """

    def __init__(self, mdp: TabularMDP, reward: TabularReward):
        self.mdp, self.reward = mdp, reward
        self._P = mdp.P.astype(LONG)
        self.terms = int(np.diff(mdp.P.indptr).max(initial=0)) + 12
        """Operations of a backup, at most: what rounding errors are multiplied by."""
        self.steps = reward.expected(mdp)
        """(S, A) what a step pays, in float64."""
        self._defects = row_defects(mdp.P)
        self.horizon = effective_horizon(mdp)
        """Discounted steps at most."""
        paid = np.abs(reward.values)
        if reward.on_states:
            self._R, self._paid = self._P @ reward.values.astype(LONG), mdp.P @ paid
        else:
            ended = np.repeat(mdp.terminal, mdp.n_actions)
            self._R = np.where(ended, LONG(0), reward.values.ravel().astype(LONG))
            self._paid = np.where(ended, 0.0, paid.ravel())

    def split(self, V: Vector) -> Split:
        """Values (S,) around the median of those of the first state, so that small numbers stay small where episodes go."""
        acting, constant = np.flatnonzero(~self.mdp.terminal), 0.0
        first = acting[np.argsort(V[acting], kind="stable")]
        weight = np.cumsum(self.mdp.d0[first])
        if weight.size and weight[-1] > 0:
            constant = float(V[first[np.searchsorted(weight, weight[-1] / 2)]])
        return Split(constant, np.where(self.mdp.terminal, 0.0, V).astype(LONG) - LONG(constant))

    def gains(self, W: Split, pairs: np.ndarray, P: Sparse | None = None) -> np.ndarray:
        """(n,) longdouble advantages of some pairs s * A + a over W; `P` are their rows, where they were taken before."""
        gamma, c, h = LONG(self.mdp.gamma), LONG(W.constant), W.differences
        onwards = (self._P[pairs] if P is None else P) @ h
        states = pairs // self.mdp.n_actions
        found = (self._R[pairs] - c * (1 - gamma)) + gamma * c * self._defects[pairs] + gamma * onwards - h[states]
        return np.where(self.mdp.terminal[states], LONG(0), found)

    def advantages(self, W: Split) -> Advantages:
        """Those of all actions over W."""
        mdp = self.mdp
        pairs, h = np.arange(mdp.P.shape[0]), np.abs(W.differences.astype(np.float64))
        values = self.gains(W, pairs, self._P)
        defects = abs(W.constant) * mdp.gamma * np.abs(self._defects.astype(np.float64))
        size = self._paid + abs(W.constant) * (1 - mdp.gamma) + defects + mdp.gamma * (mdp.P @ h) + h[pairs // mdp.n_actions]
        size, defects = (np.where(np.repeat(mdp.terminal, mdp.n_actions), 0.0, one) for one in (size, defects))
        shape = (mdp.n_states, mdp.n_actions)
        rounding = _upwards(self.terms * (EPSILON_LONG * size + abs(W.constant) * 2.0**-106))
        return Advantages(*(one.reshape(shape) for one in (values, rounding, size, defects)))

    def refined(self, V: Vector, policy: Actions, discounted: Discounted) -> Split:
        """The values of a policy (S,), from those that float64 found, by a few corrections."""
        W, pairs = self.split(V), np.arange(self.mdp.n_states) * self.mdp.n_actions + policy
        P, least = self._P[pairs], np.inf
        for _ in range(REFINEMENTS):
            off = self.gains(W, pairs, P).astype(np.float64)
            most = float(np.abs(off).max(initial=0.0))
            if most == 0 or most > 0.5 * least:
                break
            least = most
            moved = np.where(self.mdp.terminal, 0.0, discounted.solve(off))
            W = Split(W.constant, W.differences + moved.astype(LONG))
        return W


def effective_horizon(mdp: TabularMDP) -> float:
    """That of the MDP, but for rows whose sum is not quite 1; infinite where they are too far off."""
    more = max(float(row_defects(mdp.P).max(initial=0.0)), 0.0)
    if mdp.horizon is not None:
        return mdp.effective_horizon * (1 + 4 * EPSILON) * np.exp(min(mdp.horizon * more, 600.0))
    ends = (1 - mdp.gamma) - mdp.gamma * more
    return (1 + 4 * EPSILON) / ends if ends > 0 else float("inf")


def row_defects(P: Sparse) -> np.ndarray:
    """(S*A,) longdouble sum of each row minus 1: what is a multiple of 2^-52 adds up exactly. 0 where a row is empty.

    What is left, below 2^-53 a number, adds up to within 2^-106 for each of them.
    """
    rows, shape = entry_rows(P), P.shape[0]
    coarse = np.round(P.data * UNIT) / UNIT
    sums, fine = (np.bincount(rows, weights=part, minlength=shape) for part in (coarse, P.data - coarse))
    return np.where(np.diff(P.indptr) == 0, LONG(0), (sums - 1.0).astype(LONG) + fine.astype(LONG))


def _upwards(values: np.ndarray) -> np.ndarray:
    """Float64 numbers that are not below, whatever the last operations rounded."""
    return values + 4 * EPSILON * np.abs(values)
