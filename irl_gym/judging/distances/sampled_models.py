"""DARD and STARC from samples, with a model that successors are drawn from.

Their canonical values are means over draws that differ for each transition. K >= 2 replicates of each value are drawn, and
products of different replicates used (`jackknife.replicated_distance`), so that the noise of few draws does not look like a
difference between rewards. Axes: N transitions, K replicates.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from irl_gym.checks import checked_number, checked_rng
from irl_gym.errors import InvalidParameter, a_type
from irl_gym.judging.distances.jackknife import Distance, Roundings, jackknife, replicated_distance
from irl_gym.judging.distances.models import Model, stepped
from irl_gym.judging.distances.sampled import BLOCKS, ROWS, Payer, RewardCall, checked_sample
from irl_gym.judging.distances.transitions import Transitions
from irl_gym.mdp.tabular_mdp import check_discount

SampledActions = Callable[[Any, np.random.Generator], np.ndarray]
"""A policy: (observations, rng) -> (N, ...) actions."""


def sampled_dard(
    first: RewardCall,
    second: RewardCall,
    transitions: Transitions,
    *,
    gamma: float,
    model: Model,
    actions: np.ndarray,
    replicates: int = 8,
    rng: np.random.Generator,
) -> Distance:
    """DARD distance of two reward functions.

    Args:
        first: R(observations, actions, next_observations) -> (N,).
        second: the other.
        transitions: from the coverage distribution D. Observations are arrays.
        gamma: discount.
        model: draws successors. Where s' is terminal it is followed by itself.
        actions: (M, ...) actions from D_A, of which one is drawn for each replicate.
        replicates: K, at least 2.
        rng: for the draws.

    Raises:
        InvalidParameter: observations that are not arrays, a number out of range, or an argument of another kind.
        InvalidReward: a function that gives another shape, or a value that is not finite.
        UndefinedDistance: a canonical reward that is constant on the transitions.
    """
    gamma, K, rng = check_discount(gamma), _replicates(replicates), checked_rng(rng)
    choices, model = np.asarray(actions), _called("model", model, "`TableModel(mdp)`")
    if not (choices.ndim and len(choices)):
        raise InvalidParameter(f"actions is {actions!r}: expected an array of actions to draw from, such as `np.arange(A)`.")
    transitions = checked_sample(transitions, Transitions)
    here, following = _array(transitions.observations), _array(transitions.next_observations)
    rewards = (Payer(first), Payer(second))
    values = np.empty((2, len(transitions), K))
    given = [pays(here, transitions.actions, following) for pays in rewards]
    ended = transitions.ended.reshape(-1, *[1] * (following.ndim - 1))
    for k in range(K):
        drawn = choices[rng.integers(len(choices), size=len(transitions))]
        after_here, _ = stepped(model, here, drawn, rng)
        after_next = np.where(ended, following, stepped(model, following, drawn, rng)[0])
        for r, pays in enumerate(rewards):
            more = pays(following, drawn, after_next) - pays(after_here, drawn, after_next)
            values[r, :, k] = given[r] + gamma * more - pays(here, drawn, after_here)
    return _estimated(values, transitions, (rewards[0].rounding, rewards[1].rounding), centred=True)


def sampled_starc(
    first: RewardCall,
    second: RewardCall,
    transitions: Transitions,
    *,
    gamma: float,
    model: Model,
    policy: SampledActions,
    horizon: int,
    replicates: int = 32,
    rng: np.random.Generator,
) -> Distance:
    """STARC distance of two reward functions: value-adjusted levelling, L2 norms.

    The advantage of (s, a) is estimated by rollouts of the policy, from (s, a) and from s; next observations are not used. Cut
    at the horizon, values lack a share of up to gamma^horizon.

    Args:
        first: R(observations, actions, next_observations) -> (N,).
        second: the other.
        transitions: their pairs (s, a) are what is compared. Observations are arrays.
        gamma: discount.
        model: draws successors, and says which of them are terminal.
        policy: of value-adjusted levelling; it has to take every action that matters, as random actions do.
        horizon: steps of a rollout.
        replicates: K, at least 2: pairs of rollouts from each (s, a). Returns scatter, so many are needed.
        rng: for the draws.

    Raises:
        InvalidParameter: observations that are not arrays, a number out of range, or an argument of another kind.
        InvalidReward: a function that gives another shape, or a value that is not finite.
        UndefinedDistance: a canonical reward that is 0 on the transitions, or drowned in noise.
    """
    gamma, K, rng = check_discount(gamma), _replicates(replicates), checked_rng(rng)
    model = _called("model", model, "`TableModel(mdp)`")
    policy = _called("policy", policy, "`lambda observations, rng: agent.predict(observations)[0]`")
    transitions = checked_sample(transitions, Transitions)
    steps = int(checked_number("horizon", horizon, "a whole number of at least 1", least=1, whole=True))
    here, rewards = _array(transitions.observations), (Payer(first), Payer(second))
    values = np.empty((2, len(transitions), K))
    together = max(ROWS // len(here), 1)
    for done in range(0, K, together):
        k = min(together, K - done)
        many, begin = np.repeat(here, k, axis=0), np.repeat(transitions.actions, k, axis=0)
        gains = _returns(rewards, model, policy, many, begin, gamma, steps, rng)
        gains -= _returns(rewards, model, policy, many, None, gamma, steps, rng)
        values[:, :, done : done + k] = gains.reshape(2, -1, k)
    rounding = (rewards[0].rounding / (1 - gamma), rewards[1].rounding / (1 - gamma))
    return _estimated(values, transitions, rounding, centred=False)


def _returns(
    rewards: tuple[Payer, ...],
    model: Model,
    policy: SampledActions,
    here: np.ndarray,
    begin: np.ndarray | None,
    gamma: float,
    steps: int,
    rng: np.random.Generator,
) -> np.ndarray:
    """(2, N) discounted returns of one rollout from each state, with given first actions or the policy's."""
    total = np.zeros((len(rewards), len(here)))
    going, discount = np.ones(len(here), dtype=bool), 1.0
    for t in range(steps):
        drawn = begin if t == 0 and begin is not None else _acted(policy, here, rng)
        following, ended = stepped(model, here, drawn, rng)
        for r, pays in enumerate(rewards):
            total[r, going] += discount * pays(here[going], drawn[going], following[going])
        going = going & ~ended
        here, discount = following, discount * gamma
        if not going.any():
            break
    return total


