"""Demonstrations from Stable-Baselines3's buffers, which keep (n_steps, n_envs) arrays. Axes: T steps, E copies.

A replay buffer has next observations, so its episodes are whole. A rollout buffer has none, and does not tell termination from
truncation: its last observations are missing, as in most logs. The copies are read one after the other, and the last episode of
each is unfinished and counts as truncated. No attribute is imported from Stable-Baselines3: anything laid out so is read.
"""

from dataclasses import dataclass, replace
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces

from irl_gym.checks import checked_number
from irl_gym.demonstrations.choices import Last
from irl_gym.demonstrations.imports.reading import reading
from irl_gym.demonstrations.imports.rows import LogColumns, say_dropped
from irl_gym.demonstrations.imports.values import as_array, is_list, truths
from irl_gym.errors import InvalidDemonstrations, a_type
from irl_gym.mdp.episodes import Episode
from irl_gym.spaces.batches import by_part


def from_rollouts(
    buffer: Any,
    *,
    last: Last = "keep",
    space: spaces.Space | None = None,
    n_actions: int | None = None,
    action_space: spaces.Space | None = None,
    env: gym.Env | None = None,
) -> list[Episode]:
    """Episodes from a `RolloutBuffer` or a `ReplayBuffer`, with dictionaries as observations or without.

    From a rollout buffer, episodes are cut where `episode_starts` is true, and the first may be the end of an earlier one. Its
    rewards are as the algorithm has them: at a time limit PPO and A2C add the value of what would have followed. A replay
    buffer made with `optimize_memory_usage` lacks last observations, too. Where they are lacking and the last action is
    dropped, an episode of one step is left out: none of it would remain. The warning counts it.

        from_rollouts(model.rollout_buffer, env=env)

    Args:
        buffer: of the algorithm, after some steps.
        last: what to do where there are no next observations: "keep" the last action of each episode, whose successor is then
            not known, "drop" it, or "repeat" the last observation; see `irl_gym.demonstrations.imports.rows`.
        space: of the observations; the buffer's if None.
        n_actions: A; the actions count from 0.
        action_space: Discrete; the actions count from its start. The buffer's if neither is given.
        env: has both spaces.

    Raises:
        InvalidDemonstrations: no buffer, an empty one, or rows that cannot be right; the first is named by copy and step.
        NotDiscrete: continuous actions.
    """
    if not (hasattr(buffer, "dones") or hasattr(buffer, "episode_starts")) or not hasattr(buffer, "observations"):
        raise InvalidDemonstrations(
            f"the buffer is {a_type(buffer)}: expected a RolloutBuffer or a ReplayBuffer of Stable-Baselines3."
        )
    if env is None:
        space = getattr(buffer, "observation_space", None) if space is None else space
        if action_space is None and n_actions is None:
            action_space = getattr(buffer, "action_space", None)
    how = reading(space, n_actions, action_space, env, last)
    steps = _Steps.of(buffer)
    starts, flags = _cut(buffer, steps)
    following = getattr(buffer, "next_observations", None)
    rows = _worth_reading(starts, keep_single=following is not None or last in ("keep", "repeat"))
    steps = replace(steps, copy=steps.copy[rows], time=steps.time[rows])
    made = LogColumns(
        how, np.append(np.flatnonzero(starts[rows]), len(rows)), steps.name,
        *(steps.column(one) for one in (buffer.observations, buffer.actions, buffer.rewards)),
        next_observations=None if following is None else steps.column(following),
        **{key: flag[rows] for key, flag in flags.items()},
    ).cut()  # fmt: skip
    say_dropped(sum(one.ending == "dropped" for one in made), len(made), int(starts.sum()) - len(made))
    return made


