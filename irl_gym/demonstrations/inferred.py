"""Actions that nobody wrote down, inferred from where steps led on a known table.

In each state the policy is the most likely mixture w of the rows P_a, given the successors seen (`mixtures`), so that
P_pi(s) = sum_a w_a P_a(s) explains them best. Actions with equal rows are one, since states cannot tell them apart: its weight
is divided equally among them. What is made of w:
    weights   N(s) w(s, a), how often each action was taken: for cloning, which imitates P_pi whatever w it is
    policy    the action of the largest weight, as `most_frequent` takes that of the largest count: for the rows of (4),
              (P_pi(s) - P_a(s)) V >= 0, in which all actions with weight would have to be as good (Ng & Russell 2000, section
              3.1). It is *undecided*, NaN, where other mixtures are as likely that another action may lead: then nothing is
              asked in that state, which is not taken for one that the expert avoids either
A largest weight is decided if all weights are settled and no other is as large, or if it is settled and above 1/2.
Departs: the paper's expert is known. Nothing makes up an action: a step that no action explains is left out, and said.
Axes: S states, A actions, n states visited, m pairs of a state and a successor seen.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from irl_gym._typing import Indices, Matrix, Vector
from irl_gym.demonstrations.mixtures import Mixtures, most_likely
from irl_gym.errors import InvalidDemonstrations
from irl_gym.facts import Fact, counted
from irl_gym.mdp.episodes import Episode, numbered, seen_parts
from irl_gym.mdp.optimality_rows import SAME_SUCCESSORS
from irl_gym.mdp.tabular_mdp import TransitionTable
from irl_gym.records import Record
from irl_gym.spaces.states import States

AS_LARGE = 1e-4
"""A weight that is less than this above another is no larger."""


@dataclass(frozen=True, eq=False)
class Inferred(Record):
    """What the states of episodes tell of their actions."""

    weights: Matrix
    """(S, A) how often each action was taken, most likely."""
    policy: Matrix
    """(S, A) equal shares for the action of the largest weight, and those of equal rows; NaN where it is undecided, or where
    there are no steps."""
    visits: Vector
    """(S,) steps from each state, those that no action explains too."""
    clear: int
    """Steps that one action only can have made."""
    ambiguous: int
    """Steps that several actions with different rows can have made."""
    unexplained: int
    """Steps that no action of the table makes: left out."""
    first_unexplained: str
    """Where the first of these is; empty where there is none."""
    undecided: Indices
    """States with steps, of which no action has decidedly the largest weight."""
    alike: Indices
    """States in which several actions have the rows of the one that was inferred."""
    short: float
    """No mixture explains the steps of a state better by more than this, in nats a step."""

    def facts(self) -> tuple[Fact, ...]:
        """How much was inferred, and what is left open."""
        steps, states = counted(self.clear + self.ambiguous, "step"), int((self.weights.sum(axis=1) > 0).sum())
        told = (
            f"from where {steps} in {counted(states)} led, since the episodes have none: {self.clear:,} can be of one action "
            f"only, {self.ambiguous:,} of several; no mixture explains those of a state better by more than {self.short:.0e} "
            "nats each"
        )
        found = [Fact("actions inferred", told)]
        if self.undecided.size:
            told = (
                f"in {counted(self.undecided.size)} that were visited several actions explain the steps as well: none is taken"
            )
            found.append(Fact("actions undecided", told, "open"))
        if self.alike.size:
            told = f"in {counted(self.alike.size)} the action is one of several that lead to the same, which count as one"
            found.append(Fact("actions alike", told))
        if self.unexplained:
            told = f"{counted(self.unexplained, 'step')} that no action of the table makes, {self.first_unexplained} first"
            found.append(Fact("left out", told, "bad"))
        return tuple(found)

    def check_apart(self) -> None:
        """Check that the states tell which action was taken, for who pays actions apart that lead to the same.

        Raises:
            InvalidDemonstrations: they do not, in a state in which it is decided else.
        """
        if self.alike.size:
            s = int(self.alike[0])
            raise InvalidDemonstrations(
                f"in state {s} the actions {np.flatnonzero(self.policy[s] > 0).tolist()} lead to the same, and the episodes "
                "have only states: expected actions, for a reward on states and actions. Record the actions too, or use "
                'reward_on="state" (--reward-on state).'
            )


def without_actions(episodes: Iterable[Episode]) -> list[Episode]:
    """The same episodes, as if only their states had been recorded; of each the steps whose successors are known."""
    return [replace(one, actions=None) for one in seen_parts(episodes)]


def infer(episodes: Iterable[Episode], states: States, table: TransitionTable) -> Inferred:
    """Infer the actions of episodes from their states alone.

    Args:
        episodes: at least one; actions are not looked at.
        states: numbers their observations as the table does.
        table: P.

    Raises:
        InvalidDemonstrations: no step that an action of the table explains.
        UnknownObservation: an observation that the index does not hold, naming the episode.
    """
    pairs, places = _steps(episodes, states)
    unique, numbers = np.unique(pairs, return_inverse=True)
    counts = np.bincount(numbers, minlength=unique.size).astype(np.float64)
    here, there = np.divmod(unique, table.n_states)
    likelihood = _likelihood(table, here, there)
    explained = np.asarray(likelihood.any(axis=1))
    lost = np.flatnonzero(~explained[numbers])
    first = "" if not lost.size else "episode {}, step {}".format(*places[lost[0]])
    if not explained.any():
        raise InvalidDemonstrations(
            f"no action of the table makes any of the {len(pairs)} steps, {first} first: expected successors that some action "
            "has. Give the table of the environment in which the episodes were recorded."
        )
    visits = np.bincount(here, counts, minlength=table.n_states)
    here, counts, likelihood = here[explained], counts[explained], likelihood[explained]
    acted, begins, which = np.unique(here, return_index=True, return_inverse=True)
    N = np.add.reduceat(counts, begins)
    same = _classes(table, acted)
    one_of = same == np.arange(table.n_actions)  # of equal rows the lowest stands for all
    found = most_likely(likelihood * one_of[which], counts / N[which], begins)
    able = (likelihood * one_of[which] > 0).sum(axis=1)
    weights, policy = np.zeros((table.n_states, table.n_actions)), np.full((table.n_states, table.n_actions), np.nan)
    members = np.zeros(same.shape)
    np.add.at(members, (np.arange(acted.size)[:, None], same), 1)
    shared = np.take_along_axis(found.weights / np.maximum(members, 1), same, axis=1)
    weights[acted] = N[:, None] * shared / shared.sum(axis=1, keepdims=True)
    best, decided = _largest(found)
    chosen = same == best[:, None]
    policy[acted[decided]] = (chosen / chosen.sum(axis=1, keepdims=True))[decided]
    undecided = np.flatnonzero((visits > 0) & np.isnan(policy[:, 0]))
    return Inferred(
        weights, policy, visits, int(counts[able == 1].sum()), int(counts[able > 1].sum()), lost.size, first,
        undecided, acted[decided & (chosen.sum(axis=1) > 1)], float(found.short.max()),
    )  # fmt: skip


def _steps(episodes: Iterable[Episode], states: States) -> tuple[np.ndarray, np.ndarray]:
    """(N,) s S + s' of each step whose successor is known, and (N, 2) its episode and number."""
    pairs, places = [np.zeros(0, dtype=np.int64)], [np.zeros((0, 2), dtype=np.int64)]
    for number, (episode, rows) in enumerate(numbered(episodes, states)):
        known = len(episode) - (episode.ending == "unseen")
        pairs.append(rows[:known].astype(np.int64) * states.n_states + rows[1 : known + 1])
        places.append(np.stack([np.full(known, number), np.arange(known)], axis=1))
    if not sum(map(len, pairs)):
        raise InvalidDemonstrations("there is no step whose successor was recorded: expected two states of one episode.")
    return np.concatenate(pairs), np.concatenate(places)


