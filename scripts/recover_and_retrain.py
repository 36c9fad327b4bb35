"""Recover a reward from an expert by linear-programming IRL, retrain an agent on it, and say how good the agent is.

For example:
    python scripts/recover_and_retrain.py --env-id Taxi-v4
    python scripts/recover_and_retrain.py --env-id FrozenLake-v1 --env-kwargs map_name=8x8 is_slippery=true
"""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.text import Text

from irl_gym import SB3, Experiment, FiniteLP, IrlGymError, ValueIteration, recover_and_retrain
from irl_gym.experiment import parse_keywords
from irl_gym.planners import FOR_ADVANTAGES, Algorithm, Planner
from irl_gym.report import print_report

PlannerName = Literal["value-iteration", "ppo", "dqn", "a2c"]
ALGORITHMS: dict[str, Algorithm] = {"ppo": "PPO", "dqn": "DQN", "a2c": "A2C"}


@dataclass(frozen=True)
class Arguments:
    """Recover a reward from an expert, retrain an agent that sees only that reward, and judge it under the true one."""

    env_id: str = "FrozenLake-v1"
    """A registered environment; module:id for one of another package."""
    env_kwargs: tuple[str, ...] = ()
    """What the environment is made with: name=value ..., or one json object."""
    gamma: float = 0.99
    """Discount, between 0 and 1."""
    expert: PlannerName = "value-iteration"
    """Who demonstrates: exact planning, or an SB3 agent trained on the true reward."""
    episodes: int = 500
    """Demonstrations recorded; the linear program learns from the expert's whole policy, not from them."""
    learner: Literal["finite-lp"] = "finite-lp"
    """Ng & Russell's linear program for finite state spaces."""
    l1: float | Literal["auto"] = 0.0
    """lambda, the price of ||R||_1: a number, or auto for just below lambda_0."""
    margin_cap: float | Literal["auto", "none"] = "auto"
    """Cap on margins: a number, auto, or none for the paper's own program."""
    reward_on: Literal["state", "state-action"] = "state"
    """What the recovered reward is a function of."""
    shaping: bool = True
    """Retrain on the expected advantage under the recovered reward, computed from the table; else on the reward as it is."""
    retrain: PlannerName = "ppo"
    """Who learns from the recovered reward."""
    total_timesteps: int = 400_000
    """Environment steps of SB3 agents."""
    seed: int = 0
    """Of everything that is drawn."""
    out: Annotated[Path | None, tyro.conf.arg(metavar="DIR")] = None
    """Where the run is kept, and continued if it was killed. The default is a folder of its own under runs/."""


def main(arguments: Arguments) -> int:
    """Run the loop and print the report."""
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
            asked = experiment(arguments)
            report = recover_and_retrain(asked, arguments.out or Path("runs") / asked.name, show)
    except KeyboardInterrupt:
        Console(stderr=True).print("Stopped. The same command continues after the last finished stage.")
        return 130
    except IrlGymError as error:
        text = Text.assemble((type(error).__name__, "bold red"), f": {error}")
        Console(stderr=True, soft_wrap=True).print(text)
        return 2
    print_report(report, console)
    return 0


def experiment(arguments: Arguments) -> Experiment:
    """What the arguments ask for."""
    learner = FiniteLP(
        l1=arguments.l1,
        margin_cap=None if arguments.margin_cap == "none" else arguments.margin_cap,
        reward_on=arguments.reward_on,
        report_lambda_0=True,
    )
    return Experiment(
        env_id=arguments.env_id,
        env_kwargs=parse_keywords(arguments.env_kwargs),
        gamma=arguments.gamma,
        expert=planner(arguments.expert, arguments.total_timesteps),
        episodes=arguments.episodes,
        learner=learner,
        shaping=arguments.shaping,
        retrain=planner(arguments.retrain, arguments.total_timesteps, advantages=arguments.shaping),
        seed=arguments.seed,
    )


def planner(name: PlannerName, total_timesteps: int, *, advantages: bool = False) -> Planner:
    """The planner of a name, set for a reward that is an advantage if so."""
    if name not in ALGORITHMS:
        return ValueIteration()
    return SB3(ALGORITHMS[name], total_timesteps, FOR_ADVANTAGES if advantages and name == "ppo" else {})


if __name__ == "__main__":
    sys.exit(main(tyro.cli(Arguments, description=__doc__)))
