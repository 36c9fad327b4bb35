"""What policies learned on a counted table are worth, confirmed by fresh episodes of the environment.

A value computed on counts is an estimate, and the best of many estimates is too high: the maximum over noisy ones is biased
upwards. Episodes that were not counted have neither error. Of N of them, with discounted returns G and first states s_0,

    value     the mean of G, with its 95 % interval
    loss      the mean of V(s_0) - G, V the best value by the table: what the policy loses against the table's best policy

That policy is worth no more than V, which was picked for being large, but for the error that the counts leave in its value:
1.96 sqrt(sum_sa mu(s, a)^2 Var(r + gamma V(s')) / (n(s, a) - 1)), mu how often a step is taken, discounted. A step of which
less than two were counted may be off by all that rewards and V allow. What a policy that is better yet would earn is bounded by
`value_error`, which covers them all and is wider for it. An episode that is cut after T steps leaves out gamma^T / (1 - gamma)
of the largest reward seen at most, which widens both.
Axes: S states, A actions, N episodes.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from scipy.stats import norm

from irl_gym.intervals import LEVEL, Interval, mean_interval
from irl_gym.mdp.episodes import Episode
from irl_gym.mdp.planning.dynamic_programming import occupancy, policy_evaluation, policy_iteration
from irl_gym.mdp.policies import as_distribution
from irl_gym.mdp.sampling_error import spread_of
from irl_gym.tables.tabulation import Tabulation


def value_by_episodes(table: Tabulation, episodes: Sequence[Episode], horizon: int | None = None) -> Interval:
    """The discounted value from the start, by episodes of the environment itself.

    Args:
        table: its gamma, and the largest reward.
        episodes: N, fresh.
        horizon: steps that a value counts; None for all.
    """
    returns, left = _discounted(table, episodes)
    found = mean_interval(returns)
    cut = 0.0 if horizon is not None else left
    return Interval(found.estimate, found.low - cut, found.high + cut)


def loss_by_episodes(table: Tabulation, episodes: Sequence[Episode]) -> Interval:
    """What the policy of some episodes loses against the table's best: an estimate, with 95 % confidence no more than `high`.

    Args:
        table: a counted one.
        episodes: N, fresh, of one policy.
    """
    best = policy_iteration(table.mdp, table.reward)
    returns, left = _discounted(table, episodes)
    first = np.array([int(episode.rows(table.states)[0]) for episode in episodes])
    found = mean_interval(best.V[first] - returns)
    more = counting_error(table, best.policy) + left
    return Interval(found.estimate, found.low - more, found.high + more)


def counting_error(table: Tabulation, policy: np.ndarray) -> float:
    """The error that counts leave in a policy's value from the first states, with 95 % confidence; these are taken as they are.

    Args:
        table: a counted one.
        policy: (S,) actions, (S, A) probabilities or set.
    """
    mdp, payments = table.mdp, table.payments
    assert mdp.visits is not None
    V = policy_evaluation(mdp, table.reward, as_distribution(policy, mdp.n_states, mdp.n_actions))
    if payments.entries is None:
        spread = payments.deviation.ravel() + mdp.gamma * spread_of(mdp, V)
    else:
        worth = mdp.P.copy()
        worth.data = payments.entries + mdp.gamma * V[mdp.P.indices]
        mean = np.asarray(mdp.P.multiply(worth).sum(axis=1)).ravel()
        square = np.asarray(mdp.P.multiply(worth.multiply(worth)).sum(axis=1)).ravel()
        spread = np.sqrt(np.maximum(square - mean**2, 0.0))
    taken = occupancy(mdp, policy).ravel()
    few = mdp.visits.ravel() < 2
    error = np.sqrt(np.sum((taken * spread)[~few] ** 2 / (mdp.visits.ravel()[~few] - 1)))
    unknown = taken[few].sum() * (2 * payments.largest + mdp.gamma * np.ptp(V))
    return float(norm.ppf((1 + LEVEL) / 2) * error + unknown)


def _discounted(table: Tabulation, episodes: Sequence[Episode]) -> tuple[np.ndarray, float]:
    """(N,) discounted returns, and what cutting left out of their mean at most."""
    gamma = table.mdp.gamma
    returns = np.array([gamma ** np.arange(len(one)) @ one.rewards for one in episodes])
    left = np.array([0.0 if one.terminated else gamma ** len(one) for one in episodes])
    return returns, float(left.mean()) * table.payments.largest * table.mdp.effective_horizon


def loss_told(row: Mapping[str, Any]) -> str:
    """What a policy loses at most against the table's best, by its row of metrics.json; nothing where nobody asked."""
    if "loses_at_most" not in row:
        return ""
    most = row["loses_at_most"]
    if most is None:
        return " Episodes that were not counted do not tell what the agent loses against the policy that is best by the table."
    return (
        f" By episodes that were not counted the agent loses at most {most:.3g} of value against the policy that is best by "
        "the table, with 95 % confidence."
    )
