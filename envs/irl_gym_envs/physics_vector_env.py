"""N copies of a world that is a function of its state, stepped together in NumPy."""

from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space

from irl_gym.checks import checked_number
from irl_gym.environments.physics import Physics
from irl_gym.errors import InvalidInput, InvalidParameter


class PhysicsVectorEnv(gym.vector.VectorEnv[np.ndarray, np.ndarray, np.ndarray]):
    """A vector environment on a `Physics`, with the conventions of Gymnasium's own ones.

    An episode that ended begins anew at the next step, which then pays 0 and whose action is not used (NEXT_STEP).

    Args:
        physics: the world.
        num_envs: number of copies N.
        max_episode_steps: truncate episodes after this many steps; None for never.
        render_mode: None: many copies are not drawn.

    Raises:
        InvalidParameter: a number of copies or steps below 1, or a render mode.
    """

    metadata: dict[str, Any] = {"render_modes": [], "autoreset_mode": AutoresetMode.NEXT_STEP}  # noqa: RUF012 (as Gymnasium)

    def __init__(
        self,
        physics: Physics,
        num_envs: int = 1,
        max_episode_steps: int | None = None,
        render_mode: str | None = None,
    ):
        for name, value in (("num_envs", num_envs), ("max_episode_steps", max_episode_steps)):
            if value is not None:
                checked_number(name, value, "a whole number of at least 1", least=1, whole=True)
        if render_mode is not None:
            raise InvalidParameter(
                f"render_mode is {render_mode!r}: expected None. Draw a single environment of gymnasium.make."
            )
        self.physics, self.num_envs, self.max_episode_steps = physics, num_envs, max_episode_steps
        self.single_observation_space = physics.coordinates.space
        self.single_action_space = spaces.Discrete(physics.n_actions)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._limit = np.iinfo(np.int64).max if max_episode_steps is None else max_episode_steps
        self._states: np.ndarray | None = None
        self._elapsed = np.zeros(num_envs, dtype=np.int64)
        self._ended = np.zeros(num_envs, dtype=bool)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[np.ndarray, dict[str, Any]]:
        """Begin all episodes anew.

        Args:
            seed: of the generator that all copies share.
            options: {"state": (d,) or (N, d)} sets the first states.

        Raises:
            InvalidInput: states of another shape, or outside the world's bounds.
        """
        super().reset(seed=seed)
        wanted = None if options is None else options.get("state")
        self._states = self.physics.start(self.num_envs, self.np_random) if wanted is None else self._given(wanted)
        self._elapsed = np.zeros(self.num_envs, dtype=np.int64)
        self._ended = np.zeros(self.num_envs, dtype=bool)
        return self.physics.coordinates.observe(self._states), {}

    def _given(self, wanted: Any) -> np.ndarray:
        """States from the options of a reset."""
        low, high = self.physics.coordinates.low, self.physics.coordinates.high
        try:
            states = np.asarray(wanted, dtype=np.float64)
        except (TypeError, ValueError):  # ragged, or no numbers
            states = np.empty(0)
        if states.shape not in ((low.size,), (self.num_envs, low.size)):
            raise InvalidInput(
                f'options["state"] is {wanted!r}: expected ({low.size},) or ({self.num_envs}, {low.size}) numbers.'
            )
        states = np.broadcast_to(states, (self.num_envs, low.size)).copy()
        wrong = np.flatnonzero(~((states >= low) & (states <= high)).all(axis=1))
        if wrong.size:
            raise InvalidInput(
                f'options["state"] of copy {wrong[0]} is {states[wrong[0]].tolist()}: expected coordinates from '
                f"{low.tolist()} to {high.tolist()}."
            )
        return states

    def step(self, actions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Step all copies; those whose episode has ended begin anew instead.

        Raises:
            InvalidInput: before the first reset, or actions of the wrong shape or range.
        """
        if self._states is None:
            raise InvalidInput("step before the first episode: call reset first.")
        actions = np.asarray(actions)
        if actions.shape != (self.num_envs,) or actions.dtype.kind not in "iu":
            raise InvalidInput(
                f"actions have shape {actions.shape} and dtype {actions.dtype}: expected ({self.num_envs},) integers."
            )
        if actions.min() < 0 or actions.max() >= self.physics.n_actions:
            raise InvalidInput(
                f"actions range from {actions.min()} to {actions.max()}: expected 0 to {self.physics.n_actions - 1}."
            )
        moves = self.physics.transition(self._states, actions, self.np_random)
        states, rewards, terminated = moves.states, moves.rewards, moves.terminated
        self._elapsed += 1
        truncated = self._elapsed >= self._limit
        begun = np.flatnonzero(self._ended)
        if begun.size:
            states[begun] = self.physics.start(begun.size, self.np_random)
            rewards[begun], terminated[begun], truncated[begun], self._elapsed[begun] = 0.0, False, False, 0
        self._states, self._ended = states, terminated | truncated
        return self.physics.coordinates.observe(states), rewards, terminated, truncated, {}
