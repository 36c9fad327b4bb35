"""A rectangular map of cells, and the transition table of walking on it.

Cells are (row, column) from the top left and are numbered row by row: cell (r, c) of an R x C map is state r * C + c.
Walls keep their numbers, so that a state is found on the map by one division; no action leads into them. All is
vectorised: a map of a million cells takes seconds.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import scipy.sparse as sp

from irl_gym.errors import InvalidParameter
from irl_gym.mdp.tabular_mdp import TransitionTable

MOVES = ((-1, 0), (0, 1), (1, 0), (0, -1))
"""Rows and columns that each action moves: 0 up, 1 right, 2 down, 3 left."""

Cells = Sequence[int] | Sequence[Sequence[int]]
"""One cell [row, column], or a list of cells."""


@dataclass(frozen=True, eq=False)
class GridMap:
    """What stands where: (rows, columns) boolean masks and the distribution of the first cell."""

    walls: np.ndarray
    """Cells that cannot be entered."""
    goals: np.ndarray
    """Cells that pay the goal reward on arrival."""
    pits: np.ndarray
    """Cells that pay the pit reward on arrival and end the episode."""
    start: np.ndarray
    """(rows, columns) probability of the first cell."""
    terminal: np.ndarray
    """Cells that end the episode on arrival."""

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.walls.shape[0], self.walls.shape[1]


def make_map(
    size: int | Sequence[int],
    *,
    walls: Cells,
    goals: Cells | None,
    pits: Cells,
    start: Cells | Literal["uniform"] | None,
    start_probabilities: Sequence[float] | None,
    terminal_goal: bool,
) -> GridMap:
    """Check the arguments that `GridWorldEnv` takes, and draw the map.

    Raises:
        InvalidParameter: naming the first cell that lies off the map, on a wall, or on something else.
    """
    rows, columns = shape = _shape(size)
    goals = [0, columns - 1] if goals is None else goals
    wall, goal, pit = (
        _mask(shape, _cells(name, value, shape)) for name, value in (("walls", walls), ("goals", goals), ("pits", pits))
    )
    _check_apart("goals", goal, "walls", wall)
    _check_apart("pits", pit, "walls", wall)
    _check_apart("pits", pit, "goals", goal)
    terminal = (goal | pit) if terminal_goal else pit
    if isinstance(start, str):
        first = _start_everywhere(start, ~(wall | terminal), start_probabilities)
    else:
        cells = _cells("start", [rows - 1, 0] if start is None else start, shape)
        occupied = _mask(shape, cells)
        _check_apart("start", occupied, "walls", wall)
        _check_apart("start", occupied, "terminal cells (goals and pits)", terminal)
        first = np.zeros(shape)
        np.add.at(first, (cells[:, 0], cells[:, 1]), _start_weights(start_probabilities, len(cells)))
    for mask in (wall, goal, pit, first, terminal):
        mask.setflags(write=False)
    return GridMap(wall, goal, pit, first, terminal)


def walk(grid: GridMap, slip: float) -> TransitionTable:
    """The table of walking on a map: the chosen move, or with probability `slip` a uniform one of all four.

    A move off the map or into a wall stays. Rows of terminal cells are zero; those of walls loop on themselves.

    Args:
        grid: the map.
        slip: probability in [0, 1]; the chosen move happens with probability 1 - slip + slip / 4.

    Raises:
        InvalidParameter: a slip outside [0, 1].
    """
    if not 0 <= slip <= 1:
        raise InvalidParameter(f"slip is {slip}: expected a probability from 0 to 1.")
    following = _successors(grid)
    S, A = following.shape
    # Row s * A + a lists the successors of all four moves, the chosen one with more weight; duplicates are added up.
    weights = (1 - slip) * np.eye(A) + slip / A
    data = (~grid.terminal.ravel())[:, None, None] * weights
    indices = np.repeat(following, A, axis=0).ravel()
    pointers = np.arange(S * A + 1, dtype=indices.dtype) * A
    P = sp.csr_array((data.ravel(), indices, pointers), shape=(S * A, S))
    return TransitionTable(P, grid.start.ravel())


def _successors(grid: GridMap) -> np.ndarray:
    """(S, 4) the cell that each move leads to."""
    rows, columns = grid.shape
    index_type = np.int32 if 16 * rows * columns < 2**31 else np.int64
    numbers = np.arange(rows * columns, dtype=index_type).reshape(rows, columns)
    following = np.empty((rows, columns, len(MOVES)), dtype=index_type)
    for a, (down, right) in enumerate(MOVES):
        r = np.clip(np.arange(rows) + down, 0, rows - 1)[:, None]
        c = np.clip(np.arange(columns) + right, 0, columns - 1)[None, :]
        following[..., a] = np.where(grid.walls[r, c] | grid.walls, numbers, numbers[r, c])
    return following.reshape(-1, len(MOVES))


def _shape(size: int | Sequence[int]) -> tuple[int, int]:
    pair = np.asarray([size, size] if isinstance(size, int | np.integer) else size)
    if isinstance(size, bool) or pair.shape != (2,) or pair.dtype.kind not in "iu" or (pair < 1).any():
        raise InvalidParameter(f"size is {size!r}: expected a whole number of at least 1, or [rows, columns].")
    if pair.max() == 1:
        raise InvalidParameter(f"size is {size!r}: one cell leaves nowhere to go. Expected at least two cells.")
    return int(pair[0]), int(pair[1])


def _cells(name: str, value: Any, shape: tuple[int, int]) -> np.ndarray:
    """Cells as an (N, 2) integer array."""
    try:
        array = np.asarray(value)
    except ValueError:  # ragged
        array = np.asarray(None)
    if array.dtype != object and array.size == 0:
        return np.zeros((0, 2), dtype=np.int64)
    if array.ndim == 1:
        array = array[None]
    if array.ndim != 2 or array.shape[1] != 2 or array.dtype.kind not in "iu":
        raise InvalidParameter(f"{name} is {value!r}: expected a cell [row, column] or a list of cells, in whole numbers.")
    off = np.flatnonzero(((array < 0) | (array >= shape)).any(axis=1))
    if off.size:
        raise InvalidParameter(
            f"{name} has the cell {array[off[0]].tolist()}, off the map: rows go from 0 to {shape[0] - 1}, columns "
            f"from 0 to {shape[1] - 1}, counted from the top left. Move it, or make `size` larger."
        )
    return array.astype(np.int64)


def _mask(shape: tuple[int, int], cells: np.ndarray) -> np.ndarray:
    mask = np.zeros(shape, dtype=bool)
    mask[cells[:, 0], cells[:, 1]] = True
    return mask


def _check_apart(name: str, mask: np.ndarray, other: str, taken: np.ndarray) -> None:
    both = np.argwhere(mask & taken)
    if both.size:
        raise InvalidParameter(f"{name} has the cell {both[0].tolist()}, which is among the {other} too. Move one of them.")


def _start_everywhere(start: str, free: np.ndarray, probabilities: Sequence[float] | None) -> np.ndarray:
    if start != "uniform":
        raise InvalidParameter(f"start is {start!r}: expected a cell, a list of cells, or 'uniform' for every free cell.")
    if probabilities is not None:
        raise InvalidParameter("start_probabilities are given with start='uniform': list the cells in `start`, or drop them.")
    if not free.any():
        raise InvalidParameter("start is 'uniform', but every cell is a wall or terminal: leave at least one free.")
    return free / free.sum()


def _start_weights(probabilities: Sequence[float] | None, n: int) -> np.ndarray:
    if n == 0:
        raise InvalidParameter("start is empty: expected at least one cell.")
    if probabilities is None:
        return np.full(n, 1 / n)
    weights = np.asarray(probabilities, dtype=np.float64)
    if weights.shape != (n,):
        raise InvalidParameter(
            f"start_probabilities has shape {weights.shape}: expected ({n},), one number for each cell of `start`."
        )
    if not (weights >= 0).all() or not abs(weights.sum() - 1) <= 1e-9:
        raise InvalidParameter(f"start_probabilities is {weights.tolist()}: expected numbers of at least 0 that sum to 1.")
    return weights
