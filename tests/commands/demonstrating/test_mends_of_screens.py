"""The mends that errors of playing, of keys and of the command line name are executed, and serve."""

import io

import gymnasium
import numpy as np
import pygame
import pytest
import tyro
from enumeration_envs import Corridor
from gymnasium import spaces
from mended import told, unsaid

from irl_gym.commands.arguments import Arguments
from irl_gym.commands.demonstrating import screens
from irl_gym.commands.demonstrating.keyboard import controls_of
from irl_gym.commands.demonstrating.playing import Play, Turn, free_dataset, stage
from irl_gym.commands.terminal import OPTIONS

pytestmark = pytest.mark.usefixtures("unchecked")
LAKE = gymnasium.make("FrozenLake-v1")


class Drawn(Corridor):
    """Says how it is drawn, and is."""

    metadata = {"render_modes": ["ansi"], "render_fps": 4}  # noqa: RUF012

    def __init__(self, render_mode=None):
        super().__init__()
        self.render_mode = render_mode

    def render(self):
        return "." * self.cell + "@"


class Undrawn(Corridor):
    """Says nothing of drawing."""

    metadata = {"render_modes": []}  # noqa: RUF012


def staged(entry_point, mode):
    gymnasium.register("Drawn-v0", entry_point=entry_point)
    try:
        return stage("Drawn-v0", {}, mode)
    finally:
        gymnasium.registry.pop("Drawn-v0")


def in_terminal(env_id="FrozenLake-v1", **given):
    """A game that is drawn as text and played by lines of keys."""
    plain, shown = stage(env_id, given, "terminal")
    play = Play(shown, controls_of(plain), 1, keep_unfinished=True)
    turns = [play.start()]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("sys.stdin", io.StringIO("ds\n"))
        for key in screens.terminal_keys():
            turns += play.press(key)
    return all(screens.as_text(turn, 80, 24, colours=False) for turn in turns)


def no_window():
    """A picture is drawn where no window opens."""

    def refuse():
        raise pygame.error("no display")

    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SDL_VIDEODRIVER", "dummy")
        patch.setattr(screens, "_check_driver", refuse)
        try:
            screens.draw([Turn(np.zeros((4, 4, 3), np.uint8), "Here.")])
        finally:
            pygame.display.quit()


class Told(Corridor):
    """Says in some space what it shows."""

    def __init__(self, space, shown=int):
        super().__init__()
        self.observation_space, self.shown = space, shown

    def reset(self, *, seed=None, options=None):
        return self.shown(super().reset(seed=seed)[0]), {}

    def step(self, action):
        observation, *rest = self.moved(int(action))
        return self.shown(observation), *rest


def rehearsed(root, *told):
    return free_dataset("me/told-v0", Told(*told), str(root)) == "me/told-v0"


def asked(*words):
    return tyro.cli(Arguments, args=[*words, "--gamma", "0.9"], config=OPTIONS).experiment()


THREE = spaces.Box(0, 6, (3,), np.int64)
CASES = [
    # playing
    ("Choose with the mode.",
     lambda _: stage("FrozenLake-v1", {"render_mode": "human"}, "terminal"),
     lambda _: stage("FrozenLake-v1", {}, "terminal")[1].render_mode == "ansi"),
    ("Play in the terminal.", lambda _: staged(Drawn, "window"), lambda _: staged(Drawn, "terminal")),
    ("Give it a `render`, and metadata with its `render_modes` and `render_fps`.",
     lambda _: staged(Undrawn, "terminal"), lambda _: staged(Drawn, "terminal")),
    ("Mend its `observation_space`,",
     lambda root: rehearsed(root, THREE), lambda root: rehearsed(root, spaces.Discrete(7))),
    ("or what `reset` and `step` return.",
     lambda root: rehearsed(root, THREE), lambda root: rehearsed(root, THREE, lambda cell: np.full(3, cell))),
    # screens and keys
    ("but the environment drew none: expected one. Play in the terminal.",
     lambda _: next(screens.window_keys()), lambda _: in_terminal()),
    ("expected a display. Play in the terminal.", lambda _: no_window(), lambda _: in_terminal()),
    ('For example "w=3,a=0,space=2".',
     lambda _: controls_of(LAKE, "up is 3"), lambda _: controls_of(LAKE, "w=3,a=0,space=2").action("space") == 2),
    ("Use another key.", lambda _: controls_of(LAKE, "q=1"), lambda _: controls_of(LAKE, "e=1").action("e") == 1),
    # the command line
    ("expected --table sample with it.",
     lambda _: asked("--steps", "9"), lambda _: asked("--steps", "9", "--table", "sample").table.steps == 9),
    ("expected --steps with it.",
     lambda _: asked("--max-states", "9", "--table", "sample"), lambda _: asked("--steps", "9", "--table", "sample")),
    ("such as step_count=100, or", lambda _: asked("--reveal", "step_count"), lambda _: asked("--reveal", "step_count=100")),
    ("such as last=[None,0,1]; or", lambda _: asked("--reveal", "last=None"), lambda _: asked("--reveal", "last=[None,0,1]")),
    ("Leave one out.", lambda _: asked("--reveal", "step_count=9", "step_count=100"),
     lambda _: asked("--reveal", "step_count=100")),
    ("or known, or none.", lambda _: asked("--reveal", "all"), lambda _: asked("--reveal", "none").reveal == {}),
    ("expected name=value, such as map_name=8x8.",
     lambda _: asked("--env-kwargs", "8x8"), lambda _: asked("--env-kwargs", "map_name=8x8").env_kwargs == {"map_name": "8x8"}),
]  # fmt: skip
OF_THE_DOOR = "Name it with --env-id. Leave the others out."  # commands/test_mends_of_the_door.py
ELSEWHERE = "Learn from it with"  # scripts/test_play.py: test_the_script_says_what_happened_and_how_to_learn_from_it
FILES = [
    "playing.py",
    "screens.py",
    "keyboard.py",
    "arguments.py",
    "diagnoses/doctor.py",
    "terminal_report.py",
    "comparison_page.py",
]


@pytest.mark.parametrize(("says", "breaks", "mended"), CASES, ids=[one[0] for one in CASES])
def test_a_mend_that_an_error_about_a_game_names_serves(tmp_path, says, breaks, mended):
    assert says in told(breaks, tmp_path) and mended(tmp_path)


def test_every_mend_that_an_error_about_a_game_names_is_executed():
    assert not unsaid([*CASES, (OF_THE_DOOR,)], *FILES)
