"""Glances at an agent as it trains: the points of its learning curve.

On a table only the agent's actions are kept while it trains, and the episodes of all points are drawn afterwards, together:
stepping thousands of episodes at once takes a hundredth of the time of stepping a hundred, point by point.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from irl_gym.curves import EPISODES, Curve, curve_of, sampled_returns, two_returns
from irl_gym.planners import tabular_actions
from irl_gym.policies import Policy
from irl_gym.worlds import GLANCE, SteppedWorld, TableWorld, discounted_mean, step_limit


class Glances:
    """What the agent was worth at each point, under the true reward, which judges it and does not steer.

    Args:
        world: where it trains.
        told: called with the steps and the policy too.
    """

    def __init__(self, world: TableWorld | SteppedWorld, told: Callable[[int, Policy], None]):
        self.world, self.told = world, told
        self._updates: int | None = None
        self._steps: list[int] = []
        self._values: list[float] = []
        self._actions: list[np.ndarray] = []
        self._returns: list[np.ndarray] = []

    def see(self, steps: int, policy: Policy) -> None:
        """Judge the policy as it is after some environment steps; one that was not updated since the last time is as it was."""
        self.told(steps, policy)
        self._steps.append(steps)
        updates = getattr(getattr(policy, "model", None), "_n_updates", None)  # SB3 counts its gradient steps there
        if updates is not None and updates == self._updates:
            kept: list[Any]
            for kept in (self._values, self._actions, self._returns):
                kept.extend(kept[-1:])
            return
        self._updates = updates
        if isinstance(self.world, TableWorld):
            actions = tabular_actions(policy, self.world.table.states)
            self._actions.append(actions.astype(np.min_scalar_type(self.world.table.mdp.n_actions)))
            self._values.append(self.world.value(actions))
            return
        episodes = self.world.episodes(policy, GLANCE, self.world.seed + 7_919)
        self._values.append(discounted_mean(episodes, self.world.gamma))
        self._returns.append(np.array([episode.total_reward for episode in episodes]))

    def curve(self) -> Curve:
        """All points; on a table with the returns of sampled episodes."""
        world, returns, possible = self.world, self._returns, None
        if isinstance(world, TableWorld):
            limit, possible = step_limit(world.env), two_returns(world.table)
            returns = sampled_returns(world.table, self._actions, EPISODES, limit=limit, seed=world.seed + 7_919)
        return curve_of(self._steps, self._values, returns, possible)
