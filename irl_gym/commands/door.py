"""`irl-gym`: which subcommand is meant. Each is a module of this folder, which is imported when it is asked for.

A subcommand reads its arguments before it imports what it works with: --help, and a mistyped option, cost no torch.
"""

import importlib
import importlib.metadata
import os
import sys
from collections.abc import Sequence

from irl_gym.commands.terminal import STOPPED, checked_name, print_error
from irl_gym.errors import InvalidParameter

SUBCOMMANDS = {
    "run": "recover a reward from an expert, and say how good an agent becomes that sees only that reward",
    "report": "write the page of a finished run again",
    "compare": "put finished runs side by side in one page; seeds of one method are pooled",
    "doctor": "say what is wrong with the reward of a run, in sentences, each with a mend",
    "tabulate": "make the table of an environment, exact where that is possible, as npz",
    "export": "write episodes of any expert as a Minari dataset",
    "play": "play with the keyboard; your episodes become a dataset to learn from",
    "learners": "list the learners, and what each has to be given",
    "reproduce": "run the experiments of a paper again, and print its numbers beside ours",
}
"""Name -> what it does. A new one is one line here and a module of this folder, with `command`."""


def main(words: Sequence[str] | None = None) -> int:
    """Run a subcommand; what the process exits with.

    Args:
        words: of the command line; None for those of this process.
    """
    name, *rest = (sys.argv[1:] if words is None else words) or ["--help"]
    if name in ("-h", "--help", "help"):
        print(usage())
        return 0
    if name in ("--version", "-V", "version"):
        print(f"irl-gym {importlib.metadata.version('irl_gym')}")
        return 0
    try:
        if name.startswith("-"):
            raise InvalidParameter(
                f"the first word is {name!r}: expected a subcommand, as in `irl-gym run --env-id FrozenLake-v1`. `irl-gym "
                "--help` lists them."
            )
        checked_name("subcommand", name, SUBCOMMANDS)
    except InvalidParameter as error:
        print_error(error)
        return 2
    find_modules_here()
    try:
        return importlib.import_module(f"irl_gym.commands.{name}").command(rest)
    except KeyboardInterrupt:
        print("Stopped.", file=sys.stderr)
        return STOPPED


def usage() -> str:
    """What --help prints."""
    width = max(map(len, SUBCOMMANDS))
    lines = (f"  {name:{width}}  {about}" for name, about in SUBCOMMANDS.items())
    return "\n".join(
        ["irl-gym: inverse reinforcement learning for Gymnasium.", "", *lines, "", "irl-gym run --help says what it takes."]
    )


def find_modules_here() -> None:
    """Let Python find the user's own modules in the folder in which they stand, after all that is installed.

    `python -m` and a script do this, or nearly; the console script does not. `python -P` asks for none of it.
    """
    here = os.getcwd()
    if not sys.flags.safe_path and not {"", here} & {*sys.path}:
        sys.path.append(here)
