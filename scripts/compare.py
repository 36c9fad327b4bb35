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
from irl_gym.commands.terminal import check_writable, exit_code, print_error
from irl_gym.errors import InvalidParameter
from irl_gym.facts import harmless
from irl_gym.reports.comparison.compared_runs import lettered
from irl_gym.reports.comparison.comparison_page import write_comparison
from irl_gym.reports.comparison.pooled import told
from irl_gym.runs.run import read_run


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
        runs = [read_run(folder) for folder in arguments.runs]
        write_comparison(runs, arguments.out)
    except (IrlGymError, OSError) as error:
        print_error(error)
        return 2
    together = [told(pool) for pool in lettered(runs).pools]
    together += [f"{run.path}: {run.caution}" for run in runs if run.caution is not None]
    console = Console(soft_wrap=True)
    for line in together:
        console.print(Text(harmless(line)))
    console.print(Text(f"Wrote {arguments.out}: {len(runs)} runs side by side."))
    return 0


if __name__ == "__main__":
    asked = tyro.cli(Arguments, description=__doc__)
    sys.exit(exit_code(lambda: main(asked)))
