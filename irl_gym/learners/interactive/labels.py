"""What the oracle answered, state by state: asked at each visit, or only where it was not asked before.

Axes: S states, A actions.
"""

from collections.abc import Mapping
from typing import Any, Literal, Protocol, runtime_checkable

import numpy as np

from irl_gym._typing import Matrix
from irl_gym.learners.interactive.labelled import UNLABELLED
from irl_gym.programs.killable import check_limit
from irl_gym.spaces.states import States

Asking = Literal["always", "unseen"]


@runtime_checkable
class Answering(Protocol):
    """Who answers: an `Oracle`, or `Noted`, which notes what one says."""

    @property
    def queries(self) -> int:
        """How often it was asked."""
        ...

    def ask(self, observation: Any, info: Mapping[str, Any] | None = None, *, n_actions: int | None = None) -> int:
        """What is to be done."""
        ...

    def takes_over(self, observation: Any, info: Mapping[str, Any] | None, action: int) -> bool:
        """Does it act, where a learner would do `action`?"""
        ...


class Labels:
    """Asks an oracle, and keeps what it answered.

    Args:
        oracle: who answers.
        states: turns rows into observations; None where they are not numbered.
        n_actions: A, which answers are checked against.
        ask: each time; or only in states in which it has not answered yet, since what it answered there is known.
        gated: does it say only what is to be done where it takes over?
    """

    def __init__(self, oracle: Answering, states: States | None, n_actions: int, ask: Asking, *, gated: bool = False):
        self._oracle, self.states, self._n_actions, self._ask, self.gated = oracle, states, n_actions, ask, gated
        self._before = oracle.queries
        self.counts = np.zeros((0 if states is None else states.n_states, n_actions), dtype=np.int64)
        """(S, A) answers; (0, A) where states are not numbered."""

    @property
    def queries(self) -> int:
        """How often the oracle was asked here."""
        return self._oracle.queries - self._before

    @property
    def shares(self) -> Matrix:
        """(S, A) the share of each action among the answers in a state; 0 where there was none."""
        return self.counts / np.maximum(self.counts.sum(axis=1, keepdims=True), 1)

    @property
    def labelled(self) -> int | None:
        """States in which it answered; None where they are not numbered."""
        return None if self.states is None else int(self.counts.any(axis=1).sum())

    @property
    def contradicted(self) -> int:
        """States in which the oracle did not always answer the same."""
        return int(((self.counts > 0).sum(axis=1) > 1).sum())

    def decoded(self, rows: np.ndarray) -> Any:
        """The observations of rows."""
        assert self.states is not None
        return self.states.decode_batch(rows)

    def row(self, observation: Any) -> int | None:
        """The row of an observation; None where they are not numbered."""
        return None if self.states is None else int(self.states.encode(observation))

    def step(
        self, row: int | None, own: int, beta: float, draw: float, observation: Any = None,
        info: Mapping[str, Any] | None = None,
    ) -> tuple[int, bool, bool]:  # fmt: skip
        """The label of a step, or -1; whether the oracle was asked for it; and whether the oracle acts.

        Args:
            row: of the state.
            own: what the learner would do.
            beta: probability that the oracle acts, where it is not for itself to say.
            draw: a uniform number.
            observation: as `of`.
            info: as `of`.
        """
        acts = bool(draw < beta)
        if self.gated and beta < 1 and not (acts := self.takes_over(row, own, observation, info)):
            return UNLABELLED, False, False
        return (*self.of(row, observation, info), acts)

    def takes_over(self, row: int | None, action: int, observation: Any = None, info: Mapping[str, Any] | None = None) -> bool:
        """Does the oracle act in a state in which the learner would do `action`?"""
        return self._oracle.takes_over(self._seen(row, observation), info, action)

    def of(self, row: int | None, observation: Any = None, info: Mapping[str, Any] | None = None) -> tuple[int, bool]:
        """The label of a state, and whether the oracle was asked for it.

        Args:
            row: of the state; None where they are not numbered.
            observation: what it shows; None for what its row stands for.
            info: what the environment tells besides, if it is run.

        Raises:
            InvalidPolicy: the oracle's answer is no action.
            SolverTimeout: the time of a limit in force is up.
        """
        if row is not None and self._ask == "unseen" and self.counts[row].any():
            return int(self.counts[row].argmax()), False
        check_limit()
        label = self._oracle.ask(self._seen(row, observation), info, n_actions=self._n_actions)
        if row is not None:
            self.counts[row, label] += 1
        return label, True

    def _seen(self, row: int | None, observation: Any) -> Any:
        if observation is not None or row is None:
            return observation
        assert self.states is not None
        return self.states.decode(row)
