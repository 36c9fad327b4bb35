"""What every learner is and gives: a frozen record of hyper-parameters, and a frozen outcome."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol, runtime_checkable

from irl_gym.certificate import Certificate
from irl_gym.mdp import TabularMDP
from irl_gym.rewards import TabularReward
from irl_gym.solvers import Status


@dataclass(frozen=True, eq=False)
class IRLResult:
    """A learned reward and what it proves."""

    reward: TabularReward
    """(S,) paid on arrival, or (S, A)."""
    status: Status
    """What became of the program, in a sentence."""
    objective: float
    """The program's objective, recomputed from the reward."""
    certificate: Certificate
    """What the reward proves."""
    stats: Mapping[str, Any] = field(default_factory=dict)
    """Solver, seconds, iterations, program by program."""


@runtime_checkable
class Learner(Protocol):
    """Turns an MDP without reward and an expert into a reward."""

    def fit(self, mdp: TabularMDP, expert: Any) -> IRLResult:
        """Learn a reward under which the expert is optimal."""
        ...
