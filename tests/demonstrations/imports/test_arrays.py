"""Episodes from arrays, in each layout; and what is refused."""

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces

from irl_gym.demonstrations.imports.arrays import from_arrays
from irl_gym.errors import InvalidDemonstrations, InvalidParameter, NotDiscrete

LAKE = {"space": spaces.Discrete(16), "n_actions": 4}
LISTS = ([[0, 4, 8], [0, 1]], [[1, 1], [2]])


def seen(episodes):
    return [(one.observations.tolist(), one.actions.tolist(), one.terminated, one.truncated) for one in episodes]


WHOLE = [([0, 4, 8], [1, 1], True, False), ([0, 1], [2], False, True)]


def test_lists_of_any_length_become_episodes():
    assert seen(from_arrays(*LISTS, terminated=[True, False], **LAKE)) == WHOLE


def test_lists_of_arrays_become_episodes():
    arrays = [[np.array(one) for one in column] for column in LISTS]
    assert seen(from_arrays(*arrays, terminated=np.array([True, False]), **LAKE)) == WHOLE


def test_flags_may_be_a_list_for_each_episode():
    assert seen(from_arrays(*LISTS, terminated=[[False, True], [False]], **LAKE)) == WHOLE


def test_a_flag_may_hold_for_all():
    assert [one.terminated for one in from_arrays(*LISTS, terminated=True, **LAKE)] == [True, True]


@pytest.mark.parametrize(
    "cut", [{"ends": [False, True, True]}, {"lengths": [2, 1]}, {"episode": ["a", "a", "b"]}, {"ends": [False, True, False]}]
)
def test_one_long_array_is_cut(cut):
    assert seen(from_arrays([0, 4, 8, 0, 1], [1, 1, 2], terminated=[True, False], **cut, **LAKE)) == WHOLE


def test_flags_cut_one_long_array():
    flags = {"terminated": [False, True, False], "truncated": [False, False, True]}
    assert seen(from_arrays([0, 4, 8, 0, 1], [1, 1, 2], **flags, **LAKE)) == WHOLE


def test_next_observations_complete_the_episodes():
    long = {"next_observations": [4, 8, 1], "ends": [False, True, True], "terminated": [False, True, False]}
    assert seen(from_arrays([0, 4, 0], [1, 1, 2], **long, **LAKE)) == WHOLE


def test_next_observations_may_be_lists():
    episodes = from_arrays([[0, 4], [0]], [[1, 1], [2]], next_observations=[[4, 8], [1]], terminated=[True, False], **LAKE)
    assert seen(episodes) == WHOLE


@pytest.mark.parametrize("lengths", [[2, 1], np.array([2.0, 1.0])])
def test_padding_is_not_read(lengths):
    padded = np.array([[0, 4, 8], [0, 1, -1]]), np.array([[1, 1], [2, -9]])
    rewards = np.array([[1.0, 2.0], [3.0, np.nan]])
    episodes = from_arrays(*padded, lengths=lengths, rewards=rewards, terminated=[True, False], **LAKE)
    assert seen(episodes) == WHOLE and episodes[1].rewards.tolist() == [3.0]


def test_a_rectangle_needs_no_lengths():
    episodes = from_arrays(np.array([[0, 4, 8], [0, 1, 2]]), np.array([[1, 1], [2, 2]]), **LAKE)
    assert seen(episodes) == [([0, 4, 8], [1, 1], False, True), ([0, 1, 2], [2, 2], False, True)]


def test_a_column_of_actions_beside_one_long_array_is_one():
    column = np.array([[1], [1], [2]])
    flags = {"terminated": [False, True, False], "next_observations": [4, 8, 1]}
    assert seen(from_arrays(np.array([0, 4, 0]), column, **flags, **LAKE)) == WHOLE


def test_columns_that_may_be_episodes_of_a_step_are_refused():
    columns = np.array([[0], [4]]), np.array([[1], [1]])
    with pytest.raises(InvalidDemonstrations, match=r"shape \(2, 1\) .* Give actions\[:, 0\] for steps, or lengths=\[1\] \* 2"):
        from_arrays(*columns, terminated=[False, True], last="repeat", **LAKE)
    assert [len(one) for one in from_arrays(*columns, lengths=[1, 1], last="repeat", **LAKE)] == [1, 1]


def test_tuples_are_read_as_lists_are():
    assert seen(from_arrays((0, 4, 8, 0, 1), (1, 1, 2), lengths=(2, 1), terminated=(True, False), **LAKE)) == WHOLE
    padded = from_arrays(((0, 4, 8), (0, 1, 2)), np.array([[1, 1], [2, 2]]), **LAKE)
    assert [one.observations.tolist() for one in padded] == [[0, 4, 8], [0, 1, 2]]


def test_padded_episodes_of_a_step_stay_so():
    assert len(from_arrays(np.array([[0, 4], [0, 1]]), np.array([[1], [2]]), terminated=[True, False], **LAKE)) == 2


