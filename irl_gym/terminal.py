"""What all scripts say in a terminal in the same way: how far a stage is, and what went wrong."""

import contextlib
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

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
