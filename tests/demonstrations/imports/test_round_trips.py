"""What was collected comes back, through every layout and every space, and Minari stores it."""

import h5py
import minari
import numpy as np
import pandas as pd
import pytest
from demonstrations.imports.demonstrators import SPACES, check_same, demonstrations
from gymnasium import spaces

from irl_gym.demonstrations.datasets import minari_root, read_minari, write_minari
from irl_gym.demonstrations.imports.arrays import from_arrays
from irl_gym.demonstrations.imports.frames import from_frame
from irl_gym.demonstrations.imports.pairs import from_pairs
from irl_gym.demonstrations.imports.trajectories import from_d4rl, from_imitation
from irl_gym.spaces.batches import take
from irl_gym.spaces.states import StateIndex

KINDS = [*SPACES, "Blackjack", "CartPole"]


def single(space, batch, i):
    """Observation i as the environment gave it."""
    if isinstance(space, spaces.Tuple):
        return tuple(single(part, batch[k], i) for k, part in enumerate(space.spaces))
    if isinstance(space, spaces.Dict):
        return {key: single(part, batch[key], i) for key, part in space.spaces.items()}
    return batch[i]


def leaves(space, batch, stem="observation"):
    """Columns of a data frame that hold a batch, and how `from_frame` is told of them."""
    if isinstance(space, spaces.Tuple | spaces.Dict):
        parts = space.spaces.items() if isinstance(space, spaces.Dict) else enumerate(space.spaces)
        made = {key: leaves(part, batch[key], f"{stem}_{key}") for key, part in parts}
        named = {key: names for key, (_, names) in made.items()}
        columns = {name: column for some, _ in made.values() for name, column in some.items()}
        return columns, named if isinstance(space, spaces.Dict) else list(named.values())
    flat = np.asarray(batch).reshape(len(batch), -1)
    if flat.shape[1] == 1 and isinstance(space, spaces.Discrete):
        return {stem: flat[:, 0]}, stem
    return {f"{stem}.{j}": flat[:, j] for j in range(flat.shape[1])}, [f"{stem}.{j}" for j in range(flat.shape[1])]


def framed(env, episodes):
    """Rows in the layout of `last="row"`: the last of each episode has no action."""
    tables = []
    for number, one in enumerate(episodes):
        columns, names = leaves(env.observation_space, one.observations)
        flags = {"terminated": [False] * len(one) + [one.terminated], "truncated": [False] * len(one) + [one.truncated]}
        actions = [*(one.actions + getattr(env.action_space, "start", 0)), None]
        steps = {"episode": number, "step": range(len(one) + 1), "action": actions, "reward": [*one.rewards, None]}
        tables.append(pd.DataFrame({**steps, **columns, **flags}))
    return pd.concat(tables, ignore_index=True), {"observation": names, "terminated": "terminated", "truncated": "truncated"}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("how", ["frame", "csv", "tsv", "parquet"])
def test_tables_come_back_as_they_were(kind, how, tmp_path):
    env, episodes = demonstrations(kind)
    table, columns = framed(env, episodes)
    path = tmp_path / f"log.{how}"
    if how == "parquet":
        table.to_parquet(path)
    elif how != "frame":
        table.to_csv(path, sep="\t" if how == "tsv" else ",", index=False)
    check_same(episodes, from_frame(table if how == "frame" else path, **columns, last="row", env=env))


@pytest.mark.parametrize("kind", KINDS)
def test_shuffled_rows_come_back_sorted(kind):
    env, episodes = demonstrations(kind)
    table, columns = framed(env, episodes)
    shuffled = table.sample(frac=1, random_state=0).sort_values("step", ascending=False, kind="stable")
    again = from_frame(shuffled, **columns, last="row", env=env)
    order = shuffled["episode"].unique().tolist()  # in which they first appear
    check_same([episodes[number] for number in order], again)


@pytest.mark.parametrize("kind", KINDS)
def test_lists_of_what_the_environment_returned_come_back(kind):
    env, episodes = demonstrations(kind)
    observations = [[single(env.observation_space, one.observations, i) for i in range(len(one) + 1)] for one in episodes]
    again = from_arrays(
        observations, [one.actions for one in episodes], rewards=[one.rewards for one in episodes],
        terminated=[one.terminated for one in episodes], env=env, n_actions=int(env.action_space.n),
    )  # fmt: skip
    check_same(episodes, again)


@pytest.mark.parametrize("kind", KINDS)
def test_stacked_batches_and_next_observations_come_back(kind):
    env, episodes = demonstrations(kind)
    again = from_arrays(
        [take(one.observations, slice(None, -1)) for one in episodes], [one.actions for one in episodes],
        rewards=[one.rewards for one in episodes], terminated=[one.terminated for one in episodes],
        next_observations=[take(one.observations, slice(1, None)) for one in episodes],
        env=env, n_actions=int(env.action_space.n),
    )  # fmt: skip
    check_same(episodes, again)


@pytest.mark.parametrize("kind", KINDS)
def test_trajectories_of_imitation_come_back(kind):
    env, episodes = demonstrations(kind)
    trajectories = [
        {"obs": one.observations, "acts": one.actions, "rews": one.rewards, "terminal": one.terminated} for one in episodes
    ]
    check_same(episodes, from_imitation(trajectories, env=env, n_actions=int(env.action_space.n)))


