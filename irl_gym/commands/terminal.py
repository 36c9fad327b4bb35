"""What all subcommands do in a terminal in the same way: read arguments, say how far a stage is, and what went wrong."""

import contextlib
import sysconfig
import time
import traceback
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, fields, is_dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal, Protocol, TypeVar, get_args, get_origin, get_type_hints, runtime_checkable

import tyro
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table
from rich.text import Text
from tyro.conf import DisallowNone, OmitArgPrefixes, arg

from irl_gym.errors import InvalidParameter, did_you_mean
from irl_gym.facts import harmless

UNSET = arg(help_behavior_hint="")
"""What stands for "not given" is not shown in --help; the text says what happens then."""
OPTIONS = (OmitArgPrefixes, DisallowNone)
"""How tyro reads arguments: groups of them give no prefix to their flags, and nobody types None."""
Options = TypeVar("Options")


def read_arguments(kind: type[Options], words: Sequence[str], subcommand: str, about: str | None) -> Options:
    """The arguments of a subcommand, as a record; --help and what cannot be read end the process.

    Args:
        kind: a dataclass, whose fields are the options.
        words: of the command line, behind the subcommand.
        subcommand: its name.
        about: what --help says first.
    """
    try:
        if not {"-h", "--help"} & {*words}:
            _check_choices(kind, words)
    except InvalidParameter as error:
        print_error(error)
        raise SystemExit(2) from error
    return tyro.cli(kind, args=named_first(kind, words), prog=f"irl-gym {subcommand}", description=about, config=OPTIONS)


def _check_choices(kind: type, words: Sequence[str]) -> None:
    """Check the words behind options that take one of a few.

    Raises:
        InvalidParameter: another one; the closest is offered, which tyro does not do.
    """
    given = [*pairwise(words), *((flag, value) for flag, equals, value in (one.partition("=") for one in words) if equals)]
    for name, hint in get_type_hints(kind).items():
        if isinstance(hint, type) and is_dataclass(hint):
            _check_choices(hint, words)
        kinds = [one for one in ([hint] if get_origin(hint) is Literal else get_args(hint)) if one is not type(None)]
        if kinds and all(get_origin(one) is Literal for one in kinds):
            for flag, value in given:
                if flag.replace("_", "-") == f"--{name.replace('_', '-')}" and not value.startswith("-"):
                    checked_name(flag, value, [str(choice) for one in kinds for choice in get_args(one)])


FIRST = ("env_id", "run", "environment")
"""Options, or the group that has one, that the first word gives where it names none: `irl-gym run FrozenLake-v1`."""


def named_first(kind: type, words: Sequence[str]) -> list[str]:
    """The words, with the option's name before a first one that has none.

    Args:
        kind: the record of the options; one that takes words without names is given them as they are.
        words: of the command line.
    """
    known = {one.name for one in fields(kind)}
    found = next((name for name in FIRST if name in known), None)
    if found is None or not words or words[0].startswith("-"):
        return [*words]
    return ["--run" if found == "run" else "--env-id", *words]


def checked_name(what: str, name: str, known: Collection[str]) -> str:
    """Return a name that is known.

    Raises:
        InvalidParameter: another one; the closest is offered.
    """
    if name not in known:
        raise InvalidParameter(f"{what} is {name!r}: expected one of {', '.join(known)}.{did_you_mean(name, known)}")
    return name


QUIET = 10.0
"""Seconds between two lines on one stage, where there is no terminal."""
PLAIN: dict[str, Any] = {"markup": False, "highlight": False, "soft_wrap": True}
"""How Rich prints a text as it is."""
REFRESHED = 2
"""Times a second that bars are drawn: each takes a few milliseconds of the processor."""


@runtime_checkable
class Show(Protocol):
    """What is to be told how far a stage is."""

    def __call__(self, stage: str, share: float | None, told: str = "") -> None:
        """Show a stage.

        Args:
            stage: its name.
            share: of it that is done, 1 at its end; None where that cannot be known.
            told: what else is known, such as an agent's mean return.
        """


@dataclass
class _Stage:
    """What was told of a stage that has begun."""

    began: float
    first: tuple[float, float] | None = None
    """When a share above 0 was first told, and which: a training that goes on does not begin at 0."""
    share: float | None = 0.0
    said: float = 0.0
    done: bool = False
    told: str = ""

    def see(self, now: float, share: float | None, told: str) -> None:
        self.share, self.done, self.told = share, share == 1.0, told or self.told
        if self.first is None and share:
            self.first = (now, share)

    @property
    def percent(self) -> str:
        """The share that is done; nothing where that is not known."""
        return f"{self.share:.0%}".replace("%", " %") if self.share else ""

    def left(self, now: float) -> str:
        """How long it will take, if it goes on as it did; nothing where that is not known."""
        if self.first is None or self.share is None or not self.first[1] < self.share < 1:
            return ""
        pace = (now - self.first[0]) / (self.share - self.first[1])
        return f"about {_duration(pace * (1 - self.share))} left"


def _listed(*words: str) -> str:
    return ", ".join(filter(None, words))


