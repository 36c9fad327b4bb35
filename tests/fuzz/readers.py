"""Everything that reads a stranger's file: a valid one to begin with, and what is true of whatever is accepted."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import gymnasium as gym
import numpy as np
from forgetting import without_digests
from fuzz import experts, runs
from fuzz.sound import SPACE, sound_episode, sound_reward, sound_table

from irl_gym.demonstrations.datasets import load_minari, read_minari, write_minari
from irl_gym.demonstrations.imports import from_d4rl, from_frame
from irl_gym.demonstrations.recorded import recorded_environment
from irl_gym.demonstrations.shards import Shards
from irl_gym.features.bases import Fourier, Polynomial, RadialBasis
from irl_gym.features.feature_maps import OneHot, Table, Unravel
from irl_gym.features.linear_reward import LinearReward, load_payment
from irl_gym.judging.ambiguity.lambda_path import LambdaPath, lambda_path
from irl_gym.mdp.episodes import Episode
from irl_gym.mdp.planning.dynamic_programming import policy_iteration
from irl_gym.mdp.rewards import TabularReward
from irl_gym.mdp.shaping import ShapedReward
from irl_gym.mdp.tabular_mdp import TabularMDP
from irl_gym.spaces.states import StateIndex
from irl_gym.tables.enumeration.explored import Explored, load_explored
from irl_gym.tables.table_files import load_table, save_table
from irl_gym.tables.tabulate import tabulate

LAKE = {"is_slippery": True}
RING = TabularMDP.from_dense(
    np.stack([np.roll(np.eye(5), 1, axis=1), np.roll(np.eye(5), -1, axis=1)], axis=1), 0.9, np.eye(5)[0]
)
"""Two actions, both ways round five states."""
ROWS = [Episode(np.array([0, 4, 8, 9]), np.array([1, 1, 2]), np.array([0.0, 0.0, 1.0]), True, False, seed=i) for i in range(3)]


@dataclass(frozen=True)
class Reader:
    """One."""

    write: Callable[[Path], None]
    """Fills a folder with valid files."""
    read: Callable[[Path], None]
    """Reads them, and asserts what is true of what was read."""
    files: str = "**/*"
    """Which of them are changed."""
    documented: tuple[type[Exception], ...] = ()
    """Errors that are none of the library's, and which it says that it raises."""
    weight: float = 1
    """Share of the inputs."""
    of_run: bool = False
    """Is a run in the folder before it is filled?"""


def nothing(folder):
    """A folder that is left as it is."""


def lake():
    return tabulate(gym.make("FrozenLake-v1", **LAKE), gamma=0.9, check_steps=20)


def read_table(folder):
    sound_table(load_table(folder / "table.npz", SPACE))


def write_search(folder):
    found = Explored(2)
    found.starts[found.add(0, -1, -1, ())] = 1.0
    found.add(1, 0, 1, (1,))
    found.end(2)
    found.expand(0, [(0, 0, 0.5, 0.0), (0, 1, 0.5, 1.0), (1, -1, 1.0, 0.0)])
    found.save(folder / "search.npz", gym.spaces.Discrete(3), {"seed": 0})


def read_search(folder):
    found = load_explored(folder / "search.npz", gym.spaces.Discrete(3), 2, {"seed": 0})
    n = len(found.keys)
    assert all(-1 <= parent < i for i, parent in enumerate(found.parents)) and len(found.scripts) == n == len(found.ids)
    assert all(-len(found.ends) <= one < n for one in found.successors) and np.isfinite(list(found.rewards)).all()
    assert all(0 <= key < 3 for key in found.keys)
    for i in range(found.n_expanded):
        assert all(0 <= action < 2 for action, *_ in found.lines_of(i))


def write_rewards(folder):
    TabularReward.learned(np.linspace(-1, 1, 16), {"learner": "FiniteLP", "l1": 0.5}).save(folder / "reward.npz")
    TabularReward(np.ones((16, 4))).save(folder / "steps.npz")
    ShapedReward(TabularReward(np.zeros((16, 4))), TabularReward(np.ones(16)), 0.5).save(folder / "shaped.npz")


def write_linear(folder):
    cells = Unravel((4, 4))
    phi = {
        "onehot": OneHot(16), "table": Table(np.eye(16)[:, :3]),
        "radial": RadialBasis.grid([0, 0], [3, 3], 2, coordinates=cells),
        "fourier": Fourier([0, 0], [3, 3], 2, cells), "polynomial": Polynomial([0, 0], [3, 3], 2, cells),
    }  # fmt: skip
    for name, features in phi.items():
        LinearReward(np.linspace(0, 1, features.n_features), features, {"learner": "FeatureLP"}).save(folder / f"{name}.npz")


def read_rewards(folder):
    for path in sorted(folder.iterdir()):
        sound_reward(load_payment(path))


def write_path(folder):
    table = lake()
    lambda_path(table.mdp, policy_iteration(table.mdp, table.reward).policy).save(folder / "path.npz")


def read_path(folder):
    path = LambdaPath.load(folder / "path.npz")
    k = path.n_pieces
    assert path.breakpoints.shape == path.gaps.shape == (k + 1,) and len(path.rewards) == len(path.margins) == k
    assert np.isfinite(path.rewards).all() and (np.diff(path.breakpoints) >= 0).all()
    assert str(path) and path.to_json() and np.isfinite(path.at(path.lambda_0 / 2).values).all()


