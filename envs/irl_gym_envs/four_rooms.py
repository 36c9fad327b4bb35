"""Four rooms joined by four hallways (Sutton, Precup & Singh, "Between MDPs and semi-MDPs", 1999, section 2.3)."""

from collections.abc import Sequence
from typing import Literal

from irl_gym_envs.grid_map import Cells
from irl_gym_envs.grid_world import GridWorldEnv

PLAN = """
#############
#.....#.....#
#.....#.....#
#...........#
#.....#.....#
#.....#.....#
##.####.....#
#.....###.###
#.....#.....#
#.....#.....#
#...........#
#.....#.....#
#############
""".split()
"""The paper's figure: 11 x 11 cells inside the outer wall, 104 of them free."""

WALLS = [[r, c] for r, line in enumerate(PLAN) for c, letter in enumerate(line) if letter == "#"]


class FourRoomsEnv(GridWorldEnv):
    """The four rooms: a 13 x 13 `GridWorldEnv`, outer wall included, that ends on arrival at the goal.

    `slip` means what it means in `GridWorldEnv`, a uniform one of *all four* moves; the default of 4/9 is the paper's
    noise, the chosen move with probability 2/3 and each other one with 1/9.

    Args:
        slip: probability of a uniform one of all four moves.
        goals: a cell [row, column] of the 13 x 13 plan, or a list of cells; the default is the paper's G1, the hallway
            between the two rooms on the right.
        start: a cell, a list of cells, or "uniform" for every free cell; the default is the upper left corner.
        start_probabilities: one number for each cell of `start`.
        goal_reward: paid on arrival in a goal.
        step_reward: paid on arrival in any other cell.
        terminal_goal: does arrival in a goal end the episode?
        render_mode: "ansi", "rgb_array" or None.

    Raises:
        InvalidParameter: an argument that cannot be right, with its value and the mend.
    """

    def __init__(
        self,
        slip: float = 4 / 9,
        goals: Cells = (7, 9),
        start: Cells | Literal["uniform"] = (1, 1),
        start_probabilities: Sequence[float] | None = None,
        goal_reward: float = 1.0,
        step_reward: float = 0.0,
        terminal_goal: bool = True,
        render_mode: str | None = None,
    ):
        super().__init__(
            size=(len(PLAN), len(PLAN[0])), slip=slip, goals=goals, walls=WALLS, goal_reward=goal_reward,
            step_reward=step_reward, start=start, start_probabilities=start_probabilities, terminal_goal=terminal_goal,
            render_mode=render_mode,
        )  # fmt: skip
