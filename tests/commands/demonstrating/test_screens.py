"""What is shown of a game."""

import numpy as np
import pytest
from PIL import Image

from irl_gym.commands.demonstrating.playing import Turn
from irl_gym.commands.demonstrating.screens import as_text, half_blocks


def test_half_blocks_are_the_picture():
    picture = np.array([[[255, 0, 0], [0, 0, 255]], [[0, 255, 0], [0, 255, 0]]], dtype=np.uint8)
    assert half_blocks(picture, 80, 24) == "\x1b[38;2;255;0;0;48;2;0;255;0m▀\x1b[38;2;0;0;255;48;2;0;255;0m▀\x1b[0m"


@pytest.mark.parametrize("shape", [(400, 600), (600, 100), (3, 500)])
def test_half_blocks_fit(shape):
    lines = half_blocks(np.asarray(Image.new("RGB", shape[::-1])), 80, 24).split("\n")
    assert len(lines) <= 24 and all(line.count("▀") <= 80 for line in lines)


def test_a_text_without_colours_marks_the_agent():
    turn = Turn("\n\x1b[41mS\x1b[0mFF\n\x1b[35mY\x1b[0m\n", "Here.")
    assert as_text(turn, 80, 24, colours=False) == "\n@FF\nY\nHere." and "\x1b[41m" in as_text(turn, 80, 24, colours=True)


def test_a_picture_without_colours_is_left_out():
    assert as_text(Turn(np.zeros((4, 4, 3), dtype=np.uint8), "Here."), 80, 24, colours=False) == "Here."
