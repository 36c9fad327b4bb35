"""Measure the speed and memory bars: linear programs, planning, vectorised stepping, PPO, import, digests.
Each measurement runs in a process of its own, for its peak memory. Ratios are of one run.
"""

import multiprocessing
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import tyro
from stable_baselines3.common.env_util import make_vec_env

from irl_gym import (
    SB3,
    Experiment,
    FiniteLP,
    TabularVecEnv,
    ValueIteration,
    policy_iteration,
    recover_and_retrain,
    tabulate,
    value_iteration,
)
from irl_gym.commands.terminal import print_table
from irl_gym.files.own_files import check_links
from irl_gym.files.run_folder import START, changed, read_record
from irl_gym.runs.identity import STAGES

GRID = "irl_gym_envs:irl_gym/GridWorld-v0"
MEGABYTE = 1024  # of ru_maxrss, which counts kilobytes on Linux


def grid(size: int, gamma: float):
    """The table and step reward of a square grid with NR's slip of 0.3."""
    env: Any = gym.make(GRID, size=size).unwrapped
    mdp = env.mdp(gamma)
    return mdp, env.reward.expected(mdp)


def linear_program(size: int, gamma: float, **settings) -> str:
    """Seconds of a fit and peak memory above what stood before it."""
    mdp, R = grid(size, gamma)
    expert = policy_iteration(mdp, R).policy
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    start = time.perf_counter()
    gap = FiniteLP(**settings).fit(mdp, expert).proof.duality_gap
    seconds = time.perf_counter() - start
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return f"{seconds:.2f} s, peak {peak / MEGABYTE:.0f} MB ({(peak - before) / MEGABYTE:.0f} above before), gap {gap:.0e}"


def planning(size: int) -> str:
    """Seconds and peak memory of planning on a large grid to 1e-6 in V; the table is not counted in the seconds."""
    mdp, R = grid(size, 0.99)
    start = time.perf_counter()
    solution = value_iteration(mdp, R, tolerance=1e-6, sweeps=50)
    seconds, peak = time.perf_counter() - start, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / MEGABYTE
    return f"{seconds:.1f} s, error bound {solution.error:.1e}, peak {peak:.0f} MB with the table"


def lake(num_envs: int) -> TabularVecEnv:
    """FrozenLake 8x8 as one vector environment."""
    table = tabulate(gym.make("FrozenLake-v1", map_name="8x8"), gamma=0.99, check_steps=0)
    return TabularVecEnv(table.mdp, table.reward, num_envs=num_envs, max_episode_steps=200, seed=0)


def stepping() -> str:
    """Steps a second of 512 copies under random actions."""
    env, actions = lake(512), np.random.default_rng(0).integers(4, size=(1000, 512))
    env.reset()
    start = time.perf_counter()
    for _ in range(4):
        for chosen in actions:
            env.step(chosen)
    return f"{4 * actions.size / (time.perf_counter() - start) / 1e6:.1f} million steps/s"


SB3_OWN = {"n_steps": 2048, "batch_size": 64, "n_epochs": 10, "learning_rate": 3e-4, "policy_kwargs": None}
SB3_WIDE = {**SB3_OWN, "n_steps": 2048 * 8 // 512, "batch_size": 64 * 512 // 8}  # as many steps a rollout, on 512 copies


def ppo(ours: dict, theirs: dict, threads: int) -> str:
    """PPO on 512 copies of the table against PPO on DummyVecEnv(8): environment steps a second, learning included."""
    dummy = make_vec_env("FrozenLake-v1", 8, env_kwargs={"map_name": "8x8"})
    rates = []
    for env, settings, steps in ((lake(512), ours, 160_000), (dummy, theirs, 32_768)):
        start = time.perf_counter()
        steps = SB3("PPO", steps, settings, threads).plan(env, gamma=0.99).model.num_timesteps
        rates.append(steps / (time.perf_counter() - start))
    return f"{rates[0]:,.0f} against {rates[1]:,.0f} steps/s: {rates[0] / rates[1]:.1f}x"


def importing() -> str:
    """Seconds of `import irl_gym` in a new interpreter, the median of 7."""
    code = "import time; start = time.perf_counter(); import irl_gym; print(time.perf_counter() - start)"
    made = [float(subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout) for _ in range(7)]
    return f"{np.median(made):.3f} s"


def checking() -> str:
    """The check of all digests of a run, the median of 9, against a run that is short: nothing is trained, few episodes."""
    with tempfile.TemporaryDirectory() as folder:
        asked = Experiment("FrozenLake-v1", 0.99, retrain=ValueIteration(), episodes=10, eval_episodes=10)
        start = time.perf_counter()
        path = recover_and_retrain(asked, Path(folder, "run")).out
        whole, times = time.perf_counter() - start, []
        records = [read_record(path, name) or {} for name in (START, *STAGES)]
        for _ in range(9):
            start = time.perf_counter()
            check_links(path)
            assert not any(changed(path, record) for record in records)
            times.append(time.perf_counter() - start)
        files = sum(len(record["sha256"]) for record in records)
    return f"{files} files, {1000 * np.median(times):.1f} ms of {whole:.1f} s: {np.median(times) / whole:.2%}"


MEASUREMENTS: list[tuple[str, str, Callable[..., str], tuple, dict]] = [
    ("import irl_gym", "< 0.3 s", importing, (), {}),
    ("digests of a run", "< 2 % of the run", checking, (), {}),
    ("LP, 30x30, gamma 0.9, default", "< 1 s, < 500 MB", linear_program, (30, 0.9), {}),
    ("LP, 30x30, gamma 0.9, NR lambda = 0", "< 1 s, < 500 MB", linear_program, (30, 0.9), {"margin_cap": None}),
    ("LP, 100x100, gamma 0.99, default", "< 20 s, < 500 MB", linear_program, (100, 0.99), {}),
    ("LP, 100x100, gamma 0.99, NR lambda = 0", "< 20 s, < 500 MB", linear_program, (100, 0.99), {"margin_cap": None}),
    ("TabularVecEnv, 512 copies, FrozenLake 8x8", ">= 2 million steps/s", stepping, (), {}),
    ("PPO, irl_gym's defaults, against SB3's on DummyVecEnv(8)", ">= 8x", ppo, ({}, SB3_OWN, 1), {}),
    ("the same, SB3's network, rollouts, epochs on both", ">= 8x", ppo, (SB3_WIDE, SB3_OWN, 2), {}),
    ("the same, irl_gym's defaults on both", "reported", ppo, ({}, {}, 1), {}),
    ("planning, 1,000,000 states, gamma 0.99", "< 30 s, < 2000 MB", planning, (1000,), {}),
]


def measured() -> Iterator[tuple[str, ...]]:
    """Each in a process of its own."""
    for name, bar, measure, arguments, settings in MEASUREMENTS:
        with multiprocessing.get_context("spawn").Pool(1) as pool:
            yield name, bar, pool.apply(measure, arguments, settings)


def main() -> None:
    """Measure all of it, and print a table."""
    print_table("speed and memory", ("what", "bar", "measured"), measured())


if __name__ == "__main__":
    tyro.cli(main, description=__doc__)
