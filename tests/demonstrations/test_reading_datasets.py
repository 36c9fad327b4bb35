"""Datasets that name no environment are read, and what is broken in others is named."""

import json

import gymnasium as gym
import h5py
import numpy as np
import pytest
from gymnasium import spaces

from irl_gym.demonstrations.datasets import load_minari, read_minari, write_minari
from irl_gym.errors import DatasetMismatch, InvalidDemonstrations, InvalidParameter, UnknownObservation
from irl_gym.mdp.episodes import Episode, empirical_policy
from irl_gym.spaces.states import StateIndex

ID = "me/log-v0"
pytestmark = pytest.mark.filterwarnings("ignore::UserWarning")


@pytest.fixture
def lake():
    return gym.make("FrozenLake-v1", is_slippery=False)


@pytest.fixture
def write(tmp_path):
    def written(env, **given):
        episodes = [Episode(np.array([0, 4, 8]), np.array([1, 1]), np.zeros(2), False, True) for _ in range(3)]
        write_minari(episodes, ID, env, root=tmp_path, algorithm="a log", **given)
        return tmp_path / ID / "data"

    return written


@pytest.fixture
def spaceless(write):
    return write(None, observation_space=spaces.Discrete(16), action_space=spaces.Discrete(4))


def recorded_in(data, name):
    content = json.loads((data / "metadata.json").read_text())
    content["env_spec"] = json.dumps({**json.loads(content["env_spec"]), "id": name})
    (data / "metadata.json").write_text(json.dumps(content))


def changed(data, column, values):
    """The column of episode 1, with other values."""
    with h5py.File(data / "main_data.hdf5", "r+") as file:
        del file[f"episode_1/{column}"]
        file[f"episode_1/{column}"] = values


def test_a_dataset_without_an_environment_is_read_with_one_of_its_spaces(spaceless, tmp_path, lake):
    assert sum(1 for _ in read_minari(ID, root=tmp_path, env=lake)) == 3


@pytest.mark.parametrize(
    ("name", "says"),
    [("FrozenLake8x8-v1", r"observations of Discrete\(16\): expected Discrete\(64\)"), ("CliffWalking-v1", "48")],
)
def test_a_dataset_without_an_environment_is_refused_with_one_of_other_spaces(spaceless, tmp_path, name, says):
    with pytest.raises(DatasetMismatch, match=says):
        next(iter(read_minari(ID, root=tmp_path, env=gym.make(name))))


def test_other_actions_are_refused(write, tmp_path, lake):
    write(None, observation_space=spaces.Discrete(16), action_space=spaces.Discrete(5))
    with pytest.raises(DatasetMismatch, match=r"actions of Discrete\(5\): expected Discrete\(4\)"):
        next(iter(read_minari(ID, root=tmp_path, env=lake)))


def test_a_dataset_of_an_environment_unknown_here_is_read_with_one_of_its_spaces(write, tmp_path, lake):
    recorded_in(write(lake), "Nobody-v7")
    assert sum(1 for _ in read_minari(ID, root=tmp_path, env=lake)) == 3


def test_a_dataset_of_a_known_environment_is_refused_with_another_of_its_spaces(write, tmp_path, lake):
    recorded_in(write(lake), "CliffWalking-v1")
    with pytest.raises(DatasetMismatch, match=r"recorded in CliffWalking-v1"):
        next(iter(read_minari(ID, root=tmp_path, env=lake)))


@pytest.mark.parametrize(
    "break_it", [lambda data: (data / "metadata.json").unlink(), lambda data: data.rename(data.parent / "x")]
)
def test_a_folder_that_is_no_dataset_is_refused(spaceless, tmp_path, break_it):
    break_it(spaceless)
    with pytest.raises(InvalidDemonstrations, match=rf"dataset '{ID}' cannot be read .* whole Minari dataset. Copy"):
        load_minari(ID, root=tmp_path)


def test_a_file_that_was_cut_off_is_refused(spaceless, tmp_path):
    path = spaceless / "main_data.hdf5"
    path.write_bytes(path.read_bytes()[:1000])
    with pytest.raises(InvalidDemonstrations, match=f"dataset '{ID}' cannot be read"):
        list(read_minari(ID, root=tmp_path))


def test_a_malformed_id_is_told_in_our_words(tmp_path):
    with pytest.raises(InvalidParameter, match=r"^dataset id 'me' is malformed: expected namespace/name-v0\.$"):
        load_minari("me", root=tmp_path)


def test_an_episode_without_steps_is_named(spaceless, tmp_path):
    for column in ("actions", "rewards", "terminations", "truncations"):
        changed(spaceless, column, np.zeros(0, dtype=int))
    with pytest.raises(InvalidDemonstrations, match=f"dataset '{ID}', episode 1 has no steps"):
        list(read_minari(ID, root=tmp_path))


def test_a_reward_that_is_not_finite_is_named(spaceless, tmp_path):
    changed(spaceless, "rewards", [0.0, np.nan])
    with pytest.raises(InvalidDemonstrations, match="episode 1, step 1 has reward nan: expected a finite number"):
        list(read_minari(ID, root=tmp_path))


def test_an_observation_out_of_range_names_its_episode(spaceless, tmp_path):
    changed(spaceless, "observations", [0, 99, 1])
    with pytest.raises(UnknownObservation, match=r"episode 1: .*99"):
        empirical_policy(read_minari(ID, root=tmp_path), StateIndex(spaces.Discrete(16)), 4)


def test_a_dataset_of_another_map_is_refused_in_words(tmp_path):
    small, large = (gym.make("FrozenLake-v1", map_name=name) for name in ("4x4", "8x8"))
    episode = Episode(np.array([0, 1]), np.array([2]), np.array([0.0]), False, True)
    write_minari([episode], "irl_gym/lake-v0", small, root=tmp_path, algorithm="nobody")
    with pytest.raises(
        DatasetMismatch, match="in FrozenLake-v1 with map_name='4x4': expected FrozenLake-v1 with map_name='8x8'"
    ):
        list(read_minari("irl_gym/lake-v0", env=large, root=tmp_path))
