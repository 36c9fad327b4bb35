"""The table that an environment publishes as `env.unwrapped.P[s][a] = [(probability, successor, reward, terminated), ...]`.

Such a `P` is not the whole truth: the rows of terminal states carry self-loops, ordinary moves or nothing, and successors stand
in it more than once. So:
    duplicates are added up; a state entered with `terminated` becomes terminal, its rows zero;
    a state that episodes enter both with and without `terminated` is split into an ordinary row and a terminal copy;
    states that no episode visits are never a reason to split (Taxi's end states are entered both ways, but only from there).
"""

from dataclasses import dataclass
from typing import Any

import gymnasium as gym
import numpy as np
import scipy.sparse as sp
from gymnasium import spaces

from irl_gym.checks import float_array, of_single_precision
from irl_gym.errors import InvalidMDP, NotDiscrete, NotTabular
from irl_gym.spaces.states import StateIndex
from irl_gym.tables.tabulation import Evidence, Lines, Tabulation, from_lines


def published_table(env: gym.Env, gamma: float) -> Tabulation | None:
    """The table in `env.unwrapped.P`."""
    base = env.unwrapped
    P = getattr(base, "P", None)
    start = getattr(base, "initial_state_distrib", None)
    if not hasattr(P, "__getitem__") or start is None or not isinstance(base.observation_space, spaces.Discrete):
        return None  # no table, or one that does not say where episodes begin, or whose rows are no observations
    if not isinstance(base.action_space, spaces.Discrete):
        raise NotDiscrete(f"P is published, but the action space is {base.action_space}: expected Discrete.")
    if getattr(base, "fickle_passenger", False):
        return None  # the passenger changes destination outside the table
    space, actions = base.observation_space, base.action_space
    d0 = float_array("initial_state_distrib", start, "(S,) probabilities", InvalidMDP)
    if d0.shape != (int(space.n),):
        raise InvalidMDP(f"initial_state_distrib has shape {d0.shape}: expected ({int(space.n)},), one for each observation.")
    return _assemble(_entries(P, space, actions), d0, space, gamma)


@dataclass(frozen=True, eq=False)
class _Entries:
    """The lines of a published table, one array a column."""

    rows: np.ndarray
    probability: np.ndarray
    successor: np.ndarray
    reward: np.ndarray
    terminated: np.ndarray
    n_actions: int
    single: float
    """How far rows of single precision were from 1; they have been divided by their sums."""


def _entries(P: Any, space: spaces.Discrete, actions: spaces.Discrete) -> _Entries:
    """The lines of P; zero probabilities are left out, negative and NaN ones kept for the MDP's own check to name."""
    offset, first, n_actions = int(space.start), int(actions.start), int(actions.n)
    try:
        lines = [
            (s * n_actions + a, float(p), int(following) - offset, float(r), bool(done))
            for s in range(int(space.n))
            for a in range(n_actions)
            for p, following, r, done in P[s + offset][a + first]
        ]
    except (KeyError, IndexError, TypeError, ValueError) as error:
        raise NotTabular(
            f"the published P cannot be read ({type(error).__name__}: {error}): expected P[s][a] for every state and action, a "
            "list of (probability, successor, reward, terminated)."
        ) from error
    if not lines:
        raise NotTabular("the published P has no line at all: expected a list of successors for every state and action.")
    rows, probability, successor, reward, terminated = (np.array(column) for column in zip(*lines, strict=True))
    outside = np.flatnonzero((successor < 0) | (successor >= space.n))
    if outside.size:
        s, a = divmod(int(rows[outside[0]]), n_actions)
        raise InvalidMDP(f"P[s={s}, a={a}] leads to {successor[outside[0]]}: expected a state from 0 to {int(space.n) - 1}.")
    kept = probability != 0
    probability, single = of_single_precision(probability, rows, int(space.n) * n_actions)
    return _Entries(rows[kept], probability[kept], successor[kept], reward[kept], terminated[kept], n_actions, single)


def _visited(entries: _Entries, d0: np.ndarray) -> np.ndarray:
    """(S,) states that episodes act in: reached from d0, going on only where nothing terminated."""
    n_states = d0.size
    kept = ~entries.terminated
    graph = sp.csr_array(
        (np.ones(kept.sum()), (entries.rows[kept] // entries.n_actions, entries.successor[kept])),
        shape=(n_states, n_states),
    )
    mask = d0 > 0
    frontier = mask
    while frontier.any():
        following = (graph.T @ frontier.astype(float)) > 0
        frontier = following & ~mask
        mask = mask | frontier
    return mask


def _assemble(entries: _Entries, d0: np.ndarray, space: spaces.Space, gamma: float) -> Tabulation:
    """Zero terminal rows, split what is entered both ways, add up duplicates."""
    n_states, n_actions = d0.size, entries.n_actions
    visited = _visited(entries, d0)
    silent = visited[:, None] & (np.bincount(entries.rows, minlength=n_states * n_actions).reshape(n_states, n_actions) == 0)
    if silent.any():
        s, a = np.argwhere(silent)[0]
        raise NotTabular(f"the published P has no line for (s={s}, a={a}), where episodes come: expected its successors.")
    ends_from_visited = entries.terminated & visited[entries.rows // n_actions]
    ended = np.zeros(n_states, dtype=bool)
    ended[entries.successor[ends_from_visited]] = True
    both = np.flatnonzero(ended & visited)  # acted in, and arrived at for good
    terminal = ended & ~visited
    copies = {int(s): n_states + i for i, s in enumerate(both)}
    # Entered with `terminated` from states no episode visits only: terminal too, unless some episode acts there.
    elsewhere = np.zeros(n_states, dtype=bool)
    elsewhere[entries.successor[entries.terminated]] = True
    terminal |= elsewhere & ~visited
    successor = entries.successor.copy()
    copy_of = np.arange(n_states)
    copy_of[both] = n_states + np.arange(both.size)
    successor[entries.terminated] = copy_of[successor[entries.terminated]]
    kept = ~terminal[entries.rows // n_actions]
    lines = Lines(entries.rows[kept], successor[kept], entries.probability[kept], entries.reward[kept])
    evidence = Evidence(
        method="The table that the environment publishes as P, with terminal rows zeroed and duplicates added up."
        + (
            f" Rows of single precision, which summed to 1 within {entries.single:.1g}, were divided by their sums."
            if entries.single
            else ""
        ),
        exact=True, merged=0, split=len(copies), check=None,
    )  # fmt: skip
    start = np.append(d0, np.zeros(len(copies)))
    return from_lines(lines, start, n_actions, StateIndex(space, copies), gamma=gamma, evidence=evidence)
