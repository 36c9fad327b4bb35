"""Say in sentences what is wrong with the reward of a run, each with a mend.

Exits with 0 where the reward is healthy, 1 where something was found or the run did not finish, 2 where there is no run.

For example:
    python scripts/doctor.py --run runs/FrozenLake-v1-1a2b3c4d
"""

import sys
from dataclasses import dataclass
from pathlib import Path

import tyro
from rich.console import Console
from rich.text import Text

from irl_gym import IrlGymError
from irl_gym.diagnosis import Diagnosis, diagnose_run, diagnose_unfinished
from irl_gym.errors import RunIncomplete
from irl_gym.runs import read_run


@dataclass(frozen=True)
class Arguments:
    """Say in sentences what is wrong with the reward of a run, each with a mend."""

    run: Path
    """The folder of a run: the --out of recover_and_retrain.py."""


def show(diagnosis: Diagnosis, console: Console) -> None:
    """Print a diagnosis."""
    if diagnosis.healthy:
        console.print(Text.assemble(("Healthy. ", "bold green"), diagnosis.examined))
        return
    count = len(diagnosis.findings)
    console.print(Text.assemble((f"{count} finding{'s' if count > 1 else ''}. ", "bold yellow"), diagnosis.examined))
    for number, one in enumerate(diagnosis.findings, start=1):
        console.print(Text.assemble((f"\n{number}. {one.name}", "bold"), f"\n   {one.sentence}"))
        console.print(Text.assemble(("   Mend: ", "bold"), one.mend))


def main(arguments: Arguments) -> int:
    """Read the run, and say what there is."""
    console, unfinished = Console(soft_wrap=True), None
    try:
        diagnosis = diagnose_run(read_run(arguments.run))
    except IrlGymError as error:
        unfinished = Text.assemble((type(error).__name__, "bold red"), f": {error}")
        diagnosis = diagnose_unfinished(arguments.run) if isinstance(error, RunIncomplete) else None
        Console(stderr=True, soft_wrap=True).print(unfinished)
    if diagnosis is None:
        return 2
    show(diagnosis, console)
    return 0 if diagnosis.healthy and unfinished is None else 1


if __name__ == "__main__":
    sys.exit(main(tyro.cli(Arguments, description=__doc__)))
