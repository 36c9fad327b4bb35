"""How good a policy is under the true reward, and what a learned reward allows (exact, on tables).

Values are discounted and from d0. A learned reward usually leaves several policies greedy; the *worst tie* is the one of
them that is worst under the true reward, which is what an unlucky learner finds.
"""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from irl_gym._typing import ActionSets, Matrix, Vector
from irl_gym.checks import checked_number
from irl_gym.dynamic_programming import evaluate_policy, occupancy, policy_iteration, tied
from irl_gym.errors import InvalidParameter
from irl_gym.mdp import TabularMDP, checked_mdp
from irl_gym.policies import as_distribution
from irl_gym.rewards import TabularReward, as_reward
from irl_gym.sampling_error import undecided

TINY = float(np.finfo(np.float64).tiny)
TIE_TOLERANCE = 1e-6
"""Actions with Q within this of the best are greedy, in units of the reward's largest |R|."""


@dataclass(frozen=True, eq=False)
class Tie:
    """A policy among those greedy under a learned reward: the worst or the best of them under the true one."""

    policy: np.ndarray
    """(S,) its actions."""
    value: float
    """Its true value from d0."""
    tied: ActionSets
    """(S, A) the greedy actions."""


@dataclass(frozen=True, eq=False)
class Regret:
    """What a policy loses against an optimal one, in discounted value under the true reward."""

    value: float
    """From d0."""
    per_state: Vector
    """(S,) from each state on; 0 in terminal ones."""
    optimal: float
    """The optimal value from d0."""


def policy_value(mdp: TabularMDP, reward: TabularReward | np.ndarray, policy: Any, horizon: int | None = None) -> float:
    """Exact discounted value of a policy from d0: d0 . (I - gamma P_pi)^-1 R_pi.

    Args:
        mdp: P, gamma and d0.
        reward: (S,) paid on arrival, or (S, A).
        policy: (S,) actions, (S, A) probabilities or set.
        horizon: count only this many steps; None for all.

    Raises:
        InvalidMDP, InvalidReward, InvalidPolicy: no table, or a reward or policy of another.
        InvalidParameter: a horizon that is not a whole number of at least 0.
    """
    if horizon is None:
        return float(checked_mdp(mdp).d0 @ evaluate_policy(mdp, as_reward(reward), policy))
    steps = int(checked_number("horizon", horizon, "a whole number of steps of at least 0, or None", least=0, whole=True))
    mixing = checked_mdp(mdp).mixing(policy)
    P_pi, R_pi = mixing @ mdp.P, mixing @ as_reward(reward).expected(mdp).ravel()
    at, value = mdp.d0, 0.0
    for time in range(steps):
        value += mdp.gamma**time * float(at @ R_pi)
        at = at @ P_pi
    return value


def random_value(mdp: TabularMDP, reward: TabularReward | np.ndarray) -> float:
    """Exact discounted value of uniformly random actions from d0."""
    uniform = np.full((checked_mdp(mdp).n_states, mdp.n_actions), 1 / mdp.n_actions)
    return policy_value(mdp, reward, uniform)


def tie_tolerance(mdp: TabularMDP, reward: TabularReward | np.ndarray, share: float = TIE_TOLERANCE) -> float:
    """What counts as tied, in units of value: a share of the largest |R| that can be paid."""
    return share * as_reward(reward).largest(mdp)


def optimal_actions(mdp: TabularMDP, reward: TabularReward | np.ndarray, *, tolerance: float = TIE_TOLERANCE) -> ActionSets:
    """(S, A) the actions that are optimal, to a tolerance in units of the largest |R| that can be paid.

    Raises:
        InvalidMDP, InvalidReward: no table, or a reward of another.
        InvalidParameter: a negative tolerance.
    """
    tolerance = checked_number("tolerance", tolerance, "a share of max |R| of at least 0, such as 1e-6", least=0)
    reward = as_reward(reward)
    return tied(policy_iteration(checked_mdp(mdp), reward).Q, tie_tolerance(mdp, reward, tolerance))


def worst_tie(
    mdp: TabularMDP, learned: TabularReward | np.ndarray, true: TabularReward | np.ndarray, *, tolerance: float = TIE_TOLERANCE
) -> Tie:
    """The worst policy under `true` among those greedy under `learned`: dynamic programming over the tied actions.

    On a counted table actions whose successors the counts do not tell from a greedy one's are tied with it.
    """
    ties = optimal_actions(mdp, learned, tolerance=tolerance)
    if mdp.visits is not None:
        ties |= _not_told_from_greedy(mdp, as_reward(learned))
    worst = policy_iteration(mdp, -as_reward(true).expected(mdp), allowed=ties)
    return Tie(worst.policy, -float(mdp.d0 @ worst.V), ties)


def _not_told_from_greedy(mdp: TabularMDP, learned: TabularReward) -> ActionSets:
    """(S, A) actions that on a counted table have a greedy one's successors, and are within their sampling error of it."""
    solution = policy_iteration(mdp, learned)
    worth = mdp.gamma * solution.V + (learned.values if learned.on_states else 0.0)
    short = solution.Q.max(axis=1, keepdims=True) - solution.Q
    return short <= undecided(mdp, solution.policy, worth)


