"""A reward of any of three forms as a function of transitions.

    R(s, a, s') = step(s, a) + arrival(s') + full(s, a, s')
A reward (S,) is an arrival and a reward (S, A) a step: both stay as small as they are, so a table of 100,000 states needs no
array of S * A * S. A potential adds to step and arrival only, so canonical forms stay small too.
Axes: S states, A actions, n transitions.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from irl_gym._typing import Matrix, StateMask, Vector
from irl_gym.errors import InvalidReward, a_type
from irl_gym.judging.distances.comparing import numbers
from irl_gym.mdp.rewards import TabularReward
from irl_gym.mdp.tabular_mdp import TabularMDP, checked_mdp, entry_rows
from irl_gym.records import Record


@dataclass(frozen=True, eq=False)
class StepPayments(Record):
    """R(s, a, s') as a sum of three parts."""

    step: Matrix
    """(S, A)."""
    arrival: Vector
    """(S,)."""
    full: np.ndarray | None
    """(S, A, S), or None for 0."""
    precision: float
    """The share of the largest reward by which a sum of them can be off."""

    def at(self, states: np.ndarray, actions: np.ndarray, next_states: np.ndarray) -> np.ndarray:
        """(n,) what transitions pay."""
        paid = self.step[states, actions] + self.arrival[next_states]
        return paid if self.full is None else paid + self.full[states, actions, next_states]

    def shaped(self, potential: Vector, gamma: float) -> "StepPayments":
        """R(s, a, s') + gamma Phi(s') - Phi(s)."""
        return StepPayments(self.step - potential[:, None], self.arrival + gamma * potential, self.full, self.precision)

    def expected(self, mdp: TabularMDP) -> Matrix:
        """(S, A) the mean over successors; 0 in terminal states, which take no step."""
        mean = np.where(mdp.terminal[:, None], 0.0, self.step)
        mean = mean + (mdp.P @ self.arrival).reshape(mean.shape)
        if self.full is not None:
            rows = entry_rows(mdp.P)
            paid = self.full.reshape(mdp.P.shape)[rows, mdp.P.indices] * mdp.P.data
            mean = mean + np.bincount(rows, paid, minlength=mdp.P.shape[0]).reshape(mean.shape)
        return mean

    def mean_over(self, actions: np.ndarray, next_states: Vector) -> Vector:
        """(S,) the mean of R(s, A, S') with A and S' drawn from (A,) and (S,) probabilities, whatever the dynamics."""
        mean = self.step @ actions + self.arrival @ next_states
        return mean if self.full is None else mean + np.einsum("sax,a,x->s", self.full, actions, next_states)

    def largest(self, states: StateMask) -> float:
        """The largest |value| of a part, of steps out of some states (S,): possible ones or not."""
        parts = [self.step[states], self.arrival] + ([] if self.full is None else [self.full[states]])
        return max(float(np.abs(part).max(initial=0.0)) for part in parts)


def payments(mdp: TabularMDP, reward: Any, name: str = "the reward") -> StepPayments:
    """Read a reward of a table: a TabularReward, or an array (S,) paid on arrival, (S, A) or (S, A, S).

    Raises:
        InvalidMDP: no table.
        InvalidReward: another shape than the table's, or values that are not finite, or beyond 1e300.
    """
    values = reward.values if isinstance(reward, TabularReward) else reward
    if hasattr(values, "reward"):
        raise InvalidReward(f"{name} is {a_type(values)}, which holds a reward: pass its `.reward`.")
    if hasattr(values, "tabular"):
        raise InvalidReward(f"{name} is {a_type(values)}: expected a table. Pass `reward.tabular(states)`.")
    S, A = checked_mdp(mdp).n_states, mdp.n_actions
    array, precision = numbers(name, values, "(S,), (S, A) or (S, A, S) numbers")
    if array.shape not in ((S,), (S, A), (S, A, S)):
        raise InvalidReward(
            f"{name} has shape {array.shape}: expected ({S},), ({S}, {A}) or ({S}, {A}, {S}), for the {S} states and {A} "
            "actions of the table. Is it another environment's?"
        )
    return StepPayments(
        array if array.ndim == 2 else np.zeros((S, A)),
        array if array.ndim == 1 else np.zeros(S),
        array if array.ndim == 3 else None,
        precision,
    )
