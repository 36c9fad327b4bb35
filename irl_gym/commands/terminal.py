"""What all subcommands do in a terminal in the same way: read arguments, say how far a stage is, and what went wrong."""

import contextlib
import difflib
import traceback
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, TypeVar

import tyro
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table
from rich.text import Text
from tyro.conf import DisallowNone, OmitArgPrefixes, arg

from irl_gym.errors import InvalidParameter
from irl_gym.facts import harmless

UNSET = arg(help_behavior_hint="")
"""What stands for "not given" is not shown in --help; the text says what happens then."""
OPTIONS = (OmitArgPrefixes, DisallowNone)
"""How tyro reads arguments: groups of them give no prefix to their flags, and nobody types None."""
Record = TypeVar("Record")


def read_arguments(kind: type[Record], words: Sequence[str], subcommand: str, about: str | None) -> Record:
    """The arguments of a subcommand, as a record; --help and what cannot be read end the process, as tyro has it.

    Args:
        kind: a dataclass, whose fields are the options.
        words: of the command line, behind the subcommand.
        subcommand: its name.
        about: what --help says first.
    """
    return tyro.cli(kind, args=[*words], prog=f"irl-gym {subcommand}", description=about, config=OPTIONS)


def checked_name(what: str, name: str, known: Collection[str]) -> str:
    """Return a name that is known.

    Raises:
        InvalidParameter: another one; the closest is offered.
    """
    if name not in known:
        close = difflib.get_close_matches(name, known, 1, 0.5)
        offer = f" Did you mean {close[0]!r}?" if close else ""
        raise InvalidParameter(f"{what} is {name!r}: expected one of {', '.join(known)}.{offer}")
    return name


@contextlib.contextmanager
def stage_bars(console: Console) -> Iterator[Callable[[str, float], None]]:
    """A bar for each stage, on a terminal only; gives what is to be told a stage and the share of it that is done."""
    bars = Progress(
        TextColumn("{task.description:14}"), BarColumn(), TextColumn("{task.percentage:>3.0f} %"), TimeElapsedColumn(),
        console=console, disable=not console.is_terminal,
    )  # fmt: skip
    tasks: dict[str, Any] = {}

    def show(stage: str, share: float) -> None:
        if stage not in tasks:
            tasks[stage] = bars.add_task(stage, total=1.0)
        bars.update(tasks[stage], completed=share)

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
    """A mistake of the user's, or what the system refused, in one line on standard error: the error's name, and its words."""
    text = Text.assemble((type(error).__name__, "bold red"), f": {harmless(str(error))}")
    Console(stderr=True, soft_wrap=True).print(text)


DEFECT = 70
"""What a script exits with that stumbled over a defect of irl_gym: EX_SOFTWARE, as sysexits.h has it."""


def exit_code(script: Callable[[], int], others: str = "") -> int:
    """What a script exits with.

    Whatever is wrong with a user's arguments and files has an error of its own, which scripts print. Any other is a defect of
    irl_gym, and is called one, with what is needed to report it.

    Args:
        script: tells what it exits with.
        others: whose code runs in it besides, such as "the environment", and may be what is wrong.
    """
    try:
        return script()
    except Exception as error:
        whose = f"irl_gym or of {others}" if others else "irl_gym"
        told = f"This is a defect of {whose}, not of your files: {type(error).__name__}: {error}"
        said = f"{told}. Please report it with this traceback:\n{''.join(traceback.format_exception(error))}"
        Console(stderr=True, soft_wrap=True).print(Text(harmless(said)))
        return DEFECT
