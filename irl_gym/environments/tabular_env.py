"""A table and a reward back to a Gymnasium environment.

The episode starts in a state drawn from d0, a step draws s' from P(. | s, a) and pays the reward, and it ends with
`terminated` on arrival in a terminal state. There is no time limit here: wrap it in Gymnasium's TimeLimit, or give
`max_episode_steps` when registering.
"""

from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces

from irl_gym.errors import InvalidInput
from irl_gym.mdp.rewards import TabularReward, as_reward
from irl_gym.mdp.sampling import Successors
from irl_gym.mdp.tabular_mdp import TabularMDP, TransitionTable


class TabularEnv(gym.Env[Any, Any]):
    """An environment that is its table: observations are the states, actions the actions.

    Args:
        table: a TransitionTable or a TabularMDP (its discount is not used: no environment has one).
        reward: (S,) paid on arrival, or (S, A).
        render_mode: for subclasses that draw.

    Raises:
        InvalidReward: a reward of another shape than the table's.
    """

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012 (Gymnasium's own convention)

    def __init__(self, table: TransitionTable, reward: TabularReward | np.ndarray, render_mode: str | None = None):
        reward = as_reward(reward)
        reward.expected(table)  # checks the shape
        self.table, self.reward, self.render_mode = table, reward, render_mode
        self.observation_space = spaces.Discrete(table.n_states)
        self.action_space = spaces.Discrete(table.n_actions)
        self.initial_state_distrib = table.d0
        self.s: int | None = None
        self.last_action: int | None = None
        self._successors = Successors(table)

    def mdp(self, gamma: float) -> TabularMDP:
        """The table with a discount.

        Raises:
            InvalidDiscount: gamma outside (0, 1).
        """
        return TabularMDP(self.table.P, gamma, self.table.d0, self.table.visits)

    @property
    def P(self) -> dict[int, dict[int, list[tuple[float, int, float, bool]]]]:
        """The table in Gymnasium's form, `P[s][a] = [(probability, successor, reward, terminated), ...]`.

        A terminal state loops on itself without reward, as in FrozenLake. Made anew at each call.
        """
        return {s: {a: self._lines(s, a) for a in range(self.table.n_actions)} for s in range(self.table.n_states)}

    def _lines(self, s: int, a: int) -> list[tuple[float, int, float, bool]]:
        if self.table.terminal[s]:
            return [(1.0, s, 0.0, True)]
        row = s * self.table.n_actions + a
        part = slice(self.table.P.indptr[row], self.table.P.indptr[row + 1])
        return [
            (float(p), int(following), float(self.reward.pay(s, a, following)), bool(self.table.terminal[following]))
            for p, following in zip(self.table.P.data[part], self.table.P.indices[part], strict=True)
        ]

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[int, dict[str, Any]]:
        """Begin an episode in a state drawn from d0, or in `options["state"]`.

        Raises:
            InvalidInput: a state that does not exist or is terminal.
        """
        super().reset(seed=seed)
        wanted = None if options is None else options.get("state")
        if wanted is not None and (not self.observation_space.contains(wanted) or self.table.terminal[wanted]):
            raise InvalidInput(
                f'options["state"] is {wanted!r}: expected a state from 0 to {self.table.n_states - 1} that is not terminal.'
            )
        self.s = int(self._successors.start(1, self.np_random)[0]) if wanted is None else int(wanted)
        self.last_action = None
        return self.s, {}

    def step(self, action: Any) -> tuple[int, float, bool, bool, dict[str, Any]]:
        """Draw a successor and pay the reward.

        Raises:
            InvalidInput: an action outside the action space, before reset, or after the end of an episode.
        """
        if not self.action_space.contains(action):
            raise InvalidInput(f"action is {action!r}: expected an integer from 0 to {self.table.n_actions - 1}.")
        if self.s is None or self.table.terminal[self.s]:
            raise InvalidInput(f"step in state {self.s}: no episode is under way. Call reset first.")
        a = int(action)
        following = int(self._successors.draw(np.array([self.s]), np.array([a]), self.np_random)[0])
        paid = float(self.reward.pay(self.s, a, following))
        self.s, self.last_action = following, a
        return following, paid, bool(self.table.terminal[following]), False, {}
