"""Reproduce the three experiments of Ng & Russell, "Algorithms for Inverse Reinforcement Learning" (ICML 2000).

For example:
    irl-gym reproduce ng-russell-2000
    irl-gym reproduce ng-russell-2000 --experiments 1 2 --out runs/paper
    irl-gym reproduce ng-russell-2000 --quick

Leaves its figures, ng_russell_2000.json and timings.json in --out. Exit code 1 if a verdict is "no".
"""

import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from irl_gym.commands.terminal import exit_code, print_error, read_arguments
from irl_gym.errors import InvalidParameter, IrlGymError

if TYPE_CHECKING:
    from irl_gym.commands.ng_russell_2000.records import Check

EXPERIMENTS = {
    1: "the 5 x 5 grid, section 3 (figures 1 and 2)",
    2: "the mountain car, section 4 (figure 4)",
    3: "the continuous grid world, section 5 (figure 5)",
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


def command(words: Sequence[str]) -> int:
    """The subcommand for this paper: what it exits with."""
    asked = read_arguments(Arguments, words, "reproduce ng-russell-2000", __doc__)
    return exit_code(lambda: main(asked))


def main(arguments: Arguments) -> int:
    """Run, print, write."""
    from irl_gym.files.run_folder import write_json

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
        print_error(error)
        return 2
    console.print(f"Figures and numbers are in {arguments.out}.", markup=False, soft_wrap=True)
    return told_verdicts([one for outcome, _ in done.values() for one in outcome.checks], console)


def run(number: int, arguments: Arguments, console: Console) -> tuple[Any, float]:
    """Run one experiment, print its checks and draw its figures; its outcome and seconds."""
    from irl_gym.commands.ng_russell_2000 import figures
    from irl_gym.commands.ng_russell_2000.experiment_1 import Experiment1
    from irl_gym.commands.ng_russell_2000.experiment_2 import Experiment2
    from irl_gym.commands.ng_russell_2000.experiment_3 import Experiment3

    kind: Any = {1: Experiment1, 2: Experiment2, 3: Experiment3}[number]
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
    console.print(table_of(outcome.checks, f"Experiment {number}: {EXPERIMENTS[number]}"))
    console.print(f"{', '.join(drawn)}; {spent:.0f} s\n", style="dim")
    return outcome, spent


def told_verdicts(checks: "Sequence[Check]", console: Console) -> int:
    """Print how many verdicts are no; what the process exits with."""
    missed = sum(one.verdict is False for one in checks)
    console.print(f"{missed} verdicts are no." if missed else "Every verdict is yes.")
    return int(missed > 0)


def table_of(checks: "Sequence[Check]", title: str) -> Table:
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
