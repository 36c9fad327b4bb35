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
from irl_gym.page.comparison import write_comparison
from irl_gym.runs import read_run


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
        write_comparison([read_run(one) for one in arguments.runs], arguments.out)
    except (IrlGymError, OSError) as error:
        text = Text.assemble((type(error).__name__, "bold red"), f": {error}")
        Console(stderr=True, soft_wrap=True).print(text)
        return 2
    Console(soft_wrap=True).print(Text(f"Wrote {arguments.out}: {len(arguments.runs)} runs side by side."))
    return 0


if __name__ == "__main__":
    sys.exit(main(tyro.cli(Arguments, description=__doc__)))
