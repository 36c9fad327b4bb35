"""Recover a reward from an expert by linear-programming IRL, retrain an agent on it, and say how good the agent is.

For example:
    python scripts/recover_and_retrain.py --env-id Taxi-v4
    python scripts/recover_and_retrain.py --env-id CartPole-v1 --learner trajectory-lp
    python scripts/recover_and_retrain.py --dataset irl_gym/taxi-v4-expert-v0 --dataset-root DIR --learner feature-lp
"""

import sys
from collections.abc import Sequence
from pathlib import Path

from irl_gym.commands.started import say_started

if __name__ == "__main__":
    say_started(sys.argv)  # what is imported below takes seconds

import tyro
from rich.console import Console

from irl_gym import IrlGymError, recover_and_retrain
from irl_gym.commands.arguments import Arguments
from irl_gym.commands.terminal import OPTIONS, exit_code, print_error, stage_bars
from irl_gym.reports.terminal_report import print_report
from irl_gym.runs.identity import PROGRAM


def main(arguments: Arguments, command: Sequence[str]) -> int:
    """Run the loop and print the report; the command is kept, so that the run can be had again."""
    console = Console()
    try:
        with stage_bars(Console(stderr=True)) as show:  # so that they are seen where the report is piped
            asked = arguments.experiment()
            report = recover_and_retrain(asked, arguments.out or Path("runs") / asked.name, show, command)
        print_report(report, console)
    except KeyboardInterrupt:
        Console(stderr=True, soft_wrap=True).print(
            "Stopped. The same command continues after the last finished stage, and inside the training of an agent."
        )
        return 130
    except (IrlGymError, OSError) as error:
        print_error(error)
        return 2
    return 0


if __name__ == "__main__":
    asked = tyro.cli(Arguments, description=__doc__, config=OPTIONS)
    sys.exit(exit_code(lambda: main(asked, [*PROGRAM, *sys.argv[1:]]), others="the environment or of a learner of your own"))
