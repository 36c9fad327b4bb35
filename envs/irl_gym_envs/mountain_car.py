"""The mountain car of Ng & Russell (2000, section 6, experiment 2), with the physics of Gymnasium's.

A car in a valley is too weak to drive straight up to the goal on the right: it has to gather speed first. Unlike in
Gymnasium's MountainCar, the road ends at the goal and there is no time limit.
"""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from gymnasium import spaces
from gymnasium.envs.classic_control.mountain_car import MountainCarEnv as GymnasiumsMountainCarEnv

from irl_gym.environments.physics import Moves
from irl_gym.errors import InvalidInput, InvalidParameter
from irl_gym.spaces.coordinates import Coordinates
from irl_gym_envs.physics_vector_env import PhysicsVectorEnv
from irl_gym_envs.render_modes import check_render_mode

LOW, HIGH = np.array([-1.2, -0.07]), np.array([0.5, 0.07])
"""Bounds of position and velocity."""
FORCE, GRAVITY = 0.001, 0.0025
START = (-0.6, -0.4)
"""Positions in which episodes begin, at rest."""
PARKING = (-0.72, -0.32)
"""Positions in which the car is parked: the bottom of the valley."""
ROAD = Coordinates(
    spaces.Box(LOW.astype(np.float32), HIGH.astype(np.float32)), ("position", "velocity"), LOW, HIGH, np.zeros(2, dtype=bool)
)
TASKS = ("reach", "park")


@dataclass(frozen=True)
class MountainCarPhysics:
    """The mountain car, many states at once; actions 0 backward, 1 none, 2 forward."""

    task: Literal["reach", "park"] = "reach"
    """"reach" pays -1 a step, "park" pays 1 on arrival at a position in PARKING and else 0."""
    terminal_goal: bool = True
    """Does arrival at the right end of the road end the episode? If not, the car stops there."""

    def __post_init__(self) -> None:
        if self.task not in TASKS:
            raise InvalidParameter(f"task is {self.task!r}: expected one of {', '.join(TASKS)}.")

    @property
    def coordinates(self) -> Coordinates:
        """Position and velocity."""
        return ROAD

    @property
    def n_actions(self) -> int:
        """Backward, none, forward."""
        return 3

    def start(self, n: int, rng: np.random.Generator) -> np.ndarray:
        """(n, 2) first states: uniform positions in START, at rest."""
        return np.stack([rng.uniform(*START, size=n), np.zeros(n)], axis=1)

    def transition(self, states: np.ndarray, actions: np.ndarray, rng: np.random.Generator) -> Moves:
        """Where a step leads from states (N, 2) under actions (N,)."""
        position, velocity = states.T
        velocity = velocity + (actions - 1) * FORCE - np.cos(3 * position) * GRAVITY
        velocity = np.clip(velocity, LOW[1], HIGH[1])
        position = np.clip(position + velocity, LOW[0], HIGH[0])
        arrived = position >= HIGH[0]
        stopped = (position <= LOW[0]) & (velocity < 0)
        if not self.terminal_goal:
            stopped |= arrived & (velocity > 0)
        velocity[stopped] = 0.0
        if self.task == "park":
            rewards = ((position >= PARKING[0]) & (position <= PARKING[1])).astype(np.float64)
        else:
            rewards = np.full(len(states), -1.0)
        return Moves(np.stack([position, velocity], axis=1), rewards, arrived & self.terminal_goal)


class MountainCarEnv(GymnasiumsMountainCarEnv):
    """Ng & Russell's mountain car: position in [-1.2, 0.5], velocity in [-0.07, 0.07]; actions 0 backward, 1 none, 2 forward.

    Inside, the state is float64; observations are float32. Drawn by Gymnasium's MountainCar.

    Args:
        task: "reach" pays -1 a step; "park" pays 1 on arrival at a position in [-0.72, -0.32], else 0.
        terminal_goal: does arrival at position 0.5 end the episode? If not, the car stops there and goes on.
        render_mode: "human", "rgb_array" or None.

    Raises:
        InvalidParameter: an unknown task or render mode.
    """

    def __init__(self, task: Literal["reach", "park"] = "reach", terminal_goal: bool = True, render_mode: str | None = None):
        check_render_mode(render_mode, self.metadata)
        self.physics = MountainCarPhysics(task, bool(terminal_goal))
        super().__init__(render_mode)
        self.max_position = float(HIGH[0])
        self.low, self.high = LOW.astype(np.float32), HIGH.astype(np.float32)
        self.observation_space = ROAD.space
        self.state: Any = None

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[np.ndarray, dict[str, Any]]:
        """Begin an episode at rest in the valley.

        Args:
            seed: of the environment's generator.
            options: {"state": [position, velocity]} sets the first state; {"low": ..., "high": ...} the range of positions.

        Raises:
            InvalidInput: a state outside the bounds.
        """
        wanted = None if options is None else options.get("state")
        given = None if wanted is None else np.asarray(wanted, dtype=np.float64)
        if given is not None and (given.shape != (2,) or not ((given >= LOW) & (given <= HIGH)).all()):
            raise InvalidInput(
                f'options["state"] is {wanted!r}: expected [position, velocity] from {LOW.tolist()} to {HIGH.tolist()}.'
            )
        observation, info = super().reset(seed=seed, options=options)
        if given is None:
            return observation, info
        self.state = given
        if self.render_mode == "human":
            self.render()
        return self._observation(), info

    def step(self, action: Any) -> tuple[np.ndarray, float, bool, Literal[False], dict[str, Any]]:
        """Drive one step.

        Raises:
            InvalidInput: an action outside the action space, or before reset.
        """
        if not self.action_space.contains(action):
            raise InvalidInput(f"action is {action!r}: expected an integer from 0 to 2.")
        if self.state is None:
            raise InvalidInput("step before the first episode: call reset first.")
        moves = self.physics.transition(np.asarray(self.state, dtype=np.float64)[None], np.array([action]), self.np_random)
        self.state = moves.states[0]
        if self.render_mode == "human":
            self.render()
        return self._observation(), float(moves.rewards[0]), bool(moves.terminated[0]), False, {}

    def _observation(self) -> np.ndarray:
        return ROAD.observe(self.state[None])[0]


class MountainCarVectorEnv(PhysicsVectorEnv):
    """N mountain cars stepped together; the arguments are those of `MountainCarEnv` and `PhysicsVectorEnv`."""

    def __init__(
        self,
        num_envs: int = 1,
        max_episode_steps: int | None = None,
        render_mode: str | None = None,
        task: Literal["reach", "park"] = "reach",
        terminal_goal: bool = True,
    ):
        super().__init__(MountainCarPhysics(task, bool(terminal_goal)), num_envs, max_episode_steps, render_mode)
