"""Measure what progress and checkpoints cost, how soon a run says something, and how much of a training a kill repeats.

    python scripts/measure_progress.py

The training is that of the demo, FrozenLake 8x8, with the loop's own learning curve: with bars on a terminal (to nowhere) and
checkpoints, and with neither. Processor time, in turn; the ratio of the medians. The kills come at random steps of one
training, each of a process of its own that goes on where the one before was killed; the agent at the end is compared with that
of a training in one go.
"""

import ctypes
import json
import multiprocessing
import os
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import gymnasium as gym
import numpy as np
import tyro
from rich.console import Console

from irl_gym import SB3, tabulate
from irl_gym.agents.checkpoints import Checkpoint
from irl_gym.commands.terminal import stage_bars
from irl_gym.files.archives import json_in, read_arrays
from irl_gym.loop.learning_curve import Glances
from irl_gym.loop.table_world import TableWorld

SCRIPT = Path(__file__).with_name("recover_and_retrain.py")


@dataclass(frozen=True)
class Arguments:
    """What to measure."""

    rounds: int = 5
    """Trainings of each kind, and starts of the command."""
    kills: int = 10
    """In one training."""
    total_timesteps: int = 400_000
    """Environment steps of a training."""
    seed: int = 0
    """Of the steps at which kills come, and of the agents."""


def world_of(seed):
    """The demo's world, and what its agent is paid: here the true reward, shaped, which costs the same."""
    env = gym.make("FrozenLake-v1", map_name="8x8")
    world = TableWorld(env, tabulate(env, gamma=0.99, check_steps=0), 64, seed)
    return world, world.paid(world.true, shaped=True, margin_cap=None)


def train(world, paid, total, checkpoint=None, see=None):
    """The agent of a training."""
    planner = world.planner(shaped=True)
    plan = SB3(total_timesteps=total, hyperparameters=planner.hyperparameters).plan
    return world.train(SimpleNamespace(plan=partial(plan, checkpoint=checkpoint)), paid, see)


class Silent(Glances):
    """The learning curve alone."""

    def _return_of(self, glanced):
        return ""


def seconds(world, paid, total, told):
    """Processor time of a training, with progress and checkpoints or without."""
    with tempfile.TemporaryDirectory() as folder, open(os.devnull, "w") as nowhere:
        start = time.process_time()
        if not told:
            train(world, paid, total, see=Silent(world, lambda steps, earned: None).see)
            return time.process_time() - start
        with stage_bars(Console(file=nowhere, force_terminal=True, width=120)) as show:
            glances = Glances(world, lambda steps, earned: show("agent", steps / total, earned))
            train(world, paid, total, Checkpoint(Path(folder) / "kept.npz", "it", glances), glances.see)
        return time.process_time() - start


def until_first_words(folder):
    """Seconds from the start of the command to the first byte on its standard error."""
    start = time.perf_counter()
    command = [sys.executable, str(SCRIPT), "--out", str(Path(folder) / "run")]
    with subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL) as process:
        assert process.stderr is not None
        process.stderr.read(1)
        taken = time.perf_counter() - start
        process.kill()
    return taken


def weights(agent):
    """The networks of an agent."""
    return {name: one.numpy() for name, one in agent.model.get_parameters()["policy"].items()}


def killed(world, paid, total, path, until):
    """Go on with a training in a process that is killed at a step; the step at which it was, and the one that is kept."""
    at: Any = multiprocessing.Value(ctypes.c_int64, 0, lock=False)

    def see(steps, policy):
        at.value = steps
        world.glance(policy)

    def work():
        train(world, paid, total, Checkpoint(path, "it"), see)

    process = multiprocessing.get_context("fork").Process(target=work)
    process.start()
    while process.is_alive() and at.value < until:
        time.sleep(0.001)
    process.kill()
    process.join()
    kept = json_in(read_arrays(path), "told")["counters"]["num_timesteps"] if path.exists() else 0
    return at.value, kept


def main(asked):
    """Measure, and print a line a figure."""
    world, paid = world_of(asked.seed)
    train(world, paid, 5_000)  # the first of a process is slower
    times = {told: [] for told in (False, True)}
    for _ in range(asked.rounds):
        for told, found in times.items():
            found.append(seconds(world, paid, asked.total_timesteps, told))
    plain, told = (float(np.median(times[one])) for one in (False, True))
    print(
        f"training: {plain:.2f} s of processor time, {told:.2f} s with progress and checkpoints: {told / plain - 1:+.1%}",
        flush=True,
    )
    with tempfile.TemporaryDirectory() as folder:
        first = [until_first_words(Path(folder) / str(i)) for i in range(asked.rounds)]
        print(f"first words: after {np.median(first):.2f} s, {max(first):.2f} s at most, of {asked.rounds} starts")
        steps = np.sort(np.random.default_rng(asked.seed).integers(asked.total_timesteps, size=asked.kills))
        path, repeated = Path(folder) / "kept.npz", []
        for until in steps.tolist():
            at, kept = killed(world, paid, asked.total_timesteps, path, until)
            repeated.append((at - kept) / asked.total_timesteps)
        shares = f"{np.mean(repeated):.1%} on average, {max(repeated):.1%} at most"
        print(f"repeated after a kill at a random step: {shares}, of {asked.kills} kills")
        gone_on = weights(train(world, paid, asked.total_timesteps, Checkpoint(path, "it")))
        in_one_go = weights(train(world, paid, asked.total_timesteps))
        same = all(np.array_equal(gone_on[name], in_one_go[name]) for name in in_one_go)
        print(f"the agent after all kills is the one of a training in one go: {json.dumps(same)}")


if __name__ == "__main__":
    main(tyro.cli(Arguments, description=__doc__))
