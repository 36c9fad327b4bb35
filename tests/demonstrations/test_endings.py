"""No action is taught in an end: recordings that go on behind one are refused or cut, by name."""

import gymnasium as gym
import h5py
import numpy as np
import pytest
import tyro

from irl_gym.agents.planners import ValueIteration
from irl_gym.commands.arguments import Arguments
from irl_gym.commands.terminal import OPTIONS
from irl_gym.demonstrations.datasets import read_minari, write_minari
from irl_gym.demonstrations.endings import in_table
from irl_gym.errors import InvalidDemonstrations, InvalidParameter
from irl_gym.learners.linear_programs.finite import FiniteLP
from irl_gym.loop.loop import Loop
from irl_gym.mdp.episodes import Episode
from irl_gym.runs.experiment import Experiment

ID = "me/log-v0"
pytestmark = pytest.mark.filterwarnings("ignore::UserWarning")


@pytest.fixture
def lake():
    return gym.make("FrozenLake-v1", is_slippery=False)


def one(observations, actions, terminated=False):
    return Episode(np.array(observations), np.array(actions), np.zeros(len(actions)), terminated, not terminated)


@pytest.fixture
def data(tmp_path, lake):
    """Two episodes of five steps; the file of the second may be changed by column."""
    episodes = [one([0, 4, 8, 9, 10, 14], [1, 1, 2, 2, 1]) for _ in range(2)]
    write_minari(episodes, ID, lake, root=tmp_path, algorithm="a log")

    def changed(**columns):
        with h5py.File(tmp_path / ID / "data" / "main_data.hdf5", "r+") as file:
            for column, values in columns.items():
                del file[f"episode_1/{column}"]
                file[f"episode_1/{column}"] = values

    return changed


def read(root, after_end="refuse"):
    return list(read_minari(ID, root=root, after_end=after_end))[1]


@pytest.mark.parametrize("flag", ["terminations", "truncations"])
def test_an_episode_that_goes_on_after_an_end_is_refused_by_name(data, tmp_path, flag):
    data(**{flag: [False, True, False, False, True]})
    words = {"terminations": "terminated", "truncations": "truncated"}[flag]
    with pytest.raises(InvalidDemonstrations, match=rf"episode 1 goes on for 3 more steps after step 1, which is {words}"):
        read(tmp_path)


def test_an_ending_that_is_no_text_is_refused(data, tmp_path):
    with h5py.File(tmp_path / ID / "data" / "main_data.hdf5", "r+") as file:
        file["episode_1"].attrs["irl_gym_ending"] = np.array([1, 2])
    with pytest.raises(InvalidDemonstrations, match="episode 1 has irl_gym_ending"):
        read(tmp_path)


def test_an_episode_that_goes_on_after_an_end_is_cut_there_when_told(data, tmp_path):
    data(terminations=[False, True, False, False, True])
    cut = read(tmp_path, "cut")
    assert (cut.observations.tolist(), cut.actions.tolist(), cut.terminated) == ([0, 4, 8], [1, 1], True)


@pytest.mark.parametrize("column", ["terminations", "truncations", "rewards"])
@pytest.mark.parametrize("count", [3, 7])
def test_an_episode_with_another_number_of_flags_is_refused_by_name(data, tmp_path, column, count):
    data(**{column: np.zeros(count, dtype=bool if column != "rewards" else float)})
    with pytest.raises(InvalidDemonstrations, match=rf"episode 1 has 5 actions and {count} {column}: expected 5"):
        read(tmp_path)


@pytest.mark.parametrize("choice", ["refuse", "cut"])
@pytest.mark.parametrize(
    ("column", "values"), [("terminations", np.zeros(0, bool)), ("rewards", np.zeros(0)), ("observations", [0])]
)
def test_an_episode_without_any_of_something_is_told_what_is_not_there(data, tmp_path, column, values, choice):
    data(**{column: values})
    with pytest.raises(
        InvalidDemonstrations, match=rf"episode 1 has 5 actions and no {column} for them: expected at least one"
    ):
        read(tmp_path, choice)


def test_an_episode_with_too_few_flags_is_cut_to_the_steps_that_have_them(data, tmp_path):
    data(terminations=np.zeros(3, dtype=bool))
    cut = read(tmp_path, "cut")
    assert (cut.observations.tolist(), cut.truncated) == ([0, 4, 8, 9], True)


