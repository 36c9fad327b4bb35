"""Pictures of a plane of cells: what is coloured, and what stays blank."""

import gymnasium as gym
import numpy as np
import pytest

from irl_gym.reports.cell_maps import draw_actions, draw_planes
from irl_gym.tables.discretize import discretize


@pytest.fixture(scope="module")
def car():
    return discretize(gym.make("irl_gym_envs:irl_gym/MountainCar-v0"), gamma=0.99, bins=(12, 8))


def images(figure):
    return [axis.images[0] for axis in figure.axes if axis.images]


def test_planes_are_drawn_side_by_side_over_the_two_coordinates(car):
    values = np.arange(car.mdp.n_states, dtype=float)
    figure = draw_planes(car.states, car.mdp, {"one": values, "two": -values}, label="value", centred=False)
    shown = images(figure)
    assert [axis.get_title() for axis in figure.axes if axis.images] == ["one", "two"]
    assert (figure.axes[0].get_xlabel(), figure.axes[0].get_ylabel()) == ("position", "velocity")
    assert shown[0].get_array().shape == (8, 12) and shown[0].get_extent() == pytest.approx([-1.2, 0.5, -0.07, 0.07])


def test_a_plane_leaves_out_what_no_episode_reaches(car):
    shown = images(draw_planes(car.states, car.mdp, {"R": np.ones(car.mdp.n_states)}, label="R", centred=True))[0]
    reachable = car.mdp.reachable[: car.states.n_cells].reshape(12, 8).T
    assert np.array_equal(~np.ma.getmaskarray(shown.get_array()), reachable)


def test_a_reward_has_zero_in_the_middle_of_the_colours(car):
    values = np.linspace(-1, 3, car.mdp.n_states)
    norm = images(draw_planes(car.states, car.mdp, {"R": values}, label="R", centred=True))[0].norm
    assert norm.vmin == -norm.vmax


def test_actions_are_blank_where_nothing_is_known(car):
    actions = np.where(np.arange(car.mdp.n_states) % 2, 1.0, np.nan)
    shown = images(draw_actions(car.states, car.mdp, {"Expert": actions}, 3))[0].get_array()
    assert set(shown.compressed().tolist()) == {1.0}


def test_actions_have_a_legend(car):
    figure = draw_actions(car.states, car.mdp, {"Expert": np.zeros(car.mdp.n_states)}, 3)
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["action 0", "action 1", "action 2"]
