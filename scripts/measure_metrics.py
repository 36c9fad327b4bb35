"""Measure the exact metrics and reward distances on a large grid: seconds each, and the peak of memory.

For example:
    python scripts/measure_metrics.py
    python scripts/measure_metrics.py --side 100
"""

import resource
import time
from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np
import tyro
from rich.console import Console
from rich.table import Table

from irl_gym import TabularReward, policy_iteration, tabulate
from irl_gym.judging.distances import MinimalNorm, dard, epic, spearman, starc
from irl_gym.judging.metrics import (
    agreement,
    best_tie,
    expected_value_difference,
    occupancy_distance,
    optimal_actions,
    policy_value,
    random_value,
    regret,
    tie_aware_agreement,
    worst_tie,
)


def main(side: int = 317, gamma: float = 0.99, seed: int = 0) -> None:
    """Time each metric and distance on a slippery grid with a learned reward that is the true one with noise.

    Args:
        side: of the square grid; 317 makes 100,489 states.
        gamma: discount.
        seed: of the noise.
    """
    console = Console()
    start = time.perf_counter()
    table = tabulate(gym.make("irl_gym_envs:irl_gym/GridWorld-v0", size=side), gamma=gamma, check_steps=0)
    console.print(f"{table.mdp}: made in {time.perf_counter() - start:.1f} s")
    mdp, true = table.mdp, table.reward
    arrival = np.zeros(mdp.n_states)
    arrival[mdp.terminal] = 1.0
    learned = TabularReward(arrival + np.random.default_rng(seed).normal(0, 0.01, mdp.n_states))
    policy, expert = (policy_iteration(mdp, reward).policy for reward in (learned, true))
    metrics: dict[str, Callable[[], Any]] = {
        "policy_value": lambda: policy_value(mdp, true, policy),
        "random_value": lambda: random_value(mdp, true),
        "regret, per state": lambda: regret(mdp, true, policy).value,
        "expected_value_difference": lambda: expected_value_difference(mdp, true, learned),
        "worst_tie": lambda: worst_tie(mdp, learned, true).value,
        "best_tie": lambda: best_tie(mdp, learned, true).value,
        "optimal_actions and agreement": lambda: agreement(mdp, policy, optimal_actions(mdp, true)),
        "tie_aware_agreement": lambda: tie_aware_agreement(mdp, learned, expert),
        "occupancy_distance": lambda: occupancy_distance(mdp, policy, expert),
        "EPIC": lambda: epic(mdp, learned, true),
        "DARD": lambda: dard(mdp, learned, true),
        "STARC, VAL": lambda: starc(mdp, learned, true),
        "STARC, minimal norm": lambda: starc(mdp, learned, true, canonical=MinimalNorm()),
        "Spearman": lambda: spearman(mdp, learned, true),
    }
    shown = Table(title=f"Exact metrics and distances, {mdp.n_states:,} states", title_justify="left")
    for heading in ("metric", "value", "seconds"):
        shown.add_column(heading, justify="left" if heading == "metric" else "right")
    for name, metric in metrics.items():
        start = time.perf_counter()
        value = metric()
        shown.add_row(name, f"{value:.6g}", f"{time.perf_counter() - start:.1f}")
    console.print(shown)
    console.print(f"peak memory {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20:.2f} GiB")


if __name__ == "__main__":
    tyro.cli(main, description=__doc__)