def test_a_flag_beyond_the_last_step_ends_nothing(data, tmp_path):
    data(terminations=[False] * 6 + [True])
    assert not read(tmp_path, "cut").terminated


def test_an_episode_without_its_last_observation_is_refused_by_name(data, tmp_path):
    data(observations=[0, 4, 8, 9, 10])
    with pytest.raises(InvalidDemonstrations, match="episode 1 has 5 actions and 5 observations: expected 6, the last one"):
        read(tmp_path)


@pytest.mark.parametrize("flags", [[0, 2, 0, 0, 0], [[0], [0], [0], [0], [0]], [np.nan, 0, 0, 0, 0]])
def test_flags_that_are_no_booleans_are_refused_by_name(data, tmp_path, flags):
    data(terminations=flags)
    with pytest.raises(InvalidDemonstrations, match="episode 1 has terminations of shape"):
        read(tmp_path)


def test_rewards_behind_an_end_are_not_read_when_cut(data, tmp_path):
    data(terminations=[True, False, False, False, True], rewards=[1.0, np.nan, 0, 0, 0])
    assert read(tmp_path, "cut").rewards.tolist() == [1.0]


def test_another_choice_is_refused(data, tmp_path, unchecked):
    with pytest.raises(InvalidParameter, match="after_end is 'drop': expected 'refuse' or 'cut'"):
        read(tmp_path, "drop")


# --- ends that only the table knows ---

HOLE = one([0, 4, 5, 9, 8], [1, 2, 1, 0])  # 5 is a hole of FrozenLake


def in_lake(toy_text, episodes, after_end):
    table = toy_text("FrozenLake 4x4")
    return list(in_table(episodes, table.mdp, table.states, after_end))


def test_an_episode_that_acts_in_a_terminal_state_is_refused_by_name(toy_text):
    with pytest.raises(
        InvalidDemonstrations, match="episode 1, step 2 acts in observation 5, in which the environment has ended"
    ):
        in_lake(toy_text, [one([0, 4], [1]), HOLE], "refuse")


def test_an_episode_that_acts_in_a_terminal_state_ends_there_when_cut(toy_text):
    (cut,) = in_lake(toy_text, [HOLE], "cut")
    assert (cut.observations.tolist(), cut.actions.tolist(), cut.terminated, cut.truncated) == ([0, 4, 5], [1, 2], True, False)


def test_an_episode_that_begins_in_an_end_is_left_out_when_cut(toy_text):
    kept = in_lake(toy_text, [one([5, 9], [1]), one([0, 4], [1])], "cut")
    assert [list(each.observations) for each in kept] == [[0, 4]]


def test_episodes_that_all_begin_in_an_end_are_refused(toy_text):
    with pytest.raises(InvalidDemonstrations, match="every episode begins in an end"):
        in_lake(toy_text, [one([5, 9], [1])], "cut")


# --- the loop ---


def asked(root, **more):
    return Experiment(
        None, 0.99, dataset=ID, dataset_root=str(root), learner=FiniteLP(slack=1.0), retrain=ValueIteration(), **more
    )


def test_the_loop_teaches_no_action_in_an_end(data, tmp_path):
    data(observations=[0, 4, 5, 9, 8, 8], actions=[1, 2, 1, 0, 0])
    with pytest.raises(InvalidDemonstrations, match=r"acts in observation 5.*--after-end cut"):
        Loop(asked(tmp_path), tmp_path / "refused").stage("expert")
    loop = Loop(asked(tmp_path, after_end="cut"), tmp_path / "run")
    loop.stage("expert")
    assert np.isnan(np.load(tmp_path / "run" / "expert.npz")["actions"][5]).all()
    assert loop.stage("demonstrations")["steps_cut"] == 3


def test_the_command_line_has_the_choice_in_the_same_words():
    given = tyro.cli(Arguments, args=["--dataset", ID, "--after-end", "cut"], config=OPTIONS)
    assert given.experiment().after_end == "cut"


def test_a_run_of_an_earlier_version_is_known_again(tmp_path):
    assert "after_end" not in asked(tmp_path).to_json()
    assert asked(tmp_path, after_end="cut").to_json()["after_end"] == "cut"
