"""The 3x3 gridworlds of Gleave et al. (2021, appendix A.2), on which the distances of figure A.2(a) are.

Five actions: right, down, left, up, stay; moves off the grid stay; nothing is terminal; gamma 0.99. The paper pays R(s, a, s')
in the cell that is left, so these rewards are (S, A, S) with the same number for every a and s', plus a potential for Dense.
Axes: S = 9 cells from the top left, A = 5 actions.
"""

import numpy as np

from irl_gym.mdp.tabular_mdp import TabularMDP

GAMMA = 0.99
MOVES = ((0, 1), (1, 0), (0, -1), (-1, 0), (0, 0))
GOAL, CENTRE = 8, 4
CELLS = {
    "Sparse": [0, 0, 0, 0, 0, 0, 0, 0, 1],
    "Dense": [-1, -1, -1, -1, -1, -1, -1, -1, 3],
    "Center": [0, 0, 0, 0, 1, 0, 0, 0, 0],
    "Penalty": [0, 0, 0, 0, 0, 0, 0, 0, -1],
    "Path": [0, -1, -1, 0, 0, 0, -1, -1, 4],
    "Cliff": [0, -1, -1, 0, 0, 0, -4, -4, 4],
}
"""What each cell pays; Dense is 4 Sparse - 1, and is shaped below. Distances that the paper prints settle the numbers:
Sparse-Path 0.1602 (figure A.2) the goal's 4, and Path-Cliff 0.27 (figure 2) the cliff's -4."""

PRINTED = {
    ("Sparse", "Dense"): "0.0000",
    ("Sparse", "Center"): "0.7500",
    ("Sparse", "Path"): "0.1602",
    ("Path", "Cliff"): "0.27",
}
"""EPIC distances as the paper prints them, where its print was at hand: figure A.2(a), and the caption of figure 2."""


def gridworld() -> TabularMDP:
    """The table, with uniform starts."""
    P = np.zeros((9, len(MOVES), 9))
    for s in range(9):
        for a, (down, right) in enumerate(MOVES):
            row, column = np.clip((s // 3 + down, s % 3 + right), 0, 2)
            P[s, a, row * 3 + column] = 1
    return TabularMDP.from_dense(P, GAMMA, np.full(9, 1 / 9))


def gridworld_rewards() -> dict[str, np.ndarray]:
    """Names and rewards (S, A, S), in the order of the figure."""
    rewards = {name: np.broadcast_to(np.array(cells, float)[:, None, None], (9, 5, 9)) for name, cells in CELLS.items()}
    s = np.arange(9)
    Phi = -3.0 * (np.abs(s // 3 - GOAL // 3) + np.abs(s % 3 - GOAL % 3))  # nearer to the goal is better
    rewards["Dense"] = rewards["Dense"] + GAMMA * Phi - Phi[:, None, None]
    return rewards


def other_than_printed(matrix: np.ndarray) -> list[str]:
    """What differs from the paper's print in a matrix (6, 6) of EPIC distances, in the order of the figure."""
    place, told = {name: i for i, name in enumerate(CELLS)}, []
    for (one, other), printed in PRINTED.items():
        distance = float(matrix[place[one], place[other]])
        if f"{distance:.{len(printed) - 2}f}" != printed:
            told.append(f"{one}-{other} is {distance:.4f}: the paper prints {printed}")
    return told
