"""Minari datasets: plain Minari opens them, and they come back as they were."""

import json

import gymnasium as gym
import minari
import numpy as np
import pytest
import tiny_env
from gymnasium import spaces
from minari.data_collector import EpisodeBuffer

from irl_gym.demonstrations.datasets import load_minari, minari_root, read_minari, write_minari
from irl_gym.demonstrations.recorded import recorded_environment
from irl_gym.errors import (
    DatasetExists,
    DatasetMismatch,
    InvalidDemonstrations,
    InvalidParameter,
    NotDiscrete,
    UnknownEnvironment,
)
from irl_gym.mdp.episodes import Episode, collect
from irl_gym.mdp.policies import TabularPolicy
from irl_gym.spaces.states import StateIndex

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
        next(iter(read_minari(ID, root=root, states=StateIndex(spaces.Discrete(64)))))


def test_a_dataset_of_the_same_environment_is_read(root, env):
    assert sum(1 for _ in read_minari(ID, root=root, env=env)) == 5


def test_a_dataset_of_an_environment_made_otherwise_is_refused(root):
    with pytest.raises(DatasetMismatch, match=r"is_slippery=False.*is_slippery=True"):
        next(iter(read_minari(ID, root=root, env=gym.make("FrozenLake-v1", is_slippery=True))))


def test_continuous_actions_are_refused(tmp_path):
    env = gym.make("Pendulum-v1")
    one = EpisodeBuffer(
        observations=np.zeros((2, 3), dtype=np.float32), actions=np.zeros((1, 1), dtype=np.float32), rewards=np.zeros(1),
        terminations=[False], truncations=[True], infos={},
    )  # fmt: skip
    with minari_root(tmp_path):
        minari.create_dataset_from_buffers("pendulum-v0", [one], env=env)
    with pytest.raises(NotDiscrete, match="Box"):
        next(iter(read_minari("pendulum-v0", root=tmp_path)))


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


SPACES = {"observation_space": spaces.Discrete(16), "action_space": spaces.Discrete(4)}


def test_spaces_alone_make_a_dataset_that_names_no_environment(episodes, tmp_path):
    dataset = write(episodes, None, tmp_path, **SPACES)
    assert dataset.env_spec is None and dataset.observation_space == spaces.Discrete(16)
    with pytest.raises(DatasetMismatch, match=f"{ID}' does not say where .* --env-id"):
        recorded_environment(dataset)


@pytest.mark.parametrize("missing", SPACES)
def test_no_environment_and_no_space_are_refused(episodes, tmp_path, missing):
    with pytest.raises(InvalidParameter, match=f"Give {missing}"):
        write(episodes, None, tmp_path, **{**SPACES, missing: None})


def test_a_space_that_minari_cannot_keep_is_refused(episodes, tmp_path):
    with pytest.raises(InvalidParameter, match=r"observation_space is Sequence.*Minari can keep"):
        write(episodes, None, tmp_path, **{**SPACES, "observation_space": spaces.Sequence(spaces.Discrete(2))})


@pytest.mark.parametrize("data_format", ["hdf5", "arrow"])
def test_both_formats_hold_the_same(episodes, env, tmp_path, data_format):
    write(iter(episodes), env, tmp_path, data_format=data_format)
    assert [str(vars(one)) for one in read_minari(ID, root=tmp_path)] == [str(vars(one)) for one in episodes]


def test_another_format_is_refused(unchecked, episodes, env, tmp_path):
    with pytest.raises(InvalidParameter, match="data_format is 'csv'"):
        write(episodes, env, tmp_path, data_format="csv")


def test_the_environment_that_was_recorded_is_made(root, env):
    assert recorded_environment(load_minari(ID, root=root)).spec.kwargs == env.spec.kwargs


def rewritten(root, **changes):
    """The dataset, with another environment in its spec."""
    path = root / ID / "data" / "metadata.json"
    content = json.loads(path.read_text())
    content["env_spec"] = json.dumps({**json.loads(content["env_spec"]), **changes})
    path.write_text(json.dumps(content))
    return load_minari(ID, root=root)


def test_an_environment_that_is_unknown_here_is_named(root):
    dataset = rewritten(root, id="their/Maze-v3", entry_point="their_package:Maze")
    with pytest.raises(UnknownEnvironment, match=r"'their/Maze-v3'.*their_package.*package that registers it.*--env-id"):
        recorded_environment(dataset)


def test_an_environment_that_takes_other_arguments_here_is_refused(root):
    with pytest.raises(DatasetMismatch, match=r"cannot be made here.*depth"):
        recorded_environment(rewritten(root, kwargs={"depth": 3}))


def test_an_empty_dataset_is_refused_when_read(env, tmp_path):
    with minari_root(tmp_path):
        minari.create_dataset_from_buffers("empty-v0", [], env=env)
    with pytest.raises(InvalidDemonstrations, match="'empty-v0' has no episodes"):
        next(iter(read_minari("empty-v0", root=tmp_path)))


def test_a_wrapper_makes_another_environment(episodes, env, tmp_path):
    write(episodes, gym.wrappers.ClipReward(env, 0, 1), tmp_path)
    for other in (env, gym.wrappers.ClipReward(env, 0, 0.5)):
        with pytest.raises(DatasetMismatch, match="ClipReward"):
            next(iter(read_minari(ID, root=tmp_path, env=other)))
    assert sum(1 for _ in read_minari(ID, root=tmp_path, env=gym.wrappers.ClipReward(env, 0, 1))) == 5


def test_a_wrapper_that_only_watches_makes_no_other_environment(root, env):
    assert sum(1 for _ in read_minari(ID, root=root, env=gym.wrappers.RecordEpisodeStatistics(env))) == 5


@pytest.fixture
def registered():
    """An environment registered with its class, as a user's own mostly is."""
    gym.register("tests/Coin-v0", entry_point=tiny_env.TableEnv, kwargs={"P": tiny_env.coin(), "start": [1.0, 0.0]})
    yield gym.make("tests/Coin-v0", disable_env_checker=True)
    del gym.registry["tests/Coin-v0"]


def test_an_environment_registered_with_its_class_is_made_again(registered, tmp_path):
    actor = TabularPolicy(np.ones((2, 1)), StateIndex(spaces.Discrete(2)))
    dataset = write(collect(registered, actor, 3), registered, tmp_path)
    assert type(recorded_environment(dataset).unwrapped) is tiny_env.TableEnv


def test_an_environment_that_nobody_could_make_again_is_refused(episodes, env, tmp_path):
    env.unwrapped.spec.entry_point = lambda: None
    with pytest.raises(InvalidParameter, match=r"FrozenLake-v1 cannot be written as json.*entry_point='module:Class'"):
        write(episodes, env, tmp_path)
    assert not list(tmp_path.iterdir())


def test_a_dataset_is_a_sequence_of_its_episodes(tmp_path):
    env = gym.make("FrozenLake-v1")
    actor = TabularPolicy(np.full((16, 4), 0.25), StateIndex(env.observation_space))
    made = list(collect(env, actor, 5, seed=0))
    write_minari(made, ID, env, root=tmp_path, algorithm="random")
    read = read_minari(ID, root=tmp_path)
    told = [str(vars(one)) for one in made]
    assert len(read) == 5 and [str(vars(one)) for one in read] == [str(vars(one)) for one in read] == told
    assert [str(vars(read[i])) for i in (0, -1)] == [told[0], told[-1]]
    assert [str(vars(one)) for one in read[1:4][::2]] == told[1:4:2]
    with pytest.raises(IndexError):
        read[5]
