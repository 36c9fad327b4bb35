"""What the page needs of a table, worked out once: who acts how, what is optimal, and where states lie.

Axes: S states, A actions.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from irl_gym._typing import ActionSets, Indices, Matrix, StateMask, Vector
from irl_gym.judging.evaluation import good_actions
from irl_gym.judging.metrics import ties_of
from irl_gym.mdp.planning.dynamic_programming import optimum, policy_evaluation
from irl_gym.mdp.planning.howard import Optimum
from irl_gym.mdp.policies import as_distribution
from irl_gym.mdp.rewards import TabularReward
from irl_gym.mdp.tabular_mdp import TabularMDP
from irl_gym.reports.page.maps import Map
from irl_gym.tables.layouts import GridLayout
from irl_gym.tables.tabulation import Tabulation
from irl_gym.written import state_called

LEAST_SHARE = 0.5
"""Actions less likely than this share of the most likely one are not shown."""


@dataclass(frozen=True, eq=False)
class Scene:
    """What is known state by state, and what is learned there."""

    table: Tabulation
    """P, d0, gamma, the true reward and the states."""
    learned: TabularReward | None
    """The recovered reward on the rows of the table; None of a learner of policies."""
    known_expert: np.ndarray | None
    """(S,) actions, or (S, A) probabilities with rows of NaN where nothing is known; None where nothing is known at all."""
    known_agents: Mapping[str, np.ndarray]
    """(S,) actions, or (S, A), of the policies that are judged by the expert, by their names in metrics.json."""
    actions: tuple[str, ...]
    """(A,) names of the actions."""
    called: Callable[[int], str]
    """What a row's state is called."""
    grid: GridLayout | None = None
    """Where the states lie on a map of cells."""
    by_episodes: bool = False
    """Is the expert known by episodes only? Then optimal actions are good, not its own."""

    @property
    def mdp(self) -> TabularMDP:
        """P, gamma and d0."""
        return self.table.mdp

    @cached_property
    def acting(self) -> StateMask:
        """(S,) states that episodes visit and in which an action is taken."""
        return self.mdp.reachable & ~self.mdp.terminal

    @cached_property
    def place(self) -> Map | None:
        """Where states lie, if on a map."""
        return Map.of(self.grid, self.table.states, self.mdp)

    @cached_property
    def seen(self) -> StateMask:
        """(S,) states in which the expert's action is known."""
        expert = self.known_expert
        if expert is None or expert.ndim == 1:
            return np.full(self.mdp.n_states, expert is not None)
        return np.logical_not(np.isnan(expert).any(axis=1))

    @cached_property
    def expert(self) -> Matrix:
        """(S, A) the expert's probabilities; uniform where nothing is known."""
        policy = self.known_expert
        if policy is None or policy.ndim == 1:
            return self._distribution(policy)
        return self._distribution(np.where(self.seen[:, None], policy, 1 / self.mdp.n_actions))

    @cached_property
    def agents(self) -> Mapping[str, Matrix]:
        """(S, A) the probabilities of each policy that is judged, by its name."""
        return {name: self._distribution(policy) for name, policy in self.known_agents.items()}

    def _distribution(self, policy: np.ndarray | None) -> np.ndarray:
        n_states, n_actions = self.mdp.n_states, self.mdp.n_actions
        return as_distribution(np.full((n_states, n_actions), 1 / n_actions) if policy is None else policy, n_states, n_actions)

    @cached_property
    def best(self) -> Optimum:
        """The best policy under the true reward."""
        return optimum(self.mdp, self.table.reward)

    @cached_property
    def optimal(self) -> ActionSets:
        """(S, A) the actions that are optimal under the true reward."""
        return ties_of(self.best, 0.0).possible

    @cached_property
    def good(self) -> ActionSets:
        """(S, A) the actions that the agreement of metrics.json counts: the optimal ones, or a poor expert's own."""
        return good_actions(self.mdp, None if self.by_episodes else self.known_expert, self.best)

    def deviates(self, policy: Matrix) -> StateMask:
        """(S,) states in which the likeliest action of a policy is none of the good ones."""
        return self.acting & ~self.good[np.arange(self.mdp.n_states), policy.argmax(axis=1)]

    def lost(self, policy: Matrix) -> Vector:
        """(S,) what the likeliest action of a policy loses there, if all later ones are optimal, under the true reward."""
        gains = self.best.advantages.values.astype(np.float64)
        return np.where(self.acting, -gains[np.arange(self.mdp.n_states), policy.argmax(axis=1)], 0.0)

    def behind(self, policy: Matrix) -> Vector:
        """(S,) what a policy loses from there on against acting best, under the true reward."""
        return np.where(self.acting, self.best.behind(policy)[0], 0.0)

    def value(self, reward: TabularReward, policy: Matrix) -> Vector:
        """(S,) a policy's value; NaN in states that are not judged."""
        return np.where(self.acting, policy_evaluation(self.mdp, reward, policy), np.nan)

    def name(self, row: int) -> str:
        """What a state is called."""
        ended = " (ended)" if row in self._copies or self.mdp.terminal[row] else ""
        return state_called(self.called(row)) + ended

    def place_name(self, row: int, action: int | None = None) -> str:
        """What a state is called, or a state and an action."""
        return self.name(row) if action is None else f"{self.name(row)}; {self.actions[action]}"

    @cached_property
    def _copies(self) -> frozenset[int]:
        return frozenset(self.table.states.terminal_copies.values())

    def names(self, rows: Sequence[int] | Indices) -> list[str]:
        """What some states are called."""
        return [self.name(int(row)) for row in rows]


def chosen(policy: Matrix) -> ActionSets:
    """(S, A) the actions of a policy that are worth showing: those nearly as likely as the likeliest."""
    return policy >= np.maximum(LEAST_SHARE * policy.max(axis=1, keepdims=True), 1e-12)
