"""Tables of steps: how columns are named, how text is read, and what is refused, by row and line."""

import sys

import numpy as np
import pandas as pd
import pytest
from gymnasium import spaces

from irl_gym.demonstrations.imports.frames import from_frame
from irl_gym.errors import DatasetMissing, InvalidDemonstrations, InvalidParameter, NotInstalled

LAKE = {"space": spaces.Discrete(16), "n_actions": 4}
LOG = """episode,step,observation,action,reward,done
0,0,0,1,0.0,False
0,1,4,1,0.0,False
0,2,8,2,1.0,True
1,0,0,2,0.0,False
1,1,1,3,0.5,False
"""


@pytest.fixture
def log(tmp_path):
    def write(text=LOG, name="log.csv"):
        (tmp_path / name).write_text(text)
        return tmp_path / name

    return write


def seen(episodes):
    return [(one.observations.tolist(), one.actions.tolist(), one.rewards.tolist(), one.terminated) for one in episodes]


def test_a_file_becomes_episodes(log):
    assert seen(from_frame(log(), terminated="done", **LAKE)) == [
        ([0, 4, 8, 8], [1, 1, 2], [0, 0, 1], True),
        ([0, 1, 1], [2, 3], [0, 0.5], False),
    ]


def test_a_file_is_also_named_by_text(log):
    assert len(from_frame(str(log()), **LAKE)) == 2


def test_repeat_takes_the_last_observation_for_what_the_last_action_led_to(log):
    episodes = from_frame(log(), last="repeat", terminated="done", **LAKE)
    assert [(one.actions.tolist(), one.ending, one.terminated) for one in episodes] == [
        ([1, 1, 2], "seen", False),
        ([2, 3], "seen", False),
    ]


def test_drop_leaves_out_the_last_action_and_says_so(log):
    with pytest.warns(UserWarning, match="the last action of 2 of 2 episodes is dropped"):
        episodes = from_frame(log(), last="drop", terminated="done", **LAKE)
    assert seen(episodes) == [([0, 4, 8], [1, 1], [0, 0], False), ([0, 1], [2], [0], False)]


def test_next_observations_keep_the_last_action_and_its_end(log):
    frame = pd.read_csv(log()).assign(after=[4, 8, 15, 1, 2])
    episodes = from_frame(frame, next_observation="after", terminated="done", **LAKE)
    assert seen(episodes) == [([0, 4, 8, 15], [1, 1, 2], [0, 0, 1], True), ([0, 1, 2], [2, 3], [0, 0.5], False)]


def test_flags_cut_where_there_are_no_episodes_and_steps(log):
    episodes = from_frame(log(), episode=None, step=None, terminated="done", last="repeat", **LAKE)
    assert [len(one) for one in episodes] == [3, 2]


def test_a_file_without_episodes_and_flags_is_one_episode(log):
    assert [len(one) for one in from_frame(log(), episode=None, step=None, last="repeat", **LAKE)] == [5]


def test_steps_may_start_anywhere(log):
    frame = pd.read_csv(log())
    assert len(from_frame(frame.assign(step=frame["step"] + 7), **LAKE)) == 2


def test_episodes_may_have_names(log):
    frame = pd.read_csv(log())
    assert len(from_frame(frame.assign(episode=np.where(frame["episode"] == 0, "Ann", "Bob")), **LAKE)) == 2


def test_columns_may_have_any_names(log):
    path = log(LOG.replace("observation", "cell").replace("action", "move").replace("episode", "run").replace("step", "t"))
    episodes = from_frame(path, episode="run", step="t", observation="cell", action="move", reward=None, **LAKE)
    assert [one.rewards.tolist() for one in episodes] == [[0.0, 0.0, 0.0], [0.0, 0.0]]


@pytest.mark.parametrize("texts", [["(13, 10, 0)", "(20, 10, 1)"], ["[13 10  0]", "[20 10 1]"], ["13;10;False", "20;10;True"]])
def test_text_is_read_as_numbers(texts):
    space = spaces.Tuple([spaces.Discrete(32), spaces.Discrete(11), spaces.Discrete(2)])
    frame = pd.DataFrame({"episode": 0, "step": [0, 1], "observation": texts, "action": [1, 0]})
    (one,) = from_frame(frame, reward=None, space=space, n_actions=2)
    assert [part.tolist() for part in one.observations] == [[13, 20, 20], [10, 10, 10], [0, 1, 1]]


def test_lists_in_parquet_are_vectors(tmp_path):
    frame = pd.DataFrame({"episode": 0, "step": [0, 1], "observation": [[0.5, 1.5], [-0.25, 2.0]], "action": [1, 0]})
    frame.to_parquet(tmp_path / "log.parquet")
    (one,) = from_frame(tmp_path / "log.parquet", reward=None, space=spaces.Box(-3, 3, (2,), np.float32), n_actions=2)
    assert one.observations.tolist() == [[0.5, 1.5], [-0.25, 2.0], [-0.25, 2.0]]


def test_nullable_columns_are_read(log):
    frame = pd.read_csv(log()).astype({"action": "Int64", "observation": "Int64", "done": "boolean"})
    assert len(from_frame(frame, terminated="done", **LAKE)) == 2


