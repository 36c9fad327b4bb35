"""Make the table of an environment, exact where that is possible, and say how exact it is and what the environment hides.

For example:
    irl-gym tabulate --env-id FrozenLake-v1 --env-kwargs map_name=8x8 --out lake.npz
    irl-gym tabulate --env-id MountainCar-v0 --bins 30 --out car.npz
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.text import Text

from irl_gym.commands.arguments import Environment, Table, parse_reveal
from irl_gym.commands.terminal import check_writable, exit_code, print_error, read_arguments, stage_bars
from irl_gym.errors import IrlGymError
from irl_gym.facts import counted, harmless

if TYPE_CHECKING:
    import gymnasium as gym

    from irl_gym.tables.tabulation import Tabulation


@dataclass(frozen=True)
class Arguments:
    """Make the table of an environment, and keep it as npz."""

    environment: Environment = field(default_factory=Environment)
    """What is acted in."""
    table: Table = field(default_factory=Table)
    """How the table of its transitions is made."""
    seed: int = 0
    """Of everything that is drawn."""
    out: Path = Path("table.npz")
    """The file, which irl_gym.tables.table_files.load_table reads."""


def command(words: Sequence[str]) -> int:
    """The subcommand: what it exits with."""
    asked = read_arguments(Arguments, words, "tabulate", __doc__)
    return exit_code(lambda: main(asked), others="the environment")


def main(arguments: Arguments) -> int:
    """Make the table, keep it, and say what there is."""
    try:
        check_writable(arguments.out)
        with stage_bars(Console(stderr=True)) as show:
            lines = tabulated(arguments, lambda share, told: show("table", share, told))
            show("table", 1.0)
    except KeyboardInterrupt:
        Console(stderr=True).print("Stopped. Nothing was written.")
        return 130
    except (IrlGymError, OSError) as error:
        print_error(error)
        return 2
    console = Console(soft_wrap=True)
    for line in lines:
        console.print(Text(harmless(line)))
    return 0


def tabulated(arguments: Arguments, tell: Callable[[float | None, str], None]) -> list[str]:
    """Make the table and keep it; what is said of it.

    Args:
        arguments: what is asked for.
        tell: told the share that is done, None where that cannot be known, and what is known of it.

    Raises:
        IrlGymError: no such environment, or no table of it.
    """
    from irl_gym.errors import HiddenState
    from irl_gym.loop.world_choice import ON_COMMAND_LINE, telling
    from irl_gym.runs.choices import parse_keywords
    from irl_gym.runs.named_parts import environment_of
    from irl_gym.tables.discretize import discretize
    from irl_gym.tables.enumeration.table import Enumeration
    from irl_gym.tables.table_files import save_table
    from irl_gym.tables.tabulate import tabulate

    given, asked = arguments.environment, arguments.table
    env = environment_of(
        given.env_id or "FrozenLake-v1", parse_keywords(given.env_kwargs), start_seeds=given.start_seeds,
        reveal=parse_reveal(given.reveal),
    )  # fmt: skip
    by = asked.by(arguments.seed)
    try:
        if (cells := asked.cells) is not None:
            method: dict[str, Any] = {"successors": "sampled", "samples": asked.samples} if asked.samples else {}
            method["on_progress"] = lambda share: tell(share, "")
            table = discretize(env, gamma=given.gamma, bins=cells, seed=arguments.seed, **method)
        else:
            table = tabulate(env, gamma=given.gamma, by=by, seed=arguments.seed, progress=telling(by or Enumeration(), tell))
    except HiddenState as error:
        raise HiddenState(f"{error} {ON_COMMAND_LINE[HiddenState]}") from error
    save_table(table, arguments.out)
    return [*summary(env, table), f"Wrote {arguments.out}."]


def summary(env: "gym.Env", table: "Tabulation") -> Iterator[str]:
    """What a table holds, a line each: states, actions, how exact it is, and what the environment hides."""
    from irl_gym.environments.reveal import shown_by

    mdp = table.mdp
    reachable, terminal = int(mdp.reachable.sum()), int(mdp.terminal.sum())
    yield f"states                   {mdp.n_states:,}, {reachable:,} reachable, {terminal:,} terminal"
    yield f"actions                  {mdp.n_actions}"
    yield f"gamma                    {mdp.gamma:g}"
    method, *evidence = str(table.evidence).splitlines()
    yield f"made of                  {method}"
    yield from evidence
    hidden = shown_by(env)
    if hidden:
        told = ", ".join(f"{name} ({counted(n, 'value')})" for name, n in hidden.items())
        yield f"hidden, and shown here   {told}"
    elif table.evidence.repeats is None:
        none = "none found: no step contradicts the table, which does not exclude it"
        yield f"hidden state             {none if table.evidence.check is not None else 'not looked for'}"
