"""The continuous grid world of Ng & Russell (2000, section 6, experiment 3): the unit square, noisy moves, one good corner."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import gymnasium as gym
import numpy as np
from gymnasium import spaces

from irl_gym.checks import checked_number
from irl_gym.environments.physics import Moves
from irl_gym.errors import InvalidInput, InvalidParameter
from irl_gym.spaces.coordinates import Coordinates
from irl_gym_envs.grid_rendering import AGENT, AGENT_RIM, FLOOR, FRAME, GOAL, GOAL_FLOOR, circle, segment
from irl_gym_envs.physics_vector_env import PhysicsVectorEnv
from irl_gym_envs.render_modes import check_render_mode, warn_of_no_render_mode

MOVES = np.array([(0.0, 1.0), (1.0, 0.0), (0.0, -1.0), (-1.0, 0.0)])
"""Direction (x, y) of each action: 0 up, 1 right, 2 down, 3 left."""
SQUARE = Coordinates(
    spaces.Box(0.0, 1.0, (2,), np.float32), ("x", "y"), np.zeros(2), np.ones(2), np.zeros(2, dtype=bool)
)  # fmt: skip
GOAL_BOX = ((0.8, 0.8), (1.0, 1.0))
PIXELS, MARGIN = 400, 8
"""Of a picture: its side without the frame, and the frame."""

Corners = Sequence[Sequence[float]]
"""The lower left and the upper right corner of a box, [[x, y], [x, y]]."""


@dataclass(frozen=True)
class ContinuousGridWorldPhysics:
    """The continuous grid world, many states at once; actions 0 up, 1 right, 2 down, 3 left."""

    step_size: float = 0.2
    """Length of a move."""
    noise: float = 0.1
    """Added to each coordinate after a move: uniform from -noise to noise."""
    goal: Corners = GOAL_BOX
    """Box that pays 1 on arrival, bounds included."""
    terminal_goal: bool = False
    """Does arrival in the goal end the episode?"""
    first: Literal["uniform"] | Sequence[float] = "uniform"
    """Where episodes begin: anywhere in the square, or in a point."""

    def __post_init__(self) -> None:
        checked_number("step_size", self.step_size, "a length above 0 and at most 1", above=0, below=1 + 1e-12)
        checked_number("noise", self.noise, "a length from 0 to 1", least=0, below=1 + 1e-12)
        corners = _numbers(
            "goal", self.goal, (2, 2), "corners [[x, y], [x, y]], lower left and upper right, in the unit square"
        )
        if (corners[0] > corners[1]).any():
            raise InvalidParameter(f"goal is {self.goal!r}: expected the lower left corner first, then the upper right one.")
        if isinstance(self.first, str) and self.first != "uniform":
            raise InvalidParameter(f"start is {self.first!r}: expected 'uniform', or a point [x, y] of the unit square.")
        if not isinstance(self.first, str):
            _numbers("start", self.first, (2,), "'uniform', or a point [x, y] of the unit square")

    @property
    def coordinates(self) -> Coordinates:
        """To the right and upwards."""
        return SQUARE

    @property
    def n_actions(self) -> int:
        """Up, right, down, left."""
        return 4

    def start(self, n: int, rng: np.random.Generator) -> np.ndarray:
        """(n, 2) first states."""
        return rng.random((n, 2)) if isinstance(self.first, str) else np.tile(np.asarray(self.first, dtype=np.float64), (n, 1))

    def transition(self, states: np.ndarray, actions: np.ndarray, rng: np.random.Generator) -> Moves:
        """Where a step leads from states (N, 2) under actions (N,)."""
        moved = states + self.step_size * MOVES[actions] + rng.uniform(-self.noise, self.noise, size=states.shape)
        following = np.clip(moved, 0.0, 1.0)
        low, high = np.asarray(self.goal, dtype=np.float64)
        arrived = ((following >= low) & (following <= high)).all(axis=1)
        return Moves(following, arrived.astype(np.float64), arrived & self.terminal_goal)


class ContinuousGridWorldEnv(gym.Env[np.ndarray, np.int64]):
    """The unit square; a move of `step_size`, then uniform noise on each coordinate, clipped to the square.

    Actions 0 up, 1 right, 2 down, 3 left; observations [x, y] from the lower left. Arrival in the goal box pays 1, anything
    else 0. Inside, the state is float64; observations are float32.

    Args:
        step_size: length of a move.
        noise: half the width of the noise on each coordinate.
        goal: lower left and upper right corner of the goal box, bounds included.
        terminal_goal: does arrival in the goal end the episode?
        start: "uniform" over the whole square, or a point [x, y].
        render_mode: "rgb_array" or None.

    Raises:
        InvalidParameter: an argument that cannot be right, with its value and the mend.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 6}  # noqa: RUF012 (as Gymnasium)

    def __init__(
        self,
        step_size: float = 0.2,
        noise: float = 0.1,
        goal: Corners = GOAL_BOX,
        terminal_goal: bool = False,
        start: Literal["uniform"] | Sequence[float] = "uniform",
        render_mode: str | None = None,
    ):
        check_render_mode(render_mode, self.metadata)
        self.physics = ContinuousGridWorldPhysics(step_size, noise, goal, bool(terminal_goal), start)
        self.render_mode = render_mode
        self.observation_space = SQUARE.space
        self.action_space = spaces.Discrete(len(MOVES))
        self.state: np.ndarray | None = None
        self._came_from: np.ndarray | None = None

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[np.ndarray, dict[str, Any]]:
        """Begin an episode, in the state `options["state"]` if that is given.

        Raises:
            InvalidInput: a state outside the unit square.
        """
        super().reset(seed=seed)
        wanted = None if options is None else options.get("state")
        first = self.physics.start(1, self.np_random)
        if wanted is not None:
            first = _numbers('options["state"]', wanted, (2,), "a point [x, y] of the unit square")[None]
        self.state, self._came_from = first[0], None
        return SQUARE.observe(first)[0], {}

    def step(self, action: Any) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Move, with noise, and be paid on arrival.

        Raises:
            InvalidInput: an action outside the action space, or before reset.
        """
        if not self.action_space.contains(action):
            raise InvalidInput(f"action is {action!r}: expected an integer from 0 to {len(MOVES) - 1}.")
        if self.state is None:
            raise InvalidInput("step before the first episode: call reset first.")
        moves = self.physics.transition(self.state[None], np.array([action]), self.np_random)
        self._came_from, self.state = self.state, moves.states[0]
        return SQUARE.observe(moves.states)[0], float(moves.rewards[0]), bool(moves.terminated[0]), False, {}

    def render(self) -> Any:
        """The square from above as an (H, W, 3) uint8 picture; a tail shows where the agent came from."""
        if self.render_mode is None:
            return warn_of_no_render_mode(self, "rgb_array")
        return draw(self.physics.goal, self.state, self._came_from)


class ContinuousGridWorldVectorEnv(PhysicsVectorEnv):
    """N squares stepped together; the arguments are those of `ContinuousGridWorldEnv` and `PhysicsVectorEnv`."""

    def __init__(
        self,
        num_envs: int = 1,
        max_episode_steps: int | None = None,
        render_mode: str | None = None,
        step_size: float = 0.2,
        noise: float = 0.1,
        goal: Corners = GOAL_BOX,
        terminal_goal: bool = False,
        start: Literal["uniform"] | Sequence[float] = "uniform",
    ):
        physics = ContinuousGridWorldPhysics(step_size, noise, goal, bool(terminal_goal), start)
        super().__init__(physics, num_envs, max_episode_steps, render_mode)


def draw(goal: Corners, state: np.ndarray | None, came_from: np.ndarray | None) -> np.ndarray:
    """(H, W, 3) uint8 picture of the square, the goal box and the agent."""
    centres = (np.arange(PIXELS) + 0.5) / PIXELS
    x, y = centres[None, :], 1 - centres[:, None]
    (left, lower), (right, upper) = np.asarray(goal, dtype=np.float64)
    canvas = np.empty((PIXELS, PIXELS, 3))
    canvas[:] = FLOOR
    outside = np.maximum(np.maximum(left - x, x - right), np.maximum(lower - y, y - upper))
    _paint(canvas, outside, GOAL_FLOOR)
    _paint(canvas, np.abs(outside + 0.006) - 0.006, GOAL)
    if state is not None:
        if came_from is not None and (came_from != state).any():
            _paint(canvas, segment(y, x, came_from[::-1], state[::-1]) - 0.008, AGENT, opacity=0.35)
        _paint(canvas, circle(y - state[1], x - state[0], 0.03), AGENT_RIM)
        _paint(canvas, circle(y - state[1], x - state[0], 0.025), AGENT)
    framed = np.empty((PIXELS + 2 * MARGIN, PIXELS + 2 * MARGIN, 3), dtype=np.uint8)
    framed[:] = FRAME
    framed[MARGIN:-MARGIN, MARGIN:-MARGIN] = np.rint(canvas)
    return framed


def _paint(canvas: np.ndarray, distance: np.ndarray, colour: tuple[int, int, int], opacity: float = 1.0) -> None:
    """Blend a colour into the pixels inside a shape, given as a signed distance in lengths of the square."""
    cover = opacity * np.clip(0.5 - distance * PIXELS, 0, 1)[..., None]
    canvas += cover * (np.array(colour, dtype=float) - canvas)


def _numbers(name: str, value: Any, shape: tuple[int, ...], expected: str) -> np.ndarray:
    """Numbers from 0 to 1 in an array of a shape."""
    try:
        array = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):  # ragged, or no numbers
        array = np.empty(0)
    if array.shape != shape or not ((array >= 0) & (array <= 1)).all():
        raise InvalidParameter(f"{name} is {value!r}: expected {expected}.")
    return array
