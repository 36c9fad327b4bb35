"""Write the page of a finished run again: report.html, with everything in it.

For example:
    irl-gym report --run runs/demo
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from rich.console import Console
from rich.text import Text

from irl_gym.commands.terminal import UNSET, check_writable, exit_code, print_error, read_arguments
from irl_gym.errors import IrlGymError


@dataclass(frozen=True)
class Arguments:
    """Write report.html of a finished run."""

    run: Path
    """The folder of the run."""
    out: Annotated[Path | None, UNSET] = None
    """The file; the default is report.html in that folder."""


def command(words: Sequence[str]) -> int:
    """The subcommand: what it exits with."""
    asked = read_arguments(Arguments, words, "report", __doc__)
    return exit_code(lambda: main(asked))


def main(arguments: Arguments) -> int:
    """Read the run and write its page."""
    from irl_gym.reports.page.report import write_report
    from irl_gym.runs.run import read_run

    out = arguments.out or arguments.run / "report.html"
    try:
        if arguments.out is not None:
            check_writable(out)
        run = read_run(arguments.run)
        write_report(run, out)
    except (IrlGymError, OSError) as error:
        print_error(error)
        return 2
    Console(soft_wrap=True).print(Text(" ".join(filter(None, (f"Wrote {out}.", run.caution)))))
    return 0
