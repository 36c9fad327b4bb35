"""Where a person sits: a terminal or a window, as sources of keys and as places to show a turn.

A terminal gives keys as they are pressed, and is left as it was found; where no person is at the other end, lines are read. It
shows text as it is and pictures in coloured half blocks. A window shows pictures and gives the keys pressed in it.
"""

import contextlib
import os
import re
import sys
from collections.abc import Generator
from typing import Any

import numpy as np
import pygame
from PIL import Image

from irl_gym.commands.demonstrating.keyboard import keys_of_line, keys_typed
from irl_gym.commands.demonstrating.playing import Turn
from irl_gym.errors import InvalidParameter

Keys = Generator[str, None, None]
PAUSE = 800
"""Milliseconds that the end of an episode is shown in a window before the next begins."""
WAIT = 100
"""Milliseconds after which waiting for a key looks up, so that Ctrl-C in the terminal is heard."""
REPEAT = (300, 80)
"""Milliseconds before a key that is held repeats, and between repetitions."""
UNSEEN = {"offscreen", "dummy"}
"""SDL's drivers of windows that nobody sees, which it falls back to where there is no display."""


def terminal_keys() -> Keys:
    """Keys as they are pressed on standard input, where that is a terminal; else those of its lines.

    Close the generator, or use it up, to have the terminal as it was.
    """
    if os.name != "posix" or not sys.stdin.isatty():
        yield from (key for line in sys.stdin for key in keys_of_line(line))
        return
    import termios  # there is none elsewhere
    import tty

    terminal = sys.stdin.fileno()
    before = termios.tcgetattr(terminal)
    try:
        tty.setcbreak(terminal, termios.TCSANOW)  # keys that were typed ahead are kept
        with contextlib.suppress(OSError):  # a terminal that is closed is the end of the input
            while sent := os.read(terminal, 64):
                yield from keys_typed(sent.decode(errors="ignore"))
    finally:
        with contextlib.suppress(termios.error):  # it was closed
            termios.tcsetattr(terminal, termios.TCSANOW, before)


def window_keys() -> Keys:
    """Keys pressed in the window that `draw` opened, until it is closed.

    Raises:
        InvalidParameter: there is no window.
    """
    if not pygame.display.get_init():
        raise InvalidParameter("mode is window, but the environment drew none: expected one. Play in the terminal.")
    pygame.key.set_repeat(*REPEAT)
    while (event := pygame.event.wait(WAIT)).type != pygame.QUIT:
        if event.type == pygame.KEYDOWN:
            sign = getattr(event, "unicode", "")
            yield sign if sign.isprintable() and sign.strip() else pygame.key.name(event.key)


def draw(turns: list[Turn]) -> None:
    """Draw turns in a window of the size of their pictures, one after the other.

    Raises:
        InvalidParameter: no window can be opened here.
    """
    for i, turn in enumerate(turns):
        if turn.frame is not None:  # an environment that draws its own window renders None
            _blit(np.asarray(turn.frame), turn.said)
        if i + 1 < len(turns):
            pygame.time.wait(PAUSE)


def _blit(picture: np.ndarray, said: str) -> None:
    size = (picture.shape[1], picture.shape[0])
    try:
        screen: Any = pygame.display.get_surface()
        if screen is None or screen.get_size() != size:
            pygame.display.init()
            _check_driver()
            screen = pygame.display.set_mode(size)
    except pygame.error as error:
        raise InvalidParameter(
            f"mode is window, but none opens ({error}): expected a display. Play in the terminal."
        ) from error
    screen.blit(pygame.surfarray.make_surface(picture.swapaxes(0, 1)), (0, 0))
    pygame.display.set_caption(said.splitlines()[-1])
    pygame.display.flip()


def _check_driver() -> None:
    """Raise where windows are not seen, unless that was asked for."""
    driver = pygame.display.get_driver()
    if driver in UNSEEN and "SDL_VIDEODRIVER" not in os.environ:
        raise pygame.error(f"SDL finds no display and would draw {driver}")


def as_text(turn: Turn, columns: int, lines: int, *, colours: bool) -> str:
    """A turn in characters: the frame, if it can be written so, and what is said of it.

    Without colours a picture is left out, and in a text the cell with a coloured ground, which is where the agent is in
    FrozenLake and Taxi, becomes an @.
    """
    frame = turn.frame
    if isinstance(frame, str):
        plain = re.sub(r"\x1b\[[\d;]*m", "", re.sub(r"\x1b\[4\dm.\x1b\[0m", "@", frame))
        frame = (frame if colours else plain).rstrip("\n")
    elif frame is not None:
        frame = half_blocks(frame, columns, lines) if colours else None
    return "\n".join(filter(None, (frame, turn.said)))


def half_blocks(picture: np.ndarray, columns: int, lines: int) -> str:
    """An (H, W, 3) uint8 picture as coloured characters, two pixels each: as large as fits, never larger than it is."""
    height, width = picture.shape[:2]
    scale = min(columns / width, 2 * lines / height, 1.0)
    small = Image.fromarray(picture).resize(
        (max(1, int(width * scale)), max(1, int(height * scale) // 2) * 2), Image.Resampling.BOX
    )
    pairs = np.asarray(small).reshape(small.height // 2, 2, small.width, 3)
    rows = []
    for upper, lower in pairs:
        row, before = "", None
        for a, b in zip(upper.tolist(), lower.tolist(), strict=True):
            if (a, b) != before:  # a terminal keeps its colours until told otherwise
                row += f"\x1b[38;2;{a[0]};{a[1]};{a[2]};48;2;{b[0]};{b[1]};{b[2]}m"
            row, before = row + "▀", (a, b)
        rows.append(row + "\x1b[0m")
    return "\n".join(rows)
