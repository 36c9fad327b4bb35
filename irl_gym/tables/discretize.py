"""A continuous environment as a table: a grid over its state, and the moves between its cells.

Two ways to say where a step leads (the first as in Davies, "Multidimensional triangulation and interpolation for reinforcement
learning", 1997):
    multilinear   a step is made from each cell's centre, and its end is shared between the 2^d cells whose centres surround it
    sampled       steps are made from points drawn in the cell, and the cells that they end in are counted
Where a step ends the episode, it leads to terminal copies of these cells. The first states are shared in the same way. The
table is an approximation, and gets better with finer cells. Without noise, "multilinear" sees no more of a cell than its
centre: on 16 x 16 x 12 x 12 cells with velocities up to 2, all actions look equally good around CartPole's upright, and its
greedy policy falls after 20 steps; 8 samples a cell see how near the end is, and theirs balances for 500.
Axes: S states, A actions, N points, d coordinates.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import gymnasium as gym
import numpy as np
import scipy.sparse as sp

from irl_gym._typing import Indices, Points
from irl_gym.checks import checked_number
from irl_gym.environments.physics import Physics, physics_of
from irl_gym.environments.tabular_env import TabularEnv
from irl_gym.errors import InvalidParameter
from irl_gym.mdp.rewards import TabularReward
from irl_gym.mdp.tabular_mdp import TabularMDP, check_discount
from irl_gym.spaces.coordinates import IntegerCoordinate
from irl_gym.tables.cells import Cells
from irl_gym.tables.selfcheck import Payments
from irl_gym.tables.tabulation import Evidence, Tabulation

BLOCK = 1_000_000
"""Transitions assembled at once."""
BYTES = 50
"""Of memory for each transition while the table is made, 12 of which stay: measured 31 to 50."""

Method = Literal["multilinear", "sampled"]
METHODS: dict[str, str] = {
    "multilinear": "the step from its centre is shared between the centres around its end",
    "sampled": "the ends of steps from points drawn in it are counted",
}


def discretize(
    env: gym.Env,
    *,
    gamma: float,
    bins: int | Sequence[int],
    bounds: Mapping[str, Sequence[float]] | None = None,
    successors: Method = "multilinear",
    samples: int = 1,
    seed: int = 0,
    starts: int = 1000,
    memory_limit: float = 4e9,
    on_progress: Callable[[float], None] | None = None,
) -> Tabulation:
    """Make an approximate transition table of an environment whose state can be set. It is neither stepped nor reset itself.

    The true reward (S, A) is the mean that the steps paid. States that no episode reaches are in the table too. Measured on one
    core: CartPole with 20^4 cells takes 3 s (its own step is made 320,000 times), Acrobot with 10^4 cells 1 s; a mountain car
    with 1500^2 cells, stepped in NumPy, 7 s.

    Args:
        env: see `irl_gym.environments.physics.physics_of`; a continuous action needs `gymnasium.wrappers.DiscretizeAction`.
        gamma: discount in (0, 1); no environment carries one.
        bins: cells along each coordinate of the state; one number for all.
        bounds: {name: (low, high)} of coordinates, in place of the environment's own.
        successors: "multilinear" or "sampled".
        samples: steps from each cell and action. A world without noise needs but one for "multilinear"; otherwise they are
            averaged. The seed of a sample is the same for all actions.
        seed: of all that is drawn.
        starts: resets that the first states' distribution is made of.
        memory_limit: bytes of memory; a table that would take more is refused before it is begun.
        on_progress: called with the share of the work that is done.

    Raises:
        InvalidDiscount: gamma outside (0, 1).
        InvalidParameter: bins, bounds or another argument that cannot be right, or a table larger than `memory_limit`.
        NotSettable: the environment hides its state.
        NotDiscrete: an action space that is not Discrete.
    """
    check_discount(gamma)
    if successors not in METHODS:
        raise InvalidParameter(f"successors is {successors!r}: expected one of {', '.join(METHODS)}.")
    for name, value, least in (("samples", samples, 1), ("starts", starts, 1), ("seed", seed, 0)):
        checked_number(name, value, f"a whole number of at least {least}", least=least, whole=True)
    checked_number("memory_limit", memory_limit, "a number of bytes above 0, such as 4e9", above=0)
    if isinstance(env.unwrapped, TabularEnv):
        raise InvalidParameter(
            f"{type(env.unwrapped).__name__} is a table: expected an environment that is none. Use `tabulate(env, gamma=...)`."
        )
    physics = physics_of(env, bounds=bounds)
    cells = Cells(physics.coordinates, bins)
    if isinstance(physics.coordinates, IntegerCoordinate) and (cells.widths != 1).any():
        whole = round(float((physics.coordinates.high - physics.coordinates.low)[0]))
        raise InvalidParameter(
            f"bins is {bins!r}, but the states are {whole} whole numbers: expected {whole} cells, or some would share one. "
            f"Give bins={whole}, or use `tabulate(env, gamma=...)`, which needs none."
        )
    _check_size(cells, physics.n_actions, successors, samples, memory_limit)
    world = _World(physics, cells, successors, int(samples), int(seed))
    table = _assemble(world, on_progress or (lambda share: None))
    copies = len(table.ending)
    mdp = TabularMDP(table.P, gamma, np.append(_first_states(world, int(starts)), np.zeros(copies)))
    mean, deviation = (np.concatenate([part, np.zeros((copies, physics.n_actions))]) for part in (table.mean, table.deviation))
    evidence = Evidence(
        f"A grid of {' x '.join(map(str, cells.shape))} cells: of each, {METHODS[successors]} ({successors}; samples: "
        f"{samples}). The first states are those of {starts} resets.",
        exact=False, merged=table.lines - mdp.P.nnz, split=copies, check=None, error=None, reward_error=None,
        value_error=None,
    )  # fmt: skip
    payments = Payments(mean, deviation, None, table.largest)
    return Tabulation(
        mdp, TabularReward(mean, {"source": "environment"}), payments, replace(cells, ending=table.ending), evidence
    )


@dataclass(frozen=True, eq=False)
class _World:
    """A physics, a grid over its states, and how its steps become transitions between cells."""

    physics: Physics
    cells: Cells
    method: str
    samples: int
    seed: int

    def shares(self, points: Points) -> tuple[np.ndarray, np.ndarray]:
        """Cells (N, C) that points belong to, and their weights."""
        if self.method == "multilinear":
            return self.cells.spread(points)
        return self.cells.nearest(points)[:, None], np.ones((len(points), 1))

    def points(self, rows: Indices, sample: int) -> Points:
        """Where the steps from cells begin: (N, d)."""
        centres = self.cells.centres(rows)
        if self.method == "multilinear":
            return centres
        rng = np.random.default_rng([self.seed, 1, int(rows[0]), sample])
        return centres + rng.uniform(-0.5, 0.5, size=centres.shape) * self.cells.widths


@dataclass(frozen=True, eq=False)
class _Block:
    """Steps from some cells."""

    P: Any
    """(cells * A, 2 n_cells) CSR; column n_cells + c is the terminal copy of cell c."""
    total: np.ndarray
    """(cells, A) sum of what the samples paid."""
    square: np.ndarray
    """(cells, A) sum of its squares."""
    largest: float
    """The largest |reward|."""
    lines: int
    """Transitions before duplicates were added up."""


def _blocks(world: _World) -> Iterator[tuple[_Block, float]]:
    """The grid in blocks, each with the share of the grid that is done after it."""
    n, A = world.cells.n_cells, world.physics.n_actions
    corners = 2 ** len(world.cells.shape) if world.method == "multilinear" else 1
    size = max(1, BLOCK // (A * world.samples * corners))
    for first in range(0, n, size):
        rows = np.arange(first, min(first + size, n))
        yield _block(world, rows), (rows[-1] + 1) / n


def _block(world: _World, rows: Indices) -> _Block:
    n, A = world.cells.n_cells, world.physics.n_actions
    lines, columns, data = [], [], []
    total, square, largest = np.zeros((len(rows), A)), np.zeros((len(rows), A)), 0.0
    for sample in range(world.samples):
        points = world.points(rows, sample)
        for a in range(A):
            noise = np.random.default_rng([world.seed, 2, int(rows[0]), sample])  # the same for all actions
            moves = world.physics.transition(points, np.full(len(rows), a), noise)
            reached, weights = world.shares(moves.states)
            kept = weights > 0
            columns.append((reached + n * moves.terminated[:, None])[kept])
            lines.append(np.broadcast_to((np.arange(len(rows)) * A + a)[:, None], reached.shape)[kept])
            data.append(weights[kept] / world.samples)
            total[:, a] += moves.rewards
            square[:, a] += moves.rewards**2
            largest = max(largest, float(np.abs(moves.rewards).max()))
    entries = (np.concatenate(data), (np.concatenate(lines), np.concatenate(columns)))
    P = sp.csr_array(sp.coo_array(entries, shape=(len(rows) * A, 2 * n)))  # adds up duplicates
    return _Block(P, total, square, largest, entries[0].size)


@dataclass(frozen=True, eq=False)
class _Table:
    """All blocks together."""

    P: Any
    """(S*A, S) CSR, terminal copies included."""
    mean: np.ndarray
    """(cells, A) of what was paid."""
    deviation: np.ndarray
    """(cells, A) of what was paid."""
    largest: float
    """The largest |reward|."""
    ending: np.ndarray
    """Cells that have a terminal copy."""
    lines: int
    """Transitions before duplicates were added up."""


def _assemble(world: _World, on_progress: Callable[[float], None]) -> _Table:
    n, A = world.cells.n_cells, world.physics.n_actions
    index_type = np.int32 if 2 * n < 2**31 else np.int64
    data, columns, counts, totals, squares, largest, lines = [], [], [], [], [], 0.0, 0
    for block, share in _blocks(world):
        block.P.sort_indices()
        data.append(block.P.data)
        columns.append(block.P.indices.astype(index_type))
        counts.append(np.diff(block.P.indptr))
        totals.append(block.total)
        squares.append(block.square)
        largest, lines = max(largest, block.largest), lines + block.lines
        on_progress(share)
    indices = np.concatenate(columns)
    columns.clear()
    values = np.concatenate(data)
    data.clear()
    ends = indices >= n
    ending = np.unique(indices[ends]) - n
    indices[ends] = n + np.searchsorted(ending, indices[ends] - n)
    size = n + len(ending)
    pointers = np.full(size * A + 1, len(indices))  # rows of terminal copies are empty
    pointers[: n * A + 1] = np.cumsum(np.concatenate([[0], *counts]))
    P = sp.csr_array((values, indices, pointers), shape=(size * A, size))
    mean = np.concatenate(totals) / world.samples
    square = np.concatenate(squares) / world.samples
    variance = square - mean**2
    deviation = np.sqrt(np.where(variance > 1e-12 * square, variance, 0.0))
    return _Table(P, mean, deviation, largest, ending.astype(np.int64), lines)


def _first_states(world: _World, starts: int) -> np.ndarray:
    """(cells,) the distribution of the first state."""
    points = world.physics.start(starts, np.random.default_rng([world.seed, 0]))
    reached, weights = world.shares(points)
    d0 = np.bincount(reached.ravel(), weights=weights.ravel(), minlength=world.cells.n_cells)
    return d0 / d0.sum()


def _check_size(cells: Cells, n_actions: int, method: str, samples: int, memory_limit: float) -> None:
    """Refuse what would not fit, before anything is built."""
    corners = 2 ** len(cells.shape) if method == "multilinear" else 1
    n = float(np.prod(cells.shape.astype(float)))  # no integer can be too large for this
    transitions = n * n_actions * min(n, corners * samples)
    needed = BYTES * transitions + 8 * n * (6 * n_actions + 2)
    if needed > memory_limit:
        raise InvalidParameter(
            f"bins is {tuple(cells.shape.tolist())}: {n:,.0f} states with {n_actions} actions and up to {transitions:,.0f} "
            f"transitions, which would take {needed / 1e9:,.1f} GB, expected at most {memory_limit / 1e9:,.1f} GB "
            "(memory_limit). Take fewer bins or samples, or raise memory_limit."
        )
