"""A world that can be set to any state and run: a generative model (Kearns, Mansour & Ng 2002).

Axes: N states at once, d coordinates of a state, K features.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import gymnasium as gym
import numpy as np

from irl_gym.environments.physics import Physics, physics_of
from irl_gym.errors import InvalidParameter, InvalidPolicy
from irl_gym.features.feature_maps import FeatureMap, checked_features
from irl_gym.mdp.policies import Policy
from irl_gym.mdp.tabular_mdp import check_discount
from irl_gym.programs.killable import check_limit
from irl_gym.spaces.coordinates import IntegerCoordinate


@dataclass(frozen=True, eq=False)
class GenerativeModel:
    """An environment whose state can be set, with a discount.

    Raises:
        InvalidDiscount: gamma outside (0, 1).
        NotSettable: the environment keeps its state where nobody can set it (when first used).
    """

    env: gym.Env
    """A private copy is run, never the environment itself."""
    gamma: float
    """Discount; no environment carries one."""
    bounds: Mapping[str, Sequence[float]] | None = None
    """Low and high of coordinates by name, where the environment's own are infinite or too wide."""

    def __post_init__(self) -> None:
        check_discount(self.gamma)

    @cached_property
    def physics(self) -> Physics:
        """The world itself."""
        return physics_of(self.env, bounds=self.bounds)

    def states(self, n: int, rng: np.random.Generator) -> np.ndarray:
        """(n, d) states drawn uniformly within the bounds, which should hold no terminal ones: a world does not name these.

        Raises:
            InvalidParameter: states that are whole numbers, among which it would draw ends.
        """
        where = self.physics.coordinates
        if isinstance(where, IntegerCoordinate):
            raise InvalidParameter(
                f"S_0 is {n}, to be drawn, but the states of {type(self.env.unwrapped).__name__} are whole numbers, some of "
                "them ends: expected the states themselves, as (m, 1) numbers. Or use a table."
            )
        return rng.uniform(where.low, where.high, size=(n, len(where.low)))

    def actions(self, policy: Policy, states: np.ndarray) -> np.ndarray:
        """(N,) what a policy does, deterministically, in states (N, d).

        Raises:
            InvalidPolicy: anything but one of the actions for each state.
        """
        chosen, _ = policy.predict(self.physics.coordinates.observe(states), deterministic=True)
        actions, n = np.asarray(chosen), self.physics.n_actions
        if actions.shape != (len(states),) or actions.dtype.kind not in "iub" or not ((actions >= 0) & (actions < n)).all():
            raise InvalidPolicy(
                f"the policy gave {str(actions)[:90]} for {len(states)} observations: expected as many actions, 0 to {n - 1}."
            )
        return actions.astype(np.int64)

    def continuations(
        self,
        policy: Policy,
        features: FeatureMap,
        states: np.ndarray,
        action: int,
        *,
        n: int,
        horizon: int,
        rng: np.random.Generator,
    ) -> np.ndarray:
        """(N, K) mean over n rollouts of sum_t gamma^t phi(s_t), where s_0 is the successor of a state under an action.

        All rollouts take all steps, so that one seed gives every action the same random numbers; those that have ended take
        them from where they began, since a world may refuse a step after its end.

        Args:
            policy: acts from s_0 on, deterministically.
            features: phi of observations.
            states: (N, d).
            action: the first, in every state.
            n: rollouts from each state.
            horizon: steps at most after s_0.
            rng: of the world.
        """
        physics, observe = self.physics, self.physics.coordinates.observe
        repeated = np.repeat(states, n, axis=0)
        moves = physics.transition(repeated, np.full(len(repeated), action), rng)
        alive, here = ~moves.terminated, moves.states
        sums = checked_features(features, observe(here))
        weight = 1.0
        for _ in range(horizon):
            check_limit()
            if not alive.any():
                break
            weight *= self.gamma
            moving = np.where(alive[:, None], here, repeated)
            moves = physics.transition(moving, self.actions(policy, moving), rng)
            here = np.where(alive[:, None], moves.states, here)
            sums[alive] += weight * checked_features(features, observe(here[alive]))
            alive &= ~moves.terminated
        return sums.reshape(len(states), n, -1).mean(axis=1)


def least_horizon(gamma: float, share: float = 0.01) -> int:
    """The least H with gamma^H <= share: cutting there costs at most `share` of the largest value R_max / (1 - gamma)."""
    return int(np.ceil(np.log(share) / np.log(gamma)))


def truncation_bound(gamma: float, horizon: int, r_max: Any = 1.0) -> float:
    """What values lose at most when sums are cut after step H: gamma^(H+1) R_max / (1 - gamma) (footnote 2)."""
    return float(gamma ** (horizon + 1) * r_max / (1 - gamma))
