"""Rows of a log become episodes: every source ends here.

A log has a row for each step: the observation seen, the action taken then, what it paid, and perhaps whether it ended the
episode. Axes: n rows, N episodes, row after row and episode after episode. An `Episode` of T steps needs T + 1 observations,
and the commonest logs hold T: the observation that the last action led to was never written. There are five cases, and nobody
but the person who imports can tell which; `last` says it:

    next observations given   nothing is missing: the episode has every row's pair and ends in the last next observation
    last="keep", the default  every pair is kept, with what it paid and its end. What the last action led to is not known:
                              `Episode.ending` is "unseen", the last observation stands in its place, and nobody counts it. A
                              policy is learned from every pair; transitions and sums of features end a step earlier, but where
                              an exact table has one successor only, which a run then takes
    last="drop"               the last action of an episode is left out, with what it paid and the end that it made: often all
                              there is, as FrozenLake pays at the end. A warning says how many; a run and the doctor repeat it
    last="repeat"             the last observation is what the last action led to, as where a goal is not left
    last="row"                the last row of an episode is its last observation, and its action and reward are not read

With "drop" and "repeat" an episode counts as truncated, whatever its flags say: the step that ended it is not in it, or led to
no end. Where a log has no flags, or an episode stops without one, it counts as truncated too.

Without actions there is no pair to keep: as with "row", an episode's last row is its last observation, whatever `last` says.
"""

import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np

from irl_gym.demonstrations.choices import Last
from irl_gym.demonstrations.imports.members import members
from irl_gym.demonstrations.imports.reading import Reading
from irl_gym.demonstrations.imports.values import Name, is_list, numbers, truths
from irl_gym.errors import InvalidDemonstrations
from irl_gym.mdp.episodes import Ending, Episode
from irl_gym.spaces.batches import batch_size, by_part, take

ENDINGS: dict[Last, Ending] = {"keep": "unseen", "drop": "dropped", "repeat": "seen", "row": "seen"}
"""How episodes end without next observations."""


