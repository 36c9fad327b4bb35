"""A grid to walk on, by default the one of Ng & Russell (2000, section 6, experiment 1).

Four moves; with probability `slip` a uniform one of all four happens instead of the chosen one; a move off the grid or
into a wall stays. Arriving in a cell pays: the goal or the pit reward, or in every other cell the step reward.
"""

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np

from irl_gym.environments.tabular_env import TabularEnv
from irl_gym.errors import InvalidParameter
from irl_gym.mdp.rewards import TabularReward
from irl_gym_envs.grid_map import Cells, GridMap, make_map, walk
from irl_gym_envs.grid_rendering import Picture, draw_text
from irl_gym_envs.render_modes import check_render_mode, warn_of_no_render_mode


class GridWorldEnv(TabularEnv):
    """A grid of rows x columns cells, numbered row by row from the top left; actions 0 up, 1 right, 2 down, 3 left.

    Every argument but `render_mode` can be written as JSON, so that `env.spec.to_json()` holds the whole environment.

    Args:
        size: rows and columns; one number for a square.
        slip: probability that a uniform one of all four moves replaces the chosen one, which so happens with
            probability 1 - 3/4 slip.
        goals: a cell [row, column] or a list of cells; the default is the upper right corner. May be empty.
        pits: a cell or a list of cells; arrival ends the episode.
        walls: a cell or a list of cells that cannot be entered. They keep their numbers.
        goal_reward: paid on arrival in a goal, in place of the step reward.
        pit_reward: paid on arrival in a pit, in place of the step reward.
        step_reward: paid on arrival in any other cell, also when the move bumped and the cell is the same.
        start: a cell, a list of cells (uniform), or "uniform" for every cell that is neither a wall nor terminal; the
            default is the lower left corner.
        start_probabilities: one number for each cell of `start`.
        terminal_goal: does arrival in a goal end the episode? If not, the agent goes on acting there, and every arrival
            pays, also the arrival of a move that bumps and stays in the goal.
        render_mode: "ansi", "rgb_array" or None.

    Raises:
        InvalidParameter: an argument that cannot be right, with its value and the mend.
    """

    metadata: dict[str, Any] = {"render_modes": ["ansi", "rgb_array"], "render_fps": 6}  # noqa: RUF012 (as Gymnasium)

    def __init__(
        self,
        size: int | Sequence[int] = 5,
        slip: float = 0.3,
        goals: Cells | None = None,
        pits: Cells = (),
        walls: Cells = (),
        goal_reward: float = 1.0,
        pit_reward: float = -1.0,
        step_reward: float = 0.0,
        start: Cells | Literal["uniform"] | None = None,
        start_probabilities: Sequence[float] | None = None,
        terminal_goal: bool = True,
        render_mode: str | None = None,
    ):
        check_render_mode(render_mode, self.metadata)
        self.map: GridMap = make_map(
            size, walls=walls, goals=goals, pits=pits,
            start=start, start_probabilities=start_probabilities, terminal_goal=terminal_goal,
        )  # fmt: skip
        pays = {"goal_reward": goal_reward, "pit_reward": pit_reward, "step_reward": step_reward}
        for name, value in pays.items():
            if not np.isfinite(value):
                raise InvalidParameter(f"{name} is {value}: expected a finite number.")
        R = np.select([self.walls, self.goals, self.pits], [0.0, goal_reward, pit_reward], step_reward)
        super().__init__(walk(self.map, slip), TabularReward(R.ravel()), render_mode)
        self._came_from: int | None = None
        self._picture: Picture | None = None

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.map.shape

    @property
    def walls(self) -> np.ndarray:
        """(rows, columns) cells that cannot be entered."""
        return self.map.walls

    @property
    def goals(self) -> np.ndarray:
        """(rows, columns) cells that pay the goal reward."""
        return self.map.goals

    @property
    def pits(self) -> np.ndarray:
        """(rows, columns) cells that pay the pit reward and end the episode."""
        return self.map.pits

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[int, dict[str, Any]]:
        """Begin an episode in a start cell, or in the state `options["state"]`.

        Raises:
            InvalidInput: a state that does not exist, is terminal or is a wall.
        """
        wanted = None if options is None else options.get("state")
        if wanted is not None and 0 <= wanted < self.walls.size and self.walls.flat[wanted]:
            raise InvalidParameter(f'options["state"] is {wanted}, a wall: expected a cell that can be entered.')
        self._came_from = None
        return super().reset(seed=seed, options=options)

    def step(self, action: Any) -> tuple[int, float, bool, bool, dict[str, Any]]:
        """Move, perhaps slip, and be paid on arrival.

        Raises:
            InvalidInput: an action outside the action space, before reset, or after the end of an episode.
        """
        before = self.s
        result = super().step(action)
        self._came_from = before
        return result

    def render(self) -> Any:
        """The grid as text ("ansi") or as an (H, W, 3) uint8 picture ("rgb_array")."""
        if self.render_mode is None:
            return warn_of_no_render_mode(self, "ansi")
        if self.render_mode == "ansi":
            return draw_text(self.map, self.s, self._came_from, self.last_action)
        if self._picture is None:
            self._picture = Picture(self.map)
        return self._picture.draw(self.s, self._came_from, self.last_action)