@pytest.mark.parametrize("kind", KINDS)
def test_pairs_come_back_without_rewards(kind):
    env, episodes = demonstrations(kind)

    def stream():
        for one in episodes:
            for i, action in enumerate([*one.actions.tolist(), None]):
                final = action is None and one.terminated
                yield single(env.observation_space, one.observations, i), action, final

    again = from_pairs(stream(), fields=("observation", "action", "terminated"), env=env, n_actions=int(env.action_space.n))
    check_same(episodes, list(again), rewards=False)


@pytest.mark.parametrize("kind", ["Discrete", "Box of floats", "Dict"])
@pytest.mark.parametrize("how", ["dictionary", "hdf5"])
def test_arrays_of_d4rl_come_back(kind, how, tmp_path):
    env, episodes = demonstrations(kind)

    def joined(cut):
        parts = [take(one.observations, cut) for one in episodes]
        if isinstance(parts[0], dict):
            return {key: np.concatenate([part[key] for part in parts]) for key in parts[0]}
        return np.concatenate(parts)

    terminals = np.concatenate([[*[False] * (len(one) - 1), one.terminated] for one in episodes])
    arrays = {
        "observations": joined(slice(None, -1)), "next_observations": joined(slice(1, None)), "terminals": terminals,
        "actions": np.concatenate([one.actions for one in episodes]), "timeouts": np.zeros_like(terminals),
        "rewards": np.concatenate([one.rewards for one in episodes]),
    }  # fmt: skip
    if how == "hdf5":
        with h5py.File(tmp_path / "d4rl.hdf5", "w") as file:
            for key, value in arrays.items():
                parts = {f"{key}/{part}": one for part, one in value.items()} if isinstance(value, dict) else {key: value}
                for name, one in parts.items():
                    file[name] = one
            file["infos/goal"] = np.zeros(3)
    source = arrays if how == "dictionary" else tmp_path / "d4rl.hdf5"
    check_same(episodes, from_d4rl(source, env=env, n_actions=int(env.action_space.n)))


@pytest.mark.filterwarnings("ignore::UserWarning")
@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "Box of doubles"])
def test_plain_minari_opens_what_was_imported(kind, tmp_path):
    env, episodes = demonstrations(kind)
    table, columns = framed(env, episodes)
    imported = from_frame(table, **columns, last="row", env=env)
    write_minari(imported, "imported/log-v0", env, root=tmp_path, algorithm="a robot's log")
    with minari_root(tmp_path):
        dataset = minari.load_dataset("imported/log-v0")
        assert [len(one.actions) for one in dataset.iterate_episodes()] == [len(one) for one in episodes]
    check_same(episodes, list(read_minari("imported/log-v0", root=tmp_path)))


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_spaces_alone_are_enough_from_file_to_dataset(tmp_path):
    env, episodes = demonstrations("Discrete")
    table, columns = framed(env, episodes)
    table.to_csv(tmp_path / "log.csv", index=False)
    given = env.observation_space, env.action_space
    imported = from_frame(tmp_path / "log.csv", **columns, last="row", space=given[0], action_space=given[1])
    write_minari(
        imported, "log-v0", None, root=tmp_path, algorithm="a robot", observation_space=given[0], action_space=given[1]
    )
    check_same(episodes, list(read_minari("log-v0", root=tmp_path)))


def sorted_by_index(dataset, env):
    """Its episodes in the order in which they were stored; a split has them in another."""
    read = zip(dataset.episode_indices.tolist(), read_minari(dataset, env=env), strict=True)
    return [one for _, one in sorted(read, key=lambda pair: pair[0])]


@pytest.fixture
def stored(tmp_path):
    """Two Minari datasets of one environment, under one root."""
    _, episodes = demonstrations("Blackjack", 8)
    env, _ = demonstrations("Blackjack", 1)
    for name, some in {"one-v0": episodes[:5], "two-v0": episodes[5:]}.items():
        write_minari(some, name, env, root=tmp_path, algorithm="random")
    return tmp_path, env, episodes


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_combined_datasets_are_read(stored):
    root, env, episodes = stored
    with minari_root(root):
        parts = [minari.load_dataset(name) for name in ("one-v0", "two-v0")]
        combined = minari.combine_datasets(parts, "both-v0")
        check_same(episodes, list(read_minari(combined, env=env)))
    check_same(episodes, list(read_minari("both-v0", root=root, env=env, states=StateIndex(env.observation_space))))


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_split_datasets_are_read(stored):
    root, env, episodes = stored
    with minari_root(root):
        parts = minari.split_dataset(minari.load_dataset("one-v0"), [2, 3], seed=0)
        read = [list(read_minari(part, env=env)) for part in parts]
    assert [len(part) for part in read] == [2, 3]
    check_same(episodes[:5], sorted((one for part in read for one in part), key=lambda one: one.seed))


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_a_split_of_a_combination_is_read(stored):
    root, env, episodes = stored
    with minari_root(root):
        parts = [minari.load_dataset(name) for name in ("one-v0", "two-v0")]
        (some, _) = minari.split_dataset(minari.combine_datasets(parts, "both-v0"), [6, 2], seed=1)
        check_same([episodes[int(i)] for i in sorted(some.episode_indices)], sorted_by_index(some, env))
