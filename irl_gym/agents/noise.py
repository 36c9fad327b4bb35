"""Experts that err: any expert made worse by a stated amount, for studies of suboptimal demonstrations.

Two kinds of error, each for tables and for whatever has `predict`:
    epsilon    with probability epsilon a uniformly random action in place of the expert's own
                   pi'(a | s) = (1 - epsilon) pi(a | s) + epsilon / A
    softness   actions in proportion to exp(preference / temperature): mistakes that cost little are made often, others
               rarely. For a table the preference is the expert's own action value,
                   pi'(a | s) ~ exp(Q^pi(s, a) / temperature)
               0 is greedy with ties taken uniformly, infinity is uniform. `experts.SoftAgent` does it to an SB3 agent.
Axes: S states, A actions, N observations.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from irl_gym._typing import Actions, ActionSets, Matrix
from irl_gym.checks import checked_number, float_array
from irl_gym.errors import InvalidParameter, InvalidPolicy, a_type
from irl_gym.mdp.planning.dynamic_programming import Reward, backup, checked_reward, policy_evaluation, tied
from irl_gym.mdp.policies import NOISE, Policy, as_distribution, generator
from irl_gym.mdp.tabular_mdp import TabularMDP

TIE = 1e-9
"""Values this close, relative to the largest, are ties when nothing but rounding tells them apart."""


def noisy(policy: Actions | Matrix | ActionSets, epsilon: float, n_actions: int | None = None) -> Matrix:
    """A table that takes a uniformly random action with probability epsilon: (1 - epsilon) pi + epsilon / A, (S, A).

    Args:
        policy: (S,) actions, (S, A) probabilities or (S, A) set, taken uniformly.
        epsilon: from 0, the policy itself, to 1, uniform.
        n_actions: A; needed for (S,) actions, which do not tell it.

    Raises:
        InvalidParameter: epsilon outside 0 to 1, or no number of actions.
        InvalidPolicy: wrong shape or content.
    """
    epsilon = checked_epsilon(epsilon)
    shape = np.shape(policy)
    if len(shape) not in (1, 2) or shape[0] == 0:
        raise InvalidPolicy(f"policy has shape {shape}: expected (S,) actions or (S, A). Give one entry for each state.")
    if n_actions is None and len(shape) == 1:
        raise InvalidParameter("n_actions is None: expected their number, which (S,) actions do not tell. Give n_actions.")
    count = shape[1] if n_actions is None else checked_count(n_actions)
    distribution = as_distribution(policy, shape[0], count)
    return (1 - epsilon) * distribution + epsilon / count


def boltzmann(Q: Matrix, temperature: float) -> Matrix:
    """Softmax of each row of Q / temperature: (S, A) probabilities.

    Args:
        Q: (S, A) preferences, such as action values.
        temperature: in units of Q; 0 for greedy with ties taken uniformly, infinity for uniform.

    Raises:
        InvalidParameter: a preference that is not finite, or a temperature that is negative or NaN.
    """
    temperature = checked_temperature(temperature)
    Q = float_array("Q", Q, "(S, A) numbers", InvalidParameter)
    if Q.ndim != 2 or Q.shape[1] == 0:
        raise InvalidParameter(f"Q has shape {Q.shape}: expected (S, A), a preference for each state and action.")
    wrong = np.argwhere(~np.isfinite(Q))
    if wrong.size:
        s, a = wrong[0]
        raise InvalidParameter(f"Q[s={s}, a={a}] is {Q[s, a]}: a preference is a finite number.")
    if temperature == np.inf:
        return np.full(Q.shape, 1 / Q.shape[1])
    if temperature == 0:
        best = tied(Q, TIE * float(np.abs(Q).max(initial=0.0)))
        return best / best.sum(axis=1, keepdims=True)
    with np.errstate(over="ignore", under="ignore"):  # far below the best is minus infinity, whose weight is the 0 meant
        weights = np.exp((Q - Q.max(axis=1, keepdims=True)) / temperature)
    return weights / weights.sum(axis=1, keepdims=True)


def boltzmann_expert(mdp: TabularMDP, R: Reward, policy: Actions | Matrix | ActionSets, temperature: float) -> Matrix:
    """The expert that errs the less, the more an error costs: softmax of Q^pi / temperature, (S, A) probabilities.

    Args:
        mdp: S states, A actions.
        R: (S, A) what a step pays, or a TabularReward.
        policy: the expert pi: (S,) actions, (S, A) probabilities or set. It is what is played after the one step.
        temperature: in units of value; 0 for the actions that are best when pi follows, infinity for uniform.

    Raises:
        InvalidReward: wrong shape or not finite.
        InvalidPolicy: wrong shape or content.
        InvalidParameter: a temperature that is negative or NaN.
    """
    temperature = checked_temperature(temperature)
    V = policy_evaluation(mdp, R, policy)
    return boltzmann(backup(mdp, checked_reward(mdp, R), V), temperature)


@dataclass(frozen=True, eq=False)
class Noisy:
    """Any policy, but with probability epsilon a uniformly random action in place of its own.

    The noise belongs to the expert: with `deterministic=True` the policy underneath is asked for its deterministic action, and
    the noise stays. A batch is given the noise that its observations would be given one by one.

    Raises:
        InvalidParameter: no policy, epsilon outside 0 to 1, fewer than 1 actions or a negative seed.
    """

    policy: Policy
    """Who is made worse; its actions count from 0."""
    epsilon: float
    """Probability of a random action, from 0 to 1. It may be the policy's own, so actions change with epsilon (1 - 1/A)."""
    n_actions: int
    """A."""
    seed: int = 0
    """Of the noise. The policy underneath has its own."""
    _rng: np.random.Generator = field(init=False, repr=False)

    def __post_init__(self) -> None:
        if not isinstance(self.policy, Policy):
            raise InvalidParameter(
                f"policy is {a_type(self.policy)}: expected one with `predict`. Use `noisy` for tables, and wrap a "
                "function in `Acting`."
            )
        checked_epsilon(self.epsilon)
        checked_count(self.n_actions)
        object.__setattr__(self, "_rng", generator(self.seed, NOISE))

    def __reduce__(self) -> tuple:
        return type(self), (self.policy, self.epsilon, self.n_actions, self.seed)

    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None, deterministic: bool = False
    ) -> tuple[Any, Any]:
        """The action for one observation, or an array of actions for a batch; the hidden state is the policy's.

        Raises:
            InvalidPolicy: the policy underneath takes something else than an action.
        """
        answer, state = self.policy.predict(observation, state, episode_start, deterministic)
        actions = np.asarray(answer)
        wrong = actions[(actions < 0) | (actions >= self.n_actions)] if actions.dtype.kind in "iu" else actions.ravel()[:1]
        if wrong.size:
            raise InvalidPolicy(f"the policy's action is {wrong[0]}: expected an integer from 0 to {self.n_actions - 1}.")
        draws = self._rng.random((actions.size, 2)).reshape(*actions.shape, 2)
        others = np.minimum((draws[..., 1] * self.n_actions).astype(np.int64), self.n_actions - 1)
        taken = np.where(draws[..., 0] < self.epsilon, others, actions.astype(np.int64))
        return (taken if taken.ndim else np.int64(taken)), state


def checked_count(n_actions: int) -> int:
    """Return a number of actions.

    Raises:
        InvalidParameter: anything else than a whole number of at least 1.
    """
    return int(checked_number("n_actions", n_actions, "a whole number of at least 1", least=1, whole=True))


def checked_epsilon(epsilon: float) -> float:
    """Return a probability of random actions, from 0 to 1.

    Raises:
        InvalidParameter: anything else.
    """
    beyond = np.nextafter(1.0, 2.0)  # 1 itself is allowed
    return checked_number("epsilon", epsilon, "a probability from 0 to 1, such as 0.1", least=0, below=float(beyond))


def checked_temperature(temperature: float) -> float:
    """Return a temperature, from 0 to infinity.

    Raises:
        InvalidParameter: anything else.
    """
    if isinstance(temperature, float) and temperature == np.inf:
        return np.inf
    return checked_number("temperature", temperature, "a number of at least 0, in units of value; inf for uniform", least=0)
