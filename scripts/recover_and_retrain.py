"""Recover a reward from an expert by linear-programming IRL, retrain an agent on it, and say how good the agent is.

For example:
    python scripts/recover_and_retrain.py --env-id Taxi-v4
    python scripts/recover_and_retrain.py --env-id CartPole-v1 --learner trajectory-lp
    python scripts/recover_and_retrain.py --dataset irl_gym/taxi-v4-expert-v0 --dataset-root DIR --learner feature-lp
"""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import tyro
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.text import Text

from irl_gym import IrlGymError, recover_and_retrain
from irl_gym.arguments import OPTIONS, Arguments
from irl_gym.report import print_report


def main(arguments: Arguments, command: Sequence[str]) -> int:
    """Run the loop and print the report; the command is kept, so that the run can be had again."""
    console = Console()
    bar = Progress(
        TextColumn("{task.description:14}"), BarColumn(), TextColumn("{task.percentage:>3.0f} %"), TimeElapsedColumn(),
        console=console, disable=not console.is_terminal,
    )  # fmt: skip
    tasks: dict[str, Any] = {}

    def show(stage: str, share: float) -> None:
        if stage not in tasks:
            tasks[stage] = bar.add_task(stage, total=1.0)
        bar.update(tasks[stage], completed=share)

    try:
        with bar:
            asked = arguments.experiment()
            report = recover_and_retrain(asked, arguments.out or Path("runs") / asked.name, show, command)
    except KeyboardInterrupt:
        Console(stderr=True).print("Stopped. The same command continues after the last finished stage.")
        return 130
    except IrlGymError as error:
        text = Text.assemble((type(error).__name__, "bold red"), f": {error}")
        Console(stderr=True, soft_wrap=True).print(text)
        return 2
    print_report(report, console)
    return 0


if __name__ == "__main__":
    asked = tyro.cli(Arguments, description=__doc__, config=OPTIONS)
    sys.exit(main(asked, ["python", "scripts/recover_and_retrain.py", *sys.argv[1:]]))
