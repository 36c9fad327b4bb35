"""Where an episode ends: no action is ever taught in an end.

Behind an end there is nothing to choose, so a recording that goes on there is either two episodes in one or a mistake, and only
who made it can tell which. `after_end` says what is done with it:
    refuse   an error that names episode and step
    cut      the episode ends there, and what follows is left out
An end is a step whose flag says so, or a state that is terminal in an exact table. A recording that lacks flags, rewards or
observations for its last steps is refused, or cut to the steps that have all of them.
Axes: T steps.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from typing import Any, Literal, get_args

import numpy as np

from irl_gym.demonstrations import Episode
from irl_gym.errors import InvalidDemonstrations, InvalidParameter, UnknownObservation
from irl_gym.features import by_part, take
from irl_gym.mdp import TransitionTable
from irl_gym.states import States

AfterEnd = Literal["refuse", "cut"]
MEND = "Pass after_end='cut' (--after-end cut)"


def checked_after_end(value: Any) -> AfterEnd:
    """Return it.

    Raises:
        InvalidParameter: neither of the two.
    """
    if value not in get_args(AfterEnd):
        raise InvalidParameter(
            f"after_end is {value!r}: expected 'refuse' or 'cut', what to do with an episode that goes on after its end."
        )
    return value


def episode_of(here: str, raw: Any, metadata: Mapping[str, Any], first_action: int, after_end: AfterEnd) -> Episode:
    """An episode as Minari gives it.

    Args:
        here: what a message calls it.
        raw: with observations, actions, rewards, terminations and truncations.
        metadata: its seed, if it is known.
        first_action: what the dataset calls action 0.
        after_end: what to do where it goes on after an end, or has not as many flags as steps.

    Raises:
        InvalidDemonstrations: such an episode, where it is refused; one without steps, or a reward that is not finite.
    """
    steps = _complete(here, raw, after_end)
    terminated, truncated = (_flags(here, name, getattr(raw, name)[:steps]) for name in ("terminations", "truncations"))
    ends = np.flatnonzero((terminated | truncated)[:-1])
    if ends.size:
        k = int(ends[0])
        if after_end == "refuse":
            how = "terminated" if terminated[k] else "truncated"
            raise InvalidDemonstrations(
                f"{here} goes on for {steps - 1 - k} more steps after step {k}, which is {how}: expected an end in its last "
                f"step only. {MEND} to leave out what follows an end."
            )
        steps = k + 1
    rewards = np.asarray(raw.rewards, float)[:steps]
    wrong = np.flatnonzero(~np.isfinite(rewards))
    if wrong.size:
        raise InvalidDemonstrations(
            f"{here}, step {wrong[0]} has reward {rewards[wrong[0]]}: expected a finite number. Write the dataset without "
            "that episode, or with 0.0 where rewards are not known."
        )
    ended, limited = bool(terminated[steps - 1]), bool(truncated[steps - 1])
    return Episode(
        take(raw.observations, slice(0, steps + 1)), np.asarray(raw.actions, dtype=np.int64)[:steps] - first_action, rewards,
        ended, limited or (not ended and steps < len(raw.actions)), metadata.get("seed"),
    )  # fmt: skip


def _complete(here: str, raw: Any, after_end: AfterEnd) -> int:
    """T, steps that have everything.

    Raises:
        InvalidDemonstrations: not as many of something as actions, where that is refused; or no step.
    """
    counts = {name: len(getattr(raw, name)) for name in ("actions", "rewards", "terminations", "truncations")}
    by_part(lambda part: counts.update(observations=min(counts.get("observations", len(part)), len(part))), raw.observations)
    counts["observations"] -= 1  # the last one follows the last action
    steps, fewest = counts["actions"], min(counts.values())
    if fewest < 1:
        raise InvalidDemonstrations(f"{here} has no steps: expected at least one. Leave it out.")
    for name, count in counts.items():
        if count != steps and after_end == "refuse":
            one = name == "observations"
            raise InvalidDemonstrations(
                f"{here} has {steps} actions and {count + one} {name}: expected {steps + one}"
                f"{', the last one included' * one}. {MEND} to keep its first {fewest} steps, or leave it out."
            )
    return fewest


def _flags(here: str, name: str, raw: Any) -> np.ndarray:
    flags = np.asarray(raw)
    if flags.ndim != 1 or flags.dtype.kind not in "biuf" or not np.isin(flags, (0, 1)).all():
        raise InvalidDemonstrations(
            f"{here} has {name} of shape {flags.shape} and dtype {flags.dtype}: expected (T,) booleans. Write the dataset anew."
        )
    return flags.astype(bool)


def in_table(episodes: Iterable[Episode], table: TransitionTable, states: States, after_end: AfterEnd) -> Iterator[Episode]:
    """Episodes as an exact table can have them: none acts in a state that is terminal there.

    Args:
        episodes: of the table's environment.
        table: exact.
        states: its numbering.
        after_end: refuse an episode that acts in a terminal state, or cut it there; one that begins in it is left out.

    Raises:
        InvalidDemonstrations: such an episode, where it is refused; or none is left.
        UnknownObservation: an observation that is no state of the table, with its episode.
    """
    left = 0
    for number, episode in enumerate(episodes):
        try:
            rows = episode.rows(states)
        except UnknownObservation as error:
            raise UnknownObservation(f"episode {number}: {error}") from error
        ends = np.flatnonzero(table.terminal[rows[:-1]])
        if ends.size and after_end == "refuse":
            k = int(ends[0])
            raise InvalidDemonstrations(
                f"episode {number}, step {k} acts in observation {states.decode(int(rows[k]))}, in which the environment has "
                f"ended: expected no action there. {MEND} to end the episode there."
            )
        if ends.size and not ends[0]:
            continue
        left += 1
        yield _until(episode, int(ends[0])) if ends.size else episode
    if not left:
        raise InvalidDemonstrations("every episode begins in an end: expected a step of one. Is it another environment's?")


def _until(episode: Episode, steps: int) -> Episode:
    """The first steps of an episode, the last of which ended it."""
    return replace(
        episode, observations=take(episode.observations, slice(0, steps + 1)), actions=episode.actions[:steps],
        rewards=episode.rewards[:steps], terminated=True, truncated=False,
    )  # fmt: skip
