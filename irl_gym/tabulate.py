"""Any discrete environment to an exact transition table.

`tabulate(env, gamma=...)` asks each source in `SOURCES` in turn; today there are two: an environment that is a table
(TabularEnv), and the table that an environment publishes as
    env.unwrapped.P[s][a] = [(probability, successor, reward, terminated), ...]
Such a `P` is not the whole truth: the rows of terminal states carry self-loops or ordinary moves, and successors stand in it
more than once. So:
    duplicates are added up; a state entered with `terminated` becomes terminal, its rows zero;
    a state that episodes enter both with and without `terminated` is split into an ordinary row and a terminal copy;
    states that no episode visits are never a reason to split (Taxi's end states are entered both ways, but only from there);
    wrappers are looked through, and a TimeLimit stays out: truncation is not part of an MDP.
Then `env.step` is sampled and compared with the table.
"""

import difflib
import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import gymnasium as gym
import numpy as np
import scipy.sparse as sp
from gymnasium import spaces

from irl_gym._typing import Matrix, Sparse
from irl_gym.errors import InvalidMDP, InvalidParameter, IrlGymError, NotDiscrete, NotTabular, UnknownEnvironment
from irl_gym.mdp import TabularMDP, check_discount
from irl_gym.rewards import TabularReward
from irl_gym.selfcheck import SelfCheck, compare_with_steps
from irl_gym.states import StateIndex
from irl_gym.tabular_env import TabularEnv


@dataclass(frozen=True)
class Evidence:
    """How a table was obtained, and what the check against `env.step` found."""

    method: str
    """Where the probabilities come from, in a sentence."""
    exact: bool
    """Are the probabilities exact, not estimated?"""
    merged: int
    """Successors that stood more than once in a row and were added up."""
    split: int
    """States split into an ordinary row and a terminal copy."""
    check: SelfCheck | None
    """What sampling `env.step` found; None when it was not asked for."""


@dataclass(frozen=True, eq=False)
class Tabulation:
    """An environment as a table."""

    mdp: TabularMDP
    """P, gamma and d0."""
    reward: TabularReward
    """(S, A) the environment's own reward, in expectation over successors."""
    reward_deviation: Matrix
    """(S, A) standard deviation of that reward; 0 where a step always pays the same."""
    entry_rewards: np.ndarray | None
    """(nnz,) the reward of each transition (s, a, s'), in the order of `mdp.P.data`; None if s, a and s' do not settle it."""
    states: StateIndex
    """Observations to rows and back."""
    evidence: Evidence
    """How it was obtained."""


Source = Callable[[gym.Env, float], Tabulation | None]


def tabulate(env: gym.Env, *, gamma: float, check_steps: int = 10_000, seed: int = 0) -> Tabulation:
    """Make the exact transition table of a discrete environment. The environment itself is neither stepped nor reset.

    Args:
        env: a Gymnasium environment, wrapped or not.
        gamma: discount in (0, 1); no environment carries one.
        check_steps: steps of a copy of the environment to compare with the table; 0 for none.
        seed: of the check.

    Raises:
        InvalidDiscount: gamma outside (0, 1).
        NotDiscrete: a continuous action or observation space.
        NotTabular: no table is published, or something acts outside it.
        TableMismatch: `env.step` did what the table says is impossible.
    """
    check_discount(gamma)
    if not isinstance(env.action_space, spaces.Discrete):
        raise NotDiscrete(
            f"the action space is {env.action_space}: expected Discrete. Discretise the actions with a wrapper first."
        )
    for source in SOURCES:
        found = source(env, gamma)
        if found is not None:
            break
    else:
        StateIndex(env.unwrapped.observation_space)  # when it is not discrete, that is the deeper reason
        raise NotTabular(
            f"{type(env.unwrapped).__name__} publishes no transition table: expected `env.unwrapped.P[s][a]`, a list of "
            "(probability, successor, reward, terminated). Give the environment such a `P`, or build a TabularMDP yourself "
            "and use TabularEnv."
        )
    if not check_steps:
        return found
    check = compare_with_steps(
        env, found.mdp, found.states, found.reward.values, found.reward_deviation, steps=check_steps, seed=seed
    )
    return replace(found, evidence=replace(found.evidence, check=check))


def make(env_id: str, **kwargs: Any) -> gym.Env:
    """`gymnasium.make`, with the closest names when the id is unknown.

    Raises:
        UnknownEnvironment: no such id.
        InvalidParameter: arguments that the environment does not take.
    """
    try:
        return gym.make(env_id, **kwargs)
    except gym.error.DependencyNotInstalled:
        raise
    except (TypeError, KeyError, ValueError) as error:
        if isinstance(error, IrlGymError):
            raise
        unexpected = re.search(r"unexpected keyword argument '(\w+)'", str(error))
        if unexpected:
            raise InvalidParameter(
                f"{env_id} takes no argument {unexpected[1]!r}: expected those of the environment's constructor."
            ) from error
        raise InvalidParameter(f"{env_id} cannot be made with {kwargs}: {type(error).__name__}: {error}.") from error
    except (gym.error.Error, ModuleNotFoundError) as error:
        name = env_id.split(":")[-1]
        close = difflib.get_close_matches(name, gym.registry, n=3, cutoff=0.5)
        offer = f" The closest are {', '.join(close)}." if close else ""
        raise UnknownEnvironment(
            f"environment {env_id!r} is not registered: expected an id such as 'FrozenLake-v1'.{offer} An environment of "
            "another package needs its module named first, as in 'irl_gym_envs:irl_gym/GridWorld-v0'."
        ) from error