LOG = {"rewards": [[1, 2, 3], [4, 5]], "terminated": True}


def test_the_last_action_is_kept_with_what_it_paid_and_its_end():
    episodes = from_arrays([[0, 4, 8], [0, 1]], [[1, 1, 3], [2, 0]], **LOG, **LAKE)
    assert seen(episodes) == [([0, 4, 8, 8], [1, 1, 3], True, False), ([0, 1, 1], [2, 0], True, False)]
    assert [(one.rewards.tolist(), one.ending) for one in episodes] == [([1.0, 2.0, 3.0], "unseen"), ([4.0, 5.0], "unseen")]


def test_an_episode_of_one_row_is_kept():
    assert seen(from_arrays([[0], [0, 1]], [[1], [2, 2]], **LAKE))[0] == ([0, 0], [1], False, True)


def test_drop_says_what_it_drops_and_the_mend():
    with pytest.warns(UserWarning, match="the last action of 2 of 2 episodes is dropped, with what it paid: .* last='keep'"):
        from_arrays([[0, 4, 8], [0, 1]], [[1, 1, 3], [2, 0]], last="drop", **LAKE)


@pytest.mark.filterwarnings("ignore:the last action of")
def test_drop_leaves_out_the_last_action_and_the_end_it_made():
    episodes = from_arrays([[0, 4, 8], [0, 1]], [[1, 1, 3], [2, 0]], last="drop", **LOG, **LAKE)
    assert [one.ending for one in episodes] == ["dropped", "dropped"]
    assert seen(episodes) == [([0, 4, 8], [1, 1], False, True), ([0, 1], [2], False, True)]
    assert [one.rewards.tolist() for one in episodes] == [[1.0, 2.0], [4.0]]


def test_repeat_keeps_every_pair_and_counts_as_truncated():
    episodes = from_arrays([[0, 4], [0]], [[1, 1], [2]], last="repeat", terminated=True, **LAKE)
    assert seen(episodes) == [([0, 4, 4], [1, 1], False, True), ([0, 0], [2], False, True)]


def test_row_takes_the_last_row_as_an_observation_only():
    actions = [1, 1, np.nan, 2, np.nan]
    episodes = from_arrays([0, 4, 8, 0, 1], actions, lengths=[3, 2], last="row", terminated=[True, False], **LAKE)
    assert seen(episodes) == WHOLE


def test_row_reads_the_flag_of_the_last_step():
    flags = [False, True, False, False, False]
    episodes = from_arrays([0, 4, 8, 0, 1], [1, 1, -1, 2, -1], lengths=[3, 2], last="row", terminated=flags, **LAKE)
    assert seen(episodes) == WHOLE


def test_rewards_that_are_not_known_are_zero():
    assert [one.rewards.tolist() for one in from_arrays(*LISTS, **LAKE)] == [[0.0, 0.0], [0.0]]


def test_actions_of_an_action_space_are_counted_from_zero():
    episodes = from_arrays(*LISTS, space=spaces.Discrete(16), action_space=spaces.Discrete(4, start=1))
    assert [one.actions.tolist() for one in episodes] == [[0, 0], [1]]


def test_n_actions_beside_an_environment_means_actions_from_zero():
    class Room(gym.Env):
        observation_space, action_space = spaces.Discrete(16), spaces.Discrete(4, start=1)

    assert [one.actions.tolist() for one in from_arrays(*LISTS, env=Room())] == [[0, 0], [1]]
    assert [one.actions.tolist() for one in from_arrays(*LISTS, env=Room(), n_actions=4)] == [[1, 1], [2]]


@pytest.mark.parametrize("kind", [np.uint8, np.int32, np.float32, np.float64, object])
def test_whole_numbers_of_any_type_are_actions(kind):
    (episode,) = from_arrays([[0, 4, 8]], [np.array([1, 3], dtype=kind)], **LAKE)
    assert episode.actions.tolist() == [1, 3] and episode.actions.dtype == np.int64