@dataclass(frozen=True, eq=False)
class _Steps:
    """Which steps of a buffer are read: copy after copy, each in the order of time."""

    shape: tuple[int, int]
    """(n_steps, n_envs) of the buffer."""
    order: np.ndarray
    """(T,) the steps that are filled, the oldest first."""
    copy: np.ndarray
    """(n,) whose step each row is."""
    time: np.ndarray
    """(n,) and which of `order`."""

    @classmethod
    def of(cls, buffer: Any) -> "_Steps":
        """All that are filled."""
        order = _order(buffer)
        if not len(order):
            raise InvalidDemonstrations("there are no rows: the buffer is empty. Let the algorithm collect some steps first.")
        rewards = as_array(buffer.rewards, "rewards")
        if rewards.ndim != 2:
            raise InvalidDemonstrations(f"the buffer's rewards have shape {rewards.shape}: expected (n_steps, n_envs).")
        copies = rewards.shape[1]
        return cls((int(buffer.buffer_size), copies), order, *np.divmod(np.arange(copies * len(order)), len(order)))

    def name(self, row: int) -> str:
        """Where a row stands."""
        return f"copy {self.copy[row]}, step {self.time[row]} (from 0)"

    def column(self, raw: Any) -> Any:
        """(n, ...) one of the buffer's arrays, or the parts of one."""
        return by_part(
            lambda part: _by_time(as_array(part, "buffer's arrays"), *self.shape)[self.order[self.time], self.copy], raw
        )

    def flag(self, what: str, raw: Any) -> np.ndarray:
        """(n,) booleans."""
        return truths(self.column(raw) if is_list(raw) else raw, what, self.name)


def _cut(buffer: Any, steps: _Steps) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """(n,) where episodes start, and how those of a replay buffer ended."""
    flags = {}
    if hasattr(buffer, "dones"):
        done = steps.flag("dones", buffer.dones)
        timeouts = steps.flag("timeouts", getattr(buffer, "timeouts", np.zeros(steps.shape)))
        flags = {"terminated": done & ~timeouts, "truncated": done & timeouts}
        starts = np.append(True, done[:-1])
    else:
        starts = steps.flag("episode_starts", buffer.episode_starts)
    return starts | (steps.time == 0), flags


def _worth_reading(starts: np.ndarray, keep_single: bool) -> np.ndarray:
    """Rows of episodes that have a step left."""
    lengths = np.diff(np.append(np.flatnonzero(starts), len(starts)))
    rows = np.flatnonzero(np.repeat((lengths > 1) | keep_single, lengths))
    if not rows.size:
        raise InvalidDemonstrations(
            "every episode in the buffer has one step, and what it led to is not there: expected two. Pass last='keep'."
        )
    return rows


def _order(buffer: Any) -> np.ndarray:
    """(T,) the steps that are filled, the oldest first: a full replay buffer is a ring."""
    size, at, full = buffer.buffer_size, buffer.pos, getattr(buffer, "full", False)
    checked_number("the buffer's size", size, "a whole number of at least 1", least=1, whole=True, error=InvalidDemonstrations)
    rows = len(buffer.rewards) if is_list(buffer.rewards) else 0  # `get` has flattened them
    checked_number(
        "the buffer's place", at, f"a whole number from 0 to {size}", least=0, below=min(size, rows) + 1, whole=True,
        error=InvalidDemonstrations,
    )  # fmt: skip
    if not isinstance(full, bool | np.bool) or (full and rows < size):
        raise InvalidDemonstrations(f"the buffer is full: {full!r:.80}, with {rows} rows: expected true or false, and {size}.")
    if not full:
        return np.arange(at)
    order = (np.arange(size) + at) % size
    return order[1:] if getattr(buffer, "optimize_memory_usage", False) else order  # the newest step has overwritten the oldest


def _by_time(array: np.ndarray, size: int, copies: int) -> np.ndarray:
    """(n_steps, n_envs, ...)."""
    if array.shape[:2] == (size, copies):
        return array
    if array.shape[:1] == (size * copies,):  # `RolloutBuffer.get` has flattened it, copy after copy
        return array.reshape(copies, size, *array.shape[1:]).swapaxes(0, 1)
    raise InvalidDemonstrations(f"the buffer holds an array of shape {array.shape}: expected ({size}, {copies}, ...).")
