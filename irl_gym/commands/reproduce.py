"""Run the experiments of a paper again, and print its numbers beside ours; each paper has options of its own.

For example:
    irl-gym reproduce ng-russell-2000 --quick
    irl-gym reproduce abbeel-ng-2004 --figure 4
"""

import importlib
from collections.abc import Sequence

from irl_gym.commands.terminal import checked_name, print_error
from irl_gym.errors import InvalidParameter

PAPERS = {
    "ng-russell-2000": "irl_gym.commands.ng_russell_2000.reproduction",
    "abbeel-ng-2004": "irl_gym.commands.abbeel_ng_2004.reproduction",
}
"""Name -> the module that reproduces it, with `command`. A further paper is a line here and a folder of its own."""


def command(words: Sequence[str]) -> int:
    """The subcommand: what it exits with."""
    name, *rest = words or ["--help"]
    if name in ("-h", "--help"):
        print(__doc__, *(f"    {one}" for one in PAPERS), "", "irl-gym reproduce ng-russell-2000 --help says more.", sep="\n")
        return 0
    try:
        checked_name("paper", name, PAPERS)
    except InvalidParameter as error:
        print_error(error)
        return 2
    return importlib.import_module(PAPERS[name]).command(rest)