def _acted(policy: SampledActions, here: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """(N, ...) what a policy does."""
    found = policy(here, rng)
    if isinstance(found, tuple) or np.shape(found)[:1] != (len(here),):
        raise InvalidParameter(
            f"the policy gives {a_type(found)} for {len(here)} observations: expected an array with one action for "
            "each. Of SB3's predict take the first part: `lambda observations, rng: agent.predict(observations)[0]`."
        )
    return np.asarray(found)


def _estimated(values: np.ndarray, transitions: Transitions, rounding: Roundings, *, centred: bool) -> Distance:
    """The distance of replicated canonical values (2, N, K), and its error."""
    block = transitions.blocks(BLOCKS)

    def distance(kept: np.ndarray | slice) -> float:
        return replicated_distance(values[0][kept], values[1][kept], rounding, centred=centred)

    value = distance(slice(None))
    variance = jackknife(lambda b: distance(block != b), int(block.max()) + 1)
    return Distance(value, float(np.sqrt(variance)), len(transitions))


def _replicates(replicates: Any) -> int:
    return int(checked_number("replicates", replicates, "a whole number of at least 2", least=2, whole=True))


def _called(name: str, given: Any, such: str) -> Any:
    if callable(given):
        return given
    raise InvalidParameter(f"{name} is {a_type(given)}: expected a function, such as {such}.")


def _array(observations: Any) -> np.ndarray:
    if not isinstance(observations, np.ndarray):
        raise InvalidParameter(
            f"the observations are {a_type(observations)}: expected an array, which a model can step. Flatten them, "
            "for example with `gymnasium.wrappers.FlattenObservation`."
        )
    return observations