def _likelihood(table: TransitionTable, here: Indices, there: Indices) -> np.ndarray:
    """(m, A) P_a(s' | s) of some pairs."""
    rows = (here[:, None] * table.n_actions + np.arange(table.n_actions)).ravel()
    return np.asarray(table.P[rows, np.repeat(there, table.n_actions)]).reshape(here.size, table.n_actions)


def _classes(table: TransitionTable, among: Indices) -> np.ndarray:
    """(n, A) the lowest action whose row each action has, in some states."""
    n, A = among.size, table.n_actions
    rows = sp.csr_array(table.P[(among[:, None] * A + np.arange(A)).ravel()])
    told = (rows @ np.random.default_rng(0).uniform(1, 2, table.n_states)).reshape(n, A)  # equal rows are next to each other
    order = np.argsort(told, axis=1, kind="stable")
    numbers = (np.arange(n)[:, None] * A + order).ravel()
    apart = abs(rows[numbers] - rows[np.roll(numbers, 1)]).max(axis=1).toarray().ravel()
    new = (apart > SAME_SUCCESSORS).reshape(n, A)
    new[:, 0] = True
    group = np.cumsum(new, axis=1) - 1
    lowest = np.full((n, A), A)
    np.minimum.at(lowest, (np.arange(n)[:, None], group), order)
    same = np.empty((n, A), dtype=np.int64)
    np.put_along_axis(same, order, np.take_along_axis(lowest, group, axis=1), axis=1)
    return same


def _largest(found: Mixtures) -> tuple[np.ndarray, np.ndarray]:
    """(n,) actions of the largest weight, and (n,) is that decided?"""
    w = found.weights
    best, order = w.argmax(axis=1), np.sort(w, axis=1)
    second = order[:, -2] if w.shape[1] > 1 else np.zeros(len(w))
    unique = found.settled.all(axis=1) & (order[:, -1] > second + AS_LARGE)
    settled = np.take_along_axis(found.settled, best[:, None], axis=1)[:, 0]
    return best, unique | (settled & (order[:, -1] > 0.5 + AS_LARGE))
