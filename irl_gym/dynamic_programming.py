"""Dynamic programming on sparse tables (Puterman 1994, chapter 6): pure functions of an MDP and a reward.

The reward is R (S, A), what a step pays in expectation, or a TabularReward. A terminal state has no steps, so its value is 0.
    Q = R + gamma P V          V(s) = max_a Q(s, a)
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from irl_gym._typing import Actions, ActionSets, Matrix, Sparse, Vector
from irl_gym.checks import checked_number, float_array
from irl_gym.errors import InvalidParameter, InvalidReward
from irl_gym.mdp import TabularMDP
from irl_gym.policies import as_distribution
from irl_gym.rewards import TabularReward

Reward = Matrix | TabularReward
"""(S, A) what a step pays in expectation, or a TabularReward of either kind."""

EPSILON = float(np.finfo(np.float64).eps)


@dataclass(frozen=True, eq=False)
class Solution:
    """An optimal policy with its values, and how far from optimal they can be."""

    V: Vector
    """Values; at most `error` from the optimal ones in the sup norm."""
    Q: Matrix
    """Action values of V."""
    policy: Actions
    """Greedy actions; ties broken by the caller's order of preference."""
    error: float
    """Bound on max_s |V(s) - V*(s)|."""
    iterations: int
    """Improvement steps made."""


def backup(mdp: TabularMDP, R: Matrix, V: Vector) -> Matrix:
    """Q = R + gamma P V: the value (S, A) of one step and then V."""
    return R + mdp.gamma * (mdp.P @ V).reshape(mdp.n_states, mdp.n_actions)


def checked_reward(mdp: TabularMDP, R: Reward) -> Matrix:
    """Return R, an array or a TabularReward, as (S, A) floats with zero rows at terminal states.

    Raises:
        InvalidReward: wrong shape, NaN or infinite.
    """
    if isinstance(R, TabularReward):
        R = R.expected(mdp)
    array = float_array("the reward", R, "(S, A) numbers", InvalidReward)
    if array.shape != (mdp.n_states, mdp.n_actions):
        raise InvalidReward(
            f"the reward has shape {array.shape}: expected ({mdp.n_states}, {mdp.n_actions}), the reward of each step. "
            "Turn a reward on arrival into one with `TabularReward.expected(mdp)`."
        )
    wrong = np.argwhere(~np.isfinite(array))
    if wrong.size:
        s, a = wrong[0]
        raise InvalidReward(f"R[s={s}, a={a}] is {array[s, a]}: a reward is a finite number.")
    return np.where(mdp.terminal[:, None], 0.0, array)


def greedy(Q: Matrix, *, preference: Sequence[int] | None = None, tie_tolerance: float = 1e-9) -> Actions:
    """The best action of each state; among actions within `tie_tolerance` of the best, the first in `preference`.

    Args:
        Q: (S, A) action values.
        preference: all actions, most preferred first; the default is 0, 1, ..., A-1.
        tie_tolerance: in units of Q.

    Raises:
        InvalidParameter: `preference` is not a permutation of the actions.
    """
    order = np.arange(Q.shape[1]) if preference is None else np.asarray(preference)
    if sorted(order.tolist()) != list(range(Q.shape[1])):
        raise InvalidParameter(f"preference is {list(order)}: expected every action from 0 to {Q.shape[1] - 1} once.")
    return order[tied(Q, tie_tolerance)[:, order].argmax(axis=1)].astype(np.int64)


def tied(Q: Matrix, tolerance: float) -> ActionSets:
    """The set of greedy actions of each state: (S, A), those within `tolerance` of the best."""
    return Q >= Q.max(axis=1, keepdims=True) - tolerance


