"""Reproduce the three experiments of Ng & Russell, "Algorithms for Inverse Reinforcement Learning" (ICML 2000).

For example:
    python scripts/reproduce_ng_russell.py
    python scripts/reproduce_ng_russell.py --experiments 1 2 --out runs/paper
    python scripts/reproduce_ng_russell.py --quick

Leaves its figures, ng_russell_2000.json and timings.json in --out. Exit code 1 if a verdict is "no".
"""

import sys
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import tyro
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from irl_gym import IrlGymError
from irl_gym.commands.ng_russell_2000 import figures
from irl_gym.commands.ng_russell_2000.experiment_1 import Experiment1
from irl_gym.commands.ng_russell_2000.experiment_2 import Experiment2
from irl_gym.commands.ng_russell_2000.experiment_3 import Experiment3
from irl_gym.commands.ng_russell_2000.records import Check
from irl_gym.errors import InvalidParameter
from irl_gym.files.run_folder import write_json

EXPERIMENTS: dict[int, tuple[Any, str]] = {
    1: (Experiment1, "the 5 x 5 grid, section 3 (figures 1 and 2)"),
    2: (Experiment2, "the mountain car, section 4 (figure 4)"),
    3: (Experiment3, "the continuous grid world, section 5 (figure 5)"),
}


@dataclass(frozen=True)
class Arguments:
    """Reproduce the experiments of Ng & Russell (2000): numbers, verdicts, figures."""

    experiments: tuple[Literal[1, 2, 3], ...] = (1, 2, 3)
    """Which."""
    quick: bool = False
    """Smaller sizes with looser bars of their own: under a minute."""
    out: Path = Path("runs/ng_russell_2000")
    """Folder of the figures and numbers; files of an earlier run are replaced."""
    seed: int = 0
    """Of everything that is drawn."""


def main(arguments: Arguments) -> int:
    """Run, print, write."""
    console = Console(width=None if sys.stdout.isatty() else 118)
    numbers = sorted(set(arguments.experiments))
    try:
        if arguments.seed < 0 or not numbers:
            raise InvalidParameter("expected a seed of at least 0 and at least one of the experiments 1, 2 and 3.")
        arguments.out.mkdir(parents=True, exist_ok=True)
        done = {number: run(number, arguments, console) for number in numbers}
        found = {f"experiment_{number}": outcome.to_json() for number, (outcome, _) in done.items()}
        write_json(arguments.out / "ng_russell_2000.json", {"quick": arguments.quick, "seed": arguments.seed, **found})
        seconds = {f"experiment_{number}": spent for number, (_, spent) in done.items()}
        write_json(arguments.out / "timings.json", {"seconds": seconds, "total": sum(seconds.values())})
    except KeyboardInterrupt:
        Console(stderr=True).print("Stopped. Figures of the experiments that were finished are kept.")
        return 130
    except (IrlGymError, OSError) as error:
        Console(stderr=True, soft_wrap=True).print(f"{type(error).__name__}: {error}", markup=False)
        return 2
    console.print(f"Figures and numbers are in {arguments.out}.", markup=False, soft_wrap=True)
    missed = [one.what for outcome, _ in done.values() for one in outcome.checks if one.verdict is False]
    console.print(f"{len(missed)} verdicts are no." if missed else "Every verdict is yes.")
    return 1 if missed else 0


def run(number: int, arguments: Arguments, console: Console) -> tuple[Any, float]:
    """Run one experiment, print its checks and draw its figures; its outcome and seconds."""
    kind, title = EXPERIMENTS[number]
    settings = kind.quick() if arguments.quick else kind()
    if number > 1:  # the first draws nothing
        settings = replace(settings, seed=arguments.seed)
    start = time.perf_counter()
    columns = TextColumn("{task.description}"), BarColumn(), TextColumn("{task.percentage:>3.0f} %"), TimeElapsedColumn()
    with Progress(*columns, console=console, disable=not console.is_terminal, transient=True) as bar:
        task = bar.add_task(f"experiment {number}", total=1.0)
        outcome = settings.run(lambda share: bar.update(task, completed=share))
    drawn = figures.draw(outcome, arguments.out)
    spent = time.perf_counter() - start
    console.print(table_of(outcome.checks, f"Experiment {number}: {title}"))
    console.print(f"{', '.join(drawn)}; {spent:.0f} s\n", style="dim")
    return outcome, spent


def table_of(checks: tuple[Check, ...], title: str) -> Table:
    """Paper, ours, deviation, verdict."""
    table = Table(title=title, title_justify="left", title_style="bold")
    for name in ("what", "paper", "ours", "deviation", "bar", "verdict"):
        table.add_column(name, justify="left" if name in ("what", "bar") else "right")
    words = {True: "[green]yes[/]", False: "[bold red]no[/]", None: "-"}
    for one in checks:
        paper = one.paper if isinstance(one.paper, str) else f"{one.paper:.6g}"
        deviation = "" if one.deviation is None else f"{one.deviation:+.2g}"
        table.add_row(one.what, paper, f"{one.ours:.6g}", deviation, one.bar, words[one.verdict])
    return table


if __name__ == "__main__":
    sys.exit(main(tyro.cli(Arguments, description=__doc__)))
