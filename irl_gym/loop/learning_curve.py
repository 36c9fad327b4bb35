"""Glances at an agent as it trains: the points of its learning curve.

On a table only the agent's actions are kept while it trains, and the episodes of all points are drawn afterwards, together:
stepping thousands of episodes at once takes a hundredth of the time of stepping a hundred, point by point.
"""

from collections.abc import Callable

import numpy as np

from irl_gym.judging.curves import Curve, curve_of
from irl_gym.loop.worlds import RunWorld
from irl_gym.mdp.policies import Policy


class Glances:
    """What the agent was worth at each point, under the true reward, which judges it and does not steer.

    Args:
        world: where it trains.
        told: called with the steps and the policy too.
    """

    def __init__(self, world: RunWorld, told: Callable[[int, Policy], None]):
        self.world, self.told = world, told
        self._updates: int | None = None
        self._steps: list[int] = []
        self._values: list[float] = []
        self._glanced: list[np.ndarray] = []

    def see(self, steps: int, policy: Policy) -> None:
        """Judge the policy as it is after some environment steps; one that was not updated since the last time is as it was."""
        self.told(steps, policy)
        updates = getattr(getattr(policy, "model", None), "_n_updates", None)  # SB3 counts its gradient steps there
        if updates is not None and updates == self._updates:
            value, glanced = self._values[-1], self._glanced[-1]
        else:
            value, glanced = self.world.glance(policy)
        self._updates = updates
        self._steps.append(steps)
        self._values.append(value)
        self._glanced.append(glanced)

    def curve(self) -> Curve:
        """All points, with the returns of sampled episodes."""
        return curve_of(self._steps, self._values, *self.world.returns(self._glanced))
