"""What scripts say in a terminal."""

import io
import json
import re

import pytest
from rich.console import Console

from irl_gym.commands import terminal
from irl_gym.commands.terminal import DEFECT, exit_code, print_error, stage_bars
from irl_gym.errors import RunIncomplete
from irl_gym.facts import harmless


def shown(*, terminal):
    said = io.StringIO()
    with stage_bars(Console(file=said, force_terminal=terminal, width=100)) as show:
        for share in (0.0, 0.5, 1.0):
            show("expert", share)
        show("reward", 0.25)
    return said.getvalue()


def test_each_stage_has_one_bar_on_a_terminal():
    last = shown(terminal=True).rpartition("\x1b[2K")[2].splitlines()
    bars = [line for line in last if " %" in line]
    assert len(bars) == 2 and "expert" in bars[0] and "100 %" in bars[0] and "reward" in bars[1] and " 25 %" in bars[1]


def test_a_bar_of_which_no_share_is_known_says_what_is_known():
    said = io.StringIO()
    with stage_bars(Console(file=said, force_terminal=True, width=100)) as show:
        show("table", None, "[12] states found")
    line = said.getvalue().rpartition("\x1b[2K")[2].splitlines()[0]
    assert "[12] states found" in line and "%" not in line and "left" not in line


def test_plain_lines_tell_begin_and_end_where_there_is_no_terminal():
    said = shown(terminal=False)
    assert re.sub(r"\d+\.\d s", "N s", said) == "expert: begun\nexpert: done in N s\nreward: begun\n" and "\x1b" not in said


class Clock:
    """A clock that is set."""

    now = 0.0

    def monotonic(self):
        return self.now


def told(monkeypatch, *moments):
    """The plain lines of a stage that was told of at these times, each with a share and what else is known."""
    said, clock = io.StringIO(), Clock()
    monkeypatch.setattr(terminal, "time", clock)
    with stage_bars(Console(file=said, force_terminal=False)) as show:
        for clock.now, share, more in moments:
            show("agent", share, more)
    return said.getvalue().splitlines()


def test_a_stage_has_a_plain_line_in_ten_seconds_at_most(monkeypatch):
    lines = told(monkeypatch, (0.0, 0.0, ""), *((one / 2, one / 100, "") for one in range(1, 100)), (50.0, 1.0, ""))
    assert len(lines) == 2 + 4 and lines[0] == "agent: begun" and lines[-1] == "agent: done in 50 s"


def test_what_is_left_follows_from_the_pace_so_far(monkeypatch):
    lines = told(monkeypatch, (0.0, 0.0, ""), (2.0, 0.5, "mean return 3"), (12.0, 0.75, "mean return 4"))
    assert lines[1] == "agent: 75 %, 12 s, about 10 s left, mean return 4"


def test_nothing_is_said_of_what_is_left_where_the_share_is_not_known(monkeypatch):
    lines = told(monkeypatch, (0.0, 0.0, ""), (11.0, None, "7 states found"), (22.0, None, "9 states found"))
    assert lines[1:] == ["agent: 11 s, 7 states found", "agent: 22 s, 9 states found"]


def test_a_stage_that_is_asked_for_again_begins_once(monkeypatch):
    lines = told(monkeypatch, (0.0, 0.0, ""), (1.0, 1.0, "kept"), (50.0, 0.0, ""), (60.0, 1.0, "kept"))
    assert lines == ["agent: begun", "agent: done in 1.0 s, kept"]


def test_bars_end_when_the_work_fails():
    console = Console(file=io.StringIO(), force_terminal=True)
    with pytest.raises(KeyboardInterrupt), stage_bars(console) as show:
        show("expert", 0.5)
        raise KeyboardInterrupt
    with stage_bars(console) as show:  # a second display on one console would be refused
        show("expert", 1.0)


@pytest.mark.parametrize("error", [RunIncomplete(f"{'long ' * 60}[bold]end"), FileNotFoundError("no such folder")])
def test_an_error_is_one_line_on_standard_error(capsys, error):
    print_error(error)
    said = capsys.readouterr()
    assert said.out == "" and said.err == f"{type(error).__name__}: {error}\n"


def test_an_error_shows_what_a_terminal_would_obey_and_does_not_send_it(capsys):
    print_error(RunIncomplete("gamma \x1b]0;title\x07\x1b[31m \x9b31m \u202e \ud800\nexpected é"))
    said = capsys.readouterr().err
    assert not set("\x1b\x07\x9b\u202e\ud800") & set(said) and "\\x1b]0;title\\x07" in said and "\nexpected é" in said


def raising(module):
    """What raises an error, as a function of a module does."""
    code = compile('def broken():\n    raise ZeroDivisionError("\x1b[31mof what")', "/home/me/own.py", "exec")
    exec(code, names := {"__name__": module})
    return names["broken"]


def test_an_error_in_code_of_the_users_own_is_told_with_its_place(capsys):
    assert exit_code(raising("own"), others="the environment") == DEFECT
    told = "Code that is not irl_gym's raised an error, /home/me/own.py, line 2, in broken: ZeroDivisionError: "
    assert capsys.readouterr().err.startswith(told)


def test_an_error_of_a_package_that_own_code_called_is_told_with_the_place_of_that_code(capsys):
    def read():
        return json.loads("{")

    assert exit_code(read) == DEFECT
    told = f"Code that is not irl_gym's raised an error, {__file__}, line "
    said = capsys.readouterr().err
    assert said.startswith(told) and ", in read: JSONDecodeError" in said


def test_whose_defect_may_be_is_said(capsys):
    assert exit_code(raising("irl_gym.mdp.made_up"), others="the environment") == DEFECT == 70
    said = capsys.readouterr().err
    told = "This is a defect of irl_gym or of the environment, not of your files: ZeroDivisionError: \\x1b[31mof what. Please"
    assert said.startswith(told) and "Traceback (most recent call last)" in said and "in broken" in said


def test_a_script_without_a_defect_exits_as_it_says():
    assert exit_code(lambda: 2) == 2


def test_a_plain_text_is_shown_as_it_is():
    assert harmless("a b\nc é 状態 [bold]") == "a b\nc é 状態 [bold]"
