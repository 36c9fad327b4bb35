"""What a person calls the actions and states of an environment.

Gymnasium has no names for actions, so those of known environments are listed here; others are numbered. A state is called by
its observation.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import gymnasium as gym
import numpy as np

from irl_gym.spaces.listed_states import usual_observation
from irl_gym.spaces.states import States

_UP_RIGHT_DOWN_LEFT = ("up", "right", "down", "left")
ACTIONS: dict[str, tuple[str, ...]] = {
    "FrozenLakeEnv": ("left", "down", "right", "up"),
    "CliffWalkingEnv": _UP_RIGHT_DOWN_LEFT,
    "TaxiEnv": ("down", "up", "right", "left", "pick up", "drop off"),
    "BlackjackEnv": ("stick", "hit"),
    "GridWorldEnv": _UP_RIGHT_DOWN_LEFT,
    "FourRoomsEnv": _UP_RIGHT_DOWN_LEFT,
    "ContinuousGridWorldEnv": _UP_RIGHT_DOWN_LEFT,
    "Gridworld": _UP_RIGHT_DOWN_LEFT,  # gym-classics
    "CartPoleEnv": ("push left", "push right"),
    "MountainCarEnv": ("push left", "coast", "push right"),
    "AcrobotEnv": ("torque -1", "no torque", "torque +1"),
    "LunarLander": ("no engine", "left engine", "main engine", "right engine"),
    "MiniGridEnv": ("turn left", "turn right", "forward", "pick up", "drop", "toggle", "done"),
}
"""Names of the actions 0, 1, ... of environments, by the class or a base class of theirs."""

SHOWN = 8
"""Numbers of an observation that a name lists."""
TOLD = 3
"""Of more numbers, those that are told with their places."""


@dataclass(frozen=True)
class Names:
    """What the actions and the rows of a table are called in a figure."""

    actions: tuple[str, ...]
    """Of the actions 0, 1, ..."""
    state: Callable[[int], str]
    """Name of a row."""

    @classmethod
    def of(cls, env: gym.Env, states: States, env_id: str | None = None) -> "Names":
        """Those of an environment and the numbering of its states."""
        usual = usual_observation(states)
        return cls(action_names(env), lambda row: state_name(env_id, states.decode(row), None, usual))

    @classmethod
    def numbered(cls, n_actions: int) -> "Names":
        """Numbers, where there is nothing better."""
        return cls(tuple(f"action {a}" for a in range(n_actions)), lambda row: f"state {row}")


def bare_name(env_id: str | None) -> str:
    """The name in an id: FrozenLake of FrozenLake-v1, GridWorld of irl_gym_envs:irl_gym/GridWorld-v0."""
    return (env_id or "").split(":")[-1].split("/")[-1].split("-")[0]


def of_class(env: gym.Env, table: Mapping[str, tuple[str, ...]], count: int) -> tuple[str, ...]:
    """The entry of an environment's class or a base class, if it has as many names as there are things to name."""
    found = (table[kind.__name__] for kind in type(env.unwrapped).__mro__ if kind.__name__ in table)
    return next((names for names in found if len(names) == count), ())


def action_names(env: gym.Env) -> tuple[str, ...]:
    """What the actions of an environment with discrete ones are called; "action 0", "action 1", ... where nobody has said."""
    space: Any = env.action_space
    n = int(space.n)
    return of_class(env, ACTIONS, n) or tuple(f"action {a}" for a in range(n))


def state_name(env_id: str | None, observation: Any, columns: int | None = None, usual: Any = None) -> str:
    """What an observation says, in a few words.

    Args:
        env_id: of the environment, or None.
        observation: a single one.
        columns: of the map, where the observation is the number of a cell.
        usual: an observation that shows in each place what is usual there: of many numbers, those that differ from it are told.
            None for the number that the observation itself shows most.
    """
    if isinstance(observation, dict):
        beside = usual if isinstance(usual, dict) else {}
        own = (
            [state_name(env_id, observation["observation"], usual=beside.get("observation"))]
            if "observation" in observation
            else []
        )
        others = [(key, one) for key, one in observation.items() if key != "observation"]
        return ", ".join([*own, *(f"{key} {state_name(None, one, usual=beside.get(key))}" for key, one in others)])
    if isinstance(observation, tuple):
        told = _of_cards(observation) if bare_name(env_id) == "Blackjack" and len(observation) == 3 else None
        beside = usual if isinstance(usual, tuple) else (None,) * len(observation)
        parts = (state_name(None, one, usual=other) for one, other in zip(observation, beside, strict=True))
        return told or f"({', '.join(parts)})"
    array = np.asarray(observation)
    if array.ndim == 0 and array.dtype.kind in "iu":
        number = int(array)
        if bare_name(env_id) == "Taxi" and 0 <= number < 500:
            return _of_taxi(number)
        return f"{number}" if columns is None else f"row {number // columns}, column {number % columns}"
    if array.size > SHOWN:
        return _of_many(array, usual)
    parts = [f"{one:d}" if array.dtype.kind in "iub" else f"{one:.3g}" for one in array.ravel().tolist()]
    return parts[0] if len(parts) == 1 else f"({', '.join(parts)})"


def _of_many(array: np.ndarray, usual: Any) -> str:
    """Many numbers, by those that are unlike the usual ones."""
    what = f"{' x '.join(map(str, array.shape))} numbers"
    if array.dtype.kind not in "iub":
        return what
    values, counts = np.unique(array, return_counts=True)
    base = np.asarray(values[counts.argmax()] if usual is None else usual)
    places = np.argwhere(array != base).tolist()
    if not places:
        return f"{what}, all {int(base):d}" if base.ndim == 0 else what
    told = [f"{int(array[tuple(place)]):d} at {place}" for place in places[:TOLD]]
    more = [f"{len(places) - TOLD} more"] if len(places) > TOLD else []
    return f"{what}: {', '.join(told + more)}"


def _of_cards(observation: tuple[Any, ...]) -> str:
    sum_, dealer, ace = (int(one) for one in observation)
    return f"{sum_}{' with an ace' if ace else ''} against {'ace' if dealer == 1 else dealer}"


def _of_taxi(number: int) -> str:
    number, goal = divmod(number, 4)
    number, passenger = divmod(number, 5)
    row, column = divmod(number, 5)
    where = "in the taxi" if passenger == 4 else f"at {'RGYB'[passenger]}"
    return f"taxi {row}, {column}; passenger {where}, to {'RGYB'[goal]}"