def swap(line, text):
    """The log with another data row; rows count from 1."""
    lines = LOG.splitlines()
    lines[line] = text
    return "\n".join(lines) + "\n"


REFUSED = {
    "action out of range": (
        swap(4, "1,0,0,4,0.0,False"),
        r"^row 4 \(line 5 of log.csv\) has action 4: expected .* from 0 to 3",
    ),
    "action fraction": (swap(2, "0,1,4,2.5,0.0,False"), r"^row 2 \(line 3 of log.csv\) has action 2.5"),
    "action text": (swap(2, "0,1,4,left,0.0,False"), r"^row 2 \(line 3 .*\) has action 'left': expected numbers"),
    "action empty": (swap(2, "0,1,4,,0.0,False"), r"^row 2 \(line 3 .*\) has action nan"),
    "observation outside": (
        swap(3, "0,2,16,2,1.0,True"),
        r"^row 3 \(line 4 .*\) has observation 16: expected .*Discrete\(16\)",
    ),
    "observation empty": (swap(3, "0,2,,2,1.0,True"), r"^row 3 \(line 4 .*\) has observation nan"),
    "observation text": (swap(3, "0,2,(x),2,1.0,True"), r"^row 3 \(line 4 .*\) has observation '\(x\)'"),
    "reward empty": (swap(3, "0,2,8,2,,True"), r"^row 3 \(line 4 .*\) has reward nan"),
    "episode empty": (swap(3, ",2,8,2,1.0,True"), r"^row 3 \(line 4 .*\) has no episode"),
    "step empty": (swap(3, "0,,8,2,1.0,True"), r"^row 3 \(line 4 .*\) has step nan"),
    "step fraction": (swap(3, "0,1.5,8,2,1.0,True"), r"^row 3 \(line 4 .*\) has step 1.5"),
    "gap": (swap(3, "0,3,8,2,1.0,True"), r"^row 3 \(line 4 .*\) has step 3: expected step 2 after step 1"),
    "duplicate": (swap(3, "0,1,8,2,1.0,True"), r"^row 3 \(line 4 .*\) has step 1 again, as row 2 \(line 3 .*\) has"),
    "middle": (swap(1, "0,0,0,1,0.0,True"), r"^row 1 \(line 2 .*\) is terminated in the middle"),
    "flag": (swap(1, "0,0,0,1,0.0,7"), r"^row 1 \(line 2 .*\) has terminated 7"),
    "flag empty": (swap(2, "0,1,4,1,0.0,"), r"^row 2 \(line 3 .*\) has terminated nan"),
    "flag text": (swap(2, "0,1,4,1,0.0,maybe"), r"^row 2 \(line 3 .*\) has terminated 'maybe'"),
    "short row": (swap(2, "0,1,4"), r"^row 2 \(line 3 .*\) has action nan"),
    "long row": (swap(2, "0,1,4,1,0.0,False,9,9"), "line 3"),
    "all rows long": ("a,b\n1,2,3\n1,2,3\n", "more fields than its header|no column"),
    "every row longer": (LOG.replace("False", "False,1").replace("True", "True,1"), "more fields than its header"),
    "no rows": (LOG.splitlines()[0], "there are no rows"),
    "empty file": ("", "log.csv is empty: there are no rows"),
    "missing column": (LOG.replace("action", "acton"), r"^log.csv has no column 'action': .* Did you mean action='acton'\?"),
    "no such column": (LOG.replace("episode", "zzz"), r"no column 'episode': expected it for episode, .* Name the right one"),
    "blank lines count": (LOG.replace("0,1,4", "\n\n0,1,4").replace("4,1", "4,9"), r"^row 2 \(line 5 .*\) has action 9"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_right_is_refused_by_row_and_line(case, log):
    text, message = REFUSED[case]
    with pytest.raises(InvalidDemonstrations, match=message):
        from_frame(log(text), terminated="done", **LAKE)


def test_the_row_of_an_unsorted_file_is_the_files_row(log):
    lines = LOG.replace("8,2", "8,9").splitlines()
    with pytest.raises(InvalidDemonstrations, match=r"^row 1 \(line 2 of log.csv\) has action 9"):
        from_frame(log("\n".join([lines[0], *lines[:0:-1][2:], *lines[4:]]) + "\n"), **LAKE)


def test_a_row_of_several_lines_is_named_by_its_first(log):
    text = 'note,episode,step,observation,action\n"two\nlines",0,0,0,1\nx,0,1,99,1\n'
    with pytest.raises(InvalidDemonstrations, match=r"^row 2 \(line 4 of log.csv\) has observation 99"):
        from_frame(log(text), reward=None, **LAKE)


def test_the_row_of_a_frame_is_named_with_its_index(log):
    frame = pd.read_csv(log()).set_index(pd.Index(list("abcde")))
    frame.loc["d", "action"] = 17
    with pytest.raises(InvalidDemonstrations, match=r"^row 4 \(index d\) has action 17"):
        from_frame(frame, **LAKE)


def test_the_row_of_a_parquet_file_is_named(log, tmp_path):
    pd.read_csv(log()).assign(action=[1, 1, 1, 1, -1]).to_parquet(tmp_path / "log.parquet")
    with pytest.raises(InvalidDemonstrations, match=r"^row 5 of log.parquet has action -1"):
        from_frame(tmp_path / "log.parquet", **LAKE)


def test_two_columns_of_one_name_are_refused(log):
    frame = pd.read_csv(log()).rename(columns={"done": "action"})
    with pytest.raises(InvalidDemonstrations, match="2 columns 'action': expected one"):
        from_frame(frame, **LAKE)


def test_a_column_in_use_is_not_offered_for_another(log):
    with pytest.raises(InvalidDemonstrations, match=r"no column 'action'.* Name the right one with action="):
        from_frame(log(LOG.replace("action", "move")), **LAKE)


def test_a_step_too_large_to_count_is_refused(log):
    with pytest.raises(InvalidDemonstrations, match=r"row 2 \(line 3 of log.csv\) has step 1e\+300: expected a whole number"):
        from_frame(log(LOG.replace("0,1,4", "0,1e300,4")), **LAKE)


def test_an_empty_frame_is_refused(log):
    with pytest.raises(InvalidDemonstrations, match="there are no rows"):
        from_frame(pd.read_csv(log())[:0], **LAKE)


def test_a_value_of_a_vector_is_named_with_its_row(log):
    frame = pd.read_csv(log()).assign(x=0.5, y=[0, 0, 0, np.nan, 0])
    with pytest.raises(InvalidDemonstrations, match=r"^row 4 \(index 3\) has observation \[0.5, nan\]"):
        from_frame(frame, observation=["x", "y"], space=spaces.Box(-1, 1, (2,), np.float32), n_actions=4)


def test_texts_of_different_lengths_are_refused():
    frame = pd.DataFrame({"episode": 0, "step": [0, 1], "observation": ["(1, 2)", "(1)"], "action": 0})
    with pytest.raises(InvalidDemonstrations, match=r"^row 2 .* has observation '\(1\)': expected 2 numbers"):
        from_frame(frame, reward=None, space=spaces.MultiDiscrete([3, 3]), n_actions=2)


@pytest.mark.parametrize(
    "observation, space, message",
    [
        ("observation", spaces.Dict(a=spaces.Discrete(16)), "expected a dictionary with columns"),
        ({"b": "observation"}, spaces.Dict(a=spaces.Discrete(16)), r"columns of \['b'\]"),
        (["observation"], spaces.Tuple([spaces.Discrete(16)] * 2), "names 1 columns: expected 2"),
        (5, spaces.Discrete(16), "observation is 5"),
    ],
)
def test_columns_that_do_not_fit_the_space_are_refused(observation, space, message, log):
    with pytest.raises(InvalidParameter, match=message):
        from_frame(log(), observation=observation, space=space, n_actions=4)


def test_a_missing_file_is_refused(tmp_path):
    with pytest.raises(DatasetMissing, match=r"nothing.csv is not a file"):
        from_frame(tmp_path / "nothing.csv", **LAKE)


@pytest.mark.parametrize("source", ["log.xls", 5, [[1, 2]]])
def test_other_sources_are_refused(source):
    with pytest.raises(InvalidParameter, match="expected"):
        from_frame(source, **LAKE)


@pytest.mark.parametrize("name", ["log.parquet", "log.csv"])
def test_a_file_that_is_something_else_is_refused(name, tmp_path):
    (tmp_path / name).write_bytes(b"\x89PNG\r\n\x1a\n\xff\xfe")
    with pytest.raises(InvalidDemonstrations, match="cannot be read"):
        from_frame(tmp_path / name, **LAKE)


def test_a_missing_package_says_what_to_install(log, monkeypatch):
    path = log(name="log.parquet")
    monkeypatch.setitem(sys.modules, "pyarrow.parquet", None)
    with pytest.raises(NotInstalled, match=r'pip install "irl_gym\[data\]"'):
        from_frame(path, **LAKE)


def test_a_log_without_rewards_is_read(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("episode,step,observation,action\n0,0,0,1\n0,1,4,1\n0,2,8,2\n")
    (episode,) = from_frame(path, space=spaces.Discrete(16), n_actions=4)
    assert (episode.rewards.tolist(), episode.terminated) == ([0.0, 0.0, 0.0], False)


def test_a_column_named_terminated_is_read_without_being_asked_for(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("episode,step,observation,action,terminated\n0,0,0,1,true\n0,1,4,1,false\n")
    with pytest.raises(InvalidDemonstrations, match=r"row 1 .*terminated"):
        from_frame(path, space=spaces.Discrete(16), n_actions=4)


def test_a_column_of_rewards_that_is_named_has_to_be_there(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("episode,step,observation,action\n0,0,0,1\n0,1,4,1\n")
    with pytest.raises(InvalidDemonstrations, match="no column 'paid': expected it for reward"):
        from_frame(path, reward="paid", space=spaces.Discrete(16), n_actions=4)
