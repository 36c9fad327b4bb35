"""Reproduce the cloning curves of Abbeel & Ng, "Apprenticeship Learning via Inverse Reinforcement Learning" (ICML 2004).

For example:
    irl-gym reproduce abbeel-ng-2004 --figure 4
    irl-gym reproduce abbeel-ng-2004 --quick --out runs/paper

Leaves figure_4.png, abbeel_ng_2004.json and timings.json in --out. Exit code 1 if a verdict is "no".
"""

import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from rich.console import Console

from irl_gym.commands.abbeel_ng_2004 import figures
from irl_gym.commands.abbeel_ng_2004.figure_4 import Figure4
from irl_gym.commands.ng_russell_2000.reproduction import table_of, told_verdicts
from irl_gym.commands.terminal import exit_code, print_error, read_arguments, stage_bars
from irl_gym.errors import InvalidParameter, IrlGymError
from irl_gym.files.run_folder import write_json


@dataclass(frozen=True)
class Arguments:
    """Reproduce the cloning curves of Abbeel & Ng (2004): numbers, verdicts, figure."""

    figure: Literal[4] = 4
    """Which."""
    quick: bool = False
    """Fewer instances with a looser bar: under a minute."""
    out: Path = Path("runs/abbeel_ng_2004")
    """Folder of the figure and numbers; files of an earlier run are replaced."""
    seed: int = 0
    """Of everything that is drawn."""


def command(words: Sequence[str]) -> int:
    """What a command line for this paper exits with."""
    asked = read_arguments(Arguments, words, "reproduce abbeel-ng-2004", __doc__)
    return exit_code(lambda: main(asked))


def main(arguments: Arguments) -> int:
    """Run, print, write."""
    console, start = Console(width=None if sys.stdout.isatty() else 118), time.perf_counter()
    try:
        if arguments.seed < 0:
            raise InvalidParameter(f"seed is {arguments.seed}: expected at least 0.")
        arguments.out.mkdir(parents=True, exist_ok=True)
        settings = replace(Figure4.quick() if arguments.quick else Figure4(), seed=arguments.seed)
        with stage_bars(Console(stderr=True)) as show:
            outcome = settings.run(lambda share: show("figure 4", share))
        figures.draw(outcome, arguments.out)
        told = {"quick": arguments.quick, "seed": arguments.seed, "figure_4": outcome.to_json()}
        write_json(arguments.out / "abbeel_ng_2004.json", told)
        write_json(arguments.out / "timings.json", {"seconds": {"figure_4": time.perf_counter() - start}})
    except KeyboardInterrupt:
        Console(stderr=True).print("Stopped. Nothing was written.")
        return 130
    except (IrlGymError, OSError) as error:
        print_error(error)
        return 2
    console.print(table_of(outcome.checks, "Figure 4: value of clones over the expert's"))
    console.print(f"Figure and numbers are in {arguments.out}; {time.perf_counter() - start:.0f} s.", markup=False)
    return told_verdicts(outcome.checks, console)