def write_shards(folder):
    Shards(folder / "shards", SPACE).append(ROWS)


def read_shards(folder):
    for path in (folder / "shards").glob("*.damaged"):
        path.unlink()
    for one in Shards(folder / "shards", SPACE):
        assert (one.actions is None or len(one.actions) == len(one.rewards)) and len(one.rewards) == len(
            one.observations
        ) - 1 >= 1


def write_dataset(data_format):
    def write(folder):
        write_minari(ROWS, "lake-v0", gym.make("FrozenLake-v1"), root=folder, algorithm="a", data_format=data_format)

    return write


def read_dataset(folder):
    states = StateIndex(SPACE)
    for one in read_minari("lake-v0", root=folder, states=states):
        sound_episode(one)
        assert one.seed is None or one.seed >= 0
        assert states.encode_batch(one.observations).max() < 16


def read_environment(folder):
    made = recorded_environment(load_minari("lake-v0", root=folder))
    assert made.spec.id in gym.registry and made.spec.entry_point == gym.registry[made.spec.id].entry_point
    assert all(one.entry_point.startswith(("gymnasium.wrappers:", "irl_gym.")) for one in made.spec.additional_wrappers)
    made.close()


def write_d4rl(folder):
    import h5py

    with h5py.File(folder / "log.hdf5", "w") as file:
        file["observations"], file["actions"] = np.array([0, 4, 8, 0, 1]), np.array([1, 1, 2, 2, 1])
        file["next_observations"] = np.array([4, 8, 9, 1, 2])
        file["terminals"], file["timeouts"] = np.array([0, 0, 1, 0, 0], bool), np.array([0, 0, 0, 0, 1], bool)
        file["rewards"] = np.zeros(5)
        file["metadata/algorithm"] = "x"


def sound_episodes(found):
    for one in found:
        sound_episode(one)
        assert ((one.observations >= 0) & (one.observations < 16)).all()


def read_d4rl(folder):
    sound_episodes(from_d4rl(folder / "log.hdf5", space=SPACE, n_actions=4))


COLUMNS = {
    "episode": [0, 0, 0, 1, 1], "step": [0, 1, 2, 0, 1], "observation": [0, 4, 8, 0, 1], "action": [1, 1, 2, 2, 1],
    "reward": [0.0, 0.0, 1.0, 0.0, 0.0], "terminated": [False, False, True, False, False],
}  # fmt: skip


def write_frames(folder):
    import pandas as pd

    frame = pd.DataFrame(COLUMNS)
    frame.to_csv(folder / "log.csv", index=False)
    frame.to_csv(folder / "log.tsv", index=False, sep="\t")
    frame.to_parquet(folder / "log.parquet")


def read_frames(folder):
    for path in sorted(folder.iterdir()):
        sound_episodes(from_frame(path, space=SPACE, n_actions=4))


READERS = {
    "table": Reader(lambda folder: save_table(lake(), folder / "table.npz"), read_table, weight=3),
    "search": Reader(write_search, read_search, weight=2),
    "reward": Reader(write_rewards, read_rewards, weight=1.5),
    "linear reward": Reader(write_linear, read_rewards, weight=1.5),
    "lambda path": Reader(write_path, read_path),
    "expert": Reader(experts.write_experts, experts.read_experts, weight=1.5),
    "statistics": Reader(experts.write_statistics, experts.read_numbers, weight=3),
    "what an agent is shown": Reader(experts.write_what_is_shown, experts.read_what_is_shown, "*.shown.npz", weight=1.5),
    "checkpoint": Reader(experts.write_trainings(RING), experts.read_trainings(RING), weight=0.1),
    "shards": Reader(write_shards, read_shards, weight=2),
    "Minari, HDF5": Reader(write_dataset("hdf5"), read_dataset, "lake-v0/data/*", weight=3),
    "Minari, Arrow": Reader(write_dataset("arrow"), read_dataset, "lake-v0/data/**/*", weight=2),
    "environment of a dataset": Reader(write_dataset("hdf5"), read_environment, "lake-v0/data/metadata.json", weight=0.5),
    "D4RL": Reader(write_d4rl, read_d4rl, weight=2),
    "frames": Reader(write_frames, read_frames, weight=2),
    "run": Reader(nothing, runs.sound_run, weight=0.7, of_run=True),
    "run without digests": Reader(without_digests, runs.sound_run, weight=1.5, of_run=True),
    "page of a run": Reader(runs.write_page, runs.read_page, "*.*", weight=0.1, of_run=True),
    "page of two runs": Reader(runs.write_page, runs.read_comparison, "*.*", weight=0.1, of_run=True),
    "diagnosis of a run": Reader(without_digests, runs.read_diagnosis, weight=0.3, of_run=True),
    "resumed run": Reader(nothing, runs.read_folder, weight=0.5, of_run=True),
    "continued run": Reader(runs.write_unfinished, runs.read_unfinished, weight=0.01, of_run=True),
    "finished run, continued": Reader(without_digests, runs.read_unfinished, weight=0.1, of_run=True),
    "continued export": Reader(runs.write_export, runs.read_export, ".exporting-*/**/*", weight=0.1),
}
"""By what they read. A run is made once for all tests, and copied."""
