"""Say in sentences what is wrong with the reward of a run, each with a mend.

Exits with
    0   the reward is healthy
    1   something was found, or the run did not finish, be it that its page alone is missing
    2   there is no run, or its files cannot be read
    3   too little could be examined to call the reward healthy
    70  the doctor stumbled over a defect of irl_gym

For example:
    irl-gym doctor --run runs/FrozenLake-v1-1a2b3c4d
"""

import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.text import Text

from irl_gym.commands.terminal import exit_code, print_error, read_arguments
from irl_gym.errors import IrlGymError, RunIncomplete
from irl_gym.facts import harmless

if TYPE_CHECKING:
    from irl_gym.judging.diagnoses.doctor import Diagnosis
    from irl_gym.runs.run import Run

CODES = {"healthy": 0, "findings": 1, "not examined": 3}
"""What the process exits with, by the doctor's answer."""
WHOSE = (
    "What only the learner knew, as lambda_0 and what its solver said, and what episodes showed is the run's own record; "
    "all else is computed now."
)


@dataclass(frozen=True)
class Arguments:
    """Say in sentences what is wrong with the reward of a run, each with a mend."""

    run: Path
    """The folder of a run: the --out of `irl-gym run`."""


def command(words: Sequence[str]) -> int:
    """The subcommand: what it exits with."""
    asked = read_arguments(Arguments, words, "doctor", __doc__)
    return exit_code(lambda: main(asked))


def show(diagnosis: "Diagnosis", console: Console, run: "Run | None") -> None:
    """Print a diagnosis: with the names of states where the run is at hand, and mends as Python and as flags."""
    from irl_gym.judging.diagnoses.findings import row_of, told_answer, told_finding
    from irl_gym.judging.diagnoses.plain_words import usable_flags

    style = "bold green" if diagnosis.healthy else "bold yellow"
    answer = harmless(told_answer(diagnosis.to_json()))
    console.print(Text.assemble((answer, style), f" {harmless(diagnosis.examined)}"))
    for number, one in enumerate(diagnosis.findings, start=1):
        sentence = told_finding(one.to_json(), row_of if run is None else run.place_name)
        console.print(Text.assemble((f"\n{number}. {one.name}", "bold"), f"\n   {harmless(sentence)}"))
        console.print(Text.assemble(("   Mend: ", "bold"), harmless(one.mend)))
        flags = usable_flags(one.flags, given=run is not None and run.config.get("dataset") is not None)
        if flags:
            console.print(Text.assemble(("   Flags: ", "bold"), harmless(", ".join(flags))))


def left(path: Path) -> "Diagnosis | None":
    """What can be said of a run that did not finish; None where that is nothing, or its files are no run's."""
    from irl_gym.runs.diagnosed import diagnose_unfinished

    try:
        return diagnose_unfinished(path)
    except (IrlGymError, OSError):
        return None


def without_page(run: "Run | None", console: Console) -> bool:
    """Say that the run stopped before its page, if it did; a version that wrote no run.json wrote no page either."""
    if run is None or not run.version or (run.path / "report.html").exists():
        return False
    again = f"irl-gym report --run {shlex.quote(str(run.path))}"
    console.print(Text(f"\nThe run did not finish: only its page, report.html, is missing. This command writes it: {again}"))
    return True


def main(arguments: Arguments) -> int:
    """Read the run, and say what there is."""
    from irl_gym.runs.diagnosed import diagnose_run
    from irl_gym.runs.run import read_run
    from irl_gym.runs.supply import supplied

    console, unfinished, run = Console(soft_wrap=True), None, None
    try:
        run = read_run(arguments.run)
        diagnosis = supplied(diagnose_run, run)
    except (IrlGymError, OSError) as error:
        unfinished = error
        diagnosis = left(arguments.run) if isinstance(error, RunIncomplete) else None
        print_error(error)
    if diagnosis is None:
        return 2
    show(diagnosis, console, run)
    if diagnosis.examined:
        console.print(Text(f"\n{WHOSE if run is None or run.table is not None else harmless(run.whose)}"))
    if run is not None and run.caution is not None:
        console.print(Text(f"\n{run.caution}"))
    complete = unfinished is None and not without_page(run, console)
    return CODES[diagnosis.answer] if complete else CODES["findings"]
