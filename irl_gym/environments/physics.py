"""Worlds that can be set to any state, many states at once: what a discretisation needs of an environment.

An environment that offers `physics` is taken at its word. Any other is stepped itself, a private copy of it, one state at a
time: the state is written where the environment keeps it, then its own `step` does the rest, so that the world is exactly
what `env.step` does. Axes: N states at once, d coordinates.
"""

import copy
import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import gymnasium as gym
import numpy as np
from gymnasium.wrappers import DiscretizeAction, TransformAction

from irl_gym._typing import Choices, Flags, Numbers, Points
from irl_gym.checks import discrete_actions
from irl_gym.environments.watching_wrappers import only_watches
from irl_gym.errors import InvalidParameter, NotSettable, a_type
from irl_gym.spaces.coordinates import Coordinates, coordinates_of


@dataclass(frozen=True, eq=False)
class Moves:
    """What N steps did."""

    states: Points
    """Where they led."""
    rewards: Numbers
    """What they paid."""
    terminated: Flags
    """Did the episode end there?"""


@runtime_checkable
class Physics(Protocol):
    """A world that can be set to any state, many states at once."""

    @property
    def coordinates(self) -> Coordinates:
        """Of its states: names, finite bounds, and how observations show them."""
        ...

    @property
    def n_actions(self) -> int:
        """Actions are numbered from 0."""
        ...

    def start(self, n: int, rng: np.random.Generator) -> Points:
        """First states of n episodes."""
        ...

    def transition(self, states: Points, actions: Choices, rng: np.random.Generator) -> Moves:
        """Where a step leads from each state, under the action of each; one seed of `rng` gives one noise."""
        ...


def physics_of(env: gym.Env, *, bounds: Mapping[str, Sequence[float]] | None = None) -> Physics:
    """The world inside an environment. The environment itself is neither stepped nor reset.

    Args:
        env: an environment with a Discrete action space, DiscretizeAction's among them. Wrappers that only watch or limit
            are looked through, others refused.
        bounds: {name: (low, high)} of coordinates, in place of the environment's own.

    Raises:
        NotSettable: the environment hides its state, or shows something else than its state.
        NotDiscrete: an action space that is not Discrete.
        InvalidParameter: no environment, or bounds that are unknown, wrong or missing.
    """
    if not isinstance(env, gym.Env):
        raise InvalidParameter(f"env is {a_type(env)}: expected an environment, such as gymnasium.make gives.")
    actions = _actions(env)
    offered = getattr(env.unwrapped, "physics", None)
    if isinstance(offered, Physics):
        if bounds:
            return Bounded(offered, offered.coordinates.within(bounds))
        return offered
    walker = _copy_of(env.unwrapped)
    walker.reset(seed=0)
    slot = next((kind(walker) for kind in SLOTS if kind.fits(walker)), None)
    if slot is None:
        raise NotSettable(
            f"{type(walker).__name__} publishes neither `physics`, nor `set_state` and `get_state`, nor a numeric attribute "
            "`state` or `s`: expected one of these, to set it to a state. Add `get_state()` and `set_state(state)`."
        )
    coordinates = coordinates_of(walker)
    _check_shown(walker, slot, coordinates)
    return SteppedPhysics(coordinates.within(bounds or {}), walker, slot, actions)


@dataclass(frozen=True, eq=False)
class Bounded:
    """A world seen within other bounds; what it does stays the same."""

    inner: Physics
    """The world."""
    coordinates: Coordinates
    """Its coordinates, with other bounds."""

    @property
    def n_actions(self) -> int:
        """Actions are numbered from 0."""
        return self.inner.n_actions

    def start(self, n: int, rng: np.random.Generator) -> Points:
        """First states of n episodes."""
        return self.inner.start(n, rng)

    def transition(self, states: Points, actions: Choices, rng: np.random.Generator) -> Moves:
        """Where a step leads from each state."""
        return self.inner.transition(states, actions, rng)


class _Methods:
    """The state is read and written by the environment's own methods."""

    def __init__(self, env: Any):
        self.read, self.write = env.get_state, env.set_state

    @staticmethod
    def fits(env: Any) -> bool:
        return callable(getattr(env, "get_state", None)) and callable(getattr(env, "set_state", None))


class _Attribute:
    """The state is kept in the attribute `state`: an array, a list or a tuple of numbers."""

    def __init__(self, env: Any):
        self._env, self._kind = env, type(env.state)

    @staticmethod
    def fits(env: Any) -> bool:
        state = getattr(env, "state", None)
        return isinstance(state, np.ndarray | list | tuple) and np.asarray(state).dtype.kind in "fiu" and np.ndim(state) == 1

    def read(self) -> Any:
        return self._env.state

    def write(self, state: np.ndarray) -> None:
        self._env.state = state if self._kind is np.ndarray else self._kind(state.tolist())
        if hasattr(self._env, "steps_beyond_terminated"):  # CartPole counts the steps after its end
            self._env.steps_beyond_terminated = None


