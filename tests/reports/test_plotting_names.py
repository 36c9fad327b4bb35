"""Figures of environments without a map: states and actions by their names, and what the bars are."""

import gymnasium as gym
import numpy as np
import pytest
from models import ring

from irl_gym.reports.plotting import draw_policies, draw_rewards, draw_values
from irl_gym.spaces.names import Names
from irl_gym.tables.layouts import grid_layout

N = 40
ENDLESS = ring([[(s + 1) % N, (s + 2) % N] for s in range(N)])
CALLED = Names(("walk", "run"), lambda row: f"corner {row}")
R = np.arange(N) / N


def labels(axis):
    return [label.get_text() for label in axis.get_yticklabels()]


def test_a_reward_on_states_names_the_highest_and_the_lowest():
    named = draw_rewards(None, R, R, ENDLESS, CALLED).axes[3]
    wanted = [f"corner {s}" for s in (*range(39, 29, -1), *range(9, -1, -1))]
    assert labels(named) == wanted and "highest and lowest 10 of 40 states" in named.get_title()


def test_a_reward_of_steps_names_states_and_actions_and_is_not_said_to_be_of_arrivals():
    axes = draw_rewards(None, np.stack([R, R + 2], axis=1), R, ENDLESS, CALLED).axes
    assert labels(axes[2])[0] == "corner 39: run" and "expected for a step" in axes[0].get_title()


def test_values_name_the_states():
    axes = draw_values(None, R, -R, ENDLESS, CALLED).axes
    assert (labels(axes[2])[0], labels(axes[3])[0]) == ("corner 39", "corner 0")


def test_bars_of_actions_have_their_names():
    policy = np.tile([1.0, 0.0], (N, 1))
    assert labels(draw_policies(None, policy > 0, policy, policy > 0, ENDLESS, CALLED).axes[0]) == ["walk", "run"]


def test_actions_without_names_are_numbered():
    policy = np.tile([1.0, 0.0], (N, 1))
    assert labels(draw_policies(None, policy > 0, policy, policy > 0, ENDLESS).axes[0]) == ["action 0", "action 1"]


@pytest.mark.parametrize("seen", [True, False])
def test_a_map_says_where_the_expert_was_not_seen(toy_text, seen):
    table = toy_text("FrozenLake 4x4").mdp
    layout = grid_layout(gym.make("FrozenLake-v1"), table)
    policy = np.tile([0.0, 1.0, 0.0, 0.0], (16, 1))
    expert = policy > 0
    expert[4] = seen & expert[4]
    figure = draw_policies(layout, expert, policy, policy > 0, table)
    told = figure.get_supxlabel()
    assert ("without an arrow: the expert was not seen there" in told) is not seen
    assert ("seen in 10 of 11 states" in figure.axes[0].get_title()) is not seen
