"""Dynamic programming on sparse tables (Puterman 1994, chapter 6): pure functions of an MDP and a reward.

The reward is R (S, A), what a step pays in expectation, or a TabularReward. A terminal state has no steps, so its value is 0.
    Q = R + gamma P V          V(s) = max_a Q(s, a)
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from irl_gym._typing import Actions, ActionSets, Matrix, Vector
from irl_gym.checks import checked_number, float_array
from irl_gym.errors import InvalidParameter, InvalidReward
from irl_gym.mdp.planning.discounted import EPSILON, Discounted
from irl_gym.mdp.planning.howard import Optimum, howard, sweeps_of
from irl_gym.mdp.planning.precise import effective_horizon
from irl_gym.mdp.policies import as_distribution
from irl_gym.mdp.rewards import TabularReward, check_reward_itself
from irl_gym.mdp.tabular_mdp import TabularMDP, checked_mdp
from irl_gym.programs.killable import check_limit
from irl_gym.records import Record

Reward = Matrix | TabularReward
"""(S, A) what a step pays in expectation, or a TabularReward of either kind."""


@dataclass(frozen=True, eq=False)
class Solution(Record):
    """An optimal policy with its values, and how far from optimal they can be."""

    V: Vector
    """(S,) values."""
    Q: Matrix
    """(S, A) action values of V; -infinity where an action is not allowed."""
    policy: Actions
    """(S,) greedy actions; ties broken by the caller's order of preference."""
    error: float
    """Bound, rounding included, on |V(s) - V*(s)| and on V*(s) - V_policy(s) in every state."""
    iterations: int
    """Improvement steps made."""


def backup(mdp: TabularMDP, R: Matrix, V: Vector) -> Matrix:
    """Q = R + gamma P V: the value (S, A) of one step and then V."""
    return R + mdp.gamma * (mdp.P @ V).reshape(mdp.n_states, mdp.n_actions)


def checked_reward(mdp: TabularMDP, R: Reward) -> Matrix:
    """Return R, an array or a TabularReward, as (S, A) floats with zero rows at terminal states.

    Raises:
        InvalidMDP: no table.
        InvalidReward: wrong shape, NaN or infinite.
    """
    mdp = checked_mdp(mdp)
    check_reward_itself(R)
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
    return first_preferred(tied(Q, tie_tolerance), preference)


def first_preferred(good: ActionSets, preference: Sequence[int] | None = None) -> Actions:
    """(S,) the first in `preference` among each state's good actions (S, A).

    Raises:
        InvalidParameter: `preference` is not a permutation of the actions.
    """
    order = np.arange(good.shape[1]) if preference is None else np.asarray(preference)
    if sorted(order.tolist()) != list(range(good.shape[1])):
        raise InvalidParameter(f"preference is {list(order)}: expected every action from 0 to {good.shape[1] - 1} once.")
    return order[good[:, order].argmax(axis=1)].astype(np.int64)


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
    """Iterate V <- max_a Q until V and the value of its greedy policy are within `tolerance` of V* in the sup norm.

    With `sweeps` > 0 each improvement is followed by that many sweeps of V <- R_pi + gamma P_pi V with the greedy policy:
    modified policy iteration (Puterman 1994, section 6.5), the fastest here on large sparse tables.

    With d = ||TV - V|| gamma / (1 - gamma) plus rounding, V is within d of V* and a greedy policy's value within 2 d (Puterman,
    theorem 6.3.1); ties up to (1 - gamma) / 4 of the tolerance cost a quarter of it more. The stop is where that is at most the
    tolerance. The span is not used, since it leaves V wrong by a constant.

    Args:
        mdp: S states, A actions.
        R: (S, A) reward of a step, or a TabularReward.
        tolerance: of V and of the policy's value, in units of value; the default is 1e-10 of max |R| / (1 - gamma), or what
            float64 can reach.
        sweeps: evaluation sweeps after each improvement.
        preference: order in which ties are broken in the policy returned.
        max_iterations: improvement steps at most.

    Raises:
        InvalidReward: wrong shape or not finite.
        InvalidParameter: a tolerance below what float64 can reach, or `max_iterations` spent.
    """
    R = checked_reward(mdp, R)
    steps = effective_horizon(mdp)
    scale = max(float(np.abs(R).max(initial=0.0)) * steps, 1e-290)
    terms = int(np.diff(mdp.P.indptr).max(initial=0)) + 4
    rounding = terms * EPSILON * scale * steps
    expected = f"more than {4 * rounding:.1e}, the rounding of values up to {scale:.3g}"
    tolerance = max(1e-10 * scale, 16 * rounding) if tolerance is None else tolerance
    tolerance = checked_number("tolerance", tolerance, expected, above=4 * rounding)
    tie = tolerance / steps / 4
    V, error = np.zeros(mdp.n_states), np.inf
    for iteration in range(1, max_iterations + 1):
        check_limit()
        Q = backup(mdp, R, V)
        improved = Q.max(axis=1)
        error = mdp.gamma * steps * float(np.abs(improved - V).max()) + rounding
        V = improved
        if 2 * error + tolerance / 4 <= tolerance:
            Q = backup(mdp, R, V)
            return Solution(V, Q, greedy(Q, preference=preference, tie_tolerance=tie), 2 * error + tolerance / 4, iteration)
        if sweeps:
            V = sweeps_of(mdp, R, V, Q.argmax(axis=1), sweeps)
    raise InvalidParameter(
        f"max_iterations is {max_iterations}: V is within {error:.2e} of V*, not {3 / 8 * tolerance:.2e}, as the policy needs. "
        "Raise it, or `tolerance`."
    )


