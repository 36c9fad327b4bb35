"""Demonstrations of states alone: every source that may lack actions gives episodes without any, and none is made up."""

import numpy as np
import pandas as pd
import pytest
from gymnasium import spaces

from irl_gym.demonstrations.datasets import read_minari, write_minari
from irl_gym.demonstrations.imports import from_arrays, from_frame, from_pairs
from irl_gym.demonstrations.shards import Shards
from irl_gym.errors import InvalidDemonstrations, InvalidParameter
from irl_gym.mdp.episodes import Episode

LAKE = {"space": spaces.Discrete(16), "n_actions": 4}
TWO = [[0, 4, 8], [0, 1]]
LONG = [0, 4, 8, 0, 1]
FLAGS = [False, False, True, False, False]
FRAME = pd.DataFrame({"episode": [0, 0, 0, 1, 1], "step": [0, 1, 2, 0, 1], "observation": LONG, "terminated": FLAGS})
PLACES = {"space": spaces.Box(-9, 9, (2,)), "n_actions": 4}


def told(episodes):
    assert all(one.actions is None and one.ending == "seen" for one in episodes)
    return [(np.asarray(one.observations).tolist(), len(one), one.terminated, one.truncated) for one in episodes]


SOURCES = {
    "a list an episode": lambda: from_arrays(TWO, None, terminated=[True, False], **LAKE),
    "one long array with lengths": lambda: from_arrays(LONG, None, lengths=[2, 1], terminated=[True, False], **LAKE),
    "one long array with ends": lambda: from_arrays(LONG, None, ends=[0, 0, 1, 0, 1], terminated=FLAGS, **LAKE),
    "one long array with ids": lambda: from_arrays(LONG, None, episode=[0, 0, 0, 1, 1], terminated=FLAGS, **LAKE),
    "a frame": lambda: from_frame(FRAME, action=None, **LAKE),
    "a frame with last observations": lambda: from_frame(FRAME.assign(action=9), action=None, last="drop", **LAKE),
    "a frame with what follows": lambda: from_frame(
        FRAME.drop([2, 4]).assign(terminated=[False, True, False], then=[4, 8, 1]), action=None, next_observation="then", **LAKE
    ),
    "pairs": lambda: from_pairs(
        zip([0, 0, 0, 1, 1], LONG, FLAGS, strict=True), fields=("episode", "observation", "terminated"), **LAKE
    ),
}  # fmt: skip


@pytest.mark.parametrize("source", SOURCES)
def test_a_source_of_states_alone_gives_episodes_without_actions(source):
    assert told([*SOURCES[source]()]) == [([0, 4, 8], 2, True, False), ([0, 1], 1, False, True)]


def test_vectors_of_states_alone_are_episodes_too():
    found = from_arrays([np.zeros((3, 2)), np.ones((2, 2))], None, **PLACES)
    assert [(len(one), np.shape(one.observations)) for one in found] == [(2, (3, 2)), (1, (2, 2))]


def test_rewards_of_states_alone_are_one_a_step():
    assert from_arrays(TWO, None, rewards=[[1, 2], [3]], **LAKE)[0].rewards.tolist() == [1, 2]


@pytest.mark.parametrize(
    ("breaks", "said"),
    [
        (lambda: from_arrays(LONG, None, lengths=[3, 2], **LAKE), "add up to 5 steps in 2 episodes, of 5 obs.*expected 7"),
        (lambda: from_arrays([[0, 4], [0]], None, **LAKE), r"episode 1 \(from 0\) has no steps: expected at least two observ"),
        (lambda: from_arrays([], None, **LAKE), "no rows"),
        (lambda: from_frame(FRAME.drop([4]), action=None, **LAKE), r"row 4 .* is the only row of its ep.*which is no step"),
        (lambda: from_frame(FRAME, **LAKE), "has no column 'action'.* If only the states are known, pass action=None"),
    ],
)  # fmt: skip
def test_states_that_make_no_episode_are_refused(breaks, said):
    with pytest.raises(InvalidDemonstrations, match=said):
        breaks()


def test_pairs_without_observations_are_refused():
    with pytest.raises(InvalidParameter, match="expected observation, and others"):
        from_pairs([(1,)], fields=("action",), **LAKE)


# --- kept in files ---


def written(root, *actions, data_format="hdf5"):
    episodes = [Episode(np.array(TWO[0]), one, np.zeros(2), False, True) for one in actions]
    space = {"observation_space": spaces.Discrete(16), "action_space": spaces.Discrete(4, start=1)}
    return write_minari(episodes, "me/states-v0", None, root=root, algorithm="x", data_format=data_format, **space)


@pytest.mark.parametrize("data_format", ["hdf5", "arrow"])
@pytest.mark.filterwarnings("ignore::UserWarning")
def test_a_dataset_masks_actions_by_a_number_that_is_none_and_reads_them_as_missing(tmp_path, data_format):
    dataset = written(tmp_path, None, np.array([0, 3]), data_format=data_format)
    assert [one.actions.tolist() for one in dataset.iterate_episodes()] == [[-1, -1], [1, 4]]
    first, second = read_minari(dataset)
    assert first.actions is None and second.actions.tolist() == [0, 3]


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_an_episode_that_masks_some_of_its_actions_is_refused(tmp_path):
    dataset = written(tmp_path, np.array([-2, 3]))
    with pytest.raises(InvalidDemonstrations, match=r"episode 0, step 0 has action -1, .* it is masked, and others are not"):
        list(read_minari(dataset))


def test_shards_keep_episodes_of_states_alone(tmp_path):
    given = [
        Episode(np.array(TWO[0]), None, np.zeros(2), False, True),
        Episode(np.array([0, 1]), np.array([2]), np.zeros(1), True, False),
    ]
    Shards(tmp_path / "shards", spaces.Discrete(16)).append(given)
    found = [one.actions for one in Shards(tmp_path / "shards", spaces.Discrete(16))]
    assert found[0] is None and found[1].tolist() == [2]
