"""Keys and what they stand for."""

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces

from irl_gym.commands.demonstrating.keyboard import ACTIONS, KEYS, controls_of, described, keys_of_line, keys_typed
from irl_gym.errors import InvalidParameter, NotDiscrete

MIDDLE = {
    "FrozenLake 4x4": ("FrozenLake-v1", 9, 4, 1),
    "CliffWalking": ("CliffWalking-v1", 15, 12, 1),
    "Taxi": ("Taxi-v4", 222, 5, 20),
    "GridWorld": ("irl_gym_envs:irl_gym/GridWorld-v0", 12, 5, 1),
}
"""Tables: id, a state without walls around it, cells in a row, states in a cell."""


class TableOf12(gym.Env):
    """Twelve actions that nobody knows."""

    observation_space, action_space = spaces.Discrete(2), spaces.Discrete(12)


@pytest.mark.parametrize("name", MIDDLE)
@pytest.mark.parametrize(("key", "by"), [("w", (-1, 0)), ("left", (0, -1)), ("s", (1, 0)), ("right", (0, 1))])
def test_letters_and_arrows_go_where_they_point(toy_text, name, key, by):
    env_id, start, width, size = MIDDLE[name]
    mdp = toy_text(name).mdp
    action = controls_of(gym.make(env_id)).action(key)
    most_likely = int(mdp.P[[start * mdp.n_actions + action]].toarray().argmax())
    assert most_likely // size == start // size + by[0] * width + by[1]


def test_taxi_picks_up_and_drops_off_by_letters():
    controls = controls_of(gym.make("Taxi-v4"))
    assert (controls.action("p"), controls.action("o"), controls.action("P")) == (4, 5, 4)


def test_blackjack_hits_and_sticks_by_letters():
    controls = controls_of(gym.make("Blackjack-v1"))
    assert (controls.action("h"), controls.action("s")) == (1, 0)


def test_every_named_action_is_reached_without_a_clash():
    for names in ACTIONS.values():
        letters = [key for name in names for key in KEYS.get(name, ())]
        assert len(letters) == len(set(letters)) and not {"q", "r", "?"} & set(letters)


def test_an_unknown_environment_has_digits():
    controls = controls_of(TableOf12())
    assert [controls.action(str(i)) for i in range(10)] == list(range(10))
    assert str(controls).startswith("Keys: actions by number (0 1 2") and "2 of 12 actions have no key" in str(controls)


def test_keys_of_ones_own_come_on_top():
    controls = controls_of(gym.make("FrozenLake-v1"), "w=0, space=2,W=1")
    assert [controls.action(key) for key in ("w", "space", "W", "a")] == [0, 2, 1, 0]


@pytest.mark.parametrize(
    ("keys", "says"),
    [
        ("abc=1", "'abc=1': expected key=action"), ("w", "'w': expected key=action"), ("w=4", "an action from 0 to 3"),
        ("w=-1", "an action from 0 to 3"), ("w=up", "an action from 0 to 3"), ("q=1", "q, r and [?] end"),
        ("R=1", "q, r and [?] end"), ("w=1,w=2", "'w' twice"),
        ("w=" + "9" * 5_000, "an action from 0 to 3"),
    ],
)  # fmt: skip
def test_keys_that_cannot_be_are_named(keys, says):
    with pytest.raises(InvalidParameter, match=says):
        controls_of(gym.make("FrozenLake-v1"), keys)


def test_a_terminal_sends_arrows_and_characters():
    assert list(keys_typed("w\x1b[A\x1bOD \n\x1b[3~d\x1b[1;5Cs\x1b\x04")) == [
        "w", "up", "left", "space", "enter", "d", "s", "escape", "q",
    ]  # fmt: skip


def test_a_line_is_a_name_or_characters():
    assert [list(keys_of_line(line)) for line in ("up\n", "dd s\n", "\n")] == [["up"], ["d", "d", "s"], []]


def test_observations_are_told_in_words_where_they_are_short():
    assert described(gym.make("Blackjack-v1"), (14, 10, 0)) == "your sum 14, dealer shows 10, usable ace 0"
    assert described(TableOf12(), np.arange(9)) == "" and described(TableOf12(), {"at": 1}) == ""


def test_continuous_actions_have_no_keys():
    with pytest.raises(NotDiscrete, match="the action space is Box"):
        controls_of(gym.make("Pendulum-v1"))