class _Number:
    """The state is the whole number `s`, as in toy text."""

    def __init__(self, env: Any):
        self._env = env

    @staticmethod
    def fits(env: Any) -> bool:
        return isinstance(getattr(env, "s", None), int | np.integer)

    def read(self) -> Any:
        return self._env.s

    def write(self, state: np.ndarray) -> None:
        self._env.s = int(np.rint(state[0]))


SLOTS = (_Methods, _Attribute, _Number)
"""Where an environment may keep its state; the first that fits is taken."""


@dataclass(frozen=True, eq=False)
class SteppedPhysics:
    """A private copy of an environment, set to one state after the other and stepped: its own physics, but slowly.

    Measured: 6 us a step of CartPole, 10 of MountainCar and Pendulum, 29 of Acrobot.
    """

    coordinates: Coordinates
    """Of its states."""
    env: Any
    """The copy, unwrapped."""
    slot: Any
    """Reads and writes its state."""
    actions: tuple[Any, ...]
    """What its `step` is given for each action number."""

    @property
    def n_actions(self) -> int:
        """Actions are numbered from 0."""
        return len(self.actions)

    def start(self, n: int, rng: np.random.Generator) -> Points:
        """First states of n episodes: as many resets."""
        self.env.np_random = rng
        states = np.empty((n, len(self.coordinates.names)))
        for i in range(n):
            self.env.reset()
            states[i] = self.slot.read()
        return states

    def transition(self, states: Points, actions: Choices, rng: np.random.Generator) -> Moves:
        """Where a step leads from each state."""
        self.env.np_random = rng
        following, rewards, terminated = np.empty_like(states), np.empty(len(states)), np.empty(len(states), dtype=bool)
        step, read, write = self.env.step, self.slot.read, self.slot.write
        moves = [self.actions[a] for a in actions.tolist()]
        for i, (state, move) in enumerate(zip(states, moves, strict=True)):
            write(state.copy())
            _, rewards[i], terminated[i], _, _ = step(move)
            following[i] = read()
        return Moves(following, rewards, terminated)


def _actions(env: gym.Env) -> tuple[Any, ...]:
    """What the unwrapped environment's `step` is given for each action number."""
    space = discrete_actions(env.action_space)
    wrapper, translations = env, []
    while isinstance(wrapper, gym.Wrapper):
        if isinstance(wrapper, DiscretizeAction | TransformAction):
            translations.append(wrapper.action)
        elif not only_watches(wrapper):
            raise NotSettable(
                f"the wrapper {type(wrapper).__name__} changes what the environment does: expected wrappers that only watch or "
                "limit it, DiscretizeAction or TransformAction. Take it off, or give the environment that change itself."
            )
        wrapper = wrapper.env
    numbers = range(int(space.start), int(space.start + space.n))
    return tuple(functools.reduce(lambda action, translate: translate(action), translations, a) for a in numbers)


def _copy_of(env: gym.Env) -> Any:
    """A copy that draws nothing."""
    try:
        walker = copy.deepcopy(env)
    except (TypeError, AttributeError, ValueError) as error:
        mend = "Give it a __deepcopy__ that leaves this out." if env.render_mode is None else "Make it without a render mode."
        raise NotSettable(
            f"{type(env).__name__} cannot be copied ({error}): expected an environment that copy.deepcopy takes. {mend}"
        ) from error
    if getattr(walker, "render_mode", None) is not None:
        walker.render_mode = None
    return walker


def _check_shown(env: Any, slot: Any, coordinates: Coordinates) -> None:
    """Is what the environment observes after a reset what its state says?"""
    observation, _ = env.reset(seed=0)
    state = np.atleast_1d(np.asarray(slot.read(), dtype=np.float64))
    if state.shape != (len(coordinates.names),):
        raise NotSettable(
            f"{type(env).__name__} has a state of shape {state.shape}: expected ({len(coordinates.names)},), as its "
            f"observations {coordinates.space} say. Give the environment a `physics`."
        )
    shown = coordinates.observe(state[None])[0]
    if not np.allclose(shown, observation, rtol=1e-4, atol=1e-5):
        raise NotSettable(
            f"{type(env).__name__} observes {observation} in state {state}: expected {shown}. Give the environment a "
            "`physics`, which says how its observations show the state."
        )
