"""Measure what is learned from states alone, beside what is learned from the same episodes with their actions.

Scores are exact true values of the policy that is optimal under the recovered reward, or of the clone: random = 0, expert = 1,
gamma 0.99. Then how long inference takes on a large table.
"""

import time
from collections.abc import Iterator
from typing import Any

import gymnasium as gym
import numpy as np
import scipy.sparse as sp
import tyro

from irl_gym import FeatureLP, FiniteLP, policy_iteration, tabulate, value_iteration
from irl_gym.commands.terminal import print_table
from irl_gym.demonstrations.inferred import infer, without_actions
from irl_gym.features.feature_maps import OneHot
from irl_gym.judging.metrics import normalised_score, policy_value, random_value
from irl_gym.learners.cloning.clone import Clone
from irl_gym.learners.problem import Problem
from irl_gym.loop.table_world import step_limit
from irl_gym.mdp.episodes import Episode, collect_from_table
from irl_gym.mdp.sampling import Successors
from irl_gym.mdp.tabular_mdp import TransitionTable
from irl_gym.spaces.states import StateIndex

GAMMA, WITHIN = 0.99, 0.01
ENVIRONMENTS: dict[str, tuple[str, dict]] = {
    "FrozenLake 8x8 slippery": ("FrozenLake-v1", {"map_name": "8x8"}),
    "Taxi-v4": ("Taxi-v4", {}),
    "CliffWalking slippery": ("CliffWalking-v1", {"is_slippery": True}),
}


def compared(episodes: int, seed: int) -> Iterator[tuple[str, ...]]:
    """Scores from episodes with actions and without."""
    for name, (env_id, kwargs) in ENVIRONMENTS.items():
        env = gym.make(env_id, **kwargs)
        table = tabulate(env, gamma=GAMMA, check_steps=0)
        mdp, expert = table.mdp, policy_iteration(table.mdp, table.reward).policy
        ends = random_value(mdp, table.reward), policy_value(mdp, table.reward, expert)
        unpaid, most = np.zeros(mdp.P.nnz), step_limit(env)
        given = [*collect_from_table(mdp, unpaid, table.states, expert, episodes, seed=seed, max_episode_steps=most)]
        alone = without_actions(given)
        inferred = infer(alone, table.states, mdp)
        learners: dict[str, Any] = {
            "FiniteLP": FiniteLP(slack=1.0), "FeatureLP": FeatureLP(OneHot(mdp.n_states), margin_cap="auto"), "Clone": Clone(),
        }  # fmt: skip
        for learner, one in learners.items():
            scores = []
            for shown in (given, alone):
                found = one.learn(Problem.of(table, demonstrations=shown))
                acting = found.policy
                if found.reward is not None:
                    acting = value_iteration(mdp, found.reward.tabular(table.states)).policy
                scores.append(float(normalised_score(policy_value(mdp, table.reward, acting), *ends)))
            difference = scores[1] - scores[0]
            steps = f"{inferred.clear:,} / {inferred.ambiguous:,}"
            yield (
                name, learner, *(f"{one:.4f}" for one in scores),
                f"{difference:+.4f}", "yes" if abs(difference) <= WITHIN else "no",
                steps, str(inferred.undecided.size),
            )  # fmt: skip


def large(n_states: int, n_actions: int, steps: int) -> tuple[str, ...]:
    """Seconds on a random table, and how many of the decided actions are those that were taken."""
    rng = np.random.default_rng(0)
    rows, each = n_states * n_actions, 4
    data = rng.dirichlet(np.ones(each), rows).ravel()
    P = sp.csr_array(
        (data, rng.integers(n_states, size=rows * each), np.arange(0, rows * each + 1, each)), shape=(rows, n_states)
    )
    table = TransitionTable(P, np.full(n_states, 1 / n_states))
    expert, draws = rng.integers(n_actions, size=n_states), Successors(table)
    walk = [rng.integers(n_states, size=steps // 1000)]
    for _ in range(1000):
        walk.append(draws.draw(walk[-1], expert[walk[-1]], rng))
    episodes = [Episode(one, None, np.zeros(1000), False, True) for one in np.array(walk).T]
    begin = time.perf_counter()
    found = infer(episodes, StateIndex(gym.spaces.Discrete(n_states)), table)
    seconds = time.perf_counter() - begin
    known = np.flatnonzero(np.isfinite(found.policy[:, 0]))
    right = found.policy[known, expert[known]] > 0
    return (
        f"{n_states:,} states, {n_actions} actions, {steps:,} steps", f"{seconds:.1f}", f"{found.short:.0e}", f"{known.size:,}",
        f"{found.undecided.size:,}", f"{right.mean():.4f}",
    )  # fmt: skip


def main(episodes: int = 1000, seed: int = 0) -> None:
    """Print both tables.

    Args:
        episodes: of the expert.
        seed: of them.
    """
    headings = ("environment", "learner", "with actions", "states alone", "difference", f"within {WITHIN}",
                "steps of one action / of several", "states undecided")  # fmt: skip
    print_table(f"Scores from {episodes:,} episodes", headings, list(compared(episodes, seed)))
    headings = ("table", "seconds", "nats a step at most", "states decided", "undecided", "share right")
    print_table("Actions inferred on a random table", headings, [large(100_000, 5, 2_000_000)])


if __name__ == "__main__":
    tyro.cli(main)
