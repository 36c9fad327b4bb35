"""The most and the least that discounted sums can be over all policies, as bounds that hold with all rounding.

    most     y >= g_a + gamma P_a y  for every action, y >= 0    implies    y >= sup_pi (I - gamma P_pi)^-1 g_pi
    least    y <= g_a + gamma P_a y  for every action            implies    y <= inf_pi (I - gamma P_pi)^-1 g_pi
A policy is improved until the solution for it is a bound for all actions, which one product checks. Where that does not come
about, a constant (a bound always) or nothing is given. Axes: S states, A actions.
"""

import numpy as np

from irl_gym._typing import Actions, Matrix, Sparse, Vector
from irl_gym.mdp.planning.discounted import EPSILON, Discounted

TRIED = 30
"""Improvements of the policy behind a bound, at most."""


def most(P: Sparse, gamma: float, gains: Matrix, horizon: float, policy: Actions | None = None, *, sums: int = 0) -> Vector:
    """(S,) at least what any policy adds up to.

    Args:
        P: (S*A, S) transitions.
        gamma: discount.
        gains: (S, A) what an action gives, rounded upwards; -infinity where it is not allowed.
        horizon: discounted steps at most.
        policy: (S,) tried first; None for the actions that give most.
        sums: rounded operations that the entries of P are the result of.
    """
    rows, terms = np.arange(gains.shape[0]), _terms(P, sums)
    chosen: np.ndarray = np.argmax(gains, axis=1) if policy is None else policy
    y = lacking = np.zeros(gains.shape[0])
    for _ in range(TRIED):
        discounted = Discounted(P[rows * gains.shape[1] + chosen], gamma, sums=sums)
        y = discounted.above(np.maximum(gains[rows, chosen], 0.0))
        onwards = gamma * (P @ y).reshape(gains.shape)
        needed = (gains + onwards * (1 + terms)).max(axis=1) * (1 + 4 * EPSILON)
        lacking = needed - y
        if not np.isfinite(y).all() or not (lacking > 0).any():
            return y
        chosen = np.where(lacking > 0, np.argmax(gains + onwards, axis=1), chosen)
    return y + np.full(y.shape, float(lacking.max()) * horizon)


def least(P: Sparse, gamma: float, gains: Matrix, *, sums: int = 0) -> Vector:
    """(S,) at most what any policy adds up to, -infinity where nothing is proved; `gains` (S, A) are rounded downwards."""
    rows, terms = np.arange(gains.shape[0]), _terms(P, sums)
    policy = gains.argmin(axis=1)
    for _ in range(TRIED):
        discounted, given = Discounted(P[rows * gains.shape[1] + policy], gamma, sums=sums), gains[rows, policy]
        y = discounted.below(np.maximum(given, 0.0)) - discounted.above(np.maximum(-given, 0.0))
        if not np.isfinite(y).all():
            break
        onwards = gains + gamma * (P @ y).reshape(gains.shape)
        rounding = terms * (np.abs(gains) + gamma * (P @ np.abs(y)).reshape(gains.shape) + np.abs(y)[:, None])
        short = (onwards - rounding).min(axis=1) < y
        if not short.any():
            return y
        policy = np.where(short, onwards.argmin(axis=1), policy)
    return np.full(gains.shape[0], -np.inf)


def _terms(P: Sparse, sums: int) -> float:
    """The relative rounding of a product with P."""
    return (int(np.diff(P.indptr).max(initial=0)) + 12 + sums) * EPSILON
