"""Rows of a log become episodes: every source ends here.

A log has a row for each step: the observation seen, the action taken then, what it paid, and perhaps whether it ended the
episode. Axes: n rows, N episodes, row after row and episode after episode. An `Episode` of T steps needs T + 1 observations,
and the commonest logs hold T: the observation that the last action led to was never written. There are four cases, and nobody
but the person who imports can tell which; `last` says it:

    next observations given   nothing is missing: the episode has every row's pair and ends in the last next observation
    last="drop", the default  the last action of an episode, whose successor is unknown, is left out. Nothing is invented: all
                              that is kept was seen. It costs one pair an episode, and what that pair paid: often all there is,
                              as FrozenLake pays at the end. Where rewards matter, give next observations or "repeat"
    last="repeat"             every pair is kept, and the last observation stands in for its unknown successor. A policy may be
                              estimated from such an episode; a table of transitions should not be
    last="row"                the last row of an episode is its last observation, and its action and reward are not read

With "drop" and "repeat" an episode counts as truncated, whatever its flags say: the step that ended it is not in it, or its end
is not known. Where a log has no flags, or an episode stops without one, it counts as truncated too.
"""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from irl_gym.demonstrations import Episode
from irl_gym.errors import InvalidDemonstrations, InvalidParameter
from irl_gym.features import batch_size, take
from irl_gym.imports.expected import Expected
from irl_gym.imports.members import Name, as_array, is_list, members, numbers

Last = Literal["drop", "repeat", "row"]


def check_last(last: Any) -> None:
    """Refuse an unknown rule.

    Raises:
        InvalidParameter: it is none of the three.
    """
    if last not in ("drop", "repeat", "row"):
        raise InvalidParameter(
            f"last is {last!r}: expected 'drop', 'repeat' or 'row', what to do where an episode's last observation is missing."
        )


def truths(raw: Any, what: str, name: Name) -> np.ndarray:
    """Booleans, which may be written as 0 and 1 or as text: a new array (n,).

    Raises:
        InvalidDemonstrations: something else, named by its row.
    """
    values = as_array(raw, f"{what} flags")
    if values.dtype.kind in "OUT":  # a file's column in which one value is no boolean, such as an empty one
        words = {"true": 1, "false": 0}
        values = [words.get(one.lower(), one) if isinstance(one, str) else one for one in values]
    array = numbers(values, what, name)
    if array.ndim != 1 and array.shape[1:] != (1,):
        raise InvalidDemonstrations(f"the {what} flags have shape {array.shape}: expected (n,), one a row.")
    array = array.reshape(-1)
    odd = np.flatnonzero((array != 0) & (array != 1))
    if odd.size:
        raise InvalidDemonstrations(f"{name(int(odd[0]))} has {what} {array[odd[0]].item()}: expected true or false.")
    return array.astype(bool)