REFUSED = {
    "no episodes": ([[]], [], {}, "there are no rows"),
    "no steps": ([[0, 4], [0]], [[1], []], {}, r"episode 1 \(from 0\) has no steps"),
    "action out of range": (
        [[0, 4, 8]],
        [[1, 4]],
        {},
        r"episode 0, step 1 .* has action 4: expected a whole number from 0 to 3",
    ),
    "actions from 1": ([[0, 4, 8]], [[1, 4]], {}, r"Do they count from 1\? Pass action_space=Discrete\(4, start=1\)"),
    "fraction": ([[0, 4, 8]], [[1, 2.5]], {}, r"step 1 .* has action 2.5: .* number of a bin"),
    "action NaN": ([[0, 4, 8]], [[1, np.nan]], {}, r"step 1 .* has action nan: .* last='row'"),
    "action None": ([[0, 4, 8]], [[1, None]], {}, r"step 1 .* has action nan: expected a whole number"),
    "action text": ([[0, 4, 8]], [["1", "up"]], {}, r"step 1 .* has action 'up': expected numbers"),
    "action vectors": ([[0, 4, 8]], [np.zeros((2, 3))], {}, r"actions have shape \(3, 3\)"),
    "observation outside": (
        [[0, 4, 8], [0, 16]],
        [[1, 1], [2]],
        {},
        r"episode 1, step 1 .* has observation 16: .*Discrete\(16\)",
    ),
    "observation text": ([[0, "b", 8]], [[1, 1]], {}, r"step 1 .* has observation 'b': expected numbers"),
    "observation NaN": ([[0, np.nan, 8]], [[1, 1]], {}, r"step 1 .* has observation nan"),
    "observation fraction": ([[0, 0.5, 8]], [[1, 1]], {}, r"step 1 .* has observation 0.5"),
    "observations vectors": ([np.zeros((3, 2))], [[1, 1]], {}, r"observations have shape \(3, 2\): expected \('n',\)"),
    "ragged": ([[0, [1, 2], 8]], [[1, 1]], {}, r"step 1 .* has observation \[1, 2\] of shape \(2,\)"),
    "too many observations": ([[0, 4, 8], [0, 1, 2, 3]], [[1, 1], [2]], {}, "episode 1 .* has 4 observations and 1 actions"),
    "a mixture": ([[0, 4, 8], [0]], [[1, 1], [2]], {}, "episode 1 .* has 1 observations and 1 actions"),
    "episodes missing": ([[0, 4, 8]], [[1, 1], [2]], {}, "there are 1 observations for 2 episodes of actions"),
    "reward NaN": (*LISTS, {"rewards": [[0, np.nan], [0]]}, "episode 0, step 1 .* has reward nan"),
    "rewards too few": (*LISTS, {"rewards": [[0], [0]]}, r"episode 0 .* has rewards of shape \(1,\): expected \(2,\)"),
    "flags too many": (*LISTS, {"terminated": [True, True, False, True]}, "terminated flags have shape"),
    "flag that is none": (*LISTS, {"terminated": [2, 0]}, "has terminated 2: expected true or false"),
    "terminated in the middle": (*LISTS, {"terminated": [[True, False], [True]]}, "step 0 .* is terminated in the middle"),
    "lengths do not add up": ([0, 4, 8], [1, 1, 2], {"lengths": [1, 1]}, "lengths add up to 2: expected 3"),
    "length zero": ([0, 4, 8], [1, 1, 2], {"lengths": [3, 0]}, "episode 1 .* has 0 steps"),
    "padded too long": (np.zeros((1, 3)), np.zeros((1, 2)), {"lengths": [3]}, "has 3 steps: expected at most 2"),
    "episodes mixed": ([0, 4, 8], [1, 1, 2], {"episode": [1, 2, 1]}, r"row 2 \(from 0\) goes back to episode 1"),
    "no ends": ([0, 4, 8, 9], [1, 1, 2], {}, "expected ends, lengths or episode"),
    "only row": (
        [[0], [0, 1]],
        [[1], [2, 2]],
        {"last": "drop"},
        "episode 0, step 0 .* is the only row of its episode.* last='keep'",
    ),
    "a jump": ([0, 4], [1, 1], {"next_observations": [5, 8], "lengths": [2]}, r"row 0 .* another next observation .* row 1"),
    "flat row": ([0, 4, 99], [1, 1, 2], {"lengths": [3]}, r"row 2 \(from 0\) has observation 99"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_right_is_refused(case):
    observations, actions, columns, message = REFUSED[case]
    with pytest.raises(InvalidDemonstrations, match=message):
        from_arrays(observations, actions, **columns, **LAKE)


def test_two_ways_to_cut_are_refused():
    with pytest.raises(InvalidParameter, match="ends and lengths are both given"):
        from_arrays([0, 4], [1, 1], ends=[False, True], lengths=[2], **LAKE)


def test_an_unknown_rule_is_refused(unchecked):
    with pytest.raises(InvalidParameter, match="last is 'guess': expected 'keep', 'drop', 'repeat' or 'row'"):
        from_arrays([0, 4], [1, 1], lengths=[2], last="guess", **LAKE)


@pytest.mark.parametrize(
    "given, message",
    [
        ({}, "no space of observations"),
        ({"space": spaces.Discrete(16)}, "no number of actions"),
        ({"space": spaces.Discrete(16), "n_actions": 0}, "n_actions is 0"),
        ({"space": spaces.Discrete(16), "n_actions": 3, "action_space": spaces.Discrete(4)}, "n_actions is 3: expected 4"),
    ],
)
def test_missing_spaces_are_refused(given, message):
    with pytest.raises(InvalidParameter, match=message):
        from_arrays(*LISTS, **given)


def test_continuous_actions_are_refused():
    with pytest.raises(NotDiscrete, match="Box"):
        from_arrays(*LISTS, env=gym.make("Pendulum-v1"))
