"""Measure the loop on every environment: worst-tie regret, retrained score, and learning speed against the true reward.

    python scripts/measure_retraining.py --seeds 3

Learned and true reward get the same budget, seeds and PPO settings. These suit the shaped learned reward, so the true reward is
trained on a second time with normalised advantages and less entropy, which suit it better: "true, tuned".
"""

import sys
import time
from dataclasses import dataclass

import gymnasium as gym
import numpy as np
import tyro
from rich.console import Console
from rich.table import Table

from irl_gym import SB3, ExpectedAdvantage, FiniteLP, TabularVecEnv, policy_iteration, tabulate, worst_tie
from irl_gym.metrics import normalised_score, policy_value, random_value
from irl_gym.planners import FOR_ADVANTAGES, tabular_actions

ENVIRONMENTS = {
    "FrozenLake 4x4 slippery": ("FrozenLake-v1", {"map_name": "4x4"}),
    "FrozenLake 4x4": ("FrozenLake-v1", {"map_name": "4x4", "is_slippery": False}),
    "FrozenLake 8x8 slippery": ("FrozenLake-v1", {"map_name": "8x8"}),
    "FrozenLake 8x8": ("FrozenLake-v1", {"map_name": "8x8", "is_slippery": False}),
    "CliffWalking": ("CliffWalking-v1", {}),
    "CliffWalking slippery (s, a)": ("CliffWalkingSlippery-v1", {}),
    "Taxi-v4": ("Taxi-v4", {}),
    "GridWorld": ("irl_gym_envs:irl_gym/GridWorld-v0", {}),
    "FourRooms": ("irl_gym_envs:irl_gym/FourRooms-v0", {}),
}
HEADINGS = (
    "environment", "expert", "random", "worst-tie regret", "score, learned reward", "seconds",
    "steps to 0.9, learned", "steps to 0.9, true", "score, true", "steps to 0.9, true, tuned", "score, true, tuned",
)  # fmt: skip


@dataclass(frozen=True)
class Arguments:
    """What to measure."""

    seeds: int = 3
    """Retrained agents for each environment and reward."""
    total_timesteps: int = 200_000
    """Environment steps of each."""
    gamma: float = 0.99
    """Discount."""


def train(table, reward, limit, gamma, seed, steps, settings, scale):
    """One agent: its final score, steps to 0.9 (NaN if never) and seconds."""
    curve = []

    def watch(done, policy):
        actions = tabular_actions(policy, table.states)
        curve.append((done, normalised_score(policy_value(table.mdp, table.reward, actions), *scale)))

    env = TabularVecEnv(table.mdp, reward, num_envs=64, max_episode_steps=limit, seed=seed)
    start = time.perf_counter()
    SB3("PPO", steps, settings).plan(env, gamma=gamma, seed=seed, progress=watch)
    first = next((done for done, score in curve if score >= 0.9), np.nan)
    return curve[-1][1], first, time.perf_counter() - start


def row(name: str, arguments: Arguments) -> list[str]:
    """All figures of one environment."""
    env_id, kwargs = ENVIRONMENTS[name]
    env = gym.make(env_id, **kwargs)
    table = tabulate(env, gamma=arguments.gamma)
    best = policy_iteration(table.mdp, table.reward.values)
    expert, random = float(table.mdp.d0 @ best.V), random_value(table.mdp, table.reward)
    result = FiniteLP(reward_on="state-action" if "(s, a)" in name else "state").fit(table.mdp, best.policy)
    regret = (expert - worst_tie(table.mdp, result.reward, table.reward).value) / (expert - random)
    shaped = ExpectedAdvantage(result.certificate.margin_cap).apply(result.reward, table.mdp)
    limit = (env.spec.max_episode_steps if env.spec else None) or 500

    def agents(reward, settings):
        made = [
            train(table, reward, limit, arguments.gamma, seed, arguments.total_timesteps, settings, (random, expert))
            for seed in range(arguments.seeds)
        ]
        return np.array(made)

    learned = agents(shaped, FOR_ADVANTAGES)
    true, tuned = agents(table.reward, FOR_ADVANTAGES), agents(table.reward, {})
    cells = [
        name,
        f"{expert:.4f}",
        f"{random:.4f}",
        f"{regret:.2%}",
        scores(learned),
        f"{learned[:, 2].max():.0f}",
        steps(learned),
    ]
    return [*cells, steps(true), scores(true), steps(tuned), scores(tuned)]


def steps(made: np.ndarray) -> str:
    """Environment steps to 0.9 of each agent."""
    return " ".join("never" if np.isnan(one) else f"{one / 1000:.0f}k" for one in made[:, 1])


def scores(made: np.ndarray) -> str:
    """Final score of each agent."""
    return " ".join(f"{one:.3f}" for one in made[:, 0])


if __name__ == "__main__":
    asked = tyro.cli(Arguments, description=__doc__)
    shown = Table(*HEADINGS)
    for environment in ENVIRONMENTS:
        shown.add_row(*row(environment, asked))
        print(environment, file=sys.stderr)
    Console(width=190).print(shown)
