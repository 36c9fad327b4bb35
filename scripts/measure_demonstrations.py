"""Measure the loop on environments that publish no table, and from a dataset alone.

    python scripts/measure_demonstrations.py --parts environments datasets --seeds 3

Scores are exact true values of endless episodes, gamma 0.99: random = 0, optimal = 1.
"""

import sys
import tempfile
from dataclasses import dataclass
from itertools import islice, product
from pathlib import Path
from typing import Literal

import gymnasium as gym
import tyro
from gymnasium import spaces
from rich.console import Console
from rich.table import Table

from irl_gym import Experiment, FiniteLP, IrlGymError, policy_iteration, recover_and_retrain, tabulate, write_minari
from irl_gym.agents.noise import noisy
from irl_gym.commands.demonstrating.demonstrators import Recording
from irl_gym.judging.metrics import normalised_score, policy_value, random_value
from irl_gym.mdp.policies import load_actions

GAMMA, GRID, CLASSIC = 0.99, "irl_gym_envs:irl_gym/MiniGrid-v0", "irl_gym_envs.gym_classics:"
RULES: dict[str, dict] = {"sab": {}, "natural": {"sab": False, "natural": True}}  # Blackjack-v1 is registered with sab
MADE = {f"Blackjack, {rules}": ("Blackjack-v1", made) for rules, made in RULES.items()}
MADE |= {f"MiniGrid {task}": (GRID, {"task": task}) for task in ("Empty-8x8", "FourRooms", "DoorKey-5x5", "DoorKey-6x6")}
MADE |= {name: (f"{CLASSIC}{name}-v0", {}) for name in ("ClassicGridworld", "DynaMaze", "WindyGridworldKingsStochastic")}
MADE |= {"Taxi, fickle": ("Taxi-v4", {"fickle_passenger": True}), "a user's own machine": ("Machine-v0", {})}
KNOWN: dict[str, tuple[str, dict]] = {
    "FrozenLake 8x8 slippery": ("FrozenLake-v1", {"map_name": "8x8"}),
    "Taxi": ("Taxi-v4", {}),
}
HEADINGS = {
    "environments": "environment|scores of agents|worst tie's regret|states|table, s|agent, s",
    "datasets": "dataset|noise|episodes|expert|agents, FiniteLP(slack=1.0)|agents, FiniteLP(slack=None)",
}


class Machine(gym.Env):
    """A user's own, in ten lines: run it for 1, or mend it for -1; worn to 9, it breaks for good."""

    observation_space, action_space = spaces.Discrete(10), spaces.Discrete(2)

    def reset(self, *, seed=None, options=None):
        """Begin as new."""
        super().reset(seed=seed)
        self.wear = 0
        return self.wear, {}

    def step(self, action):
        """Run (0) or mend (1)."""
        self.wear = min(9, self.wear + int(self.np_random.integers(4))) if action == 0 else 0
        return self.wear, 1.0 if action == 0 else -1.0, self.wear == 9, False, {}


@dataclass(frozen=True)
class Arguments:
    """What to measure."""

    parts: tuple[Literal["environments", "datasets"], ...] = ("environments", "datasets")
    """Which tables to print."""
    seeds: int = 3
    """Runs of the loop, each from episodes of its own."""


def on_environment(name: str, seeds: int, folder: Path) -> list[str]:
    """Scores of the retrained agents; the worst tie's regret and seconds are the most of any run."""
    asked = [Experiment(MADE[name][0], GAMMA, MADE[name][1], seed=seed) for seed in range(seeds)]
    runs = [recover_and_retrain(one, folder / one.name) for one in asked]
    regret = max(run.metrics["reward"]["worst_tie_regret_share"] for run in runs)
    seconds = [f"{max(run.stages[stage]['seconds'] for run in runs):.1f}" for stage in ("table", "agent")]
    told = " ".join(f"{run.metrics['policies']['retrained']['score']:.3f}" for run in runs)
    return [name, told, f"{regret:.2%}", f"{runs[0].metrics['table']['states']:,}", *seconds]


def from_dataset(name: str, epsilon: float, episodes: int, seeds: int, folder: Path) -> list[str]:
    """Scores of the demonstrating expert and of the agents retrained from its episodes."""
    env = gym.make(KNOWN[name][0], **KNOWN[name][1])
    table = tabulate(env, gamma=GAMMA, check_steps=0)
    mdp, reward, best = table.mdp, table.reward, policy_iteration(table.mdp, table.reward).policy
    ends = random_value(mdp, reward), policy_value(mdp, reward, best)
    own = normalised_score(policy_value(mdp, reward, noisy(best, epsilon, mdp.n_actions)), *ends)
    found: dict[float | None, list[str]] = {1.0: [], None: []}
    for seed in range(seeds):
        dataset = f"measured/{name.split()[0].lower()}-{int(100 * epsilon)}-{episodes}-{seed}-v0"
        drawn = Recording("value-iteration", GAMMA, epsilon, seed).demonstrator(env, folder).episodes(0)
        write_minari(islice(drawn, episodes), dataset, env, root=folder, algorithm="value-iteration")
        for slack, told in found.items():
            asked = Experiment(None, GAMMA, dataset=dataset, dataset_root=str(folder), learner=FiniteLP(slack=slack), seed=seed)
            try:
                run = recover_and_retrain(asked, folder / asked.name)
                value = policy_value(mdp, reward, load_actions(run.out / "agent_policy.npz"))
                told.append(f"{normalised_score(value, *ends):.3f}")
            except IrlGymError as error:
                told.append(type(error).__name__)
    return [name, f"{epsilon:.0%}", f"{episodes:,}", f"{own:.3f}", *(" ".join(told) for told in found.values())]


if __name__ == "__main__":
    asked = tyro.cli(Arguments, description=__doc__)
    gym.register("Machine-v0", f"{__name__}:Machine")
    for part in asked.parts:
        shown = Table(*HEADINGS[part].split("|"))
        with tempfile.TemporaryDirectory() as place:
            kinds = product(KNOWN, (0.0, 0.1), (10, 100, 1_000))
            own = (on_environment(name, asked.seeds, Path(place)) for name in MADE)
            for row in own if part == "environments" else (from_dataset(*kind, asked.seeds, Path(place)) for kind in kinds):
                shown.add_row(*row)
                print(*row, sep=", ", file=sys.stderr)
        Console(width=150).print(shown)
