"""Put several finished runs side by side in one page that opens from disk.

For example:
    irl-gym compare runs/a runs/b runs/c --out compare.html
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro
from rich.console import Console
from rich.text import Text

from irl_gym.commands.terminal import UNSET, check_writable, exit_code, print_error, read_arguments
from irl_gym.errors import InvalidParameter, IrlGymError
from irl_gym.facts import harmless


@dataclass(frozen=True)
class Arguments:
    """Put several runs side by side in one page."""

    runs: tyro.conf.Positional[Annotated[tuple[Path, ...], UNSET]]
    """Folders of finished runs, two or more, of one environment or of several."""
    out: Path = Path("compare.html")
    """The file."""


def command(words: Sequence[str]) -> int:
    """The subcommand: what it exits with."""
    asked = read_arguments(Arguments, words, "compare", __doc__)
    return exit_code(lambda: main(asked))


def main(arguments: Arguments) -> int:
    """Read the runs and write the page."""
    try:
        if len(arguments.runs) == 1:
            raise InvalidParameter(f"runs has 1 folder, {arguments.runs[0]}: expected two or more to put side by side.")
        twice = next((one for one, n in Counter(map(Path.resolve, arguments.runs)).items() if n > 1), None)
        if twice is not None:
            raise InvalidParameter(f"runs has {twice} twice: expected different folders. Put another run in its place.")
        check_writable(arguments.out)
        side_by_side(arguments.runs, arguments.out)
    except (IrlGymError, OSError) as error:
        print_error(error)
        return 2
    return 0


def side_by_side(folders: Sequence[Path], out: Path) -> None:
    """Write the page of some finished runs, and say what holds of those that differ in their seed alone.

    Raises:
        IrlGymError, OSError: one that cannot be read, or a page that cannot be written.
    """
    from irl_gym.reports.comparison.compared_runs import lettered
    from irl_gym.reports.comparison.comparison_page import write_comparison
    from irl_gym.reports.comparison.pooled import told
    from irl_gym.runs.run import read_run

    runs = [read_run(folder) for folder in folders]
    write_comparison(runs, out)
    together = [told(pool) for pool in lettered(runs).pools]
    together += [f"{run.path}: {run.caution}" for run in runs if run.caution is not None]
    console = Console(soft_wrap=True)
    for line in together:
        console.print(Text(harmless(line)))
    console.print(Text(f"Wrote {out}: {len(runs)} runs side by side."))
