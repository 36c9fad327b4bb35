"""What episodes hold of a table: the observations that occur, and how often each step was seen.

A last step whose successor was not recorded (`Episode.ending`) is no step of a table: only its state counts.
Episodes are read in blocks, so memory grows with the states and transitions that occur, not with the episodes.
Axes: S states, A actions, M different transitions, n observations of k numbers.
"""

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from gymnasium import spaces

from irl_gym.errors import InvalidDemonstrations, UnknownObservation
from irl_gym.mdp.episodes import Episode
from irl_gym.spaces.integer_spaces import checked_members, ranges, to_numbers
from irl_gym.spaces.listed_states import in_order
from irl_gym.tables.repeats import Repeats, Visits

BLOCK = 10_000
"""Steps read at a time; fewer where an observation has many numbers."""
NUMBERS = 1 << 22
"""Numbers of observations read at a time: 32 MB."""
LARGEST = 1e150
"""|reward| up to which its square is finite."""


@dataclass(frozen=True, eq=False)
class Tally:
    """Sums over all steps of some episodes. A state is its place in `numbers`."""

    numbers: np.ndarray
    """(n, k) the observations that occur, in lexicographic order."""
    started: np.ndarray
    """(n,) int64, episodes that began there."""
    ordinary: np.ndarray
    """(n,) bool, seen where no episode had terminated."""
    ended: np.ndarray
    """(n,) bool, entered with `terminated`."""
    pairs: np.ndarray
    """(M,) int64, s * A + a."""
    following: np.ndarray
    """(M,) int64, the state entered."""
    terminated: np.ndarray
    """(M,) bool, entered with `terminated`?"""
    counts: np.ndarray
    """(M,) int64, how often."""
    paid: np.ndarray
    """(M, 4) float64: sum, sum of squares, least and largest reward."""
    n_episodes: int
    """Episodes read."""
    repeats: Repeats
    """What repeated visits within an episode say about hidden state."""


def tally(episodes: Iterable[Episode], space: spaces.Space, n_actions: int) -> Tally:
    """Count what episodes hold, a block at a time.

    Raises:
        NotDiscrete: observations that are not integers.
        InvalidDemonstrations: no episode; an action out of range, or a reward that is not finite or beyond 1e150, with its
            episode and step.
        UnknownObservation: an observation outside the space, with its episode.
    """
    found = _Found(space, n_actions)
    for block in _blocks(episodes, len(ranges(space))):
        found.add(block)
    if not found.n_episodes:
        raise InvalidDemonstrations("there are no episodes: expected at least one.")
    if not found.lines:
        raise InvalidDemonstrations(
            f"none of the {found.n_episodes} episodes has a step whose successor was recorded: expected one. Give the next "
            "observations when they are imported."
        )
    return found.tally()


