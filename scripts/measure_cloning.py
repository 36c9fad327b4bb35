"""Measure how fast a neural clone acts as its expert does, beside `imitation` 1.0.1: same steps, network and batches, one run.

    python -m venv .imitation
    .imitation/bin/python -m pip install "$(grep ^torch== constraints.txt)"    # first: any other way may fetch gigabytes
    .imitation/bin/python -m pip install imitation==1.0.1 "numpy<2"
    python scripts/measure_cloning.py --python .imitation/bin/python

Without `--python` ours is measured alone. 100 episodes of an expert each; both clone them, one after the other, in a process of
their own on one thread (`clone_timed.py`). What counts is the processor time until the clone, acting deterministically, earns
0.98 of what the expert earns, on average over the seeds; of Taxi, whose 100 episodes leave many starts unseen, what that of
imitation earns in the end, two standard errors aside, since what is done in unseen starts is chance; where it is not
measured, of ours. On FrozenLake and Taxi returns are exact, within the environment's time limit, else means of 20
episodes. Pendulum, whose actions are continuous, is cloned by ours alone, until within a quarter of the expert's return. Exits
with 1 where ours is slower. Axes: N steps, K snapshots, S states, A actions.
"""

import math
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import gymnasium as gym
import numpy as np
import tyro
from clone_timed import EVERY
from gymnasium import spaces

from irl_gym import policy_iteration, tabulate
from irl_gym.checks import checked_number
from irl_gym.commands.terminal import UNSET, print_table
from irl_gym.loop.table_world import step_limit
from irl_gym.mdp.episodes import collect_from_table
from irl_gym.mdp.policies import as_distribution

EPISODES, JUDGED = 100, 20
HIDDEN, BATCH = 32, 32
Act = Callable[[np.ndarray], np.ndarray]
"""Observations (n, ...) -> actions (n, ...)."""


@dataclass(frozen=True)
class Arguments:
    """Measure how fast a neural clone acts as its expert does."""

    python: Annotated[Path | None, UNSET] = None
    """Python of an environment with imitation 1.0.1; the default is to measure ours alone."""
    seeds: int = 3
    """Seeds 0, 1, ... of each."""

    def __post_init__(self) -> None:
        checked_number("seeds", self.seeds, "a whole number of at least 1", least=1, whole=True)


@dataclass(frozen=True)
class Task:
    """What is cloned, and how the clone is judged."""

    env: gym.Env
    """Where."""
    steps: dict[str, np.ndarray]
    """Observations, actions and lengths of the expert's episodes."""
    epochs: int
    """Passes over them."""
    worth: Callable[[Act], float]
    """The mean return of who acts so."""
    expert: Act
    """Who is cloned."""
    share: float | None
    """Of what the expert earns, which is enough; None for what is earned in the end."""
    alone: bool = False
    """Is it cloned by ours alone?"""


def on_table(env_id: str, updates: int, share: float | None, **options: Any) -> Task:
    """An environment whose table is known, and its best policy."""
    env = gym.make(env_id, **options)
    table, limit = tabulate(env, gamma=0.99), step_limit(env)
    mdp, paid = table.mdp, table.reward.expected(table.mdp)
    best = policy_iteration(mdp, table.reward).policy
    entries = table.payments.entries
    assert entries is not None
    drawn = [*collect_from_table(mdp, entries, table.states, best, EPISODES, max_episode_steps=limit)]

    def worth(act: Act) -> float:
        policy = as_distribution(act(np.arange(mdp.n_states)), mdp.n_states, mdp.n_actions)
        law, total, P, R = mdp.d0, 0.0, mdp.P_pi(policy), (policy * paid).sum(axis=1)
        for _ in range(limit):
            total, law = total + law @ R, law @ P
        return float(total)

    seen = np.concatenate([one.observations[:-1] for one in drawn])
    steps = {"observations": seen, "actions": np.concatenate([one.taken("an expert's episode") for one in drawn])}
    steps["lengths"] = np.array([len(one) for one in drawn])
    return Task(env, steps, math.ceil(updates * BATCH / len(seen)), worth, lambda rows: best[rows], share)


def by_stepping(env_id: str, updates: int, expert: Act, share: float, *, alone: bool = False) -> Task:
    """An environment that is stepped, and who acts well in it."""
    env = gym.make(env_id)

    def worth(act: Act) -> float:
        return float(np.mean([rewards.sum() for _, _, rewards in played(env_id, act, JUDGED, 7_919)]))

    drawn = played(env_id, expert, EPISODES, 0)
    steps = {name: np.concatenate([one[i] for one in drawn]) for i, name in enumerate(("observations", "actions"))}
    steps["lengths"] = np.array([len(one[2]) for one in drawn])
    epochs = math.ceil(updates * BATCH / len(steps["actions"]))
    return Task(env, steps, epochs, worth, expert, share, alone)


