"""Where the states of a grid environment lie, read from the environment and its table.

No environment says which way an action goes. The table does: the mean displacement of an action over all states, jumps
left out (falling off CliffWalking's cliff puts the walker back to the start). Symmetric noise cancels in the mean, so
slippery actions point where they are meant to. Axes: S states, A actions; the map is (rows, columns).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces

from irl_gym.mdp.tabular_mdp import TransitionTable
from irl_gym.records import Record
from irl_gym.spaces.states import StateIndex
from irl_gym.tables.tabulation import Tabulation

MOST_STARTS = 8
"""More start cells than this are not marked."""


@dataclass(frozen=True, eq=False)
class GridLayout(Record):
    """The map that the first rows * columns states of a table fill row by row."""

    shape: tuple[int, int]
    """Rows and columns."""
    directions: np.ndarray
    """(A, 2) rows down and columns right of each action, each -1, 0 or 1; zeros for an action that goes nowhere."""
    blocked: np.ndarray
    """(rows, columns) cells that no episode visits: walls, and what lies behind them."""
    terminal: np.ndarray
    """(rows, columns) cells that end the episode on arrival."""
    letters: np.ndarray
    """(rows, columns) S start, G goal, H hole or pit, E another end; "" elsewhere."""

    @property
    def n_cells(self) -> int:
        """Number of cells; states beyond (terminal copies) are not on the map."""
        return self.shape[0] * self.shape[1]

    def cells(self, values: np.ndarray) -> np.ndarray:
        """(rows, columns, ...) of values (S, ...); what belongs to terminal copies is left out."""
        return np.asarray(values)[: self.n_cells].reshape(*self.shape, *np.shape(values)[1:])

    def to_json(self) -> dict[str, Any]:
        """The map as json."""
        arrays = {name: getattr(self, name).tolist() for name in ("directions", "blocked", "terminal", "letters")}
        return {"shape": list(self.shape), **arrays}

    @classmethod
    def from_json(cls, told: Mapping[str, Any]) -> "GridLayout":
        """The map that `to_json` wrote, in the shape of `run_schema.Grid`.

        Raises:
            ValueError: its parts are not of one size.
        """
        rows, columns = told["shape"]
        blocked, terminal = (np.array(told[name], dtype=bool).reshape(rows, columns) for name in ("blocked", "terminal"))
        letters = np.array(told["letters"], dtype="<U1").reshape(rows, columns)
        return cls((rows, columns), np.array(told["directions"], dtype=int).reshape(-1, 2), blocked, terminal, letters)


def map_of(env: gym.Env, table: Tabulation) -> GridLayout | None:
    """The map of an environment whose table is exact and has all its cells as rows; None where some only are listed."""
    exact = table.evidence.exact and isinstance(table.states, StateIndex)
    return grid_layout(env, table.mdp) if exact else None


def grid_layout(env: gym.Env, table: TransitionTable) -> GridLayout | None:
    """The map of a grid environment, or None if the environment is none (Taxi: 25 cells, but 500 states).

    A grid environment publishes `desc` (FrozenLake), `nrow` and `ncol`, or `shape` (CliffWalking, GridWorld), and
    has one discrete observation for each cell.

    Args:
        env: the environment, wrapped or not.
        table: its table, which may have rows for terminal copies after those of the cells.
    """
    shape = grid_shape(env)
    space = env.observation_space
    if shape is None or not isinstance(space, spaces.Discrete) or shape[0] * shape[1] != int(space.n):
        return None
    n = shape[0] * shape[1]
    if table.n_states < n:
        return None
    directions = _directions(table, shape)
    if not directions.any():
        return None
    terminal = table.terminal[:n].reshape(shape)
    blocked = ~table.reachable[:n].reshape(shape)
    letters = _letters(env.unwrapped, table.d0[:n].reshape(shape), terminal & ~blocked)
    return GridLayout(shape, directions, blocked, terminal, letters)


def grid_shape(env: gym.Env) -> tuple[int, int] | None:
    """Rows and columns of a grid environment, from whichever attribute it has; None if it has none."""
    base: Any = env.unwrapped
    if hasattr(base, "desc"):
        found: Any = np.shape(base.desc)
    elif hasattr(base, "nrow") and hasattr(base, "ncol"):
        found = base.nrow, base.ncol
    else:
        found = getattr(base, "shape", None)
    if not isinstance(found, tuple) or len(found) != 2 or not all(isinstance(n, int | np.integer) for n in found):
        return None
    return int(found[0]), int(found[1])


def _directions(table: TransitionTable, shape: tuple[int, int]) -> np.ndarray:
    """(A, 2) the mean displacement of each action, rounded to one of the eight neighbours."""
    coo = table.P.tocoo()
    s, a = np.divmod(coo.row.astype(np.int64), table.n_actions)
    n = shape[0] * shape[1]
    on_map = (s < n) & (coo.col < n) & table.reachable[s]
    s, a, following, p = s[on_map], a[on_map], coo.col[on_map], coo.data[on_map]
    moved = np.stack([following // shape[1] - s // shape[1], following % shape[1] - s % shape[1]], axis=1)
    near = np.abs(moved).max(axis=1) <= 1
    mean = np.zeros((table.n_actions, 2))
    np.add.at(mean, a[near], p[near, None] * moved[near])
    visits = np.bincount(a[near], weights=p[near], minlength=table.n_actions)
    mean /= np.maximum(visits, 1e-300)[:, None]
    longest = np.abs(mean).max(axis=1, keepdims=True)
    # Below 5 % of the steps an action has no direction; a component over half the other makes a diagonal.
    return np.where(longest > 0.05, np.rint(mean / np.maximum(longest, 1e-300)), 0).astype(int)


def _letters(base: Any, start: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """What to call each cell, from the environment's own map where it has one."""
    letters = np.full(ends.shape, "", dtype="<U1")
    letters[ends] = "G" if ends.sum() == 1 else "E"
    if 0 < (start > 0).sum() <= MOST_STARTS:
        letters[start > 0] = "S"
    desc: Any = getattr(base, "desc", "")
    if np.shape(desc) == ends.shape:
        own = np.array(desc).astype(str)
        letters[own == "G"], letters[own == "H"] = "G", "H"
    for name, letter in (("goals", "G"), ("pits", "H")):
        mask: Any = getattr(base, name, ())
        if np.shape(mask) == ends.shape:
            letters[np.asarray(mask, dtype=bool)] = letter
    return letters