def _blocks(episodes: Iterable[Episode], width: int) -> Iterator[list[Episode]]:
    block, steps, most = [], 0, min(BLOCK, NUMBERS // max(width, 1))
    for episode in episodes:
        block.append(episode)
        steps += len(episode)
        if steps >= most:
            yield block
            block, steps = [], 0
    if block:
        yield block


class _Found:
    """The sums while episodes are read; states numbered as they come."""

    def __init__(self, space: spaces.Space, n_actions: int):
        self.space, self.n_actions, self.n_episodes = space, n_actions, 0
        self.states: dict[bytes, int] = {}
        self.started: Counter[int] = Counter()
        self.ordinary: set[int] = set()
        self.ended: set[int] = set()
        self.lines: dict[tuple[int, int], list[float]] = {}
        self.visits = Visits()

    def add(self, block: list[Episode]) -> None:
        """Count some episodes."""
        lengths = np.array([len(episode) for episode in block])
        actions, rewards = self._checked(block, lengths)
        ids = self._ids(self._numbers(block))
        lasts = np.cumsum(lengths + 1) - 1
        firsts = lasts - lengths
        done = np.zeros(ids.size, dtype=bool)
        done[lasts] = [episode.terminated and episode.ending != "unseen" for episode in block]
        self.started.update(ids[firsts].tolist())
        self.ordinary.update(np.unique(ids[~done]).tolist())
        self.ended.update(np.unique(ids[done]).tolist())
        known = np.ones(actions.size, dtype=bool)  # steps whose successors are: the last of an episode may not be
        known[np.cumsum(lengths) - 1] = [episode.ending != "unseen" for episode in block]
        if known.any():
            pairs = (np.delete(ids, lasts) * self.n_actions + actions)[known]
            arrivals, rewards = np.delete(ids * 2 + done, firsts)[known], rewards[known]
            self._add_lines(pairs, arrivals, rewards)
            self.visits.add(pairs, arrivals, rewards, self.n_episodes + np.repeat(np.arange(len(block)), lengths)[known])
        self.n_episodes += len(block)

    def _numbers(self, block: list[Episode]) -> np.ndarray:
        """(N, k) the observations of some episodes, one after the other."""
        try:
            return checked_members(self.space, np.concatenate([to_numbers(self.space, one.observations) for one in block]))
        except UnknownObservation:
            for i, episode in enumerate(block):  # each alone, to name the one that is wrong
                try:
                    checked_members(self.space, to_numbers(self.space, episode.observations))
                except UnknownObservation as error:
                    raise UnknownObservation(f"in episode {self.n_episodes + i}, {error}") from error
            raise

    def _checked(self, block: list[Episode], lengths: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        # Cast before they are joined: NumPy joins signed and unsigned integers to floats.
        actions = np.concatenate([
            one.taken(f"a table is counted from actions, and episode {self.n_episodes + i}").astype(np.int64)
            for i, one in enumerate(block)
        ])  # fmt: skip
        rewards = np.concatenate([np.asarray(episode.rewards, dtype=np.float64) for episode in block])
        wrong = (actions < 0) | (actions >= self.n_actions)
        unpaid = ~(np.abs(rewards) <= LARGEST)  # NaN too
        if wrong.any() or unpaid.any():
            at = int(np.argmax(wrong | unpaid))
            i = int(np.searchsorted(np.cumsum(lengths), at, side="right"))
            where = f"episode {self.n_episodes + i}, step {at - int(lengths[:i].sum())}"
            if wrong[at]:
                raise InvalidDemonstrations(f"{where} takes action {actions[at]}: expected 0 to {self.n_actions - 1}.")
            limit = f", {LARGEST:.0e} at most" if np.isfinite(rewards[at]) else ""
            raise InvalidDemonstrations(
                f"{where} pays {rewards[at]}: expected a finite reward{limit}. Mend or leave out the episode."
            )
        return actions, rewards

    def _ids(self, numbers: np.ndarray) -> np.ndarray:
        """(N,) the places of observations in the order in which they came."""
        raw = np.ascontiguousarray(numbers)
        keys, place = np.unique(raw.view(np.dtype((np.void, raw.dtype.itemsize * raw.shape[1]))).ravel(), return_inverse=True)
        known = [self.states.setdefault(key, len(self.states)) for key in keys.tolist()]
        return np.array(known, dtype=np.int64)[place]

    def _add_lines(self, pairs: np.ndarray, arrivals: np.ndarray, rewards: np.ndarray) -> None:
        order = np.lexsort((arrivals, pairs))
        pairs, arrivals, rewards = pairs[order], arrivals[order], rewards[order]
        new = np.append(True, (np.diff(pairs) != 0) | (np.diff(arrivals) != 0))
        begin = np.flatnonzero(new)
        columns = (
            np.diff(np.append(begin, pairs.size)),
            np.add.reduceat(rewards, begin),
            np.add.reduceat(rewards**2, begin),
            np.minimum.reduceat(rewards, begin),
            np.maximum.reduceat(rewards, begin),
        )
        lines = zip(*(column.tolist() for column in columns), strict=True)
        for key, line in zip(zip(pairs[begin].tolist(), arrivals[begin].tolist(), strict=True), lines, strict=True):
            old = self.lines.get(key)
            if old is None:
                self.lines[key] = list(line)
            else:
                old[:3] = old[0] + line[0], old[1] + line[1], old[2] + line[2]
                old[3:] = min(old[3], line[3]), max(old[4], line[4])

    def tally(self) -> Tally:
        """The sums, with states in lexicographic order."""
        n = len(self.states)
        numbers = np.frombuffer(b"".join(self.states), dtype=np.int64).reshape(n, -1)
        order = in_order(numbers)
        rank = np.empty(n, dtype=np.int64)
        rank[order] = np.arange(n)
        started = np.zeros(n, dtype=np.int64)
        started[list(self.started)] = list(self.started.values())
        ordinary, ended = np.zeros(n, dtype=bool), np.zeros(n, dtype=bool)
        ordinary[list(self.ordinary)] = True
        ended[list(self.ended)] = True
        keys, sums = np.array(list(self.lines), dtype=np.int64), np.array(list(self.lines.values()))
        s, a = np.divmod(keys[:, 0], self.n_actions)
        arrived, terminated = np.divmod(keys[:, 1], 2)
        repeats = self.visits.result()
        at, action = divmod(repeats.row, self.n_actions)
        return Tally(
            numbers[order], started[order], ordinary[order], ended[order], rank[s] * self.n_actions + a, rank[arrived],
            terminated == 1, sums[:, 0].astype(np.int64), sums[:, 1:], self.n_episodes,
            replace(repeats, row=int(rank[at]) * self.n_actions + action),
        )  # fmt: skip
