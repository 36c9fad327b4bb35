"""A table of an environment, and the evidence for it."""

from dataclasses import dataclass

import numpy as np

from irl_gym.mdp import TabularMDP, TransitionTable, entry_rows
from irl_gym.rewards import RewardFunction, TabularReward
from irl_gym.selfcheck import Payments, SelfCheck
from irl_gym.states import States


@dataclass(frozen=True)
class Evidence:
    """How a table was obtained, and what the check against `env.step` found."""

    method: str
    """Where the probabilities come from, in a sentence."""
    exact: bool
    """Are the probabilities exact, not estimated?"""
    merged: int
    """Successors that stood more than once in a row and were added up."""
    split: int
    """States split into an ordinary row and a terminal copy."""
    check: SelfCheck | None
    """What sampling `env.step` found; None when it was not asked for."""


@dataclass(frozen=True, eq=False)
class Tabulation:
    """An environment as a table."""

    mdp: TabularMDP
    """P, gamma and d0."""
    reward: TabularReward
    """(S, A) the environment's own reward, in expectation over successors."""
    payments: Payments
    """What single steps pay: mean, deviation, and the reward of each transition where s, a and s' settle it."""
    states: States
    """Observations to rows and back."""
    evidence: Evidence
    """How it was obtained."""


def payments_of(table: TransitionTable, reward: RewardFunction) -> Payments:
    """What a reward function pays on the transitions of a table."""
    rows = entry_rows(table.P)
    states, actions = np.divmod(rows, table.n_actions)
    paid = np.asarray(reward.pay(states, actions, table.P.indices), dtype=np.float64)
    mean, deviation = moments(rows, table.P.data, paid, (table.n_states, table.n_actions))
    return Payments(mean, deviation, paid, float(np.abs(paid).max(initial=0.0)))


def moments(rows: np.ndarray, p: np.ndarray, r: np.ndarray, shape: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    """(S, A) mean and standard deviation of what a step pays, from lines of row, probability and reward."""
    R, square = (np.bincount(rows, weights=p * moment, minlength=shape[0] * shape[1]).reshape(shape) for moment in (r, r**2))
    variance = square - R**2
    return R, np.sqrt(np.where(variance > 1e-12 * square, variance, 0.0))
