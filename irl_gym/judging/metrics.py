"""How good a policy is under the true reward, and what a learned reward allows (exact, on tables).

Values are discounted and from d0. A learned reward usually leaves several policies greedy; the *worst tie* is the one of
them that is worst under the true reward, which is what an unlucky learner finds.
"""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from irl_gym._typing import ActionSets, Matrix, Vector
from irl_gym.checks import checked_number, is_word
from irl_gym.errors import InvalidParameter
from irl_gym.mdp.planning.dynamic_programming import occupancy, optimum, policy_evaluation, policy_iteration
from irl_gym.mdp.planning.finite_horizon import value_within
from irl_gym.mdp.planning.howard import OUTWARDS, Optimum
from irl_gym.mdp.policies import as_distribution
from irl_gym.mdp.rewards import TabularReward, as_reward
from irl_gym.mdp.sampling_error import not_told
from irl_gym.mdp.tabular_mdp import TabularMDP, checked_mdp
from irl_gym.records import Record

TINY = float(np.finfo(np.float64).tiny)


@dataclass(frozen=True, eq=False)
class Ties(Record):
    """Which actions are as good as the best: decided by bounds of their values, rounding included."""

    tied: ActionSets
    """(S, A) as good, to the rounding of the table's own numbers; all in terminal states."""
    undecided: ActionSets
    """(S, A) neither tied nor worse for certain: hidden by what the solver of a learned reward left open, by rounding, or on a
    counted table by what the counts do not tell."""

    @property
    def possible(self) -> ActionSets:
        """(S, A) the actions that may be as good as the best: tied or undecided."""
        return self.tied | self.undecided


@dataclass(frozen=True)
class Agreement(Record):
    """How often a policy does what a reward asks for, over the reachable states that are not terminal."""

    share: float
    """Share of the states in which its action is tied with the best, or may be; NaN where every start is terminal."""
    undecided: float
    """The part of it in which that is undecided."""


@dataclass(frozen=True, eq=False)
class Tie(Record):
    """A policy among those greedy under a learned reward: the worst or the best of them under the true one."""

    policy: np.ndarray
    """(S,) its actions."""
    value: float
    """Its true value from d0."""
    tied: ActionSets
    """(S, A) the greedy actions, undecided ones among them."""
    error: float
    """Bound on how far `value` is from the worst or best, rounding included."""


@dataclass(frozen=True, eq=False)
class Regret(Record):
    """What a policy loses against an optimal one, in discounted value under the true reward."""

    value: float
    """From d0."""
    per_state: Vector
    """(S,) from each state on; 0 in terminal ones."""
    optimal: float
    """The optimal value from d0."""
    error: float
    """Bound on the error of `value`, rounding included."""


def policy_value(mdp: TabularMDP, reward: TabularReward | np.ndarray, policy: Any, horizon: int | None = None) -> float:
    """Exact discounted value of a policy from d0: d0 . (I - gamma P_pi)^-1 R_pi.

    Args:
        mdp: P, gamma and d0.
        reward: (S,) paid on arrival, or (S, A).
        policy: (S,) actions, (S, A) probabilities or set.
        horizon: count only this many steps; None for all.

    Raises:
        InvalidMDP, InvalidReward, InvalidPolicy: no table, or a reward or policy of another.
        InvalidParameter: a horizon that is not a whole number of at least 1.
    """
    if horizon is None:
        return float(checked_mdp(mdp).d0 @ policy_evaluation(mdp, as_reward(reward), policy))
    return value_within(checked_mdp(mdp), as_reward(reward), policy, horizon=horizon, gamma=mdp.gamma)


def random_value(mdp: TabularMDP, reward: TabularReward | np.ndarray) -> float:
    """Exact discounted value of uniformly random actions from d0."""
    uniform = np.full((checked_mdp(mdp).n_states, mdp.n_actions), 1 / mdp.n_actions)
    return policy_value(mdp, reward, uniform)


def ties(mdp: TabularMDP, reward: TabularReward | np.ndarray, *, tolerance: float | None = None) -> Ties:
    """Which actions are optimal, and of which that is undecided.

    Args:
        mdp: P, gamma and d0.
        reward: (S,) paid on arrival, or (S, A).
        tolerance: differences up to this share of the largest |R| that can be paid are undecided; None for what the reward's
            own solver left open (`TabularReward.tolerance`), which is nothing for a reward that is given.

    Raises:
        InvalidMDP, InvalidReward: no table, or a reward of another.
        InvalidParameter: a negative tolerance.
    """
    reward, open_ = as_reward(reward), 0.0
    found = optimum(checked_mdp(mdp), reward)
    if tolerance is None:
        open_ = reward.tolerance
    else:
        expected = "a share of max |R| of at least 0, such as 1e-6, or None"
        open_ = checked_number("tolerance", tolerance, expected, least=0) * reward.largest(mdp)
    return ties_of(found, open_)


