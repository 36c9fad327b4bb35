"""Minari datasets: plain Minari opens them, and they come back as they were."""

import gymnasium as gym
import minari
import numpy as np
import pytest
from gymnasium import spaces
from minari.data_collector import EpisodeBuffer

from irl_gym.datasets import load_minari, minari_root, read_minari, write_minari
from irl_gym.demonstrations import Episode, collect
from irl_gym.errors import DatasetExists, DatasetMismatch, DatasetMissing, InvalidDemonstrations, InvalidParameter, NotDiscrete
from irl_gym.policies import TabularPolicy
from irl_gym.states import StateIndex

ID = "irl_gym/lake-expert-v0"
# Minari remarks on metadata that these tests leave at their defaults.
pytestmark = pytest.mark.filterwarnings("ignore::UserWarning")


@pytest.fixture
def env():
    return gym.make("FrozenLake-v1", is_slippery=False)


@pytest.fixture
def episodes(env):
    actor = TabularPolicy(np.full((16, 4), 0.25), StateIndex(spaces.Discrete(16)), seed=0)
    return list(collect(env, actor, 5, seed=3))


def write(episodes, env, root, **kwargs):
    return write_minari(episodes, ID, env, root=root, algorithm="random", **kwargs)


@pytest.fixture
def root(episodes, env, tmp_path):
    write(episodes, env, tmp_path, random_return=0.01, expert_return=0.7)
    return tmp_path


def test_plain_minari_lists_and_opens_the_dataset(root, monkeypatch):
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(root))
    assert list(minari.list_local_datasets()) == [ID]
    assert minari.load_dataset(ID).total_episodes == 5


def test_recover_environment_gives_the_same_environment(root, env):
    with minari_root(root):
        assert minari.load_dataset(ID).recover_environment().spec.kwargs == env.spec.kwargs


def test_reference_returns_normalise_scores(root):
    with minari_root(root):
        assert minari.get_normalized_score(minari.load_dataset(ID), np.array([0.01, 0.7])).tolist() == [0.0, 1.0]


def test_episodes_come_back_as_they_were(root, episodes):
    for one, again in zip(episodes, read_minari(ID, root=root), strict=True):
        assert np.array_equal(one.observations, again.observations)
        assert np.array_equal(one.actions, again.actions)
        assert np.array_equal(one.rewards, again.rewards)
        assert one.seed == again.seed
        assert (one.terminated, one.truncated) == (again.terminated, again.truncated)


def test_seeds_are_recorded(root):
    with minari_root(root):
        metadata = minari.load_dataset(ID).storage.get_episode_metadata(range(5))
        assert [one["seed"] for one in metadata] == [3, 4, 5, 6, 7]


def test_the_same_episodes_make_the_same_bytes(episodes, env, tmp_path):
    for name in ("a", "b"):
        write(episodes, env, tmp_path / name)
    first, second = (tmp_path / name / ID / "data" / "main_data.hdf5" for name in ("a", "b"))
    assert first.read_bytes() == second.read_bytes()


def test_an_existing_id_is_refused_and_left_alone(root, episodes, env):
    with pytest.raises(DatasetExists, match=ID):
        write(episodes[:1], env, root)
    assert sum(1 for _ in read_minari(ID, root=root)) == 5


def test_no_episodes_leave_nothing_behind(env, tmp_path):
    with pytest.raises(InvalidDemonstrations, match="no episodes"):
        write([], env, tmp_path)
    assert not list(tmp_path.iterdir())


def test_a_failure_half_way_leaves_no_dataset(episodes, env, tmp_path):
    def breaking():
        yield episodes[0]
        raise RuntimeError("power cut")

    with pytest.raises(RuntimeError, match="power cut"):
        write(breaking(), env, tmp_path)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("wrong", ["no-version", "bad name-v0", ""])
def test_a_malformed_id_is_refused(episodes, env, tmp_path, wrong):
    with pytest.raises(InvalidParameter, match="malformed"):
        write_minari(episodes, wrong, env, root=tmp_path, algorithm="random")


def test_a_dataset_of_another_environment_is_refused(root):
    with pytest.raises(DatasetMismatch, match=r"Discrete\(16\).*Discrete\(64\)"):
        next(read_minari(ID, root=root, states=StateIndex(spaces.Discrete(64))))


def test_a_dataset_of_the_same_environment_is_read(root, env):
    assert sum(1 for _ in read_minari(ID, root=root, env=env)) == 5


def test_a_dataset_of_an_environment_made_otherwise_is_refused(root):
    with pytest.raises(DatasetMismatch, match=r"'is_slippery': False.*'is_slippery': True"):
        next(read_minari(ID, root=root, env=gym.make("FrozenLake-v1", is_slippery=True)))


def test_continuous_actions_are_refused(tmp_path):
    env = gym.make("Pendulum-v1")
    one = EpisodeBuffer(
        observations=np.zeros((2, 3), dtype=np.float32), actions=np.zeros((1, 1), dtype=np.float32), rewards=np.zeros(1),
        terminations=[False], truncations=[True], infos={},
    )  # fmt: skip
    with minari_root(tmp_path):
        minari.create_dataset_from_buffers("pendulum-v0", [one], env=env)
    with pytest.raises(NotDiscrete, match="Box"):
        next(read_minari("pendulum-v0", root=tmp_path))


def test_an_unknown_id_is_a_missing_file(tmp_path):
    with pytest.raises(FileNotFoundError):
        next(read_minari("nothing-v0", root=tmp_path))


def test_a_missing_dataset_names_those_that_are_there(root):
    with pytest.raises(DatasetMissing, match=f"'nothing-v0' is not under .* There are {ID}"):
        load_minari("nothing-v0", root=root)


def test_a_missing_dataset_says_when_there_is_none(tmp_path):
    with pytest.raises(DatasetMissing, match=r"There is none. Name the root folder, or set MINARI_DATASETS_PATH"):
        load_minari("nothing-v0", root=tmp_path)


@pytest.mark.parametrize("wrong", ["no-version", "bad name-v0", ""])
def test_a_malformed_id_is_not_looked_for(tmp_path, wrong):
    with pytest.raises(InvalidParameter, match="malformed"):
        load_minari(wrong, root=tmp_path)


def test_load_minari_opens_what_was_written(root, env):
    dataset = load_minari(ID, root=root)
    assert dataset.total_episodes == 5 and dataset.recover_environment().spec.kwargs == env.spec.kwargs


def test_load_minari_looks_under_the_root_in_force(root, monkeypatch):
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(root))
    assert load_minari(ID).total_episodes == 5


def test_dictionary_observations_come_back(tmp_path):
    space = spaces.Dict(a=spaces.Discrete(3), b=spaces.MultiDiscrete([2, 2]))

    class Room(gym.Env):
        observation_space, action_space = space, spaces.Discrete(2, start=1)
        spec = None

    observations = {"a": np.array([0, 2]), "b": np.array([[0, 1], [1, 1]])}
    write_minari(
        [Episode(observations, np.array([1]), np.zeros(1), True, False)], "room-v0", Room(), root=tmp_path, algorithm="x"
    )
    (again,) = read_minari("room-v0", root=tmp_path, states=StateIndex(space))
    assert again.rows(StateIndex(space)).tolist() == [1, 11] and again.actions.tolist() == [1]


def test_minari_root_is_restored(tmp_path, monkeypatch):
    monkeypatch.delenv("MINARI_DATASETS_PATH", raising=False)
    with minari_root(tmp_path):
        pass
    import os

    assert "MINARI_DATASETS_PATH" not in os.environ
