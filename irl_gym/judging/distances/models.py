"""What follows a state and an action: the model that DARD and STARC draw from, where there is no table to sum over."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from irl_gym.checks import checked_number, checked_rng
from irl_gym.errors import InvalidParameter, UndefinedDistance, a_type
from irl_gym.judging.distances.transitions import Transitions
from irl_gym.mdp.sampling import Successors
from irl_gym.mdp.tabular_mdp import TabularMDP, TransitionTable, checked_mdp

Model = Callable[[Any, np.ndarray, np.random.Generator], tuple[Any, np.ndarray]]
"""(observations, actions, rng) -> (next observations, terminated (N,)). Rows that have ended are passed too, and not read."""


def stepped(model: Model, observations: Any, actions: np.ndarray, rng: np.random.Generator) -> tuple[Any, np.ndarray]:
    """What a model draws.

    Raises:
        InvalidParameter: something else than a pair of as many next observations and flags.
    """
    found: Any = model(observations, actions, rng)
    if isinstance(found, tuple) and len(found) == 2 and [np.shape(part)[:1] for part in found] == [(len(actions),)] * 2:
        return found[0], np.asarray(found[1], dtype=bool)
    raise InvalidParameter(
        f"the model gives {a_type(found)} for {len(actions)} actions: expected a pair, (N, ...) next observations and "
        "(N,) whether each is terminal."
    )


@dataclass(frozen=True, eq=False)
class TableModel:
    """The model of a table, on rows of its state index. A terminal state is followed by itself.

    Raises:
        InvalidMDP: no table.
        UndefinedDistance: every state is terminal.
    """

    mdp: TabularMDP
    """P."""
    _successors: Successors = field(init=False, repr=False)

    def __post_init__(self) -> None:
        acting = ~checked_mdp(self.mdp).terminal
        if not acting.any():
            raise UndefinedDistance("every state is terminal: there are no transitions to draw.")
        anywhere = TransitionTable(self.mdp.P, acting / acting.sum())  # its starts, which may be terminal, play no part here
        object.__setattr__(self, "_successors", Successors(anywhere))

    def __call__(self, observations: Any, actions: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        """Successors (N,) of states (N,), and whether each is terminal.

        Raises:
            InvalidParameter: states or actions that are not rows of the table.
        """
        following = _indices("states", observations, self.mdp.n_states)
        taken = _indices("actions", actions, self.mdp.n_actions)
        acting = ~self.mdp.terminal[following]
        following[acting] = self._successors.draw(following[acting], taken[acting], rng)
        return following, self.mdp.terminal[following]

    def transitions(self, n: int, rng: np.random.Generator) -> Transitions:
        """Draw n transitions: s and a uniform, s of states that act; s' from P.

        Raises:
            InvalidParameter: n that is not a whole number of at least 2, or an rng that is none.
        """
        rng = checked_rng(rng)
        n = int(checked_number("n", n, "a whole number of at least 2", least=2, whole=True))
        acting = np.flatnonzero(~self.mdp.terminal)
        states, actions = rng.choice(acting, size=n), rng.integers(self.mdp.n_actions, size=n)
        following, ended = self(states, actions, rng)
        return Transitions(states, actions, following, ended)


def _indices(name: str, values: Any, size: int) -> np.ndarray:
    """A new array of numbers from 0 to size - 1."""
    array = np.asarray(values)
    if array.ndim != 1 or array.dtype.kind not in "iu":
        raise InvalidParameter(f"{name} have shape {array.shape} and dtype {array.dtype}: expected (N,) rows of the table.")
    wrong = array[(array < 0) | (array >= size)]
    if wrong.size:
        raise InvalidParameter(f"{name} hold {wrong[0]}: expected 0 to {size - 1}, as in the table.")
    return array.astype(np.int64)
