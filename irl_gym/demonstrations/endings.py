"""Where an episode ends: no action is ever taught in an end.

Behind an end there is nothing to choose, so a recording that goes on there is either two episodes in one or a mistake, and only
who made it can tell which. `after_end` says what is done with it:
    refuse   an error that names episode and step
    cut      the episode ends there, and what follows is left out
An end is a step whose flag says so, or a state that is terminal in an exact table. A recording that lacks flags, rewards or
observations for its last steps is refused, or cut to the steps that have all of them. Where only the last observation is
missing and that is said (`Episode.ending`), nothing is wrong: an exact table with one successor knows it.
Axes: T steps.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, get_args

import numpy as np

from irl_gym.demonstrations.choices import AfterEnd
from irl_gym.demonstrations.minari_formats import ENDING, known_actions
from irl_gym.errors import InvalidDemonstrations, InvalidParameter
from irl_gym.mdp.episodes import Ending, Episode, numbered
from irl_gym.mdp.tabular_mdp import TransitionTable
from irl_gym.spaces.batches import batch_sizes, by_part, take
from irl_gym.spaces.states import States

LOST: dict[str, tuple[str, str]] = {
    "dropped": ("episode", "whose last action was dropped in the import, with what it paid"),
    "unseen": ("episode", "without word of what the last action led to"),
    "followed": ("episode", "without word of what the last action led to, which the table knows"),
    "steps_cut": ("step", "cut off after an end"),
    "episodes_cut": ("episode", "left out for beginning in an end"),
}
"""What may be missing from a dataset, and what a report calls it, behind its count: a noun, and what is the matter."""
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
        metadata: its seed, and how it ended, where these are known.
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
        take(raw.observations, slice(0, steps + 1)), known_actions(np.asarray(raw.actions)[:steps], first_action), rewards,
        ended, limited or (not ended and steps < len(raw.actions)), metadata.get("seed"), _ending(here, metadata),
    )  # fmt: skip


def _ending(here: str, metadata: Mapping[str, Any]) -> Any:
    told = metadata.get(ENDING, "seen")
    if not isinstance(told, str) or told not in get_args(Ending):
        raise InvalidDemonstrations(
            f"{here} has {ENDING} {told!r}: expected one of {', '.join(get_args(Ending))}. Did a newer irl_gym write it?"
        )
    return told


def _complete(here: str, raw: Any, after_end: AfterEnd) -> int:
    """T, steps that have everything.

    Raises:
        InvalidDemonstrations: not as many of something as actions, where that is refused; or no step.
    """
    counts = {name: len(getattr(raw, name)) for name in ("actions", "rewards", "terminations", "truncations")}
    counts["observations"] = min(batch_sizes(raw.observations)) - 1  # the last one follows the last action
    steps, fewest = counts["actions"], min(counts.values())
    if fewest < 1:
        fewer = next(name for name, count in counts.items() if count == fewest)
        what = f"{steps} actions and no {fewer} for them" if steps > 0 else "no steps"
        raise InvalidDemonstrations(f"{here} has {what}: expected at least one. Leave it out.")
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

    Where it was not recorded what the last action led to, and the table has one successor only, that is taken.

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
    for number, (episode, rows) in enumerate(numbered(episodes, states)):
        ends = np.flatnonzero(table.terminal[rows[:-1]])
        if ends.size and after_end == "refuse":
            k = int(ends[0])
            row = " If it is the row of a last observation, import it with last='row'." if episode.ending == "unseen" else ""
            raise InvalidDemonstrations(
                f"episode {number}, step {k} acts in observation {states.decode(int(rows[k]))}, in which the environment has "
                f"ended: expected no action there. {MEND} to end the episode there.{row}"
            )
        if ends.size and not ends[0]:
            continue
        left += 1
        known = _until(episode, int(ends[0])) if ends.size else _followed(episode, rows, table, states)
        if known.actions is None:
            _check_possible(number, rows[: len(known) + (known.ending != "unseen")], table, states)
        yield known
    if not left:
        raise InvalidDemonstrations("every episode begins in an end: expected a step of one. Is it another environment's?")


def _check_possible(number: int, rows: np.ndarray, table: TransitionTable, states: States) -> None:
    """Check that some action of the table makes each step of an episode of states alone.

    Raises:
        InvalidDemonstrations: none does.
    """
    pairs = (rows[:-1, None] * table.n_actions + np.arange(table.n_actions)).ravel(), np.repeat(rows[1:], table.n_actions)
    possible = np.asarray(table.P[pairs]).reshape(-1, table.n_actions).any(axis=1)
    if not possible.all():
        k = int(np.argmin(possible))
        here, there = (states.decode(int(one)) for one in rows[k : k + 2])
        raise InvalidDemonstrations(
            f"episode {number}, step {k} leads from {here} to {there}, and no action of the environment does: expected a state "
            "that follows. Leave the episode out, or cut it into two there."
        )


def _followed(episode: Episode, rows: np.ndarray, table: TransitionTable, states: States) -> Episode:
    """The episode with what its last action led to, where that was not recorded and can have been one state only."""
    if episode.ending != "unseen" or episode.actions is None:
        return episode
    following = table.P[[rows[-2] * table.n_actions + episode.actions[-1]]].indices
    if len(following) != 1:
        return episode
    ended = bool(table.terminal[following[0]])
    known = take(episode.observations, slice(None, -1))
    observations = by_part(lambda part, last: np.concatenate([part, last]), known, states.decode_batch(following))
    return replace(episode, observations=observations, terminated=ended, truncated=not ended, ending="followed")


def _until(episode: Episode, steps: int) -> Episode:
    """The first steps of an episode, the last of which ended it."""
    actions = None if episode.actions is None else episode.actions[:steps]
    return replace(
        episode, observations=take(episode.observations, slice(0, steps + 1)), actions=actions,
        rewards=episode.rewards[:steps], terminated=True, truncated=False, ending="seen",
    )  # fmt: skip


def left_out(given: Sequence[Episode], taken: Sequence[Episode], steps: int | None) -> dict[str, int]:
    """What is not known of episodes, or not taken: counts, none of which is 0.

    Args:
        given: as the dataset has them.
        taken: as learners get them.
        steps: that the dataset says it has; None where none are cut.

    Returns:
        By the keys of `LOST`.
    """
    counts = {name: sum(one.ending == name for one in taken) for name in ("dropped", "unseen", "followed")}
    counts["steps_cut"] = 0 if steps is None else max(0, steps - sum(map(len, taken)))
    counts["episodes_cut"] = len(given) - len(taken)
    return {name: count for name, count in counts.items() if count}
