"""Planning for H steps by backward induction: policies that depend on the time (Puterman 1994, section 4.5).

    Q_h(s, a) = R_h+1(s, a) + gamma sum_s' P(s' | s, a) V_h+1(s')      V_h(s) = max_a Q_h(s, a)      V_H = 0
where R_h+1(s, a) is what the step from time h pays; a reward on states is paid on arrival, R_h+1(s') (`time_expanded`).
The sums are finite, so gamma may be 1, as it is in the lecture notes (section 1.1) and here where nothing else is said.
Axes: S states, A actions, H steps.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from irl_gym._typing import Matrix
from irl_gym.mdp.planning.discounted import EPSILON
from irl_gym.mdp.planning.dynamic_programming import greedy
from irl_gym.mdp.policies import policy_array
from irl_gym.mdp.rewards import as_reward
from irl_gym.mdp.tabular_mdp import TransitionTable, check_discount, checked_horizon
from irl_gym.mdp.time_expanded import checked_table, depends_on_time, policy_over_time, reward_over_time
from irl_gym.programs.killable import check_limit
from irl_gym.records import Record

TIED = 1e-13
"""Share of the largest sum of |R| over H steps up to which actions are tied in a policy."""


@dataclass(frozen=True, eq=False)
class FiniteSolution(Record):
    """An optimal policy of H steps, with its values."""

    V: np.ndarray
    """(H+1, S) what is still earned from time h on; V[H] is 0."""
    Q: np.ndarray
    """(H, S, A) action values of V."""
    policy: np.ndarray
    """(H, S) greedy actions at each time; ties broken by the caller's order of preference."""
    error: float
    """Bound, rounding included, on |V - V*| and on what the policy earns less than V*, at every time and in every state."""


def backward_induction(
    table: TransitionTable, R: Any, *, horizon: int, gamma: float = 1.0, preference: Sequence[int] | None = None
) -> FiniteSolution:
    """The best that can be done in H steps, exactly.

    Args:
        table: what a step does; the discount of a TabularMDP is not taken.
        R: (S, A) or (S,), the same at all times, as a TabularReward or an array; or (H+1, S), R_h(s) paid on arrival.
        horizon: H.
        gamma: discount, 1 for plain sums.
        preference: order in which ties are broken in the policy.

    Raises:
        InvalidMDP, InvalidReward: no table, or a reward of another.
        InvalidParameter: a horizon that is no whole number of at least 1, or a preference that is none.
        InvalidDiscount: gamma outside (0, 1].
    """
    steps = StepsWithin(table, R, horizon, gamma)
    H, shape = steps.horizon, (table.n_states, table.n_actions)
    V, Q = np.zeros((H + 1, shape[0])), np.zeros((H, *shape))
    policy = np.zeros((H, shape[0]), dtype=np.int64)
    tie = max(TIED * steps.largest, steps.rounding)
    for h in range(H - 1, -1, -1):
        check_limit()
        Q[h] = steps.pays[h] + steps.gamma * (table.P @ V[h + 1]).reshape(shape)
        V[h] = Q[h].max(axis=1)
        policy[h] = greedy(Q[h], preference=preference, tie_tolerance=tie)
    return FiniteSolution(V, Q, policy, H * tie + 2 * steps.rounding)


def evaluation_within(table: TransitionTable, R: Any, policy: Any, *, horizon: int, gamma: float = 1.0) -> np.ndarray:
    """(H+1, S) what a policy still earns from each time on.

    Args:
        table: what a step does.
        R: as in `backward_induction`.
        policy: (S,), (S, A), or one that depends on the time: (H, S) actions, (H, S, A) probabilities or sets.
        horizon: H.
        gamma: discount, 1 for plain sums.

    Raises:
        InvalidPolicy: wrong shape or content; and as `backward_induction`.
    """
    steps = StepsWithin(table, R, horizon, gamma)
    V = np.zeros((steps.horizon + 1, table.n_states))
    for h, (P, paid) in zip(range(steps.horizon - 1, -1, -1), steps.under(policy, backwards=True), strict=True):
        V[h] = paid + steps.gamma * (P @ V[h + 1])
    return V


def value_within(table: TransitionTable, R: Any, policy: Any, *, horizon: int, gamma: float = 1.0) -> float:
    """What a policy earns from d0 in H steps, exactly; forwards in time, so that no step is made where all have ended.

    Arguments and errors as `evaluation_within`.
    """
    steps = StepsWithin(table, R, horizon, gamma)
    at, value = table.d0, 0.0
    for h, (P, paid) in enumerate(steps.under(policy)):
        value += steps.gamma**h * float(at @ paid)
        at = at @ P
        if not at.any():
            break
    return value


def occupancy_within(table: TransitionTable, policy: Any, *, horizon: int, gamma: float = 1.0) -> np.ndarray:
    """(H, S, A) gamma^h P(s_h = s, a_h = a) from d0; terminal states take no action: their rows are 0.

    Arguments and errors as `evaluation_within`.
    """
    steps = StepsWithin(table, np.zeros((table.n_states, table.n_actions)), horizon, gamma)
    each = policy_over_time(policy, table.n_states, table.n_actions, steps.horizon)
    mu, at = np.zeros_like(each), np.where(table.terminal, 0.0, table.d0)
    for h, distribution in enumerate(each):
        mu[h] = at[:, None] * distribution
        at = np.where(table.terminal, 0.0, steps.gamma * (mu[h].ravel() @ table.P))
    return mu


class StepsWithin:
    """What each of H steps pays and does; arguments and errors as `backward_induction`."""

    def __init__(self, table: TransitionTable, R: Any, horizon: int, gamma: float):
        self.table, self.horizon = checked_table(table), checked_horizon(horizon)
        self.gamma = check_discount(gamma, self.horizon)
        self.pays: Sequence[Matrix] = self._paid(R)
        """H arrays (S, A), one and the same where the reward does not depend on the time."""
        self.largest = sum(float(np.abs(one).max(initial=0.0)) for one in self.pays)
        """Of |R|, over all steps."""
        terms = int(np.diff(table.P.indptr).max(initial=0)) + 4
        self.rounding = self.horizon * terms * EPSILON * self.largest
        """Of a value, at most."""

    def _paid(self, R: Any) -> list[Matrix]:
        over_time = reward_over_time(R, self.table, self.horizon)
        if over_time is None:
            return [as_reward(R).expected(self.table)] * self.horizon
        shape = (self.table.n_states, self.table.n_actions)
        return [(self.table.P @ one).reshape(shape) for one in over_time[1:]]

    def under(self, policy: Any, *, backwards: bool = False) -> Iterator[tuple[Any, np.ndarray]]:
        """(S, S) transitions and (S,) pay of a policy at each time, or from the last time to the first."""
        array, table = policy_array(policy), self.table
        timed = depends_on_time(array)
        if timed:
            array = policy_over_time(array, table.n_states, table.n_actions, self.horizon)
        mixing = table.mixing(array[0] if timed else array)
        P = mixing @ table.P
        for h in range(self.horizon)[:: -1 if backwards else 1]:
            if timed:
                mixing = table.mixing(array[h])
                P = mixing @ table.P
            yield P, mixing @ self.pays[h].ravel()
