"""How good a policy is under the true reward, and what a learned reward allows (exact, on tables).

Values are discounted and from d0. A learned reward usually leaves several policies greedy; the *worst tie* is the one of
them that is worst under the true reward, which is what an unlucky learner finds.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from irl_gym._typing import ActionSets, Matrix
from irl_gym.dynamic_programming import evaluate_policy, policy_iteration, tied
from irl_gym.mdp import TabularMDP
from irl_gym.policies import as_distribution
from irl_gym.rewards import TabularReward, as_reward

TIE_TOLERANCE = 1e-6
"""Actions with Q within this of the best are greedy, in units of the reward's largest |R|."""


@dataclass(frozen=True, eq=False)
class WorstTie:
    """The worst policy among those greedy under a learned reward."""

    policy: np.ndarray
    """(S,) its actions."""
    value: float
    """Its true value from d0."""
    tied: ActionSets
    """(S, A) the greedy actions."""


def policy_value(mdp: TabularMDP, reward: TabularReward | np.ndarray, policy: Any, horizon: int | None = None) -> float:
    """Exact discounted value of a policy from d0: d0 . (I - gamma P_pi)^-1 R_pi.

    Args:
        mdp: P, gamma and d0.
        reward: (S,) paid on arrival, or (S, A).
        policy: (S,) actions, (S, A) probabilities or set.
        horizon: count only this many steps; None for all.
    """
    if horizon is None:
        return float(mdp.d0 @ evaluate_policy(mdp, as_reward(reward), policy))
    mixing = mdp.mixing(policy)
    P_pi, R_pi = mixing @ mdp.P, mixing @ as_reward(reward).expected(mdp).ravel()
    at, value = mdp.d0, 0.0
    for time in range(horizon):
        value += mdp.gamma**time * float(at @ R_pi)
        at = at @ P_pi
    return value


def random_value(mdp: TabularMDP, reward: TabularReward | np.ndarray) -> float:
    """Exact discounted value of uniformly random actions from d0."""
    uniform = np.full((mdp.n_states, mdp.n_actions), 1 / mdp.n_actions)
    return policy_value(mdp, reward, uniform)


def optimal_actions(mdp: TabularMDP, reward: TabularReward | np.ndarray, *, tolerance: float = TIE_TOLERANCE) -> ActionSets:
    """(S, A) the actions that are optimal, to a tolerance in units of max |R|."""
    reward = as_reward(reward)
    return tied(policy_iteration(mdp, reward).Q, tolerance * float(np.abs(reward.values).max()))


def worst_tie(
    mdp: TabularMDP, learned: TabularReward | np.ndarray, true: TabularReward | np.ndarray, *, tolerance: float = TIE_TOLERANCE
) -> WorstTie:
    """The worst policy under `true` among those greedy under `learned`: dynamic programming over the tied actions."""
    ties = optimal_actions(mdp, learned, tolerance=tolerance)
    worst = policy_iteration(mdp, -as_reward(true).expected(mdp), allowed=ties)
    return WorstTie(worst.policy, -float(mdp.d0 @ worst.V), ties)


def normalised_score(value: float, random: float, expert: float) -> float:
    """Where a value lies between a random policy (0) and the expert (1); NaN when these are equal."""
    return (value - random) / (expert - random) if expert != random else float("nan")


def agreement(mdp: TabularMDP, policy: Any, good: ActionSets) -> float:
    """Share of the reachable, non-terminal states in which a policy takes an action of the set `good` (S, A).

    A stochastic policy counts with the probability it gives to the set.
    """
    acting = mdp.reachable & ~mdp.terminal
    probabilities: Matrix = as_distribution(policy, mdp.n_states, mdp.n_actions)
    return float((probabilities * good).sum(axis=1)[acting].mean())


def mean_interval(values: np.ndarray, *, rng: np.random.Generator, resamples: int = 2000) -> tuple[float, float, float]:
    """The mean of sampled returns with a bootstrapped 95 % interval: mean, low, high."""
    values = np.asarray(values, dtype=np.float64)
    means = values[rng.integers(values.size, size=(resamples, values.size))].mean(axis=1)
    low, high = np.quantile(means, [0.025, 0.975])
    return float(values.mean()), float(low), float(high)
