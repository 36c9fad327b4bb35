"""The script as a person runs it: by a pipe, in a terminal, in a window."""

import os
import pty
import select
import shlex
import signal
import subprocess
import sys
import termios
import time
from pathlib import Path

import minari
import pytest
from stopped import HANG

from irl_gym.commands.door import main
from irl_gym.loop import loop

ROOT = Path(__file__).parents[2]
SCRIPT = ROOT / "scripts" / "play.py"
LAKE = ("--env-kwargs", "is_slippery=false")
WON = "ddsssd\n"


def command(*arguments):
    return [sys.executable, str(SCRIPT), "--root", "data", *arguments]


def piped(keys, *arguments, cwd, **variables):
    return subprocess.run(
        command(*arguments), cwd=cwd, input=keys, capture_output=True, text=True, timeout=HANG, env={**os.environ, **variables}
    )


@pytest.fixture
def played(script, tmp_path):
    """The script called in this process, where its input is no terminal."""
    return lambda keys, *arguments: script("play", "--root", "data", *arguments, cwd=tmp_path, typed=keys)


def kept(cwd, monkeypatch, dataset_id):
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(cwd / "data"))
    return list(minari.load_dataset(dataset_id).iterate_episodes())


def test_piped_keys_become_a_dataset_that_minari_opens(tmp_path, monkeypatch):
    made = piped("d\nd\ns\ns\ns\nd\n" + "ssddsd\n", *LAKE, "--episodes", "2", "--dataset-id", "me/lake-v0", cwd=tmp_path)
    assert made.returncode == 0, made.stderr
    episodes = kept(tmp_path, monkeypatch, "me/lake-v0")
    assert [one.actions.tolist() for one in episodes] == [[2, 2, 1, 1, 1, 2], [1, 1, 2, 2, 1, 2]]
    assert [bool(one.terminations[-1]) for one in episodes] == [True, True]


def test_the_script_says_what_happened_and_how_to_learn_from_it(tmp_path, capsys, monkeypatch, played):
    made = played(WON, *LAKE, "--episodes", "1")
    assert "Episode 1: return 1 in 6 steps, it ended." in made.stdout and "\x1b" not in made.stdout and made.stderr == ""
    assert made.stdout.endswith("    irl-gym run --dataset irl_gym/frozenlake-v1-played-v0 --dataset-root data\n")
    monkeypatch.setitem(loop.MAKERS, "figures", ())  # which take the time
    _, *words = shlex.split(made.stdout.splitlines()[-1])
    monkeypatch.chdir(tmp_path)
    assert main([*words, "--retrain", "value-iteration"]) == 0 and "The recovered reward" in capsys.readouterr().out


def test_the_end_of_the_input_keeps_what_was_finished(tmp_path, monkeypatch, played):
    made = played(WON + "dd\n", *LAKE)
    assert made.returncode == 0 and "The unfinished episode of 2 steps is discarded." in made.stdout
    assert len(kept(tmp_path, monkeypatch, "irl_gym/frozenlake-v1-played-v0")) == 1


def test_an_unfinished_episode_is_kept_where_asked(tmp_path, monkeypatch, played):
    made = played("ddq", *LAKE, "--keep-unfinished")
    assert made.returncode == 0, made.stderr
    (episode,) = kept(tmp_path, monkeypatch, "irl_gym/frozenlake-v1-played-v0")
    assert episode.truncations.tolist() == [False, True] and not episode.terminations.any()


def test_nothing_played_leaves_no_dataset(tmp_path, played):
    made = played("ddq", *LAKE)
    assert made.returncode == 1 and "No episode was finished" in made.stdout and not list((tmp_path / "data").iterdir())


def test_a_terminal_without_arrows_is_no_reason_to_lose_a_game(tmp_path):
    made = piped(WON, *LAKE, "--episodes", "1", cwd=tmp_path, PYTHONIOENCODING="ascii")
    assert made.returncode == 0 and "Keys: left (a ? 0)" in made.stdout


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("--env-id", "FrozenLaek-v1"), "UnknownEnvironment: environment 'FrozenLaek-v1'"),
        (("--env-id", "Pendulum-v1"), "NotDiscrete: the action space is Box"),
        (("--keys", "w=9"), "InvalidParameter: keys has 'w=9'"),
        (("--dataset-id", "bad"), "InvalidParameter: dataset id 'bad'"),
        (("--episodes", "0"), "InvalidParameter: episodes is 0"),
        (("--root", "/dev/null"), "InvalidParameter: root is /dev/null"),
        (("--env-kwargs", "8x8"), "InvalidParameter: env-kwargs has '8x8'"),
    ],
)
def test_a_mistake_gets_one_clear_line(tmp_path, called, arguments, says):
    made = called(SCRIPT, "--root", "data", *arguments, cwd=tmp_path)
    assert made.returncode == 2 and made.stderr.startswith(says) and made.stderr.count("\n") == 1


def test_a_window_without_a_display_is_refused(tmp_path):
    made = piped("", "--mode", "window", cwd=tmp_path, SDL_VIDEODRIVER="nonsense")
    assert made.returncode == 2 and made.stderr.startswith("InvalidParameter: FrozenLake-v1 cannot be rendered here")


def test_a_window_that_nobody_would_see_is_refused(tmp_path, monkeypatch):
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "SDL_VIDEODRIVER"):
        monkeypatch.delenv(name, raising=False)
    made = piped("", "--mode", "window", cwd=tmp_path)
    assert made.returncode == 2 and "SDL finds no display" in made.stderr and "Play in the terminal" in made.stderr


