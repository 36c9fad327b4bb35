"""Where a mixture of expert and learner comes to, and what the oracle says there: exactly, or by episodes.

    pi_i = beta_i pi* + (1 - beta_i) pi      drawn anew at each step (Ross, Gordon & Bagnell 2011, algorithm 3.1)
    exactly    d(s) = sum_t gamma^t P(s_t = s) under pi_i, by one sparse solve
    by episodes    each step counts 1, whatever gamma is; of a table, or of an environment that is stepped
    gated      the learner acts until the oracle takes over, which says what is to be done there only (HG-DAgger)
What was done and what the oracle says are two things: the learner learns from labels, never from what it did itself. There is
none in a state that ends an episode. Axes: S states, A actions, N labelled visits, T steps.
"""

import copy
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import gymnasium as gym
import numpy as np

from irl_gym._typing import Matrix, StateMask, Vector
from irl_gym.learners.interactive.labelled import UNLABELLED, LabelledEpisode
from irl_gym.learners.interactive.labels import Labels
from irl_gym.mdp.episodes import stacked
from irl_gym.mdp.planning.dynamic_programming import occupancy
from irl_gym.mdp.rewards import TabularReward
from irl_gym.mdp.sampling import Successors
from irl_gym.mdp.tabular_mdp import TabularMDP, TransitionTable
from irl_gym.programs.killable import check_limit
from irl_gym.records import Record
from irl_gym.spaces.batches import take

Act = Callable[[Any, int | None, float], int]
"""What a policy does: of an observation, its row if it has one, and a uniform number that it may draw by."""


@dataclass(frozen=True, eq=False)
class LabelledVisits(Record):
    """The visits of a round that were labelled, in the order in which they were, and the episodes that they are of."""

    states: np.ndarray | None
    """(N,) rows; None where observations are not numbered."""
    labels: np.ndarray
    """(N,) what the oracle says is to be done there."""
    asked: np.ndarray
    """(N,) was it asked for this one, or had it answered there before?"""
    weights: Vector
    """(N,) 1 of each step of an episode; d(s) of the exact mode, where gated times the probability that it takes over."""
    executed: np.ndarray | None
    """(N,) what was done; None in the exact mode, in which all is done that the mixture does."""
    episodes: tuple[LabelledEpisode, ...] = ()
    """With the steps that were not labelled; none in the exact mode."""

    def aggregated(self, shape: tuple[int, int]) -> Matrix:
        """(S, A) the weight of each label."""
        assert self.states is not None
        weights = np.zeros(shape)
        np.add.at(weights, (self.states, self.labels), self.weights)
        return weights

    def mistakes(self, policy: Matrix) -> float:
        """The share of the visits that a policy (S, A) labels otherwise; 0 of none."""
        return float(self.weights @ (1 - policy[self.states, self.labels]) / max(self.weights.sum(), np.finfo(float).tiny))


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
    mixed, told, one_hot = policy.copy(), [], np.eye(mdp.n_actions)

    def acting(rows: np.ndarray) -> Matrix:
        for row in rows.tolist():
            own, share = policy[row], beta
            if labels.gated and beta < 1:
                kept = np.array([p > 0 and not labels.takes_over(row, a) for a, p in enumerate(own)])
                share = float(own[~kept].sum())
                own = np.where(kept, own, 0.0) / max(own[kept].sum(), np.finfo(float).tiny)
                if not share:
                    continue
            label, asked = labels.of(row)
            told.append((row, label, asked, share if labels.gated else 1.0))
            mixed[row] = (1 - share) * own + share * one_hot[label]
        return mixed[rows]

    reached(mdp, acting)
    columns = np.array(told, dtype=np.float64).reshape(-1, 4).T
    states, answers, asked = (one.astype(kind) for one, kind in zip(columns, (int, int, bool), strict=False))
    weights = np.maximum(occupancy(mdp, mixed).sum(axis=1)[states], 0.0) * columns[3]
    return LabelledVisits(states, answers, asked, weights, None)


