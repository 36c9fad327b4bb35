"""The classes of policies that labels are cloned in: of numbered states, or of observations, by a network.

    of rows           `fit(weights, table)` of `Clone`, `SoftmaxClone`; a policy is (S, A); `fit_costs` at the price of mistakes
    of observations   `fit_labels(observations, labels, spaces)` of `NeuralClone`; a policy has `predict`, and is deterministic
Axes: S states, A actions.
"""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from irl_gym._typing import Matrix
from irl_gym.errors import InvalidParameter
from irl_gym.learners.interactive.answers import fitted
from irl_gym.learners.interactive.visits import LabelledVisits, labelled_parts
from irl_gym.learners.problem import Spaces
from irl_gym.mdp.policies import as_distribution
from irl_gym.mdp.tabular_mdp import TabularMDP
from irl_gym.spaces.states import States


@dataclass(eq=False)
class OfRows:
    """Policies of numbered states."""

    learner: Any
    """Clones."""
    table: TabularMDP | None
    """None where it is not known."""
    spaces: Spaces
    """Of the problem."""
    shape: tuple[int, int]
    """S and A."""
    costs: Matrix | None = None
    """(S, A) what an action costs more than the oracle's; None where mistakes are counted."""
    folder: Path | None = None
    """Where what was learned is kept."""
    _weights: Matrix = field(init=False)

    def __post_init__(self) -> None:
        self._weights = np.zeros(self.shape)

    def first(self) -> Matrix:
        """Before anything was learned: any action."""
        return np.full(self.shape, 1 / self.shape[1])

    def learned(self, visits: LabelledVisits, rng: np.random.Generator) -> Matrix:
        """(S, A) the clone of all labels, these among them."""
        self._weights += visits.aggregated(self.shape)

        def fit() -> Matrix:
            if self.costs is None:
                return np.asarray(self.learner.fit(self._weights, self.table, states=self.spaces.states).policy)
            visited = self._weights.sum(axis=1, keepdims=True)
            found = self.learner.fit_costs(visited * self.costs, visited[:, 0] > 0, self.table, states=self.spaces.states)
            return np.asarray(found.policy)

        of = (type(self.learner).__name__, self.learner, self._weights, self.costs)
        return fitted(self.folder, of, fit, lambda policy: {"policy": policy}, lambda one: self._checked(one["policy"]))

    def _checked(self, policy: np.ndarray) -> Matrix:
        if policy.shape != self.shape:
            raise ValueError(f"the policy has shape {policy.shape}")
        as_distribution(policy, *self.shape)
        return policy

    def matrix(self, policy: Matrix) -> Matrix:
        """(S, A) probabilities."""
        return policy

    def act(self, policy: Matrix, observation: Any, row: int | None, draw: float) -> int:
        """An action that is drawn."""
        assert row is not None
        return min(int((draw >= policy[row].cumsum()).sum()), self.shape[1] - 1)

    def mistakes(self, policy: Matrix, visits: LabelledVisits) -> float:
        """The share of labels from which a draw from the policy differs."""
        return visits.mistakes(policy)


@dataclass(eq=False)
class OfObservations:
    """Policies of observations: None before anything was learned, which acts at random."""

    learner: Any
    """Clones."""
    spaces: Spaces
    """Of the problem."""
    states: States | None
    """Rows of observations, where there is a table."""
    n_actions: int
    """A."""
    folder: Path | None = None
    """Where what was learned is kept."""
    _seen: list[Any] = field(default_factory=list)
    _labels: list[np.ndarray] = field(default_factory=list)

    def first(self) -> None:
        """Before anything was learned."""

    def learned(self, visits: LabelledVisits, rng: np.random.Generator) -> Any:
        """The clone of all labels, these among them."""
        for seen, labels in labelled_parts(visits.episodes):
            self._seen.append(seen)
            self._labels.append(labels)
        seed, learner, spaces = int(rng.integers(2**31)), self.learner, self.spaces
        return fitted(
            self.folder, (type(learner).__name__, learner, self._seen, self._labels, seed),
            lambda: learner.fit_labels(self._seen, self._labels, spaces, np.random.default_rng(seed)).policy,
            learner.arrays, lambda one: learner.agent(one, spaces),
        )  # fmt: skip

    def matrix(self, policy: Any) -> Matrix:
        """(S, A) probabilities, of a table: its deterministic actions."""
        assert self.states is not None
        S, A = self.states.n_states, self.n_actions
        if policy is None:
            return np.full((S, A), 1 / A)
        return np.eye(A)[np.asarray(policy.predict(self.states.decode_batch(np.arange(S)), deterministic=True)[0])]

    def act(self, policy: Any, observation: Any, row: int | None, draw: float) -> int:
        """Its deterministic action."""
        if policy is None:
            return min(int(draw * self.n_actions), self.n_actions - 1)
        return int(np.asarray(policy.predict(observation, deterministic=True)[0]))

    def mistakes(self, policy: Any, visits: LabelledVisits) -> float:
        """The share of labels from which its actions differ."""
        parts = labelled_parts(visits.episodes)
        if policy is None or not parts:
            return 1 - 1 / self.n_actions if parts else 0.0
        other = [np.asarray(policy.predict(seen, deterministic=True)[0]) != labels for seen, labels in parts]
        return float(np.concatenate(other).mean())


PolicyClass = OfRows | OfObservations


def check_clones(learner: Any, *, priced: bool, sampled: bool) -> None:
    """Check that a learner clones labels.

    Args:
        learner: what was given.
        priced: do mistakes have prices?
        sampled: are there episodes?

    Raises:
        InvalidParameter: it does not; or a network, of which there are no exact visits and no prices.
    """
    column = getattr(getattr(learner, "needs", None), "column", None)
    rows = column == "passive" and callable(getattr(learner, "fit", None)) and getattr(learner, "on_rows", False)
    seen = column == "passive" and callable(getattr(learner, "fit_labels", None))
    if not (rows or seen) or isinstance(learner, type):
        what = "one that clones labels, such as Clone(...), SoftmaxClone(...) or NeuralClone(...)"
        raise InvalidParameter(f"the learner is {learner!r:.60}: expected {what}.")
    name = type(learner).__name__
    if priced and not callable(getattr(learner, "fit_costs", None)):
        raise InvalidParameter(
            f"cost is 'advantage' and the learner a {name}: expected one with `fit_costs`, such as Clone(...) or "
            "SoftmaxClone(...)."
        )
    if not rows and not sampled:
        raise InvalidParameter(
            f"episodes is None and the learner a {name}, which learns from observations: expected a number of episodes a "
            "round. Give `episodes`, such as 20."
        )
