"""What the grids look like: text and pixels."""

import gymnasium as gym
import numpy as np
import pytest

from irl_gym_envs import grid_rendering as drawing

ID = "irl_gym_envs:irl_gym/GridWorld-v0"
MAP = {"size": [2, 3], "slip": 0.0, "walls": [0, 1], "pits": [1, 2]}


def started(render_mode, **kwargs):
    env = gym.make(ID, **{**MAP, **kwargs}, render_mode=render_mode)
    env.reset(seed=0)
    return env


def tile(picture, row, column):
    """The pixels of a cell of MAP."""
    margin, cell = drawing.BIGGEST_CELL // 8, drawing.BIGGEST_CELL
    return picture[margin + row * cell : margin + (row + 1) * cell, margin + column * cell : margin + (column + 1) * cell]


def share_of(colour, pixels):
    return float((np.abs(pixels.astype(int) - colour).max(axis=-1) <= 3).mean())


def test_ansi_shows_the_map_and_the_agent():
    assert started("ansi").render().splitlines()[:4] == ["+-------+", "| . # G |", "| o . X |", "+-------+"]


def test_ansi_tells_the_last_move():
    env = started("ansi")
    env.step(0)
    assert env.render().splitlines()[-1] == "o at row 0, column 0: chose up, went up"


def test_ansi_tells_when_the_agent_bumped():
    env = started("ansi")
    env.step(3)
    assert env.render().splitlines()[-1] == "o at row 1, column 0: chose left, stayed"


def test_ansi_tells_the_end_of_the_episode():
    env = started("ansi")
    env.step(1)
    env.step(1)
    assert "the episode is over" in env.render()


def test_ansi_marks_the_start_when_the_agent_has_left_it():
    env = started("ansi")
    env.step(0)
    assert "| S . X |" in env.render()


def test_rgb_array_is_a_picture_of_bytes():
    picture = started("rgb_array").render()
    margin = 2 * (drawing.BIGGEST_CELL // 8)
    assert picture.dtype == np.uint8 and picture.shape == (2 * 56 + margin, 3 * 56 + margin, 3)


@pytest.mark.parametrize(
    ("row", "column", "colour", "least"),
    [(0, 1, drawing.WALL, 0.99), (0, 2, drawing.GOAL, 0.1), (1, 2, drawing.PIT, 0.1), (1, 0, drawing.AGENT, 0.15)],
    ids=["wall", "goal", "pit", "agent"],
)
def test_rgb_array_shows_what_stands_in_a_cell(row, column, colour, least):
    assert share_of(colour, tile(started("rgb_array").render(), row, column)) > least


def test_rgb_array_moves_the_agent():
    env = started("rgb_array")
    env.step(0)
    picture = env.render()
    assert share_of(drawing.AGENT, tile(picture, 0, 0)) > 0.15 and share_of(drawing.AGENT, tile(picture, 1, 0)) < 0.01


def test_rgb_array_shows_where_the_agent_came_from():
    before, env = started("rgb_array"), started("rgb_array")
    env.step(0)
    empty = tile(before.render(), 1, 1)
    left = tile(env.render(), 1, 0)
    assert (left[: left.shape[0] // 4, 28] < empty[: empty.shape[0] // 4, 28]).any()


def test_rgb_array_points_the_chevron_where_the_action_went():
    env = started("rgb_array")
    env.step(0)
    pointing = tile(env.render(), 0, 0)
    white = np.argwhere((pointing == 255).all(axis=-1))
    tip = white[white[:, 0] == white[:, 0].min()]
    assert abs(tip[:, 1].mean() - 27.5) < 1.5


def test_rgb_array_does_not_change_between_two_calls():
    env = started("rgb_array")
    np.testing.assert_array_equal(env.render(), env.render())


def test_rgb_array_stays_small_when_the_map_is_large():
    env = started("rgb_array", size=[300, 200])
    assert max(env.render().shape) <= drawing.LARGEST + 20


def test_rgb_array_is_drawn_before_the_first_reset():
    env = gym.make(ID, **MAP, render_mode="rgb_array").unwrapped
    assert share_of(drawing.AGENT, env.render()) == 0


def test_render_warns_when_no_mode_was_chosen():
    env = gym.make(ID, **MAP)
    env.reset(seed=0)
    with pytest.warns(UserWarning, match="without a render mode"):
        env.unwrapped.render()


def test_polygon_distance_is_negative_inside_and_positive_outside():
    y, x = drawing.pixels(9, 9, 9)
    square = np.array([(-0.2, -0.2), (-0.2, 0.2), (0.2, 0.2), (0.2, -0.2)])
    distance = drawing.polygon(y, x, square)
    inside = (np.abs(y) < 0.2) & (np.abs(x) < 0.2)
    np.testing.assert_array_equal(distance < 0, inside)
