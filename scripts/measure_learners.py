"""Measure what FeatureLP and TrajectoryLP recover, and how long FeatureLP takes on large tables.
Scores are exact true values of the policy greedy under the recovered reward: random = 0, expert = 1, gamma 0.99.
"""

import multiprocessing
import resource
import time
from collections.abc import Iterator
from itertools import product
from typing import Any, cast

import gymnasium as gym
import numpy as np
import tyro

from irl_gym import FeatureLP, Simulator, TrajectoryLP, ValueIteration, policy_iteration, tabulate, value_iteration, worst_tie
from irl_gym.agents.planners import tabular_actions
from irl_gym.commands.terminal import print_table
from irl_gym.features.bases import Fourier, Polynomial, RadialBasis
from irl_gym.features.feature_maps import FeatureMap, OneHot, Unravel
from irl_gym.judging.metrics import normalised_score, policy_value, random_value
from irl_gym.loop.table_world import step_limit
from irl_gym.mdp.episodes import collect_from_table
from irl_gym.mdp.optimality import certify
from irl_gym.mdp.policies import Policy

GAMMA = 0.99
ENVIRONMENTS: dict[str, tuple[str, dict, tuple[int, ...]]] = {
    "FrozenLake 8x8 slippery": ("FrozenLake-v1", {"map_name": "8x8"}, (8, 8)),
    "Taxi-v4": ("Taxi-v4", {}, (5, 5, 5, 4)),
    "FrozenLake 8x8": ("FrozenLake-v1", {"map_name": "8x8", "is_slippery": False}, (8, 8)),
    "CliffWalking": ("CliffWalking-v1", {}, (4, 12)),
    "FourRooms": ("irl_gym_envs:irl_gym/FourRooms-v0", {}, (13, 13)),
}


def maps(shape: tuple[int, ...]) -> dict[str, FeatureMap]:
    """The features measured, of coordinates 0 .. n - 1."""
    low, high, digits = [0.0] * len(shape), [n - 1.0 for n in shape], Unravel(shape)
    some: dict[str, FeatureMap] = {"one-hot": OneHot(int(np.prod(shape)))}
    some["Gaussians, 4 a coordinate"] = RadialBasis.grid(low, high, 4, coordinates=digits)
    return some | {"Fourier, order 3": Fourier(low, high, 3, digits), "polynomials, degree 3": Polynomial(low, high, 3, digits)}


class Known:
    """An environment's table, its expert, and the score of a policy."""

    def __init__(self, name: str):
        env_id, kwargs, self.shape = ENVIRONMENTS[name]
        self.env = gym.make(env_id, **kwargs)
        self.table = tabulate(self.env, gamma=GAMMA, check_steps=0)
        self.expert = policy_iteration(self.table.mdp, self.table.reward).policy
        mdp, reward = self.table.mdp, self.table.reward
        self._ends = (random_value(mdp, reward), policy_value(mdp, reward, self.expert))

    def score(self, policy: np.ndarray) -> float:
        """Between random and expert."""
        return normalised_score(policy_value(self.table.mdp, self.table.reward, policy), *self._ends)


def of_features() -> Iterator[tuple[str, ...]]:
    """Score and worst tie's score: the paper's program, then with capped margins."""
    for name in ENVIRONMENTS:
        known = Known(name)
        for features, phi in maps(known.shape).items():
            cells = []
            for cap in (None, "auto"):
                found = FeatureLP(phi, margin_cap=cap).fit(known.table.mdp, known.expert, states=known.table.states)
                learned = found.reward.tabular(known.table.states)
                greedy = policy_iteration(known.table.mdp, learned).policy
                worst = worst_tie(known.table.mdp, learned, known.table.reward).policy
                violated = certify(known.table.mdp, known.expert, learned).violated
                cells += [f"{known.score(greedy):.3f} / {known.score(worst):.3f}", str(violated.size)]
            yield name, f"{features}: {phi.n_features}", *cells


def of_trajectories() -> Iterator[tuple[str, ...]]:
    """Scores of the best round's policy from 500 episodes, three seeds."""
    for name, cap in product(("Taxi-v4", "FrozenLake 8x8 slippery", "FrozenLake 8x8"), (None, "auto")):
        known = Known(name)
        table, limit = known.table, step_limit(known.env)
        paid: Any = table.payments.entries
        told = []
        for seed in range(3):
            drawn = collect_from_table(table.mdp, paid, table.states, known.expert, 500, seed=seed, max_episode_steps=limit)
            learner = TrajectoryLP(OneHot(int(np.prod(known.shape))), gap_cap=cap, seed=seed)
            found = learner.fit(Simulator(known.env, ValueIteration(), GAMMA), drawn)
            told.append(f"{known.score(tabular_actions(cast(Policy, found.policy), table.states)):.3f}")
        yield name, str(cap), " ".join(told)


def large(size: int, centres: int, sample: int) -> tuple[str, ...]:
    """Seconds and peak memory of a fit on a square grid."""
    env: Any = gym.make("irl_gym_envs:irl_gym/GridWorld-v0", size=size).unwrapped
    mdp = env.mdp(GAMMA)
    expert = value_iteration(mdp, env.reward.expected(mdp), sweeps=50, tolerance=1e-6).policy
    phi = RadialBasis.grid([0, 0], [size - 1] * 2, centres, coordinates=Unravel((size, size)))
    begin = time.perf_counter()
    found = FeatureLP(phi, S_0=sample).fit(mdp, expert)
    seconds, peak = time.perf_counter() - begin, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    gap = f"{found.proof.duality_gap / found.proof.objective:.0e}"
    return f"{size**2:,}", f"{centres**2}", f"{sample:,}", f"{seconds:.1f} s", f"{peak:.2f} GB", gap


def of_size() -> Iterator[tuple[str, ...]]:
    """Each fit in a process of its own, for its peak memory."""
    for settings in ((500, 8, 20_000), (1000, 10, 2_000)):
        with multiprocessing.get_context("spawn").Pool(1) as pool:
            yield pool.apply(large, settings)


def main() -> None:
    """Measure all of it, and print tables."""
    scores = ("environment", "features", "paper: score / worst tie", "violated", "margin_cap='auto'", "violated")
    print_table("FeatureLP", scores, of_features())
    print_table("TrajectoryLP, 500 episodes, one-hot", ("environment", "gap_cap", "scores, 3 seeds"), of_trajectories())
    print_table("FeatureLP on grids", ("states", "features", "S_0", "fit", "peak memory", "relative gap"), of_size())


if __name__ == "__main__":
    tyro.cli(main, description=__doc__)
