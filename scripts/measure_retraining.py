"""Measure the loop on every environment: worst-tie regret, retrained score, and learning speed against the true reward.

    python scripts/measure_retraining.py --seeds 3

Steps to 0.9: after which the score stays there. Five ways to train, all with the same budget and seeds: the learned reward,
shaped by its expected advantage, as the pipeline does; the learned reward as it is; the true reward with the very same PPO
settings; the true reward with normalised advantages and less entropy, which suit it; the true reward, shaped in the same way.
"""

import sys
import time
from dataclasses import dataclass

import gymnasium as gym
import numpy as np
import tyro
from rich.console import Console
from rich.table import Table

from irl_gym import SB3, FiniteLP, TabularVecEnv, policy_iteration, tabulate, worst_tie
from irl_gym.agents.planners import FOR_ADVANTAGES, tabular_actions
from irl_gym.judging.metrics import normalised_score, policy_value, random_value
from irl_gym.mdp.shaping import ExpectedAdvantage
from irl_gym.runs.scorecard import settled_at

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
WAYS = ("learned, shaped", "learned", "true, same settings", "true, suited settings", "true, shaped")


@dataclass(frozen=True)
class Arguments:
    """What to measure."""

    seeds: int = 3
    """Retrained agents for each environment and reward."""
    total_timesteps: int = 200_000
    """Environment steps of each."""
    gamma: float = 0.99
    """Discount."""


def train(table, reward, limit, asked, seed, settings, scale):
    """One agent: its final score, steps after which it stays at 0.9 (NaN if it does not), and seconds."""
    curve = []

    def watch(done, policy):
        curve.append((done, policy_value(table.mdp, table.reward, tabular_actions(policy, table.states))))

    env = TabularVecEnv(table.mdp, reward, num_envs=64, max_episode_steps=limit, seed=seed)
    start = time.perf_counter()
    SB3("PPO", asked.total_timesteps, settings).plan(env, gamma=asked.gamma, seed=seed, progress=watch)
    seconds = time.perf_counter() - start
    return normalised_score(curve[-1][1], *scale), settled_at(np.array(curve), *scale) or np.nan, seconds


def row(name: str, asked: Arguments) -> list[str]:
    """All figures of one environment."""
    env_id, kwargs = ENVIRONMENTS[name]
    env = gym.make(env_id, **kwargs)
    table = tabulate(env, gamma=asked.gamma)
    best = policy_iteration(table.mdp, table.reward)
    expert, random = float(table.mdp.d0 @ best.V), random_value(table.mdp, table.reward)
    result = FiniteLP(reward_on="state-action" if "(s, a)" in name else "state").fit(table.mdp, best.policy)
    regret = (expert - worst_tie(table.mdp, result.reward, table.reward).value) / (expert - random)
    cap, scaled = float(result.proof.margin_cap or np.nan), float(np.abs(table.reward.values).max())
    shaped = ExpectedAdvantage(cap)
    rewards = {
        "learned, shaped": (shaped.apply(result.reward, table.mdp), FOR_ADVANTAGES),
        "learned": (result.reward, {}),
        "true, same settings": (table.reward, FOR_ADVANTAGES),
        "true, suited settings": (table.reward, {}),
        "true, shaped": (
            ExpectedAdvantage(cap * scaled).apply(table.reward, table.mdp),
            FOR_ADVANTAGES,
        ),
    }
    limit = (env.spec.max_episode_steps if env.spec else None) or 500
    cells = [name, f"{regret:.2%}"]
    for way in WAYS:
        made = np.array([
            train(table, rewards[way][0], limit, asked, seed, rewards[way][1], (random, expert)) for seed in range(asked.seeds)
        ])  # fmt: skip
        steps = ["never" if np.isnan(one) else f"{one / 1000:.0f}k" for one in made[:, 1]]
        scores = [f"{one:.3f}" for one in made[:, 0]]
        cells.append(" ".join(steps) + "\n" + " ".join(scores) + (f"\n{made[:, 2].max():.0f} s" if way == WAYS[0] else ""))
    return cells


if __name__ == "__main__":
    asked = tyro.cli(Arguments, description=__doc__)
    shown = Table(
        "environment", "worst-tie regret", *WAYS, title="steps after which the score stays at 0.9; final score", show_lines=True
    )
    for environment in ENVIRONMENTS:
        shown.add_row(*row(environment, asked))
        print(environment, file=sys.stderr)
    Console(width=170).print(shown)