def _own(env: gym.Env, gamma: float) -> Tabulation | None:
    """The table of a TabularEnv, which is one."""
    base = env.unwrapped
    if not isinstance(base, TabularEnv):
        return None
    mdp = base.mdp(gamma)
    rows = np.repeat(np.arange(mdp.P.shape[0]), np.diff(mdp.P.indptr))
    states, actions = np.divmod(rows, mdp.n_actions)
    paid = np.asarray(base.reward.pay(states, actions, mdp.P.indices), dtype=np.float64)
    R, deviation = _moments(rows, mdp.P.data, paid, (mdp.n_states, mdp.n_actions))
    evidence = Evidence("The environment is its table (TabularEnv).", exact=True, merged=0, split=0, check=None)
    index = StateIndex(base.observation_space)
    return Tabulation(mdp, TabularReward(R, {"source": "environment"}), deviation, paid, index, evidence)


def _published(env: gym.Env, gamma: float) -> Tabulation | None:
    """The table in `env.unwrapped.P`."""
    base = env.unwrapped
    P = getattr(base, "P", None)
    if not hasattr(P, "__getitem__"):
        return None
    if not isinstance(base.observation_space, spaces.Discrete):
        raise NotTabular(
            f"P is published, but the observation space is {base.observation_space}: expected Discrete, so that "
            "observations are the rows of P."
        )
    if getattr(base, "fickle_passenger", False):
        raise NotTabular(
            "fickle_passenger=True: the passenger changes destination outside the table that Taxi publishes, and depends on "
            "a flag that the observation does not show. Make the environment with fickle_passenger=False."
        )
    start = getattr(base, "initial_state_distrib", None)
    if start is None:
        raise NotTabular(
            f"{type(base).__name__} publishes P but no start: expected `initial_state_distrib`, (S,) probabilities."
        )
    space, actions = base.observation_space, base.action_space
    d0 = np.asarray(start, dtype=np.float64)
    return _assemble(_entries(P, space, actions), d0, space, gamma)  # pyright: ignore


@dataclass(frozen=True)
class _Entries:
    """The lines of a published table, one array a column."""

    rows: np.ndarray
    probability: np.ndarray
    successor: np.ndarray
    reward: np.ndarray
    terminated: np.ndarray
    n_actions: int


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
    rows, probability, successor, reward, terminated = (np.array(column) for column in zip(*lines, strict=True))
    outside = np.flatnonzero((successor < 0) | (successor >= space.n))
    if outside.size:
        s, a = divmod(int(rows[outside[0]]), n_actions)
        raise InvalidMDP(f"P[s={s}, a={a}] leads to {successor[outside[0]]}: expected a state from 0 to {int(space.n) - 1}.")
    kept = probability != 0
    return _Entries(rows[kept], probability[kept], successor[kept], reward[kept], terminated[kept], n_actions)


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
    for s, copy in copies.items():
        successor[(entries.successor == s) & entries.terminated] = copy
    size = n_states + len(copies)
    kept = ~terminal[entries.rows // n_actions]
    shape = (size * n_actions, size)
    rows = entries.rows[kept]
    P = sp.coo_array((entries.probability[kept], (rows, successor[kept])), shape=shape)
    mdp = TabularMDP(P, gamma, np.append(d0, np.zeros(len(copies))))
    p, r = entries.probability[kept], entries.reward[kept]
    R, deviation = _moments(rows, p, r, (size, n_actions))
    paid = _entry_rewards(mdp.P, rows, successor[kept], p, r)
    evidence = Evidence(
        method="The table that the environment publishes as P, with terminal rows zeroed and duplicates added up.",
        exact=True, merged=int(kept.sum()) - mdp.P.nnz, split=len(copies), check=None,
    )  # fmt: skip
    states = StateIndex(space, terminal_copies=copies)
    return Tabulation(mdp, TabularReward(R, {"source": "environment"}), deviation, paid, states, evidence)


def _moments(rows: np.ndarray, p: np.ndarray, r: np.ndarray, shape: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    """(S, A) mean and standard deviation of what a step pays, from lines of row, probability and reward."""
    R, square = (np.bincount(rows, weights=p * moment, minlength=shape[0] * shape[1]).reshape(shape) for moment in (r, r**2))
    variance = square - R**2
    return R, np.sqrt(np.where(variance > 1e-12 * np.maximum(square, 1), variance, 0.0))


def _entry_rewards(P: Sparse, rows: np.ndarray, columns: np.ndarray, p: np.ndarray, r: np.ndarray) -> np.ndarray | None:
    """(nnz,) rewards in the order of P.data; None where two lines of one (s, a, s') pay differently."""
    stored = np.repeat(np.arange(P.shape[0]), np.diff(P.indptr)) * P.shape[1] + P.indices  # increasing: P is canonical
    position = np.searchsorted(stored, rows * P.shape[1] + columns)
    mean = np.bincount(position, weights=p * r, minlength=P.nnz) / P.data
    return mean if np.allclose(mean[position], r, rtol=1e-9, atol=1e-12) else None


SOURCES: tuple[Source, ...] = (_own, _published)
"""Asked in turn for a table; the first answer is taken."""