def played(env_id: str, act: Act, n: int, seed: int) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Observations, actions and rewards of n episodes, which are played side by side."""
    envs = gym.make_vec(env_id, num_envs=n)
    seen, going, told = envs.reset(seed=seed)[0], np.ones(n, dtype=bool), []
    while going.any():
        done = act(seen)
        following, rewards, terminated, truncated, _ = envs.step(done)
        told.append((seen.copy(), done, rewards, going.copy()))
        seen, going = following, going & ~(terminated | truncated)
    envs.close()
    seen, done, rewards, alive = (np.array(part) for part in zip(*told, strict=True))
    return [(seen[alive[:, i], i], done[alive[:, i], i], rewards[alive[:, i], i]) for i in range(n)]


def balancing(seen: np.ndarray) -> np.ndarray:
    """CartPole: push to where the pole falls."""
    return (seen @ np.array([0.1, 0.4, 10.0, 3.0]) > 0).astype(np.int64)


def swinging(seen: np.ndarray) -> np.ndarray:
    """Pendulum: swing up by its energy, and hold it there."""
    cosine, angle, speed = seen[:, 0], np.arctan2(seen[:, 1], seen[:, 0]), seen[:, 2]
    energy = speed**2 / 6 + 5 * (cosine - 1)
    near = (np.abs(angle) < 0.5) & (np.abs(speed) < 3)
    pull = np.where(near, -12 * angle - 3 * speed, -2 * energy * np.where(speed >= 0, 1, -1))
    return np.clip(pull, -2, 2).astype(np.float32)[:, None]


TASKS: dict[str, Callable[[], Task]] = {
    "FrozenLake 8x8": lambda: on_table("FrozenLake-v1", 2_000, 0.98, map_name="8x8"),
    "Taxi": lambda: on_table("Taxi-v4", 2_500, None),
    "CartPole": lambda: by_stepping("CartPole-v1", 1_500, balancing, 0.98),
    "Pendulum": lambda: by_stepping("Pendulum-v1", 12_000, swinging, 0.75, alone=True),
}


def acting(weights: np.ndarray, env: gym.Env) -> Act:
    """The deterministic actions of the network 32-32 with these weights."""
    seen, done = env.observation_space, env.action_space
    size = int(seen.n) if isinstance(seen, spaces.Discrete) else int(np.prod(seen.shape or ()))
    out = int(done.n) if isinstance(done, spaces.Discrete) else int(np.prod(done.shape or ()))
    rest = weights if isinstance(done, spaces.Discrete) else weights[out:]  # log of the standard deviation
    layers = []
    for fan_in, fan_out in ((size, HIDDEN), (HIDDEN, HIDDEN), (HIDDEN, out)):
        layers.append((rest[: fan_in * fan_out].reshape(fan_out, fan_in), rest[fan_in * fan_out : fan_in * fan_out + fan_out]))
        rest = rest[fan_in * fan_out + fan_out :]
    assert not rest.size

    def act(observations: np.ndarray) -> np.ndarray:
        x = np.eye(size)[observations] if isinstance(seen, spaces.Discrete) else observations
        for W, b in layers[:-1]:
            x = np.tanh(x @ W.T + b)
        found = x @ layers[-1][0].T + layers[-1][1]
        if isinstance(done, spaces.Discrete):
            return found.argmax(axis=1)
        assert isinstance(done, spaces.Box)
        return np.clip(found, done.low, done.high).astype(np.float32)

    return act


def cloned(python: Path | str, whose: str, task: Task, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """(K,) seconds and (K, ...) weights of the snapshots of one cloning."""
    bounds = {}
    for name, space in (("observation", task.env.observation_space), ("action", task.env.action_space)):
        discrete = isinstance(space, spaces.Discrete)
        told: Any = space
        bounds |= {f"{name}_low": 0 if discrete else told.low, f"{name}_high": told.n if discrete else told.high}
    with tempfile.TemporaryDirectory() as folder:
        given, found = Path(folder) / "steps.npz", Path(folder) / "found.npz"
        np.savez(given, **task.steps, **bounds)
        script = Path(__file__).with_name("clone_timed.py")
        command = [python, script, whose, given, found, str(task.epochs), str(seed)]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)  # imitation prints tables of its losses
        with np.load(found) as file:
            return file["seconds"], file["weights"]


def reached(task: Task, found: list[tuple[np.ndarray, np.ndarray]], enough: float) -> tuple[float, int]:
    """Seconds and updates, on average over the seeds, until as much is earned; infinite, and 0, where it never is."""
    seconds = np.mean([times for times, _ in found], axis=0)
    for i, spent in enumerate(seconds.tolist()):
        if np.mean([task.worth(acting(weights[i], task.env)) for _, weights in found]) >= enough:
            return spent, (i + 1) * EVERY
    return math.inf, 0


def measured(task: Task, arguments: Arguments) -> tuple[list[str], bool]:
    """A row of the table, and whether ours is as fast."""
    who: dict[str, Path | str] = {"ours": sys.executable}
    if arguments.python is not None and not task.alone:
        who = {"imitation": arguments.python, **who}
    found = {name: [cloned(python, name, task, seed) for seed in range(arguments.seeds)] for name, python in who.items()}
    expert = task.worth(task.expert)
    enough = expert - (1 - (task.share or 0)) * abs(expert)
    if task.share is None:
        ends = [task.worth(acting(weights[-1], task.env)) for _, weights in found[next(iter(who))]]
        enough = float(np.mean(ends) - 2 * np.std(ends) / math.sqrt(len(ends)))
    took = {name: reached(task, one, enough) for name, one in found.items()}
    row = [f"{len(task.steps['actions']):,}", f"{expert:.4g}", f"{enough:.4g}"]
    row += [f"{took[name][0]:.2f} ({took[name][1]:,})" if name in who else "" for name in ("imitation", "ours")]
    if "imitation" not in who:
        return [*row, ""], math.isfinite(took["ours"][0])
    ratio = took["ours"][0] / took["imitation"][0]
    return [*row, f"{ratio:.2f}"], ratio <= 1


def main() -> None:
    """Clone, print the seconds, and compare them."""
    arguments = tyro.cli(Arguments)
    rows, fine = [], True
    for name, make in TASKS.items():
        row, fast = measured(make(), arguments)
        rows.append([name, *row])
        fine &= fast
    columns = ("environment", "steps", "expert", "enough", "imitation: s (updates)", "ours: s (updates)", "ours / imitation")
    print_table("Processor time until a clone earns enough", columns, rows)
    sys.exit(0 if fine else 1)


if __name__ == "__main__":
    main()
