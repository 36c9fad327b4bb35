"""The first sign of life of a command, which is there before anything heavy is imported: this module imports nothing else."""

import sys
from collections.abc import Sequence


def say_started(arguments: Sequence[str]) -> None:
    """Say in a line on standard error that a command has begun, unless its arguments ask for help."""
    if not {"-h", "--help"} & set(arguments):
        print("irl_gym: loading", file=sys.stderr, flush=True)