@dataclass(frozen=True, eq=False)
class Rows:
    """The columns of a log, unchecked."""

    expected: Expected
    """What they are checked against."""
    observations: Any
    """n observations, in any layout that `members` takes."""
    actions: Any
    """(n,) in the source's numbering."""
    offsets: np.ndarray
    """(N + 1,) int64: the row at which each episode starts, and n."""
    name: Name
    """Says where a row stands."""
    rewards: Any = None
    """(n,); None where the log has none: then they are 0.0. No learner reads them; a report on such a dataset cannot say what
    the expert earned."""
    terminated: Any = None
    """(n,) booleans."""
    truncated: Any = None
    """(n,) booleans."""
    next_observations: Any = None
    """n observations."""
    last: Last = "drop"
    """The rule of the module's docstring; not read where `next_observations` are given."""

    @property
    def _only_observed(self) -> bool:
        """Has the last row of an episode an observation and nothing else?"""
        return self.next_observations is None and self.last == "row"

    def episodes(self) -> list[Episode]:
        """Check every row, then cut.

        Raises:
            InvalidDemonstrations: the first row that cannot be right, by name.
            InvalidParameter: an unknown rule for the last observation.
        """
        check_last(self.last)
        n, N = int(self.offsets[-1]), len(self.offsets) - 1
        if n == 0:
            raise InvalidDemonstrations("there are no rows: expected at least one step.")
        lengths = np.diff(self.offsets)
        if (lengths == 0).any():
            raise InvalidDemonstrations(
                f"episode {int(np.argmin(lengths))} (from 0) has no steps: expected at least one. Leave it out."
            )
        batch = self._checked_observations(self.observations, n, "observation")
        actions, rewards = self._actions(), self._rewards()
        terminated, truncated = self._ends(self.terminated, "terminated"), self._ends(self.truncated, "truncated")
        offsets, known = self.offsets + np.arange(N + 1), True  # of the observations, when a last one is put in
        if self.next_observations is not None:
            successors = self._checked_observations(self.next_observations, n, "next observation")
            self._check_linked(batch, successors)
            batch = _with_last(batch, take(successors, self.offsets[1:] - 1), self.offsets)
        elif self.last == "repeat":
            batch, known = _with_last(batch, take(batch, self.offsets[1:] - 1), self.offsets), False
        else:
            offsets, known = self.offsets, self._only_observed
            self._check_longer_than_one(lengths)
        terminated = terminated & known
        truncated = (truncated & known) | ~terminated
        episodes = []
        for i, (start, stop, row) in enumerate(
            zip(offsets[:-1].tolist(), offsets[1:].tolist(), self.offsets.tolist(), strict=False)
        ):
            steps = slice(row, row + stop - start - 1)
            seen = take(batch, slice(start, stop))
            episodes.append(Episode(seen, actions[steps], rewards[steps], bool(terminated[i]), bool(truncated[i])))
        return episodes

    @property
    def _acting(self) -> np.ndarray:
        """(n,) booleans: is the row's action read?"""
        acting = np.ones(int(self.offsets[-1]), dtype=bool)
        acting[self.offsets[1:] - 1] = not self._only_observed
        return acting

    def _checked_observations(self, raw: Any, n: int, what: str) -> Any:
        batch = members(self.expected.space, raw, what, self.name)
        if batch_size(batch) != n:
            raise InvalidDemonstrations(f"there are {batch_size(batch)} {what}s: expected {n}, one a row.")
        return batch

    def _column(self, raw: Any, what: str) -> np.ndarray:
        """(n,) numbers; 0 in rows that are not read."""
        if self._only_observed and is_list(raw) and len(raw) == self.offsets[-1]:
            raw = raw.copy() if isinstance(raw, np.ndarray) else list(raw)
            for row in self.offsets[1:] - 1:
                raw[row] = self.expected.first_action if what == "action" else 0
        array = numbers(raw, what, self.name)
        if array.ndim == 2 and array.shape[1] == 1:
            array = array[:, 0]
        if array.shape != (self.offsets[-1],):
            raise InvalidDemonstrations(f"the {what}s have shape {array.shape}: expected ({self.offsets[-1]},), one a row.")
        return array

    def _actions(self) -> np.ndarray:
        array, expected = self._column(self.actions, "action"), self.expected
        array = array.astype(np.int64) if array.dtype.kind == "u" else array  # so that the difference may be negative
        counted = array - expected.first_action
        wrong = np.flatnonzero(~((counted >= 0) & (counted < expected.n_actions) & (counted == np.floor(counted))))
        if not wrong.size:
            return counted.astype(np.int64)
        value = array[wrong[0]].item()
        if np.isnan(value):
            mend = "If the last row of an episode holds only the last observation, pass last='row'."
        elif value != np.floor(value):
            mend = "Irl_gym learns from whole actions: give each continuous action the number of a bin."
        elif value == expected.first_action + expected.n_actions and (counted[self._acting] > 0).all():
            start = expected.first_action + 1
            mend = f"Do they count from {start}? Pass action_space=Discrete({expected.n_actions}, start={start})."
        else:
            mend = "Was it recorded in another environment?"
        raise InvalidDemonstrations(f"{self.name(int(wrong[0]))} has action {value}: expected {expected.range}. {mend}")

    def _rewards(self) -> np.ndarray:
        if self.rewards is None:
            return np.zeros(self.offsets[-1])
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
        lasts = self.offsets[1:] - 1
        if raw is None:
            return np.zeros(len(lasts), dtype=bool)
        n = int(self.offsets[-1])
        array = truths(raw, what, self.name)
        if array.shape != (n,):
            raise InvalidDemonstrations(f"there are {array.size} {what} flags: expected {n}, one a row.")
        before = np.maximum(lasts - 1, self.offsets[:-1])
        middle = array
        ends = middle[lasts] | (middle[before] & self._only_observed)
        middle[lasts] = False
        if self._only_observed:
            middle[before] = False
        if middle.any():
            raise InvalidDemonstrations(
                f"{self.name(int(np.argmax(middle)))} is {what} in the middle of an episode: expected that only in its last "
                "row. Give the rows after it the id of another episode."
            )
        return ends

    def _check_longer_than_one(self, lengths: np.ndarray) -> None:
        if (lengths < 2).any():
            first = int(self.offsets[np.argmax(lengths < 2)])
            mend = "Leave the episode out." if self._only_observed else "Give the next observations, or pass last='repeat'."
            raise InvalidDemonstrations(
                f"{self.name(first)} is the only row of its episode, which has no steps without its last action "
                f"(last={self.last!r}): expected at least two rows. {mend}"
            )

    def _check_linked(self, batch: Any, successors: Any) -> None:
        """A next observation is what the next row of the episode observes."""
        inside = np.ones(int(self.offsets[-1]), dtype=bool)
        inside[self.offsets[1:] - 1] = False
        rows = np.flatnonzero(inside)
        differ = _differ(take(successors, rows), take(batch, rows + 1))
        if differ.any():
            row = int(rows[np.argmax(differ)])
            raise InvalidDemonstrations(
                f"{self.name(row)} has another next observation than the observation of {self.name(row + 1)}, which follows it "
                "in the same episode: expected the same. Are rows missing, or does an episode end there?"
            )


def _differ(left: Any, right: Any) -> np.ndarray:
    """(n,) booleans: are two batches different in a row? Floats may differ in their last digits."""
    if isinstance(left, dict | tuple):
        keys = left if isinstance(left, dict) else range(len(left))
        return np.logical_or.reduce([_differ(left[key], right[key]) for key in keys])
    same = np.isclose(left, right, rtol=1e-5, atol=1e-6) if left.dtype.kind == "f" else left == right
    return ~same.all(axis=tuple(range(1, same.ndim)))


def _with_last(batch: Any, final: Any, offsets: np.ndarray) -> Any:
    """A batch of n + N observations: after each episode's rows, its final one."""
    if isinstance(batch, dict):
        return {key: _with_last(part, final[key], offsets) for key, part in batch.items()}
    if isinstance(batch, tuple):
        return tuple(_with_last(part, final[i], offsets) for i, part in enumerate(batch))
    return np.insert(batch, offsets[1:], final, axis=0)