@dataclass(frozen=True, eq=False)
class LogColumns:
    """The columns of a log, unchecked."""

    how: Reading
    """What they are checked against, and the rule of the module's docstring, not read where `next_observations` are given."""
    offsets: np.ndarray
    """(N + 1,) int64: the row at which each episode starts, and n."""
    name: Name
    """Says where a row stands."""
    observations: Any
    """n observations, in any layout that `members` takes."""
    actions: Any
    """(n,) in the source's numbering; None where only the states are known."""
    rewards: Any = None
    """(n,); None where the log has none: then they are 0.0. No learner reads them; a report on such a dataset cannot say what
    the expert earned."""
    terminated: Any = None
    """(n,) booleans."""
    truncated: Any = None
    """(n,) booleans."""
    next_observations: Any = None
    """n observations."""

    def episodes(self) -> list[Episode]:
        """Check every row, then cut; say in one line what is dropped. Errors as `cut`."""
        made = self.cut()
        say_dropped(sum(one.ending == "dropped" for one in made), len(made))
        return made

    def cut(self) -> list[Episode]:
        """Check every row, then cut.

        Raises:
            InvalidDemonstrations: the first row that cannot be right, by name.
        """
        if self._n == 0:
            raise InvalidDemonstrations("there are no rows: expected at least one step.")
        lengths = np.diff(self.offsets)
        if (lengths == 0).any():
            raise InvalidDemonstrations(
                f"episode {int(np.argmin(lengths))} (from 0) has no steps: expected at least one. Leave it out."
            )
        batch = self._observations(self.observations, "observation")
        actions, rewards = self._actions(), self._rewards()
        terminated, truncated = self._ends(self.terminated, "terminated"), self._ends(self.truncated, "truncated")
        finals = None
        if self.next_observations is not None:
            successors = self._observations(self.next_observations, "next observation")
            self._check_linked(batch, successors)
            finals = take(successors, self._lasts)
        elif self._last in ("keep", "repeat"):
            finals = take(batch, self._lasts)
        else:
            self._check_longer_than_one(lengths)
        ending = "seen" if self.next_observations is not None else ENDINGS[self._last]
        offsets = self.offsets  # of the observations
        if finals is not None:  # put in after the rows of each episode
            batch = by_part(lambda part, final: np.insert(part, self.offsets[1:], final, axis=0), batch, finals)
            offsets = offsets + np.arange(len(offsets))
        if self.next_observations is None and self._last in ("drop", "repeat"):  # then the step that ended it is not known
            terminated = np.zeros_like(terminated)
        bounds = zip(self.offsets.tolist(), offsets.tolist(), offsets[1:].tolist(), strict=False)
        episodes = []
        for (row, start, stop), ended, limited in zip(bounds, terminated.tolist(), truncated.tolist(), strict=True):
            steps, seen = slice(row, row + stop - start - 1), take(batch, slice(start, stop))
            taken = None if actions is None else actions[steps]
            episodes.append(Episode(seen, taken, rewards[steps], ended, limited or not ended, ending=ending))
        return episodes

    @property
    def _n(self) -> int:
        return int(self.offsets[-1])

    @property
    def _lasts(self) -> np.ndarray:
        """(N,) the last row of each episode."""
        return self.offsets[1:] - 1

    @property
    def _last(self) -> Last:
        """What is done where the last observation is missing."""
        return "row" if self.actions is None else self.how.last

    @property
    def _only_observed(self) -> bool:
        """Has the last row of an episode an observation and nothing else?"""
        return self.next_observations is None and self._last == "row"

    def _observations(self, raw: Any, what: str) -> Any:
        batch = members(self.how.space, raw, what, self.name)
        if batch_size(batch) != self._n:
            raise InvalidDemonstrations(f"there are {batch_size(batch)} {what}s: expected {self._n}, one a row.")
        return batch

    def _column(self, raw: Any, what: str) -> np.ndarray:
        """(n,) numbers; those that count as 0 in rows that are not read."""
        if self._only_observed and is_list(raw) and len(raw) == self._n:
            raw = raw.copy() if isinstance(raw, np.ndarray) else list(raw)
            for row in self._lasts:
                raw[row] = self.how.first_action if what == "action" else 0
        array = numbers(raw, what, self.name)
        if array.ndim == 2 and array.shape[1] == 1:
            array = array[:, 0]
        if array.shape != (self._n,):
            raise InvalidDemonstrations(f"the {what}s have shape {array.shape}: expected ({self._n},), one a row.")
        return array

    def _actions(self) -> np.ndarray | None:
        if self.actions is None:
            return None
        array, how = self._column(self.actions, "action"), self.how
        array = array.astype(np.int64) if array.dtype.kind == "u" else array  # so that the difference may be negative
        counted = array - how.first_action
        wrong = np.flatnonzero(~((counted >= 0) & (counted < how.n_actions) & (counted == np.floor(counted))))
        if not wrong.size:
            return counted.astype(np.int64)
        value, span = array[wrong[0]].item(), f"from {how.first_action} to {how.first_action + how.n_actions - 1}"
        acting = np.delete(counted, self._lasts) if self._only_observed else counted
        if np.isnan(value):
            mend = "If the last row of an episode holds only the last observation, pass last='row'."
        elif value != np.floor(value):
            mend = "Irl_gym learns from whole actions: give each continuous action the number of a bin."
        elif value == how.first_action + how.n_actions and (acting > 0).all():
            start = how.first_action + 1
            mend = f"Do they count from {start}? Pass action_space=Discrete({how.n_actions}, start={start})."
        else:
            mend = "Was it recorded in another environment?"
        raise InvalidDemonstrations(f"{self.name(int(wrong[0]))} has action {value}: expected a whole number {span}. {mend}")

    def _rewards(self) -> np.ndarray:
        if self.rewards is None:
            return np.zeros(self._n)
        array = self._column(self.rewards, "reward").astype(np.float64)
        wrong = np.flatnonzero(~np.isfinite(array))
        if wrong.size:
            raise InvalidDemonstrations(
                f"{self.name(int(wrong[0]))} has reward {array[wrong[0]]}: expected a finite number. Leave the rewards out if "
                "they are not known; no learner reads them."
            )
        return array

    def _ends(self, raw: Any, what: str) -> np.ndarray:
        """(N,) booleans: does each episode end so?"""
        if raw is None:
            return np.zeros(len(self._lasts), dtype=bool)
        flags = truths(raw, what, self.name)
        if flags.shape != (self._n,):
            raise InvalidDemonstrations(f"there are {flags.size} {what} flags: expected {self._n}, one a row.")
        ends = flags[self._lasts]
        flags[self._lasts] = False
        if self._only_observed:  # the flag may stand in the row of the last action, too
            before = np.maximum(self._lasts - 1, self.offsets[:-1])
            ends |= flags[before]
            flags[before] = False
        if flags.any():
            raise InvalidDemonstrations(
                f"{self.name(int(np.argmax(flags)))} is {what} in the middle of an episode: expected that only in its last "
                "row. Give the rows after it the id of another episode."
            )
        return ends

    def _check_longer_than_one(self, lengths: np.ndarray) -> None:
        if (lengths < 2).any():
            first = int(self.offsets[np.argmax(lengths < 2)])
            mend = "Leave the episode out." if self._only_observed else "Give the next observations, or pass last='keep'."
            how = f"which has no steps without its last action (last={self.how.last!r})"
            why = "which is no step" if self.actions is None else how
            raise InvalidDemonstrations(
                f"{self.name(first)} is the only row of its episode, {why}: expected at least two rows. {mend}"
            )

    def _check_linked(self, batch: Any, successors: Any) -> None:
        """A next observation is what the next row of the episode observes."""
        rows = np.delete(np.arange(self._n), self._lasts)
        differ: list[np.ndarray] = []
        by_part(lambda here, there: differ.append(_differ(here, there)), take(successors, rows), take(batch, rows + 1))
        if np.any(differ):
            row = int(rows[np.argmax(np.any(differ, axis=0))])
            raise InvalidDemonstrations(
                f"{self.name(row)} has another next observation than the observation of {self.name(row + 1)}, which follows it "
                "in the same episode: expected the same. If rows are missing or an episode ends there, give those after it the "
                "id of another episode."
            )


def say_dropped(dropped: int, episodes: int, left_out: int = 0) -> None:
    """Warn, in one line, of last actions that are dropped, and of episodes of which nothing is left; of none, nothing.

    Args:
        dropped: episodes that lose their last action.
        episodes: all that are made.
        left_out: episodes of one step, which are not.
    """
    if dropped or left_out:
        rest = f", and {left_out} of one step {'is' if left_out == 1 else 'are'} left out" if left_out else ""
        warnings.warn(
            f"the last action of {dropped} of {episodes} episodes is dropped, with what it paid{rest}: give next observations, "
            "or last='keep', the default, which keeps it.",
            stacklevel=4,
        )


def _differ(left: np.ndarray, right: np.ndarray) -> np.ndarray:
    """(n,) booleans: are two arrays different in a row? Floats may differ in their last digits."""
    same = np.isclose(left, right, rtol=1e-5, atol=1e-6) if left.dtype.kind == "f" else left == right
    return ~np.all(same, axis=tuple(range(1, same.ndim)))
