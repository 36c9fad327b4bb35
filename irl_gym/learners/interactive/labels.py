"""What the oracle answered, state by state: asked at each visit, or only where it was not asked before.

Axes: S states, A actions.
"""

from collections.abc import Mapping
from typing import Any, Literal

import numpy as np

from irl_gym._typing import Matrix
from irl_gym.learners.problem import Oracle
from irl_gym.spaces.states import States

Asking = Literal["always", "unseen"]


class Labels:
    """Asks an oracle, and keeps what it answered.

    Args:
        oracle: who answers.
        states: turns rows into observations.
        n_actions: A, which answers are checked against.
        ask: each time; or only in states in which it has not answered yet, since what it answered there is known.
    """

    def __init__(self, oracle: Oracle, states: States, n_actions: int, ask: Asking):
        self._oracle, self._states, self._n_actions, self._ask = oracle, states, n_actions, ask
        self._before = oracle.queries
        self.counts = np.zeros((states.n_states, n_actions), dtype=np.int64)
        """(S, A) answers."""

    @property
    def queries(self) -> int:
        """How often the oracle was asked here."""
        return self._oracle.queries - self._before

    @property
    def shares(self) -> Matrix:
        """(S, A) the share of each action among the answers in a state; 0 where there was none."""
        return self.counts / np.maximum(self.counts.sum(axis=1, keepdims=True), 1)

    @property
    def contradicted(self) -> int:
        """States in which the oracle did not always answer the same."""
        return int(((self.counts > 0).sum(axis=1) > 1).sum())

    def of(self, row: int, observation: Any = None, info: Mapping[str, Any] | None = None) -> tuple[int, bool]:
        """The label of a state, and whether the oracle was asked for it.

        Args:
            row: of the state.
            observation: what it shows; None for what its row stands for.
            info: what the environment tells besides, if it is run.

        Raises:
            InvalidPolicy: the oracle's answer is no action.
        """
        known = self.counts[row]
        if self._ask == "unseen" and known.any():
            return int(known.argmax()), False
        seen = self._states.decode(row) if observation is None else observation
        label = self._oracle.ask(seen, info, n_actions=self._n_actions)
        self.counts[row, label] += 1
        return label, True