def policy_evaluation(mdp: TabularMDP, R: Reward, policy: Actions | Matrix | ActionSets) -> Vector:
    """V = (I - gamma P_pi)^-1 R_pi by one sparse factorisation, equation (5) of Ng & Russell with rewards on steps.

    Fast where successors are near one another, as on grids; where they are anywhere the factors fill in.

    Raises:
        InvalidReward: wrong shape or not finite.
        InvalidPolicy: wrong shape or content.
    """
    mixing = checked_mdp(mdp).mixing(policy)
    return Discounted(sp.csr_array(mixing @ mdp.P), mdp.gamma).solve(mixing @ checked_reward(mdp, R).ravel())


def policy_iteration(
    mdp: TabularMDP,
    R: Reward,
    *,
    allowed: ActionSets | None = None,
    preference: Sequence[int] | None = None,
    max_iterations: int = 10_000,
) -> Solution:
    """Howard's policy iteration with exact evaluation, improved until extended precision sees nothing better (`howard`).

    Policies are never compared: with ties they can alternate for ever. V is the value of the last policy evaluated; the policy
    returned differs from it in ties only, broken by `preference`.

    Args:
        mdp: S states, A actions.
        R: (S, A) reward of a step, or a TabularReward.
        allowed: (S, A) actions the policy may use; the default is all.
        preference: order in which ties are broken in the policy returned.
        max_iterations: improvement steps at most.

    Raises:
        InvalidReward: wrong shape or not finite.
        InvalidParameter: `allowed` of another shape or with an empty row, or `max_iterations` spent.
    """
    found = optimum(mdp, R, allowed=allowed, max_iterations=max_iterations)
    policy = first_preferred(found.tied(), preference)
    rounding = EPSILON * float(np.abs(found.V).max(initial=0.0))
    return Solution(found.V, found.Q, policy, found.bound(policy) + rounding, found.iterations)


def optimum(mdp: TabularMDP, R: Reward, *, allowed: ActionSets | None = None, max_iterations: int = 10_000) -> Optimum:
    """What policy iteration finds, with advantages in extended precision and bounds; arguments and errors as there."""
    reward = R if isinstance(R, TabularReward) else TabularReward(checked_reward(mdp, R))
    shape = reward.expected(checked_mdp(mdp)).shape
    if allowed is not None and np.shape(allowed) != shape:
        raise InvalidParameter(f"allowed has shape {np.shape(allowed)}: expected {shape}, a set of actions for each state.")
    blocked = np.zeros(shape, dtype=bool) if allowed is None else ~np.asarray(allowed, dtype=bool)
    empty = np.flatnonzero(blocked.all(axis=1))
    if empty.size:
        raise InvalidParameter(f"allowed[s={empty[0]}] is empty: expected at least one action in each state.")
    return howard(mdp, reward, blocked, max_iterations)


def occupancy(mdp: TabularMDP, policy: Actions | Matrix | ActionSets) -> Matrix:
    """Discounted visits mu(s, a) = sum_t gamma^t P(s_t = s, a_t = a) from d0; sum(mu * R) is the policy's value.

    Terminal states take no action: their rows are 0.
    """
    distribution = as_distribution(policy, mdp.n_states, mdp.n_actions)
    visits = Discounted(mdp.P_pi(policy), mdp.gamma).solve_transposed(mdp.d0)
    return np.where(mdp.terminal[:, None], 0.0, visits[:, None] * distribution)
