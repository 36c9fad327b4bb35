"""What follows a state and an action: the model that DARD and STARC draw from, where there is no table to sum over."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from irl_gym.checks import checked_number
from irl_gym.distances.transitions import Transitions
from irl_gym.errors import UndefinedDistance
from irl_gym.mdp import TabularMDP, TransitionTable
from irl_gym.sampling import Successors

Model = Callable[[Any, np.ndarray, np.random.Generator], tuple[Any, np.ndarray]]
"""(observations, actions, rng) -> (next observations, terminated (N,)). Rows that have ended are passed too, and not read."""


@dataclass(frozen=True, eq=False)
class TableModel:
    """The model of a table, on rows of its state index. A terminal state is followed by itself.

    Raises:
        UndefinedDistance: every state is terminal.
    """

    mdp: TabularMDP
    """P."""
    _successors: Successors = field(init=False, repr=False)

    def __post_init__(self) -> None:
        acting = ~self.mdp.terminal
        if not acting.any():
            raise UndefinedDistance("every state is terminal: there are no transitions to draw.")
        anywhere = TransitionTable(self.mdp.P, acting / acting.sum())  # its starts, which may be terminal, play no part here
        object.__setattr__(self, "_successors", Successors(anywhere))

    def __call__(self, observations: Any, actions: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        """Successors (N,) of states (N,), and whether each is terminal."""
        following = np.array(observations, dtype=np.int64)
        acting = ~self.mdp.terminal[following]
        following[acting] = self._successors.draw(following[acting], np.asarray(actions)[acting], rng)
        return following, self.mdp.terminal[following]

    def transitions(self, n: int, rng: np.random.Generator) -> Transitions:
        """Draw n transitions: s and a uniform, s of states that act; s' from P."""
        n = int(checked_number("n", n, "a whole number of at least 2", least=2, whole=True))
        acting = np.flatnonzero(~self.mdp.terminal)
        states, actions = rng.choice(acting, size=n), rng.integers(self.mdp.n_actions, size=n)
        following, ended = self(states, actions, rng)
        return Transitions(states, actions, following, ended)
