"""Glances at an agent as it trains: the points of its learning curve.

On a table only the agent's actions are kept while it trains, and the episodes of all points are drawn afterwards, together:
stepping thousands of episodes at once takes a hundredth of the time of stepping a hundred, point by point.
"""

import time
from collections.abc import Callable, Mapping

import numpy as np

from irl_gym.agents.checkpoint_checks import LARGEST, MOST, numbers
from irl_gym.errors import DamagedFile
from irl_gym.judging.curves import Curve, curve_of
from irl_gym.loop.worlds import RunWorld
from irl_gym.mdp.policies import Policy

SELDOM = 200
"""Times as long as it takes to draw the episodes of one point, before they are drawn again only to be told of."""


class Glances:
    """What the agent was worth at each point, under the true reward, which judges it and does not steer.

    Args:
        world: where it trains.
        told: called with the steps made so far and what is known of the agent's true return.
    """

    def __init__(self, world: RunWorld, told: Callable[[int, str], None]):
        self.world, self.told = world, told
        self._updates: int | None = None
        self._steps: list[int] = []
        self._values: list[float] = []
        self._glanced: list[np.ndarray] = []
        self._returned, self._again = "", 0.0

    def see(self, steps: int, policy: Policy) -> None:
        """Judge the policy as it is after some environment steps; one that was not updated since the last time is as it was."""
        updates = getattr(getattr(policy, "model", None), "_n_updates", None)  # SB3 counts its gradient steps there
        if updates is not None and updates == self._updates:
            value, glanced = self._values[-1], self._glanced[-1]
        else:
            value, glanced = self.world.glance(policy)
        self._updates = updates
        self._steps.append(steps)
        self._values.append(value)
        self._glanced.append(glanced)
        self.told(steps, self._return_of(glanced))

    def _return_of(self, glanced: np.ndarray) -> str:
        """The mean true return of the last point whose episodes were drawn, and its step: seldom, so that it takes no time."""
        start = time.monotonic()
        if start >= self._again:
            (returns,), _ = self.world.returns([glanced])
            self._returned = f"mean return {np.mean(returns):.4g} after {self._steps[-1]:,} steps"
            self._again = start + SELDOM * (time.monotonic() - start)
        return self._returned

    def arrays(self) -> Mapping[str, np.ndarray]:
        """All points so far, as a checkpoint keeps them."""
        if not self._steps:
            return {}
        updates = np.array(-1 if self._updates is None else self._updates)
        return {"steps": np.array(self._steps), "values": np.array(self._values), "glanced": np.stack(self._glanced),
                "updates": updates}  # fmt: skip

    def take(self, arrays: Mapping[str, np.ndarray]) -> None:
        """Go on from the points of a checkpoint.

        Raises:
            DamagedFile: they are none of this world.
        """
        if not arrays:
            return
        steps, values = (numbers(arrays, name, (None,), kind, 0 if kind == "iu" else -LARGEST, LARGEST)
                         for name, kind in (("steps", "iu"), ("values", "f")))  # fmt: skip
        mdp, updates = self.world.mdp, int(numbers(arrays, "updates", (), "iu", -1, MOST))
        if mdp is None:
            glanced = numbers(arrays, "glanced", (len(steps), None))
        else:
            glanced = numbers(arrays, "glanced", (len(steps), mdp.n_states), "iu", 0, mdp.n_actions - 1)
        if len(values) != len(steps):
            raise DamagedFile(f"its values are {len(values)}: expected {len(steps)}")
        self._steps, self._values, self._glanced = steps.tolist(), values.tolist(), list(glanced)
        self._updates = None if updates < 0 else updates

    def curve(self) -> Curve:
        """All points, with the returns of sampled episodes."""
        return curve_of(self._steps, self._values, *self.world.returns(self._glanced))