def value_iteration(
    mdp: TabularMDP,
    R: Reward,
    *,
    tolerance: float | None = None,
    sweeps: int = 0,
    preference: Sequence[int] | None = None,
    max_iterations: int = 1_000_000,
) -> Solution:
    """Iterate V <- max_a Q until V is within `tolerance` of V* in the sup norm.

    With `sweeps` > 0 each improvement is followed by that many sweeps of V <- R_pi + gamma P_pi V with the greedy policy:
    modified policy iteration (Puterman 1994, section 6.5), the fastest here on large sparse tables.

    The stop is ||TV - V|| gamma / (1 - gamma) plus rounding <= tolerance (Puterman, theorem 6.3.1); the span is not used, since
    it leaves V wrong by a constant.

    Args:
        mdp: S states, A actions.
        R: (S, A) reward of a step, or a TabularReward.
        tolerance: in units of value; the default is 1e-10 of max |R| / (1 - gamma), or what float64 can reach.
        sweeps: evaluation sweeps after each improvement.
        preference: order in which ties are broken in the policy returned.
        max_iterations: improvement steps at most.

    Raises:
        InvalidReward: wrong shape or not finite.
        InvalidParameter: a tolerance below what float64 can reach, or `max_iterations` spent.
    """
    R = checked_reward(mdp, R)
    scale = max(float(np.abs(R).max(initial=0.0)) / (1 - mdp.gamma), 1e-290)
    rounding = 4 * EPSILON * scale / (1 - mdp.gamma)
    expected = f"more than {rounding:.1e}, the rounding of values up to {scale:.3g}"
    tolerance = max(1e-10 * scale, 4 * rounding) if tolerance is None else tolerance
    tolerance = checked_number("tolerance", tolerance, expected, above=rounding)
    V, error = np.zeros(mdp.n_states), np.inf
    for iteration in range(1, max_iterations + 1):
        Q = backup(mdp, R, V)
        improved = Q.max(axis=1)
        error = mdp.gamma / (1 - mdp.gamma) * float(np.abs(improved - V).max()) + rounding
        V = improved
        if error <= tolerance:
            Q = backup(mdp, R, V)
            return Solution(V, Q, greedy(Q, preference=preference, tie_tolerance=2 * tolerance), error, iteration)
        if sweeps:
            V = _evaluation_sweeps(mdp, R, V, Q.argmax(axis=1), sweeps)
    raise InvalidParameter(f"max_iterations is {max_iterations}: V is within {error:.2e} of V*, not {tolerance:.2e}.")


def _evaluation_sweeps(mdp: TabularMDP, R: np.ndarray, V: np.ndarray, policy: np.ndarray, sweeps: int) -> np.ndarray:
    """Sweeps of V <- R_pi + gamma P_pi V."""
    rows = np.arange(mdp.n_states)
    P_pi, R_pi = mdp.gamma * mdp.P[rows * mdp.n_actions + policy], R[rows, policy]
    for _ in range(sweeps):
        V = P_pi @ V + R_pi
    return V


def evaluate_policy(mdp: TabularMDP, R: Reward, policy: Actions | Matrix | ActionSets) -> Vector:
    """V = (I - gamma P_pi)^-1 R_pi by one sparse factorisation, equation (5) of Ng & Russell with rewards on steps.

    Fast where successors are near one another, as on grids; where they are anywhere the factors fill in.

    Raises:
        InvalidReward: wrong shape or not finite.
        InvalidPolicy: wrong shape or content.
    """
    mixing = mdp.mixing(policy)
    return Discounted(sp.csr_array(mixing @ mdp.P), mdp.gamma).solve(mixing @ checked_reward(mdp, R).ravel())


class Discounted:
    """I - gamma P_pi, factorised once.

    Args:
        P_pi: (S, S) transitions under a policy.
        gamma: discount.
    """

    def __init__(self, P_pi: Sparse, gamma: float):
        identity = sp.eye_array(P_pi.shape[0], format="csc")
        matrix = sp.csc_matrix(identity - gamma * P_pi)
        # Its diagonal dominates each row, so no pivots are sought; that order halves the factors of SuperLU's default.
        self._factor = splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})

    def solve(self, right: np.ndarray) -> np.ndarray:
        """X with (I - gamma P_pi) x = right."""
        return self._factor.solve(np.ascontiguousarray(right, dtype=np.float64))

    def solve_transposed(self, right: np.ndarray) -> np.ndarray:
        """X with (I - gamma P_pi)^T x = right."""
        return self._factor.solve(np.ascontiguousarray(right, dtype=np.float64), trans="T")


