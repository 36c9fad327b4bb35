"""List the learners, and what each has to be given: Table 1 of the lecture notes (2.1.3), from what learners declare.

For example:
    irl-gym learners
    irl-gym learners my_module:MyLearner --markdown
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import tyro

from irl_gym.commands.terminal import UNSET, exit_code, print_error, print_table, read_arguments
from irl_gym.errors import IrlGymError

if TYPE_CHECKING:
    from irl_gym.learners.needs import Needs

COLUMNS = ("learner", "setting", "demonstrations D*", "environment, dynamics T", "oracle pi*", "reward R", "besides")
VARIABLES = (("demonstrations", "expert"), ("environment", "dynamics"), ("oracle",), ("reward",))
"""The parts of a problem that each variable of Table 1 stands for."""


@dataclass(frozen=True)
class Arguments:
    """List the learners, and what each has to be given."""

    names: tyro.conf.Positional[Annotated[tuple[str, ...], UNSET]] = ()
    """Learners of your own beside those that are built in, as module:Class."""
    markdown: bool = False
    """As a table in Markdown."""


def command(words: Sequence[str]) -> int:
    """The subcommand: what it exits with."""
    asked = read_arguments(Arguments, words, "learners", __doc__)
    return exit_code(lambda: main(asked), others="a learner of your own")


def main(arguments: Arguments) -> int:
    """Print the table."""
    try:
        found = rows(arguments.names)
    except IrlGymError as error:
        print_error(error)
        return 2
    if arguments.markdown:
        print(*(f"| {' | '.join(row)} |" for row in (COLUMNS, ["---"] * len(COLUMNS), *found)), sep="\n")
    else:
        print_table("What each learner has to be given", COLUMNS, found)
    return 0


def rows(own: Sequence[str] = ()) -> list[list[str]]:
    """A row for each learner: its name, its column of Table 1, and what it needs.

    Args:
        own: learners beside those that are built in, as module:Class.

    Raises:
        UnknownLearner: no such module or class, or one that is no learner.
    """
    from irl_gym.learners.registry import BUILT_IN, learner_class

    needs = {name: learner_class(name).needs for name in (*BUILT_IN, *own)}
    return [[name, one.column, *(_asked(one, parts) for parts in VARIABLES), _besides(one)] for name, one in needs.items()]


def _asked(needs: "Needs", parts: Sequence[str]) -> str:
    """Is a variable asked for: yes with what it is of, optional, or no?"""
    from irl_gym.learners.needs import OR

    required = [one for part in needs.required if {*part.split(OR)} & {*parts} for one in part.split(OR) if one in parts]
    if required:
        alone = any({*part.split(OR)} <= {*parts} for part in needs.required)
        told = {"needed": "", "inferred": "; actions inferred on a table", "not read": "; states alone"}[needs.actions]
        return f"{'yes' if alone else 'or another'} ({OR.join(required)}{told if 'demonstrations' in required else ''})"
    return "optional" if {*needs.optional} & {*parts} else "no"


def _besides(needs: "Needs") -> str:
    """What is no variable of Table 1."""
    named = {part for parts in VARIABLES for part in parts}
    told = [one for one in needs.parts if one not in named]
    return ", ".join(f"{one} (optional)" if one in needs.optional else one for one in told) or "nothing"
