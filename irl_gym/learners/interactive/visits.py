"""Where a mixture of expert and learner comes to, and what the oracle says there: exactly, or by episodes.

    pi_i = beta_i pi* + (1 - beta_i) pi      drawn anew at each step (Ross, Gordon & Bagnell 2011, algorithm 3.1)
    exactly    d(s) = sum_t gamma^t P(s_t = s) under pi_i, by one sparse solve
    by episodes    each step counts 1, whatever gamma is; of a table, or of an environment that is stepped
What was done and what the oracle says are two things: the learner learns from labels, never from what it did itself. There is
none in a state that ends an episode. Axes: S states, A actions, N visits.
"""

from collections.abc import Callable
from dataclasses import dataclass

import gymnasium as gym
import numpy as np

from irl_gym._typing import Matrix, StateMask, Vector
from irl_gym.learners.interactive.labels import Labels
from irl_gym.mdp.planning.dynamic_programming import occupancy
from irl_gym.mdp.sampling import Successors
from irl_gym.mdp.tabular_mdp import TabularMDP, TransitionTable
from irl_gym.programs.killable import check_limit
from irl_gym.records import Record
from irl_gym.spaces.states import States


@dataclass(frozen=True, eq=False)
class LabelledVisits(Record):
    """The visits of a round, in the order in which they were labelled."""

    states: np.ndarray
    """(N,) rows."""
    labels: np.ndarray
    """(N,) what the oracle says is to be done there."""
    asked: np.ndarray
    """(N,) was it asked for this one, or had it answered there before?"""
    weights: Vector
    """(N,) 1 of each step of an episode; d(s) of the exact mode."""
    executed: np.ndarray | None
    """(N,) what was done; None in the exact mode, in which all is done that the mixture does."""

    def aggregated(self, shape: tuple[int, int]) -> Matrix:
        """(S, A) the weight of each label."""
        weights = np.zeros(shape)
        np.add.at(weights, (self.states, self.labels), self.weights)
        return weights

    def mistakes(self, policy: Matrix) -> float:
        """The share of the visits that a policy (S, A) labels otherwise."""
        return float(self.weights @ (1 - policy[self.states, self.labels]) / self.weights.sum())


def reached(table: TransitionTable, acting: Callable[[np.ndarray], Matrix]) -> StateMask:
    """(S,) the states to act in that a policy comes to; it is asked once for each, (m, A) for rows (m,)."""
    found = (table.d0 > 0) & ~table.terminal
    frontier = np.flatnonzero(found)
    while frontier.size:
        at, actions = np.nonzero(acting(frontier) > 0)
        onward = np.zeros(table.n_states, dtype=bool)
        onward[table.P[frontier[at] * table.n_actions + actions].indices] = True
        frontier = np.flatnonzero(onward & ~found & ~table.terminal)
        found[frontier] = True
    return found


def exact_visits(mdp: TabularMDP, policy: Matrix, beta: float, labels: Labels) -> LabelledVisits:
    """All that the mixture comes to, weighted by d; of an oracle that always answers the same this is pi_i itself."""
    mixed, told = policy.copy(), []

    def acting(rows: np.ndarray) -> Matrix:
        answers = [labels.of(int(row)) for row in rows]
        told.extend(zip(rows.tolist(), answers, strict=True))
        mixed[rows] = (1 - beta) * policy[rows] + beta * np.eye(mdp.n_actions)[[label for label, _ in answers]]
        return mixed[rows]

    reached(mdp, acting)
    states, answers, asked = (np.array(part) for part in zip(*((row, *answer) for row, answer in told), strict=True))
    weights = np.maximum(occupancy(mdp, mixed).sum(axis=1)[states], 0.0)
    return LabelledVisits(states, answers, asked, weights, None)


def drawn_visits(
    table: TransitionTable, policy: Matrix, beta: float, labels: Labels, episodes: int, most: int, rng: np.random.Generator
) -> LabelledVisits:
    """Episodes from a table, step by step together, cut after `most` steps."""
    successors, told, cumulated = Successors(table), [], policy.cumsum(axis=1)
    rows = successors.start(episodes, rng)
    for _ in range(most):
        if not rows.size:
            break
        check_limit()
        answers = np.array([labels.of(int(row)) for row in rows])
        draws = rng.random((rows.size, 2))
        own = np.minimum((draws[:, 1:] >= cumulated[rows]).sum(axis=1), table.n_actions - 1)
        done = np.where(draws[:, 0] < beta, answers[:, 0], own)
        told.append((rows, answers[:, 0], answers[:, 1].astype(bool), done))
        rows = successors.draw(rows, done, rng)
        rows = rows[~table.terminal[rows]]
    states, answered, asked, executed = (np.concatenate(part) for part in zip(*told, strict=True))
    return LabelledVisits(states, answered, asked, np.ones(states.size), executed)


def stepped_visits(
    env: gym.Env, states: States, policy: Matrix, beta: float, labels: Labels, episodes: int, most: int,
    rng: np.random.Generator,
) -> LabelledVisits:  # fmt: skip
    """Episodes in an environment, which is reset and stepped, cut after `most` steps; the oracle is shown its `info` too."""
    first, told = int(getattr(env.action_space, "start", 0)), []
    cumulated = policy.cumsum(axis=1)
    for seed in rng.integers(2**31, size=episodes).tolist():
        observation, info = env.reset(seed=seed)
        for _ in range(most):
            check_limit()
            row = int(states.encode(observation))
            label, new = labels.of(row, observation, info)
            by_expert, draw = rng.random(2)
            own = min(int((draw >= cumulated[row]).sum()), policy.shape[1] - 1)
            done = label if by_expert < beta else own
            told.append((row, label, new, done))
            observation, _, terminated, truncated, info = env.step(done + first)
            if terminated or truncated:
                break
    visited, answers, asked, executed = (np.array(part) for part in zip(*told, strict=True))
    return LabelledVisits(visited, answers, asked, np.ones(len(told)), executed)