def policy_iteration(
    mdp: TabularMDP,
    R: Reward,
    *,
    tolerance: float = 1e-10,
    allowed: ActionSets | None = None,
    preference: Sequence[int] | None = None,
    max_iterations: int = 10_000,
) -> Solution:
    """Howard's policy iteration with exact evaluation; it stops when no action improves the *value* by `tolerance`.

    Policies are never compared: with ties they can alternate for ever. V is the value of the last policy evaluated; the policy
    returned differs from it in ties only, broken by `preference`.

    Args:
        mdp: S states, A actions.
        R: (S, A) reward of a step.
        tolerance: smallest improvement, relative to max |V|, that changes an action; at least the rounding of V.
        allowed: (S, A) actions the policy may use; the default is all.
        preference: order in which ties are broken in the policy returned.
        max_iterations: improvement steps at most.

    Raises:
        InvalidReward: wrong shape or not finite.
        InvalidParameter: `allowed` of another shape or with an empty row, a negative tolerance, or `max_iterations` spent.
    """
    R = checked_reward(mdp, R)
    tolerance = checked_number("tolerance", tolerance, "a number of at least 0, relative to max |V|", least=0)
    if allowed is not None and np.shape(allowed) != R.shape:
        raise InvalidParameter(f"allowed has shape {np.shape(allowed)}: expected {R.shape}, a set of actions for each state.")
    blocked = np.zeros(R.shape, dtype=bool) if allowed is None else ~np.asarray(allowed, dtype=bool)
    empty = np.flatnonzero(blocked.all(axis=1))
    if empty.size:
        raise InvalidParameter(f"allowed[s={empty[0]}] is empty: expected at least one action in each state.")
    states = np.arange(mdp.n_states)
    policy = _warm_start(mdp, R, blocked)
    smallest = max(tolerance, 16 * EPSILON / (1 - mdp.gamma))
    for iteration in range(1, max_iterations + 1):
        V = evaluate_policy(mdp, R, policy)
        Q = np.where(blocked, -np.inf, backup(mdp, R, V))
        step = smallest * float(np.abs(V).max()) + 1e-300
        better = Q.max(axis=1) > Q[states, policy] + step
        if not better.any():
            error = float(np.maximum(Q.max(axis=1) - V, 0).max()) / (1 - mdp.gamma)
            return Solution(V, Q, greedy(Q, preference=preference, tie_tolerance=2 * step), error, iteration)
        policy = np.where(better, Q.argmax(axis=1), policy)
    raise InvalidParameter(f"max_iterations is {max_iterations}: policy iteration did not finish.")


def _warm_start(mdp: TabularMDP, R: np.ndarray, blocked: np.ndarray) -> np.ndarray:
    """A policy to begin with: greedy for R; on tables where a factorisation costs, after some cheap improvements."""
    policy = np.where(blocked, -np.inf, R).argmax(axis=1)
    V = np.zeros(mdp.n_states)
    for _ in range(20 if mdp.n_states > 500 else 0):
        V = _evaluation_sweeps(mdp, R, V, policy, 20)
        policy = np.where(blocked, -np.inf, backup(mdp, R, V)).argmax(axis=1)
    return policy


def occupancy(mdp: TabularMDP, policy: Actions | Matrix | ActionSets) -> Matrix:
    """Discounted visits mu(s, a) = sum_t gamma^t P(s_t = s, a_t = a) from d0; sum(mu * R) is the policy's value.

    Terminal states take no action: their rows are 0.
    """
    distribution = as_distribution(policy, mdp.n_states, mdp.n_actions)
    visits = Discounted(mdp.P_pi(policy), mdp.gamma).solve_transposed(mdp.d0)
    return np.where(mdp.terminal[:, None], 0.0, visits[:, None] * distribution)