def best_tie(
    mdp: TabularMDP, learned: TabularReward | np.ndarray, true: TabularReward | np.ndarray, *, tolerance: float = TIE_TOLERANCE
) -> Tie:
    """The best policy under `true` among those greedy under `learned`: what a learner with luck finds."""
    ties = optimal_actions(mdp, learned, tolerance=tolerance)
    best = policy_iteration(mdp, as_reward(true).expected(mdp), allowed=ties)
    return Tie(best.policy, float(mdp.d0 @ best.V), ties)


def regret(mdp: TabularMDP, true: TabularReward | np.ndarray, policy: Any) -> Regret:
    """V* - V_pi under the true reward, from d0 and from each state.

    Args:
        mdp: P, gamma and d0.
        true: (S,) paid on arrival, or (S, A).
        policy: (S,) actions, (S, A) probabilities or set.
    """
    true = as_reward(true)
    best = policy_iteration(checked_mdp(mdp), true).V
    lost = np.maximum(best - evaluate_policy(mdp, true, policy), 0.0)  # below 0 by rounding only
    return Regret(float(mdp.d0 @ lost), lost, float(mdp.d0 @ best))


def expected_value_difference(
    mdp: TabularMDP,
    true: TabularReward | np.ndarray,
    learned: TabularReward | np.ndarray,
    expert: Any = None,
    *,
    tolerance: float = TIE_TOLERANCE,
) -> float:
    """Expert's value less that of a policy planned for the learned reward, both under the true one and from d0.

    The planned policy takes each of its tied actions with the same probability, so the figure does not depend on the order
    of actions; `worst_tie` and `best_tie` bound it. (Levine, Popovic & Koltun 2011, section 6.) Below 0 when the planned
    policy is better than an expert that errs.

    Args:
        mdp: P, gamma and d0.
        true: (S,) paid on arrival, or (S, A).
        learned: the same, of either kind.
        expert: (S,) actions, (S, A) probabilities or set; None for an optimal one.
        tolerance: what counts as tied; see `optimal_actions`.
    """
    true = as_reward(true)
    value = float(checked_mdp(mdp).d0 @ policy_iteration(mdp, true).V) if expert is None else policy_value(mdp, true, expert)
    return value - policy_value(mdp, true, optimal_actions(mdp, learned, tolerance=tolerance))


def normalised_score(value: float, random: float, expert: float) -> float:
    """Where a value lies between a random policy (0) and the expert (1); NaN when these are equal."""
    return (value - random) / (expert - random) if expert != random else float("nan")


def agreement(mdp: TabularMDP, policy: Any, good: ActionSets) -> float:
    """Share of the reachable, non-terminal states in which a policy takes an action of the set `good` (S, A).

    A stochastic policy counts with the probability it gives to the set. NaN where every start is terminal.

    Raises:
        InvalidMDP, InvalidPolicy: no table, or a policy of another.
        InvalidParameter: `good` of another shape, or of something else than booleans.
    """
    acting = checked_mdp(mdp).reachable & ~mdp.terminal
    probabilities: Matrix = as_distribution(policy, mdp.n_states, mdp.n_actions)
    chosen = np.asarray(good)
    if chosen.shape != probabilities.shape or chosen.dtype != bool:
        raise InvalidParameter(
            f"good has shape {chosen.shape} and dtype {chosen.dtype}: expected {probabilities.shape} booleans, such as "
            "`optimal_actions(mdp, reward)`."
        )
    return float((probabilities * chosen).sum(axis=1)[acting].mean()) if acting.any() else float("nan")


def tie_aware_agreement(
    mdp: TabularMDP, learned: TabularReward | np.ndarray, expert: Any, *, tolerance: float = TIE_TOLERANCE
) -> float:
    """Share of the reachable, non-terminal states whose expert's action is within a tolerance of the learned reward's best.

    Comparing the actions of two greedy policies calls every tie broken differently a disagreement; this does not.
    """
    return agreement(mdp, expert, optimal_actions(mdp, learned, tolerance=tolerance))


def occupancy_distance(
    mdp: TabularMDP, first: Any, second: Any, *, on: Literal["state", "state-action"] = "state-action"
) -> float:
    """Total variation between the discounted occupancies of two policies: 0 for the same behaviour, 1 for none in common.

    Each occupancy mu(s, a) = sum_t gamma^t P(s_t = s, a_t = a) is divided by its sum. Terminal states take no step; where every
    episode starts in one, no step is ever taken and all policies are the same.

    Args:
        mdp: P, gamma and d0.
        first: (S,) actions, (S, A) probabilities or set.
        second: the same.
        on: compare where the policies are, or what they do there as well.

    Raises:
        InvalidParameter: `on` is neither.
    """
    if on not in ("state", "state-action"):
        raise InvalidParameter(f"on is {on!r}: expected 'state' or 'state-action'.")
    visits = [occupancy(checked_mdp(mdp), policy) for policy in (first, second)]
    if on == "state":
        visits = [mu.sum(axis=1) for mu in visits]
    one, other = (mu / max(mu.sum(), TINY) for mu in visits)
    return min(1.0, float(np.abs(one - other).sum() / 2))