def test_pictures_in_a_terminal_need_no_display(tmp_path, monkeypatch):
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "SDL_VIDEODRIVER"):
        monkeypatch.delenv(name, raising=False)
    made = piped("q", "--env-id", "CartPole-v1", cwd=tmp_path)
    assert made.returncode == 1 and made.stderr == ""


def test_playing_imports_no_torch(tmp_path):
    code = f"import sys; from irl_gym.commands.door import main; main({['play', *LAKE, '--episodes', '1', '--root', '.']!r})"
    command = [sys.executable, "-c", f"{code}; print('torch' in sys.modules)"]
    made = subprocess.run(command, cwd=tmp_path, input=WON, capture_output=True, text=True, timeout=HANG)
    assert "is written" in made.stdout and made.stdout.endswith("\nFalse\n"), made.stderr


def test_a_taken_id_is_refused_before_playing(played):
    asked = (*LAKE, "--episodes", "1", "--dataset-id", "me/lake-v0")
    assert played(WON, *asked).returncode == 0
    made = played(WON, *asked)
    assert made.returncode == 2 and "DatasetExists" in made.stderr and made.stdout == ""


class Terminal:
    """The script in a pseudo-terminal of its own."""

    def __init__(self, cwd, *arguments):
        self.ours, self.theirs = pty.openpty()
        self.before = termios.tcgetattr(self.theirs)
        self.seen, self.read = b"", 0
        self.process = subprocess.Popen(
            command(*arguments), cwd=cwd, stdin=self.theirs, stdout=self.theirs, stderr=self.theirs,
            start_new_session=True, preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
        )  # fmt: skip

    def wait_for(self, text):
        """Read on until a text that has not been waited for yet."""
        deadline = time.monotonic() + HANG
        while (at := self.seen.find(text, self.read)) < 0:
            self._look(deadline)
        self.read = at + len(text)

    def end(self):
        deadline = time.monotonic() + HANG
        while self.process.poll() is None:
            self._look(deadline)
        self._look(deadline)
        restored = termios.tcgetattr(self.theirs) == self.before
        os.close(self.ours)
        os.close(self.theirs)
        return self.process.returncode, restored, self.seen.decode()

    def _look(self, deadline):
        if time.monotonic() > deadline:
            self.process.kill()
            self.process.wait()
            pytest.fail(self.seen.decode(errors="replace"))
        while select.select([self.ours], [], [], 0.1)[0]:
            self.seen += os.read(self.ours, 65536)


def test_a_terminal_gives_keys_without_enter_and_is_restored(tmp_path, monkeypatch):
    terminal = Terminal(tmp_path, *LAKE, "--episodes", "1")
    terminal.wait_for(b"begins")
    for key in (b"\x1b[C", b"d", b"\x1b[B", b"s", b"s"):
        os.write(terminal.ours, key)
        terminal.wait_for(b"Step")
    os.write(terminal.ours, b"d")
    code, restored, seen = terminal.end()
    assert code == 0 and restored and "\x1b[H\x1b[2J" in seen and "\x1b[41mG" in seen
    (episode,) = kept(tmp_path, monkeypatch, "irl_gym/frozenlake-v1-played-v0")
    assert episode.actions.tolist() == [2, 2, 1, 1, 1, 2]


@pytest.mark.parametrize("ending", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_game_keeps_what_was_finished_and_restores_the_terminal(tmp_path, monkeypatch, ending):
    terminal = Terminal(tmp_path, *LAKE)
    terminal.wait_for(b"begins")
    os.write(terminal.ours, b"ddsssdd")
    terminal.wait_for(b"Episode 1: return 1")
    terminal.process.send_signal(ending)
    code, restored, seen = terminal.end()
    assert code == 130 and restored and "is written" in seen
    assert len(kept(tmp_path, monkeypatch, "irl_gym/frozenlake-v1-played-v0")) == 1


def test_a_terminal_that_is_closed_loses_nothing_that_was_finished(tmp_path, monkeypatch):
    terminal = Terminal(tmp_path, *LAKE)
    terminal.wait_for(b"begins")
    os.write(terminal.ours, b"ddsssdd")
    terminal.wait_for(b"Episode 1: return 1")
    os.close(terminal.theirs)
    os.close(terminal.ours)
    terminal.process.wait(60)
    assert len(kept(tmp_path, monkeypatch, "irl_gym/frozenlake-v1-played-v0")) == 1


IN_WINDOW = """
import pygame, runpy, sys
pygame.display.init()
for name, sign in (("d", "d"), ("right", ""), ("x", "x"), ("down", ""), ("s", "s"), ("s", "S"), ("d", "d")):
    pygame.event.post(pygame.event.Event(pygame.KEYDOWN, key=pygame.key.key_code(name), unicode=sign))
pygame.event.post(pygame.event.Event(pygame.QUIT))
sys.argv = sys.argv[1:]
runpy.run_path(sys.argv[0], run_name="__main__")
"""


def test_a_window_gives_keys_until_it_is_closed(tmp_path, monkeypatch):
    made = subprocess.run(
        [sys.executable, "-c", IN_WINDOW, *command(*LAKE, "--mode", "window")[1:]], cwd=tmp_path, capture_output=True,
        text=True, timeout=HANG, env={**os.environ, "SDL_VIDEODRIVER": "dummy", "PYGAME_HIDE_SUPPORT_PROMPT": "1"},
    )  # fmt: skip
    assert made.returncode == 0, made.stderr
    (episode,) = kept(tmp_path, monkeypatch, "irl_gym/frozenlake-v1-played-v0")
    assert episode.actions.tolist() == [2, 2, 1, 1, 1, 2] and "Episode 2 of 5 begins" in made.stdout
