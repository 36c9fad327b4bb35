"""Demonstrations from a stream of (observation, action) pairs: a robot's log as it is read, a person's moves as they are made.

One episode is in memory at a time, so the stream may be longer than memory; it is checked as it goes, and `write_minari` leaves
nothing behind when a pair is refused.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces

from irl_gym.checks import is_word
from irl_gym.demonstrations.choices import Last
from irl_gym.demonstrations.imports.reading import Reading, reading
from irl_gym.demonstrations.imports.rows import LogColumns, say_dropped
from irl_gym.demonstrations.imports.values import truths
from irl_gym.errors import InvalidDemonstrations, InvalidParameter
from irl_gym.mdp.episodes import Episode

FIELDS = ("observation", "action", "reward", "episode", "terminated", "truncated")
FLAGS = FIELDS[4:]


def from_pairs(
    pairs: Iterable[Any],
    *,
    fields: Sequence[str] | None = None,
    last: Last = "keep",
    space: spaces.Space | None = None,
    n_actions: int | None = None,
    action_space: spaces.Space | None = None,
    env: gym.Env | None = None,
) -> Iterator[Episode]:
    """Episodes from pairs, one at a time.

    An episode ends at `None`, at a pair whose action is None (its observation is the last one), where the `episode` field
    changes, after a pair that is `terminated` or `truncated`, and with the stream.

        from_pairs([(0, 1), (4, 1), (8, None), (0, 2), (1, 1), None], env=env)
        from_pairs(log, fields=("episode", "observation", "action", "terminated"), env=env)

    Args:
        pairs: tuples of (observation, action) or (observation, action, reward), or of `fields`.
        fields: what the tuples hold, in order, out of observation, action, reward, episode, terminated, truncated; without
            action only the states are known, and the last pair of an episode is its last observation.
        last: what to do where an episode ends without its last observation: "keep" the last action, whose successor is then
            not known, "drop" it, "repeat" the last observation, or "row", the last pair's action means nothing; see
            `irl_gym.demonstrations.imports.rows`.
        space: of the observations.
        n_actions: A; the actions count from 0.
        action_space: Discrete; the actions count from its start.
        env: has both spaces.

    Raises:
        InvalidDemonstrations: a pair that cannot be right, named by its number, counted from 0; or no pair.
        InvalidParameter: spaces that are missing, or unknown fields.
        NotDiscrete: continuous actions.
    """
    how = reading(space, n_actions, action_space, env, last)
    if not isinstance(pairs, Iterable) or (isinstance(pairs, np.ndarray) and not pairs.ndim):
        raise InvalidDemonstrations(f"the pairs are {type(pairs).__name__}: expected something to iterate over.")
    names = list(fields) if isinstance(fields, Sequence) else []
    known = all(is_word(one, *FIELDS) and names.count(one) == 1 for one in names)
    if fields is not None and not (known and FIELDS[0] in names):
        raise InvalidParameter(f"fields are {fields!r}: expected observation, and others of {FIELDS}, once each.")
    return _counted(_episodes(pairs, tuple(names), how))


def _counted(episodes: Iterator[Episode]) -> Iterator[Episode]:
    """The same episodes; when they have all been given, one line says how many lost their last action."""
    dropped = given = 0
    for episode in episodes:
        dropped, given = dropped + (episode.ending == "dropped"), given + 1
        yield episode
    say_dropped(dropped, given)


def _episodes(pairs: Iterable[Any], fields: tuple[str, ...], how: Reading) -> Iterator[Episode]:
    steps: list[dict[str, Any]] = []
    number, first, closed = -1, 0, False
    for number, pair in enumerate(pairs):
        if pair is None:
            if steps:
                yield _episode(steps, first, how)
            steps, closed = [], False
            continue
        step = _step(pair, fields, number)
        final = "action" in step and step["action"] is None
        follows = bool(steps) and step.get("episode") == steps[-1].get("episode")
        ended = any(truths([step[key]], key, lambda _, n=number: _name(n))[0] for key in FLAGS if step.get(key) is not None)
        if steps and (not follows or (closed and not final and "episode" not in step)):
            yield _episode(steps, first, how)
            steps = []
        first = first if steps else number
        steps.append(step)
        closed = ended
        if final:
            yield _episode(steps, first, replace(how, last="row"))
            steps, closed = [], False
    if steps:
        yield _episode(steps, first, how)
    if number < 0:
        raise InvalidDemonstrations("there are no pairs: expected at least one.")


def _step(pair: Any, fields: tuple[str, ...], number: int) -> dict[str, Any]:
    names = fields or FIELDS[:3]
    if not isinstance(pair, tuple | list) or len(pair) not in ((len(fields),) if fields else (2, 3)):
        also = "" if fields else " or (observation, action)"
        raise InvalidDemonstrations(f"{_name(number)} is {pair!r}: expected ({', '.join(names)}){also}.")
    step = dict(zip(names, pair, strict=False))
    episode = step.get("episode")
    try:
        bool(episode == episode)  # an array cannot say whether it is the one before
    except (ValueError, TypeError, RuntimeError) as error:
        raise InvalidDemonstrations(f"{_name(number)} has episode {episode!r}: expected one number or name.") from error
    return step


def _name(number: int) -> str:
    return f"pair {number} (from 0)"


def _episode(steps: list[dict[str, Any]], first: int, how: Reading) -> Episode:
    """One episode, of which `first` is the number of the first pair."""

    def name(row: int) -> str:
        return _name(first + row)

    columns: dict[str, Any] = {}
    how = how if "action" in steps[0] else replace(how, last="row")
    for column, key in {"rewards": "reward", "terminated": "terminated", "truncated": "truncated"}.items():
        values = [step.get(key) for step in steps]
        if all(value is None for value in values):
            continue
        if how.last == "row" and values[-1] is None:
            values[-1] = 0  # not read
        missing = [row for row, value in enumerate(values) if value is None]
        if missing:
            raise InvalidDemonstrations(
                f"{name(missing[0])} has no {key}: expected one in every pair of an episode, or in none."
            )
        columns[column] = values
    actions = [step["action"] for step in steps] if "action" in steps[0] else None
    (episode,) = LogColumns(
        how, np.array([0, len(steps)]), name, [step["observation"] for step in steps],
        np.array(actions, dtype=object) if how.last == "row" and actions is not None else actions, **columns,
    ).cut()  # fmt: skip
    return episode
