"""Measure what a user's own DQN earns on the learned reward, by the README's lines, against DQN on the true reward.

    python scripts/measure_own_agent.py --seeds 3

Three small environments; on each DQN of Stable-Baselines3 is trained with the same settings, steps and seeds on the true
reward, on `LearnedReward(env, result, shaping=table)`, and on `LearnedReward(env, result)`, the reward as it is. A score is the
exact value of the greedy policy under the true reward, 0 for random actions and 1 for the best policy. Exits with 1 where the
mean score of the shaped reward is below 0.9 of that of the true reward in an environment. About seven minutes on one core.
"""

import sys
from dataclasses import dataclass

import gymnasium as gym
import numpy as np
import torch
import tyro
from rich.progress import track
from stable_baselines3 import DQN

from irl_gym import FiniteLP, LearnedReward, policy_iteration, tabulate
from irl_gym.agents.planners import tabular_actions
from irl_gym.checks import checked_number
from irl_gym.commands.terminal import print_table
from irl_gym.judging.metrics import normalised_score, policy_value, random_value

BAR = 0.9
ENVIRONMENTS = {
    "FrozenLake 4x4": ("FrozenLake-v1", {"is_slippery": False, "max_episode_steps": 100}),
    "CliffWalking": ("CliffWalking-v1", {"max_episode_steps": 100}),
    "GridWorld 5x5, slip 0.1": ("irl_gym_envs:irl_gym/GridWorld-v0", {"slip": 0.1, "max_episode_steps": 100}),
}
SETTINGS = {
    "learning_rate": 1e-3, "buffer_size": 20_000, "learning_starts": 500, "batch_size": 64, "target_update_interval": 250,
    "exploration_fraction": 0.4, "exploration_final_eps": 0.05, "policy_kwargs": {"net_arch": [64]}, "device": "cpu",
}  # fmt: skip
"""Of all trainings alike."""


@dataclass(frozen=True)
class Arguments:
    """Measure what a user's own DQN earns on the learned reward."""

    seeds: int = 3
    """Seeds 0, 1, ... of each training."""
    steps: int = 20_000
    """Environment steps of each."""
    gamma: float = 0.95
    """Discount of tables and agents."""

    def __post_init__(self) -> None:
        for name in ("seeds", "steps"):
            checked_number(name, getattr(self, name), "a whole number of at least 1", least=1, whole=True)


def scores(arguments: Arguments, env_id: str, kwargs: dict) -> dict[str, list[float]]:
    """The scores of the agents by what they were paid, one a seed."""
    env = gym.make(env_id, **kwargs)
    table = tabulate(env, gamma=arguments.gamma)
    expert = policy_iteration(table.mdp, table.reward)
    result = FiniteLP().fit(table.mdp, expert.policy)
    best, chance = float(table.mdp.d0 @ expert.V), random_value(table.mdp, table.reward)
    paid = {"true": env, "shaped": LearnedReward(env, result, shaping=table), "as it is": LearnedReward(env, result)}
    found: dict[str, list[float]] = {name: [] for name in paid}
    for name, trained_on in paid.items():
        for seed in range(arguments.seeds):
            agent = DQN("MlpPolicy", trained_on, gamma=arguments.gamma, seed=seed, **SETTINGS).learn(arguments.steps)
            value = policy_value(table.mdp, table.reward, tabular_actions(agent, table.states))
            found[name].append(normalised_score(value, chance, best))
    return found


def main() -> None:
    """Train, print the scores, and compare them with the bar."""
    arguments = tyro.cli(Arguments)
    torch.set_num_threads(1)
    rows, fine = [], True
    for name, (env_id, kwargs) in track(ENVIRONMENTS.items(), "environments"):
        found = scores(arguments, env_id, kwargs)
        shaped, true = float(np.mean(found["shaped"])), float(np.mean(found["true"]))
        fine &= shaped >= BAR * true
        ratio = f"{shaped / true:.3f}" if true > 0 else "true not learned"
        rows.append([name, *(" ".join(f"{one:.2f}" for one in some) for some in found.values()), ratio])
    print_table("Scores of DQN by what it was paid", ("environment", "true", "shaped", "as it is", "shaped / true"), rows)
    sys.exit(0 if fine else 1)


if __name__ == "__main__":
    main()
