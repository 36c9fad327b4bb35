"""The least and the largest value of many linear functions over one polytope, by one linear program each.

    {x: low <= A x <= high, least <= x <= most}
The functions are dealt out in chunks of fixed size. Each chunk has its own `WarmLP`, factored once and started afresh, so an
answer depends on its chunk alone: any number of processes gives the same bytes. Axes: n unknowns, m rows, k functions.
"""

import multiprocessing
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial

import numpy as np

from irl_gym._typing import Sparse
from irl_gym.checks import checked_number
from irl_gym.programs.deadline import NEVER, Deadline
from irl_gym.programs.warm_lp import WarmLP

CHUNK = 100
"""Functions solved one after the other from one start."""


@dataclass(frozen=True, eq=False)
class Polytope:
    """What the unknowns may be. Bounds of +-np.inf are none."""

    A: Sparse
    """(m, n)."""
    low: np.ndarray
    """(m,) least values of the rows."""
    high: np.ndarray
    """(m,) largest values of the rows."""
    least: np.ndarray
    """(n,) least values of the unknowns."""
    most: np.ndarray
    """(n,) largest values of the unknowns."""

    def program(self, deadline: Deadline = NEVER, *, perturbed: bool = True) -> WarmLP:
        """The linear program whose objective may change."""
        return WarmLP(self.A, self.low, self.high, self.least, self.most, deadline=deadline, perturbed=perturbed)


def extremes(
    polytope: Polytope,
    functions: Sparse,
    *,
    lowest: np.ndarray | None = None,
    workers: int = 1,
    deadline: Deadline = NEVER,
) -> tuple[np.ndarray, np.ndarray]:
    """The least and the largest value of each function.

    Args:
        polytope: not empty, and bounded in the direction of each function.
        functions: (k, n) one function in each row.
        lowest: (k,) booleans: functions whose least value is wanted too; the others' is NaN. None for all.
        workers: processes. More than one are started afresh ("spawn"), so a script that asks for them needs the usual
            `if __name__ == "__main__":`.
        deadline: of all linear programs together.

    Returns:
        (k,) least and (k,) largest values.

    Raises:
        InvalidParameter: workers below 1.
        SolverInfeasible: the polytope is empty.
        SolverTimeout, SolverFailed: no answer.
    """
    workers = int(checked_number("workers", workers, "a number of processes of at least 1", least=1, whole=True))
    count = functions.shape[0]
    lowest = np.ones(count, dtype=bool) if lowest is None else lowest
    chunks = [(functions[at : at + CHUNK], lowest[at : at + CHUNK]) for at in range(0, count, CHUNK)]
    solve = partial(_chunk, polytope, deadline)
    if workers == 1 or len(chunks) < 2:
        found = list(map(solve, chunks))
    else:
        spawning = multiprocessing.get_context("spawn")
        with ProcessPoolExecutor(min(workers, len(chunks)), mp_context=spawning) as pool:
            found = list(pool.map(solve, chunks))
    joined = np.concatenate([np.zeros((0, 2)), *found])
    return joined[:, 0], joined[:, 1]


def _chunk(polytope: Polytope, deadline: Deadline, chunk: tuple[Sparse, np.ndarray]) -> np.ndarray:
    """(c, 2) least and largest values of a chunk's functions."""
    functions, lowest = chunk
    program, dense = polytope.program(deadline), functions.toarray()
    found = np.full((dense.shape[0], 2), np.nan)
    for i, function in enumerate(dense):
        if lowest[i]:
            found[i, 0] = program.minimise(function).objective
        found[i, 1] = -program.minimise(-function).objective
    return found