def _duration(seconds: float) -> str:
    if seconds < 10:
        return f"{seconds:.1f} s"
    return f"{seconds:.0f} s" if seconds < 100 else f"{seconds / 60:.0f} min"


@contextlib.contextmanager
def stage_bars(console: Console) -> Iterator[Show]:
    """How far each stage is: a bar on a terminal, elsewhere plain lines, at its begin and end and rarely in between."""
    live = console.is_terminal and not console.is_dumb_terminal
    bars = Progress(
        TextColumn("{task.description:14}"), BarColumn(20), TextColumn("{task.fields[percent]:>5}"), TimeElapsedColumn(),
        TextColumn("{task.fields[told]}", markup=False),
        console=console, disable=not live, refresh_per_second=REFRESHED,
    )  # fmt: skip
    stages: dict[str, _Stage] = {}
    tasks: dict[str, Any] = {}

    def draw(stage: str, known: _Stage, now: float, *, begins: bool) -> None:
        if begins:
            tasks[stage] = bars.add_task(stage, total=None, percent="", told="")
        said, total = _listed(known.left(now), known.told), 1.0 if known.share else None  # a bar without a total moves
        bars.update(tasks[stage], total=total, completed=known.share or 0.0, percent=known.percent, told=said)

    def write(stage: str, known: _Stage, now: float, *, begins: bool) -> None:
        if not (begins or known.done or now >= known.said + QUIET):
            return
        known.said, taken = now, _duration(now - known.began)
        words = (f"done in {taken}",) if known.done else ("begun",) if begins else (known.percent, taken, known.left(now))
        console.print(f"{stage}: {_listed(*words, known.told)}", **PLAIN)

    def show(stage: str, share: float | None, told: str = "") -> None:
        begins, now = stage not in stages, time.monotonic()
        known = stages.setdefault(stage, _Stage(now))
        if not known.done:  # what is asked again of a stage that is finished is no news
            known.see(now, share, told)
            (draw if live else write)(stage, known, now, begins=begins)

    with bars:
        yield show


def check_writable(out: Path) -> None:
    """Check where a file is to go, before anything is worked out.

    Raises:
        InvalidParameter: the folder does not exist, or there is a folder of the file's own name.
    """
    if not out.parent.is_dir():
        raise InvalidParameter(f"out is {out}, but there is no folder {out.parent}: expected one that exists. Make it first.")
    if out.is_dir():
        raise InvalidParameter(f"out is {out}, which is a folder: expected a file's name, such as {out / 'page.html'}.")


def print_table(title: str, columns: Iterable[str], rows: Iterable[Iterable[str]], width: int = 150) -> None:
    """Figures in rows and columns; brackets and colons in names are no markup."""
    table = Table(*columns, title=title)
    for row in rows:
        table.add_row(*row)
    Console(width=width, markup=False, emoji=False).print(table)


def print_error(error: Exception) -> None:
    """What is wrong, or a warning, in one line on standard error: its name, and its words."""
    text = Text.assemble((type(error).__name__, "bold red"), f": {harmless(str(error))}")
    Console(stderr=True, soft_wrap=True).print(text)


DEFECT = 70
"""What a script exits with that stumbled over a defect, of irl_gym or of code of the user's own: EX_SOFTWARE of sysexits.h."""
STOPPED = 130
"""What a process exits with that Ctrl-C ended."""
OURS = ("irl_gym", "irl_gym_envs")
"""Packages whose code is no user's own."""
INSTALLED = ("site-packages", "dist-packages")
"""Folders of code that is none either."""


def exit_code(script: Callable[[], int], others: str = "") -> int:
    """What a script exits with.

    Whatever is wrong with a user's arguments and files has an error of its own, which scripts print. Any other is a defect of
    irl_gym, and is called one, with what is needed to report it; unless code of the user's own raised it, which is named.

    Args:
        script: tells what it exits with.
        others: whose code runs in it besides, such as "the environment", and may be what is wrong.
    """
    try:
        return script()
    except Exception as error:
        what, where = f"{type(error).__name__}: {error}", _own_place(error)
        whose = f"irl_gym or of {others}" if others else "irl_gym"
        told = f"This is a defect of {whose}, not of your files: {what}. Please report it with this traceback"
        if where is not None:
            told = f"Code that is not irl_gym's raised an error, {where}: {what}. Its traceback"
        said = f"{told}:\n{''.join(traceback.format_exception(error))}"
        Console(stderr=True, soft_wrap=True).print(Text(harmless(said)))
        return DEFECT


def _own_place(error: Exception) -> str | None:
    """Where code of the user's own raised an error, itself or in what it called of installed packages; None for irl_gym's."""
    if isinstance(error, SyntaxError) and Path(error.filename or "").is_file():
        return f"{error.filename}, line {error.lineno}"
    for frame, line in reversed([*traceback.walk_tb(error.__traceback__)]):
        file = frame.f_code.co_filename
        if frame.f_globals.get("__name__", "").split(".")[0] in OURS:
            return None
        installed = file.startswith(("<", sysconfig.get_path("stdlib"))) or {*INSTALLED} & {*Path(file).parts}
        if not installed:
            return f"{file}, line {line}, in {frame.f_code.co_name}"
    return None
