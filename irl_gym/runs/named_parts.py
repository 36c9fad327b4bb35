"""What the names on a command line stand for: environments, planners and features."""

from collections.abc import Mapping, Sequence
from math import comb, log10
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces

from irl_gym.agents.planners import FOR_ADVANTAGES, FOR_CONTROL, SB3, Algorithm, Planner, ValueIteration
from irl_gym.demonstrations.datasets import load_minari
from irl_gym.demonstrations.recorded import recorded_environment
from irl_gym.environments.reveal import Reveal, known_hidden
from irl_gym.environments.seeded_starts import SeededStarts
from irl_gym.errors import InvalidFeatures, NotDiscrete, NotSettable
from irl_gym.features.bases import Fourier, Polynomial, RadialBasis
from irl_gym.features.feature_maps import FeatureMap, OneHot, Unravel
from irl_gym.runs.choices import KNOWN, FeatureName, PlannerName, Reveals
from irl_gym.spaces.coordinates import coordinates_of
from irl_gym.spaces.integer_spaces import ranges
from irl_gym.tables.layouts import grid_shape
from irl_gym.tables.tabulate import make

_ALGORITHMS: dict[str, Algorithm] = {"ppo": "PPO", "dqn": "DQN", "a2c": "A2C"}
MOST_FEATURES = 256
"""Features that a default size makes at most."""
MOST_ALLOWED = 1 << 16
"""Features that are made at most, whatever the size."""
MOST_CENTRES = 15
"""Centres along a coordinate, or cosines, that a default size makes at most: those of Ng & Russell's experiment 3."""


def environment_of(
    env_id: str | None,
    env_kwargs: Mapping[str, Any],
    dataset: str | None = None,
    dataset_root: str | None = None,
    *,
    start_seeds: Sequence[int] = (),
    reveal: Reveals = KNOWN,
    trust_dataset: bool = False,
) -> gym.Env:
    """The environment of an id, or the one that a dataset was recorded in.

    Args:
        env_id: None for the dataset's.
        env_kwargs: given to `gymnasium.make`.
        dataset: a Minari id.
        dataset_root: Minari's root folder.
        start_seeds: seeds of the layouts that resets draw from; none for whatever resets draw.
        reveal: hidden integers that the observation shall show, and their numbers of values; "known" for those that are
            known to be hidden.
        trust_dataset: import and call what the dataset names, whatever it is.

    Raises:
        UnknownEnvironment: no such id.
        NotTrusted: a dataset that names more than a registered environment, and is not trusted.
        DatasetMissing: no such dataset.
        DatasetMismatch: a dataset that does not say where it was recorded.
        InvalidParameter: arguments, seeds or names that the environment does not take.
    """
    if env_id is None:
        return recorded_environment(load_minari(dataset or "", root=dataset_root), trust=trust_dataset)
    env = make(env_id, **env_kwargs)
    if start_seeds:
        env = SeededStarts(env, tuple(start_seeds))
    shown = known_hidden(env) if reveal == KNOWN else reveal
    return Reveal(env, shown) if shown else env


def steps_only(env: gym.Env) -> bool:
    """Has an environment no table, since its observations or actions are not integers?"""
    try:
        ranges(env.observation_space)
    except NotDiscrete:
        return True
    return not isinstance(env.action_space, spaces.Discrete)


def planner_named(
    name: PlannerName | None,
    total_timesteps: int | None,
    *,
    advantages: bool = False,
    control: bool = False,
    discrete: bool = False,
) -> Planner | None:
    """The planner of a name; None for None.

    Args:
        name: what was asked for.
        total_timesteps: environment steps of SB3; None for its default.
        advantages: is the reward an advantage between -1 and 0, on a table?
        control: is the environment stepped itself?
        discrete: and shows numbers, not coordinates?
    """
    if name is None or name == "value-iteration":
        return None if name is None else ValueIteration()
    algorithm = _ALGORITHMS[name]
    ppo = algorithm == "PPO"
    settings = {} if not ppo or (control and discrete) else FOR_CONTROL.hyperparameters if control else {}
    if ppo and advantages and not control:
        settings = FOR_ADVANTAGES
    default = FOR_CONTROL.total_timesteps if control else SB3().total_timesteps
    return SB3(algorithm, default if total_timesteps is None else total_timesteps, settings)


