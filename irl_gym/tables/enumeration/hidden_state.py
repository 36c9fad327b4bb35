"""The proof that an observation hides part of the state: two visits after which one action does different things."""

from typing import Any

from gymnasium import spaces

from irl_gym.spaces.integer_spaces import first_of, from_numbers, numbers_of_keys
from irl_gym.tables.enumeration.explored import Explored

Behaviour = dict[tuple[int, Any, float], float]
"""(action, successor, reward) -> probability; a successor is a state's number, an end's, or (key, terminated) of a new one."""
SAME = 1e-9
MOST_TOLD = 3


def behaviour_of_lines(lines: list[tuple[int, int, float, float]]) -> Behaviour:
    """What an expanded state does."""
    found: Behaviour = {}
    for action, successor, probability, reward in lines:
        place = action, successor, round(reward, 9)
        found[place] = found.get(place, 0.0) + probability
    return found


def unlike(first: Behaviour, second: Behaviour) -> int | None:
    """The first action that does different things; None where all do the same."""
    if first.keys() == second.keys() and all(abs(p - second[place]) <= SAME for place, p in first.items()):
        return None
    places = sorted({*first, *second}, key=lambda place: place[0])
    return next(place[0] for place in places if abs(first.get(place, 0.0) - second.get(place, 0.0)) > SAME)


def proof(
    explored: Explored, space: spaces.Space, number: int, action: int, first: Behaviour, second: Behaviour, way: list[int]
) -> str:  # fmt: skip
    """The two visits in words.

    Args:
        explored: states and ends.
        space: of observations.
        number: the state.
        action: which action tells the visits apart.
        first: what it does after the way on which the state was found.
        second: what it does after `way`.
        way: actions of the second visit.
    """
    names: dict[int, Any] = {number: key for key, number in explored.ids.items()}
    names |= {-1 - number: key for key, number in explored.ends.items()}
    told = [_told(space, names, {place[1:]: p for place, p in one.items() if place[0] == action}) for one in (first, second)]
    return (
        f"observation {shown(space, explored.keys[number])} hides part of the state. After {_actions(explored.way(number))}, "
        f"action {action} leads to {told[0]}; after {_actions(way)}, to {told[1]}."
    )


def _told(space: spaces.Space, names: dict[int, Any], outcomes: dict[tuple[Any, float], float]) -> str:
    parts = []
    for (successor, reward), probability in sorted(outcomes.items(), key=lambda one: -one[1])[:MOST_TOLD]:
        key, ended = (names[successor], successor < 0) if isinstance(successor, int) else successor
        end = ", the end" if ended else ""
        parts.append(f"{shown(space, key)}{end} (probability {probability:.4g}, reward {reward:.4g})")
    return " or ".join(parts) + (" or more" if len(outcomes) > MOST_TOLD else "")


def _actions(way: list[int]) -> str:
    """Actions, those of a long way shortened."""
    if not way:
        return "reset"
    return f"actions {way}" if len(way) <= 30 else f"{len(way)} actions that end with {way[-30:]}"


def shown(space: spaces.Space, key: Any) -> str:
    """A key as the observation it stands for, shortened."""
    observation = first_of(space, from_numbers(space, numbers_of_keys(space, [key])))
    text = " ".join(str(_plain(observation)).split())
    return text if len(text) <= 80 else f"{text[:77]}..."


def _plain(observation: Any) -> Any:
    """An observation without NumPy's way of writing numbers."""
    if isinstance(observation, dict):
        return {name: _plain(part) for name, part in observation.items()}
    if isinstance(observation, tuple):
        return tuple(map(_plain, observation))
    return observation.tolist() if hasattr(observation, "tolist") else observation