def drawn_visits(
    table: TransitionTable, policy: Matrix, beta: float, labels: Labels, episodes: int, most: int, rng: np.random.Generator,
    reward: TabularReward | None = None, number: int = 1,
) -> LabelledVisits:  # fmt: skip
    """Episodes from a table, step by step together, cut after `most` steps."""
    successors, told, cumulated = Successors(table), [], policy.cumsum(axis=1)
    rows, who = successors.start(episodes, rng), np.arange(episodes)
    for _ in range(most):
        if not rows.size:
            break
        check_limit()
        draws = rng.random((rows.size, 2))
        own = np.minimum((draws[:, 1:] >= cumulated[rows]).sum(axis=1), table.n_actions - 1)
        answers = [labels.step(row, a, beta, draw) for row, a, draw in zip(*map(np.ndarray.tolist, (rows, own, draws[:, 0])))]  # noqa: B905
        label, asked, acts = (np.array(part) for part in zip(*answers, strict=True))
        done = np.where(acts, label, own)
        arrived = successors.draw(rows, done, rng)
        told.append((who, rows, label, asked, done, arrived))
        going = ~table.terminal[arrived]
        rows, who = arrived[going], who[going]
    who, states, label, asked, done, arrived = (np.concatenate(part) for part in zip(*told, strict=True))
    paid = np.zeros(done.size) if reward is None else np.asarray(reward.pay(states, done, arrived), dtype=np.float64)
    order, ends = np.argsort(who, kind="stable"), np.cumsum(np.bincount(who, minlength=episodes))
    found = []
    for which in np.split(order, ends[:-1]):
        last = arrived[which[-1]]
        seen, ended = labels.decoded(np.append(states[which], last)), bool(table.terminal[last])
        found.append(
            LabelledEpisode(
                seen, done[which], paid[which], ended, not ended, labels=label[which], asked=asked[which], round=number
            )
        )
    told_of = label != UNLABELLED
    return LabelledVisits(
        states[told_of], label[told_of], asked[told_of], np.ones(int(told_of.sum())), done[told_of], tuple(found)
    )


def stepped_visits(
    env: gym.Env, act: Act, beta: float, labels: Labels, episodes: int, most: int, rng: np.random.Generator, number: int = 1
) -> LabelledVisits:
    """Episodes in an environment, which is reset and stepped, cut after `most` steps; the oracle is shown its `info` too."""
    first, rows, found = int(getattr(env.action_space, "start", 0)), [], []
    for seed in rng.integers(2**31, size=episodes).tolist():
        observation, info = env.reset(seed=seed)
        seen, told, paid = [copy.deepcopy(observation)], [], []  # an environment may go on changing it
        terminated = truncated = False
        while not (terminated or truncated):
            check_limit()
            row = labels.row(observation)
            by_expert, draw = rng.random(2)
            own = act(observation, row, draw)
            label, asked, acts = labels.step(row, own, beta, by_expert, observation, info)
            done = label if acts else own
            rows.append(row)
            told.append((label, asked, done))
            observation, reward, terminated, truncated, info = env.step(done + first)
            seen.append(copy.deepcopy(observation))
            paid.append(float(reward))
            truncated = truncated or (not terminated and len(told) == most)
        label, asked, done = (np.array(part) for part in zip(*told, strict=True))
        found.append(
            LabelledEpisode(
                stacked(seen), done, np.array(paid), bool(terminated), bool(truncated), seed, labels=label, asked=asked,
                round=number,
            )
        )  # fmt: skip
    label, asked, done = (np.concatenate([getattr(one, name) for one in found]) for name in ("labels", "asked", "actions"))
    told_of = label != UNLABELLED
    visited = None if labels.states is None else np.array(rows, dtype=np.int64)[told_of]
    return LabelledVisits(visited, label[told_of], asked[told_of], np.ones(int(told_of.sum())), done[told_of], tuple(found))


def labelled_parts(episodes: tuple[LabelledEpisode, ...]) -> list[tuple[Any, np.ndarray]]:
    """The labelled observations of each episode that has some, and their labels."""
    parts = [(one, np.flatnonzero(one.labelled)) for one in episodes]
    return [(take(one.observations, which), one.labels[which]) for one, which in parts if which.size]
