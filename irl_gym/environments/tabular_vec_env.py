"""A table and a reward as a Stable-Baselines3 VecEnv that steps all copies at once in NumPy.

Differs from `DummyVecEnv([lambda: TimeLimit(TabularEnv(...), n)] * num_envs)` in speed only: the same distributions, the same
infos (`terminal_observation`, `TimeLimit.truncated`, Monitor's `episode`), the same automatic reset.
Axes: N copies, S states, A actions.
"""

import json
import time
from collections.abc import Mapping, Sequence
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import VecEnv

from irl_gym.checks import checked_number
from irl_gym.errors import InvalidInput, InvalidParameter
from irl_gym.mdp.rewards import TabularReward, as_reward
from irl_gym.mdp.sampling import Successors
from irl_gym.mdp.tabular_mdp import TransitionTable
from irl_gym.spaces.states import States


class TabularVecEnv(VecEnv):
    """N copies of a tabular environment, stepped together.

    Args:
        table: a TransitionTable or a TabularMDP.
        reward: (S,) paid on arrival, or (S, A).
        num_envs: number of copies N.
        max_episode_steps: truncate episodes after this many steps; None for never.
        states: turns rows into the observations of another environment; the default is the rows themselves.
        show_rows: show rows all the same, and keep `states` for who encodes observations later: a row is what a one-hot
            network wants, and Stable-Baselines3 takes no Tuple.
        seed: of the generator that all copies share.

    Raises:
        InvalidReward: a reward of another shape than the table's.
        InvalidParameter: a number of copies or steps below 1, or a state index of another size.
    """

    def __init__(
        self,
        table: TransitionTable,
        reward: TabularReward | np.ndarray,
        *,
        num_envs: int = 64,
        max_episode_steps: int | None = None,
        states: States | None = None,
        show_rows: bool = False,
        seed: int | None = None,
    ):
        reward = as_reward(reward)
        reward.expected(table)  # checks the shape
        for name, value in (("num_envs", num_envs), ("max_episode_steps", max_episode_steps)):
            if value is not None:
                checked_number(name, value, "a whole number of at least 1", least=1, whole=True)
        if states is not None and states.n_states != table.n_states:
            raise InvalidParameter(f"the state index has {states.n_states} states: expected {table.n_states}, the table's.")
        self.table, self.reward, self.max_episode_steps, self.states = table, reward, max_episode_steps, states
        self.render_mode = None
        self._rng = np.random.default_rng(seed)
        self._successors = Successors(table)
        self._limit = np.iinfo(np.int64).max if max_episode_steps is None else max_episode_steps
        self.shows_rows = show_rows or states is None
        shown = None if self.shows_rows else states
        space = spaces.Discrete(table.n_states) if shown is None else shown.space
        parts = space.spaces.values() if isinstance(space, spaces.Dict) else ()
        if isinstance(space, spaces.Tuple) or any(isinstance(part, spaces.Tuple | spaces.Dict) for part in parts):
            raise InvalidParameter(
                f"the observation space is {space}: Stable-Baselines3 takes no Tuple observations, and no Dict inside a Dict. "
                "Use show_rows=True."
            )
        self._observations = None if shown is None else shown.decode_batch(np.arange(table.n_states))
        super().__init__(num_envs, space, spaces.Discrete(table.n_actions))
        self._actions = np.zeros(num_envs, dtype=np.int64)
        self._begin()

    def _begin(self) -> None:
        self._rows = self._successors.start(self.num_envs, self._rng)
        self._elapsed = np.zeros(self.num_envs, dtype=np.int64)
        self._returns = np.zeros(self.num_envs)
        self._began = time.time()

    def _observe(self, rows: np.ndarray) -> Any:
        if self._observations is None:
            return rows.copy()
        if isinstance(self._observations, dict):
            return {key: values[rows] for key, values in self._observations.items()}
        return self._observations[rows]

    def reset(self) -> Any:
        """Begin all episodes anew; a seed given by `seed` takes effect here."""
        if self._seeds[0] is not None:
            self._rng = np.random.default_rng(self._seeds[0])
        self._reset_seeds()
        self._reset_options()
        self._begin()
        self.reset_infos = [{} for _ in range(self.num_envs)]
        return self._observe(self._rows)

    def moment(self) -> dict[str, np.ndarray]:
        """Where all copies stand, and the state of the generator: all that what follows depends on but the actions."""
        drawn = np.array(json.dumps(self._rng.bit_generator.state))
        return {"rows": self._rows, "elapsed": self._elapsed, "returns": self._returns, "generator": drawn}

    def go_on(self, moment: Mapping[str, np.ndarray]) -> tuple[Any, np.ndarray]:
        """Set all copies to a `moment` of theirs; what they show, and (N,) whether their episodes have just begun.

        Raises:
            InvalidInput: a copy stands in a terminal state, or longer than episodes last.
        """
        rows, elapsed, returns = (moment[name].copy() for name in ("rows", "elapsed", "returns"))
        if self.table.terminal[rows].any() or elapsed.max() >= self._limit:
            raise InvalidInput(
                f"copies stand in {rows[:9]} after {elapsed[:9]} steps: expected states that act, and at most "
                f"{self._limit - 1:,} steps, as `moment` gave them."
            )
        self._rng.bit_generator.state = json.loads(str(moment["generator"]))
        self._rows, self._elapsed, self._returns = rows, elapsed, returns
        return self._observe(rows), elapsed == 0

    def step_async(self, actions: np.ndarray) -> None:
        """Take the actions (N,) of the next step.

        Raises:
            InvalidInput: wrong shape, or an action out of range.
        """
        actions = np.asarray(actions)
        if actions.shape != (self.num_envs,) or actions.dtype.kind not in "iu":
            raise InvalidInput(
                f"actions have shape {actions.shape} and dtype {actions.dtype}: expected ({self.num_envs},) integers."
            )
        if actions.min() < 0 or actions.max() >= self.table.n_actions:
            raise InvalidInput(
                f"actions range from {actions.min()} to {actions.max()}: expected 0 to {self.table.n_actions - 1}."
            )
        self._actions = actions

    def step_wait(self) -> tuple[Any, np.ndarray, np.ndarray, list[dict[str, Any]]]:
        """Step all copies; those that end begin anew at once."""
        following = self._successors.draw(self._rows, self._actions, self._rng)
        rewards = self.reward.pay(self._rows, self._actions, following)
        self._elapsed += 1
        self._returns += rewards
        terminated = self.table.terminal[following]
        dones = terminated | (self._elapsed >= self._limit)
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        ended = np.flatnonzero(dones)
        if ended.size:
            self._finish(ended, following, terminated, infos)
            following = following.copy()
            following[ended] = self._successors.start(ended.size, self._rng)
        self._rows = following
        return self._observe(following), rewards.astype(np.float32), dones, infos

    def _finish(self, ended: np.ndarray, following: np.ndarray, terminated: np.ndarray, infos: list[dict[str, Any]]) -> None:
        """Write the infos of episodes that ended, and clear their counters."""
        last = self._observe(following[ended])
        elapsed = round(time.time() - self._began, 6)
        for i, copy in enumerate(ended.tolist()):
            final = {key: values[i] for key, values in last.items()} if isinstance(last, dict) else last[i]
            infos[copy] = {
                "terminal_observation": final,
                "TimeLimit.truncated": not terminated[copy],
                "episode": {"r": float(self._returns[copy]), "l": int(self._elapsed[copy]), "t": elapsed},
            }
        self._returns[ended] = 0.0
        self._elapsed[ended] = 0

    def close(self) -> None:
        """Nothing to close."""

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """The attribute, once for each copy: they share it."""
        return [getattr(self, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Refused: copies share everything.

        Raises:
            InvalidInput: always.
        """
        raise InvalidInput(f"attribute {attr_name!r} cannot be set on single copies: they share one table. Make a new env.")

    def env_method(self, method_name: str, *method_args: Any, indices: Any = None, **method_kwargs: Any) -> list[Any]:
        """Call a method of this environment, once for each copy."""
        return [getattr(self, method_name)(*method_args, **method_kwargs) for _ in self._get_indices(indices)]

    def env_is_wrapped(self, wrapper_class: type[gym.Wrapper], indices: Any = None) -> list[bool]:
        """True for Monitor, whose episode infos this environment gives itself."""
        return [issubclass(wrapper_class, Monitor) for _ in self._get_indices(indices)]

    def get_images(self) -> Sequence[np.ndarray | None]:
        """No pictures."""
        return [None] * self.num_envs


def shows_rows(states: States) -> bool:
    """Are rows better shown than observations? Yes, but for numbers from 0, the only ones that SB3 encodes, and floats."""
    space = states.space
    from_0 = isinstance(space, spaces.Discrete) and space.start == 0
    return not from_0 and not (isinstance(space, spaces.Box) and space.dtype.kind == "f")
