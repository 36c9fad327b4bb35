"""Put several finished runs side by side in one page that opens from disk.

For example:
    python scripts/compare.py runs/a runs/b runs/c --out compare.html
"""

import sys
from dataclasses import dataclass
from pathlib import Path

import tyro
from rich.console import Console
from rich.text import Text

from irl_gym import IrlGymError
from irl_gym.errors import InvalidParameter
from irl_gym.facts import harmless
from irl_gym.page.comparison import lettered, write_comparison
from irl_gym.page.pooled import told
from irl_gym.pooling import pools
from irl_gym.run_reader import understood
from irl_gym.runs import Run, read_run
from irl_gym.terminal import check_writable, print_error


@dataclass(frozen=True)
class Arguments:
    """Put several runs side by side in one page."""

    runs: tyro.conf.Positional[tuple[Path, ...]]
    """Folders of finished runs, two or more, of one environment or of several."""
    out: Path = Path("compare.html")
    """The file."""


def main(arguments: Arguments) -> int:
    """Read the runs and write the page."""
    try:
        if len(arguments.runs) == 1:
            raise InvalidParameter(f"runs has 1 folder, {arguments.runs[0]}: expected two or more to put side by side.")
        check_writable(arguments.out)
        runs = [_read(folder) for folder in arguments.runs]
        with understood(*arguments.runs):
            write_comparison(runs, arguments.out)
            together = [told(pool) for pool in pools(lettered(runs))] + [
                f"{run.path}: {run.caution}" for run in runs if run.caution is not None
            ]
    except (IrlGymError, OSError) as error:
        print_error(error)
        return 2
    console = Console(soft_wrap=True)
    for line in together:
        console.print(Text(harmless(line)))
    console.print(Text(f"Wrote {arguments.out}: {len(runs)} runs side by side."))
    return 0


def _read(folder: Path) -> Run:
    """One run; what is wrong with it names it alone."""
    with understood(folder):
        return read_run(folder)


if __name__ == "__main__":
    sys.exit(main(tyro.cli(Arguments, description=__doc__)))