def ties_of(found: Optimum, left_open: float) -> Ties:
    """The ties of an optimum under a reward whose solver left differences of action values open up to `left_open`."""
    gap, wide = found.gaps
    mdp, reward = found.table.mdp, found.table.reward
    tied, open_ = (gap + wide <= found.level) | mdp.terminal[:, None], found.level + left_open
    if mdp.visits is not None:  # what the counts leave open between actions of the same successors
        open_ = open_ + not_told(mdp, found.policy, mdp.gamma * found.V + (reward.values if reward.on_states else 0.0))
    return Ties(tied, (gap - wide <= open_) & ~tied)


def optimal_actions(mdp: TabularMDP, reward: TabularReward | np.ndarray, *, tolerance: float | None = None) -> ActionSets:
    """(S, A) the actions that are or may be optimal; arguments and errors as `ties`."""
    return ties(mdp, reward, tolerance=tolerance).possible


def worst_tie(
    mdp: TabularMDP,
    learned: TabularReward | np.ndarray,
    true: TabularReward | np.ndarray,
    *,
    tolerance: float | None = None,
) -> Tie:
    """The worst policy under `true` among those greedy under `learned`: dynamic programming over the tied actions.

    Undecided actions count as tied: what a solver left open, or counts do not tell, an agent may take. Arguments and errors as
    `ties`.
    """
    allowed = optimal_actions(mdp, learned, tolerance=tolerance)
    worst = policy_iteration(mdp, _negative(true), allowed=allowed)
    return Tie(worst.policy, -float(mdp.d0 @ worst.V), allowed, worst.error)


def best_tie(
    mdp: TabularMDP,
    learned: TabularReward | np.ndarray,
    true: TabularReward | np.ndarray,
    *,
    tolerance: float | None = None,
) -> Tie:
    """The best policy under `true` among those greedy under `learned`: what a learner with luck finds."""
    allowed = optimal_actions(mdp, learned, tolerance=tolerance)
    best = policy_iteration(mdp, as_reward(true), allowed=allowed)
    return Tie(best.policy, float(mdp.d0 @ best.V), allowed, best.error)


def _negative(reward: TabularReward | np.ndarray) -> TabularReward:
    return TabularReward(-as_reward(reward).values)


def regret(mdp: TabularMDP, true: TabularReward | np.ndarray, policy: Any) -> Regret:
    """V* - V_pi under the true reward, from d0 and from each state; found as a sum of losses, not as a difference of values.

    Args:
        mdp: P, gamma and d0.
        true: (S,) paid on arrival, or (S, A).
        policy: (S,) actions, (S, A) probabilities or set.
    """
    found = optimum(checked_mdp(mdp), as_reward(true))
    behind, unsure = found.behind(as_distribution(policy, mdp.n_states, mdp.n_actions))
    lost = np.maximum(behind, 0.0)  # below 0 by rounding only
    error = float(mdp.d0 @ (unsure + found.error)) * (1 + OUTWARDS)
    return Regret(float(mdp.d0 @ lost), lost, float(mdp.d0 @ found.W.values), error)


def expected_value_difference(
    mdp: TabularMDP,
    true: TabularReward | np.ndarray,
    learned: TabularReward | np.ndarray,
    expert: Any = None,
    *,
    tolerance: float | None = None,
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
        tolerance: what counts as tied; see `ties`.
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
    mdp: TabularMDP, learned: TabularReward | np.ndarray, expert: Any, *, tolerance: float | None = None
) -> Agreement:
    """Share of the reachable, non-terminal states whose expert's action is, or may be, the learned reward's best.

    Comparing the actions of two greedy policies calls every tie broken differently a disagreement; this does not.
    Arguments and errors as `ties`.
    """
    found = ties(mdp, learned, tolerance=tolerance)
    return Agreement(agreement(mdp, expert, found.possible), agreement(mdp, expert, found.undecided))


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
    if not is_word(on, "state", "state-action"):
        raise InvalidParameter(f"on is {on!r}: expected 'state' or 'state-action'.")
    visits = [occupancy(checked_mdp(mdp), policy) for policy in (first, second)]
    if on == "state":
        visits = [mu.sum(axis=1) for mu in visits]
    one, other = (mu / max(mu.sum(), TINY) for mu in visits)
    return min(1.0, float(np.abs(one - other).sum() / 2))
