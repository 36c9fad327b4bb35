"""Layouts of the package imitation and of D4RL, and what is refused."""

from types import SimpleNamespace

import h5py
import numpy as np
import pytest
from gymnasium import spaces

from irl_gym.demonstrations.imports.trajectories import from_d4rl, from_imitation
from irl_gym.errors import DatasetMissing, InvalidDemonstrations

LAKE = {"space": spaces.Discrete(16), "n_actions": 4}
GOOD = {"obs": [0, 4, 8], "acts": [1, 1]}


def test_objects_of_imitation_are_read():
    one = SimpleNamespace(obs=np.array([0, 4, 8]), acts=np.array([1, 1]), rews=np.array([0.0, 1.0]), infos=None, terminal=True)
    (episode,) = from_imitation([one], **LAKE)
    assert episode.rewards.tolist() == [0.0, 1.0] and (episode.terminated, episode.truncated) == (True, False)


def test_one_trajectory_needs_no_list():
    assert len(from_imitation(GOOD, **LAKE)) == 1


def test_a_time_limit_in_the_infos_is_a_truncation():
    limited = GOOD | {"terminal": True, "infos": [{}, {"TimeLimit.truncated": True}]}
    (episode,) = from_imitation([limited], **LAKE)
    assert (episode.terminated, episode.truncated) == (False, True)


def test_a_trajectory_without_terminal_is_truncated():
    (episode,) = from_imitation([GOOD], **LAKE)
    assert (episode.terminated, episode.truncated) == (False, True)


def test_wrapped_dictionaries_of_imitation_are_unwrapped():
    space = spaces.Dict(a=spaces.Discrete(16))
    wrapped = SimpleNamespace(unwrap=lambda: {"a": np.array([0, 4, 8])})
    (episode,) = from_imitation([SimpleNamespace(obs=wrapped, acts=[1, 1], terminal=False)], space=space, n_actions=4)
    assert episode.observations["a"].tolist() == [0, 4, 8]


@pytest.mark.parametrize(
    "trajectories, message",
    [
        ([], "there are no trajectories"),
        ([GOOD, {"obs": [0, 1]}], r"trajectory 1 \(from 0\) is a dict without 'acts'"),
        ([GOOD, {"obs": [0], "acts": []}], "trajectory 1 .* has no steps"),
        ([GOOD, {"obs": [0, 4], "acts": [9]}], r"trajectory 1, step 0 \(from 0\) has action 9"),
        ([GOOD, {"obs": [0, 4], "acts": [1, 2, 3]}], "trajectory 1 .* has 2 observations and 3 actions"),
        ([GOOD | {"rews": [0, 1]}, GOOD], "trajectory 1 .* has no rews, but others have"),
        ([GOOD | {"terminal": "yes"}], "trajectory 0 .* has terminal 'yes'"),
    ],
)
def test_trajectories_that_cannot_be_right_are_refused(trajectories, message):
    with pytest.raises(InvalidDemonstrations, match=message):
        from_imitation(trajectories, **LAKE)


FLAT = {"observations": [0, 4, 0, 1, 5], "actions": [1, 1, 2, 3, 0], "terminals": [0, 1, 0, 0, 0], "timeouts": [0, 0, 0, 1, 0]}


def test_terminals_and_timeouts_end_episodes_and_the_rest_is_unfinished():
    episodes = from_d4rl(FLAT | {"next_observations": [4, 8, 1, 2, 6], "rewards": [1, 2, 3, 4, 5]}, **LAKE)
    assert [one.observations.tolist() for one in episodes] == [[0, 4, 8], [0, 1, 2], [5, 6]]
    assert [(one.terminated, one.truncated) for one in episodes] == [(True, False), (False, True), (False, True)]


def test_without_next_observations_the_rule_holds():
    episodes = from_d4rl(FLAT, **LAKE)
    assert [one.observations.tolist() for one in episodes] == [[0, 4, 4], [0, 1, 1], [5, 5]]
    assert [(one.terminated, one.ending) for one in episodes] == [(True, "unseen"), (False, "unseen"), (False, "unseen")]


def test_a_column_of_actions_is_read():
    assert from_d4rl(FLAT | {"actions": np.array([[1], [1], [2], [3], [0]])}, last="repeat", **LAKE)[0].actions.tolist() == [
        1,
        1,
    ]


@pytest.mark.parametrize(
    "change, message",
    [
        ({"actions": [0.5, 1, 1, 1, 1]}, r"row 0 \(from 0\) has action 0.5: .* number of a bin"),
        ({"actions": np.zeros((5, 3))}, r"actions have shape \(5, 3\)"),
        ({"actions": [1, 1]}, r"ends of the episodes are \(5,\) for 2 actions"),
        ({"timeouts": [0, 1]}, "5 terminals and 2 timeouts"),
        ({"observations": [0, 4, 0]}, "there are 3 observations: expected 5"),
        ({"rewards": [0, 4, 0]}, r"rewards have shape \(3,\): expected \(5,\)"),
        ({"terminals": [0, 0, 2, 0, 0]}, "row 2 .* has terminated 2"),
    ],
)
def test_arrays_that_cannot_be_right_are_refused(change, message):
    with pytest.raises(InvalidDemonstrations, match=message):
        from_d4rl(FLAT | change, **LAKE)


def test_an_episode_of_one_row_has_none_without_its_last_action():
    with pytest.raises(InvalidDemonstrations, match=r"row 4 .* is the only row of its episode, .* pass last='keep'"):
        from_d4rl(FLAT, last="drop", **LAKE)


def test_a_missing_array_offers_the_closest():
    with pytest.raises(InvalidDemonstrations, match=r"there is no 'terminals' .* Rename 'terminal'"):
        from_d4rl({"observations": [0], "actions": [1], "terminal": [True]}, **LAKE)


def test_no_rows_are_refused():
    with pytest.raises(InvalidDemonstrations, match="there are no rows"):
        from_d4rl({"observations": [], "actions": [], "terminals": []}, **LAKE)


def test_a_missing_file_is_refused(tmp_path):
    with pytest.raises(DatasetMissing, match="is not a file"):
        from_d4rl(tmp_path / "nothing.hdf5", **LAKE)


def test_a_file_that_is_not_hdf5_is_refused(tmp_path):
    (tmp_path / "log.hdf5").write_text("observations,actions\n")
    with pytest.raises(InvalidDemonstrations, match="cannot be read"):
        from_d4rl(tmp_path / "log.hdf5", **LAKE)


def test_a_file_without_the_arrays_is_refused(tmp_path):
    with h5py.File(tmp_path / "log.hdf5", "w") as file:
        file["actions"] = [1]
    with pytest.raises(InvalidDemonstrations, match=r"no 'observations' among \['actions'\]"):
        from_d4rl(tmp_path / "log.hdf5", **LAKE)
