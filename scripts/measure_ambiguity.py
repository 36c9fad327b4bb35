"""Measure how long the instruments of `irl_gym.judging.ambiguity` take, and what they find in Ng & Russell's first experiment.

For example:
    python scripts/measure_ambiguity.py
"""

import time
from collections.abc import Iterator
from typing import Any

import gymnasium as gym
import numpy as np
import tyro

from irl_gym import FiniteLP, policy_iteration, tabulate, value_iteration
from irl_gym.commands.ng_russell_2000.experiment_1 import Experiment1
from irl_gym.commands.terminal import print_table
from irl_gym.judging.ambiguity.feasible import membership, sample_feasible
from irl_gym.judging.ambiguity.lambda_path import lambda_path
from irl_gym.judging.ambiguity.uniqueness import optimal_face
from irl_gym.judging.ambiguity.widths import feasible_widths
from irl_gym.mdp.tabular_mdp import TabularMDP

Row = tuple[str, ...]
ASKED: dict[str, dict[str, Any]] = {"default": {}, "(4) alone": {"margin": None}, "steps": {"reward_on": "state-action"}}
GRID = "irl_gym_envs:irl_gym/GridWorld-v0"


def grid(size: int, gamma: float) -> tuple[TabularMDP, np.ndarray]:
    """A square grid's MDP and an optimal policy."""
    env: Any = gym.make(GRID, size=size).unwrapped
    mdp = env.mdp(gamma)
    return mdp, policy_iteration(mdp, env.reward.expected(mdp)).policy


def first_experiment() -> tuple[TabularMDP, np.ndarray, np.ndarray]:
    """Ng & Russell's 5x5 grid, its expert and its true reward (25,)."""
    settings = Experiment1()
    mdp = tabulate(gym.make(GRID), gamma=settings.gamma, check_steps=0).mdp
    true = mdp.terminal.astype(float)
    return mdp, value_iteration(mdp, (mdp.P @ true).reshape(25, 4), preference=settings.preference).policy, true


def of_widths() -> Iterator[Row]:
    """400 states: bar 60 s on 2 cores. And 900, where a second process pays."""
    cases = [(20, 0.9, 1, "default"), *((20, 0.99, workers, asked) for asked in ASKED for workers in (1, 2))]
    for size, gamma, workers, asked in [*cases, (30, 0.99, 1, "default"), (30, 0.99, 2, "default")]:
        mdp, expert = grid(size, gamma)
        begin = time.perf_counter()
        found = feasible_widths(mdp, expert, workers=workers, **ASKED[asked])
        seconds = f"{time.perf_counter() - begin:.1f} s"
        width = found.width[np.isfinite(found.width)]
        spread = f"{width.min():.3f} / {np.median(width):.3f} / {width.max():.3f}"
        yield f"{size} x {size}, gamma {gamma}", asked, str(workers), seconds, spread


def of_faces() -> Iterator[Row]:
    """Is the optimum unique?"""
    problems = {"Ng & Russell's 5 x 5": first_experiment()[:2], "20 x 20, gamma 0.99": grid(20, 0.99)}
    for name, (mdp, expert) in problems.items():
        for learner in (FiniteLP(margin_cap=None), FiniteLP(margin_cap=None, l1=1.05), FiniteLP()):
            begin = time.perf_counter()
            face = optimal_face(mdp, expert, learner)
            seconds = f"{time.perf_counter() - begin:.2f} s"
            asked = f"margin_cap={learner.margin_cap!r}, l1={learner.l1}"
            yield name, asked, str(face.unique), str(face.differing.size), f"{np.nanmax(face.width):.2e}", seconds


def of_membership() -> Iterator[Row]:
    """Are these rewards feasible in Ng & Russell's grid?"""
    mdp, expert, true = first_experiment()
    drawn = sample_feasible(mdp, expert, rng=np.random.default_rng(0))
    rewards = {
        "true": true,
        "true, negated": -true,
        "zero": np.zeros(25),
        "learned": FiniteLP().fit(mdp, expert).reward,
        "drawn (S, A)": drawn,
    }
    for name, reward in rewards.items():
        yield name, str(membership(mdp, expert, reward))


def of_paths() -> Iterator[Row]:
    """The lambda path: all pieces, or the 60 that matter first."""
    problems = {"Ng & Russell's 5 x 5": first_experiment()[:2]}
    for slippery in (True, False):
        table = tabulate(gym.make("FrozenLake-v1", map_name="8x8", is_slippery=slippery), gamma=0.99, check_steps=0)
        expert = policy_iteration(table.mdp, table.reward).policy
        problems[f"FrozenLake 8x8{' slippery' if slippery else ''}"] = table.mdp, expert
    problems |= {"10 x 10, gamma 0.9": grid(10, 0.9), "20 x 20, gamma 0.9": grid(20, 0.9)}
    for name, (mdp, expert) in problems.items():
        cases: list[dict[str, Any]] = [{}, {"margin_cap": "auto"}]
        for options in [*cases, {"most_pieces": 60}] if mdp.n_states >= 100 else cases:
            begin = time.perf_counter()
            path = lambda_path(mdp, expert, **options)
            seconds = f"{time.perf_counter() - begin:.2f} s"
            asked = ", ".join(f"{option}={value!r}" for option, value in options.items()) or "default"
            gap = f"{path.gap / path.total_margins[0]:.0e}"
            yield name, asked, str(path.n_pieces), str(path.solves), seconds, f"{path.lambda_0:.5f}", gap


def main() -> None:
    """Measure all of it, and print tables."""
    print_table("membership, Ng & Russell's 5 x 5 grid", ("reward", "finding"), of_membership())
    spread = "least / middle / largest width"
    print_table("feasible widths (bar: 60 s on 2 cores)", ("table", "options", "processes", "seconds", spread), of_widths())
    print_table("optimal faces", ("table", "learner", "unique", "states that differ", "largest width", "seconds"), of_faces())
    columns = ("table", "options", "pieces", "programs", "seconds", "lambda_0", "gap / f(0)")
    print_table("lambda path", columns, of_paths())


if __name__ == "__main__":
    tyro.cli(main, description=__doc__)
