"""The gridworld of Abbeel & Ng (2004), section 5.1: 128 x 128 cells, in 8 x 8 macrocells of 16 x 16, which are the features.

    moves    four; with 30 % a uniform one of all four in its place (the chosen one then has 0.775); a move off the grid stays
    start    uniform
    reward   R(s) = w_c for all cells s of macrocell c: 0 with probability 0.9, else uniform on [0, 1]; then divided by the sum.
             Draws with fewer than two that are not 0 are drawn again
A state is paid at each step that is begun in it, the first included: V = sum_t gamma^t R(s_t), as the paper's w . mu.
Axes: S cells, row by row from the top; A moves up, right, down, left; K macrocells.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from irl_gym.mdp.tabular_mdp import TabularMDP

MOVES = np.array([(-1, 0), (0, 1), (1, 0), (0, -1)])
"""(A, 2) rows and columns."""


@dataclass(frozen=True)
class Gridworld:
    """The world without its reward."""

    side: int = 128
    """Cells along each side."""
    block: int = 16
    """Cells along each side of a macrocell."""
    gamma: float = 0.99
    """Discount."""
    noise: float = 0.3
    """Probability of a random move."""
    zero: float = 0.9
    """Probability that the weight of a macrocell is 0."""

    @property
    def n_cells(self) -> int:
        """K."""
        return (self.side // self.block) ** 2

    @property
    def cells(self) -> np.ndarray:
        """(S,) the macrocell of each cell."""
        rows, columns = np.divmod(np.arange(self.side**2), self.side)
        return rows // self.block * (self.side // self.block) + columns // self.block

    def mdp(self) -> TabularMDP:
        """P, gamma and d0."""
        S, A = self.side**2, len(MOVES)
        places = np.stack(np.divmod(np.arange(S), self.side), axis=1)[:, None] + MOVES  # (S, A, 2)
        following = np.clip(places, 0, self.side - 1) @ [self.side, 1]  # (S, A)
        shares = (1 - self.noise) * np.eye(A) + self.noise / A  # (A chosen, A made)
        entries = np.tile(shares, (S, 1)).ravel(), (np.repeat(np.arange(S * A), A), np.repeat(following, A, axis=0).ravel())
        return TabularMDP(sp.csr_array(entries, shape=(S * A, S)), self.gamma, np.full(S, 1 / S))

    def weights(self, rng: np.random.Generator) -> np.ndarray:
        """(K,) weights of the true reward, of sum 1."""
        while True:
            w = np.where(rng.random(self.n_cells) < self.zero, 0.0, rng.random(self.n_cells))
            if np.count_nonzero(w) >= 2:
                return w / w.sum()