def features_named(
    name: FeatureName, env: gym.Env, *, size: int | None = None, coordinates: Sequence[int] | None = None
) -> FeatureMap:
    """The features of a name, for the observations of an environment.

    Args:
        name: "auto" is one-hot for Discrete observations, radial for others.
        env: its observation space, or what is known of its state, gives the bounds.
        size: centres along each coordinate, Fourier order or degree; None for as many as give 256 features at most, and 15 a
            coordinate.
        coordinates: values of each coordinate that a Discrete observation is made of, such as 5 5 5 4 for Taxi; None for rows
            and columns of a grid environment.

    Raises:
        InvalidFeatures: observations that such features cannot be of.
    """
    space = env.observation_space
    if name == "auto":
        name = "one-hot" if isinstance(space, spaces.Discrete) and coordinates is None else "radial"
    if name == "one-hot":
        if not isinstance(space, spaces.Discrete) or space.start != 0:
            raise InvalidFeatures(f"one-hot features are of integers from 0, but observations are of {space}: choose radial.")
        return OneHot(int(space.n))
    low, high, unravel = _bounds(env, coordinates)
    d = len(low)
    if size is None:
        each = min(MOST_CENTRES, max(2, int(MOST_FEATURES ** (1 / d) + 1e-9)))
        size = {"radial": each, "fourier": each - 1, "polynomial": 2}[name]
    if size > 0:
        _check_count(name, size, d)
    if name == "radial":
        return RadialBasis.grid(low, high, size, coordinates=unravel)
    return (Fourier if name == "fourier" else Polynomial)(low, high, size, unravel)


def _check_count(name: FeatureName, size: int, d: int) -> None:
    """Refuse features that nobody could wait for, such as two centres along each pixel of a picture."""
    count = comb(d + size, size) if name == "polynomial" else (size if name == "radial" else size + 1) ** d
    if count > MOST_ALLOWED:
        much = f"{count:,}" if count < 10**9 else f"10^{int(log10(count))}"
        raise InvalidFeatures(
            f"{name} features of size {size} of {d} coordinates would be {much}: expected {MOST_ALLOWED:,} at most. Choose "
            "a smaller size, show fewer coordinates, or give features in Python."
        )


def _bounds(env: gym.Env, coordinates: Sequence[int] | None) -> tuple[list[float], list[float], Unravel | None]:
    """Low and high of the coordinates, and what makes them of an observation."""
    space: Any = env.observation_space
    if isinstance(space, spaces.Discrete):
        shape = coordinates or _grid(env, int(space.n))
        if shape is None or min(shape) < 1 or int(np.prod(shape)) != space.n:
            raise InvalidFeatures(
                f"coordinates are {None if shape is None else list(shape)}, but observations are of {space}: expected numbers "
                "whose product is theirs, such as 5 5 5 4 for Taxi. Name them, or choose one-hot."
            )
        return [0.0] * len(shape), [float(n - 1) for n in shape], Unravel(tuple(int(n) for n in shape))
    if isinstance(space, spaces.MultiDiscrete):
        low = space.start.ravel().astype(float)
        return low.tolist(), (low + space.nvec.ravel() - 1).tolist(), None
    if not isinstance(space, spaces.Box):
        raise InvalidFeatures(
            f"observations are of {space}: expected a Box, Discrete or MultiDiscrete. Flatten them, with "
            "`gymnasium.wrappers.FlattenObservation(env)`."
        )
    low, high = space.low.ravel().astype(float), space.high.ravel().astype(float)
    if not (np.abs([low, high]) < 1e30).all():  # CartPole's velocities are unbounded, or bounded by float32's largest
        low, high = _known_bounds(env, low, high)
    return low.tolist(), high.tolist(), None


def _grid(env: gym.Env, n: int) -> Sequence[int] | None:
    """Rows and columns, where each cell is a state: Taxi's is a map too, but of the taxi only."""
    shape = grid_shape(env)
    return shape if shape is not None and int(np.prod(shape)) == n else None


def _known_bounds(env: gym.Env, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    try:
        known = coordinates_of(env.unwrapped)
    except NotSettable:
        known = None
    if known is None or len(known.low) != len(low) or not np.isfinite([known.low, known.high]).all():
        box = f"gymnasium.spaces.Box(-10, 10, {env.observation_space.shape})"
        raise InvalidFeatures(
            f"observations range from {low.tolist()} to {high.tolist()}: expected finite bounds, to put features between. Clip "
            "them where they seldom go, as with `gymnasium.wrappers.TransformObservation(env, lambda seen: numpy.clip(seen, "
            f"-10, 10), {box})`; or give features in Python."
        )
    return known.low, known.high
