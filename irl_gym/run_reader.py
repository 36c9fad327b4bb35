"""The files of a run's folder, which anybody may have written, read one at a time; what is wrong is said with its mend."""

import contextlib
import os
import zipfile
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from irl_gym.claims import AGAIN, into_folder, ours, shell_command
from irl_gym.errors import IrlGymError, RunIncomplete
from irl_gym.run_folder import NOT_THE_SAME, SURPRISES, changed

ONCE = ("config.json", "run.json")
"""Files that no stage writes: they are there from the start."""


@contextlib.contextmanager
def understood(*paths: str | os.PathLike) -> Iterator[None]:
    """For what is made of folders that anybody may have written: json that no run leaves is the run's fault, no traceback.

    Args:
        paths: the folders.

    Raises:
        RunIncomplete: in place of what the surprise raised, which it names.
    """
    try:
        yield
    except IrlGymError:
        raise
    except SURPRISES as error:
        raise not_understood(error, *paths) from error


def not_understood(error: Exception, *paths: str | os.PathLike) -> RunIncomplete:
    """The error of folders whose files can be read and say what no run says."""
    told = ", ".join(map(str, paths))
    return RunIncomplete(
        f"{told} cannot be understood ({type(error).__name__}: {error}): expected files as a run leaves them. If they "
        "were changed, or another program wrote them, make the run again; if not, it is a defect of irl_gym: please report it."
    )


class RunReader:
    """Reads files of one folder, and says which is wrong."""

    def __init__(self, path: Path):
        self.path, self.command = path, None
        self.files: set[str] = set()

    def incomplete(self, what: str) -> RunIncomplete:
        """The error of a run that has to be continued."""
        here = None if self.command is None else into_folder(self.command, str(self.path))
        again = shell_command(here) or f"recover_and_retrain(experiment, {str(self.path)!r}) with the same experiment"
        how = "The same command" if self.command is None or ours(self.command) else "A command of another program, it says,"
        return RunIncomplete(f"{self.path} is incomplete: {what}: expected a finished run. {how} continues it: {again}")

    def lost(self, what: str) -> RunIncomplete:
        """The error of a run that cannot be continued, since what says which run it is is gone."""
        again = shell_command(None if self.command is None else into_folder(self.command))
        told = f"with another --out: {again}" if again else f"in a new folder: recover_and_retrain(experiment, {AGAIN!r})"
        return RunIncomplete(
            f"{self.path} is damaged: {what}: expected what the run wrote at its start, which no stage writes again. Make the "
            f"run again, {told}"
        )

    def read(self, name: str, read: Callable[[Path], Any]) -> Any:
        """The content of a file."""
        self.files.add(name)
        try:
            return read(self.path / name)
        except FileNotFoundError as error:
            missing = Path(error.filename or name)
            told = missing.relative_to(self.path) if missing.is_relative_to(self.path) else name
            raise self.incomplete(f"{told} is missing") from error
        except (OSError, *SURPRISES, EOFError, zipfile.BadZipFile, IrlGymError) as error:
            what = f"{name} cannot be read ({type(error).__name__}: {error})"
            if name in ONCE:
                raise self.lost(what) from error
            raise self.incomplete(f"{what}; delete it, and its stage is run again") from error

    def maybe(self, name: str, read: Callable[[Path], Any]) -> Any:
        """The content of a file that not every run has."""
        return self.read(name, read) if (self.path / name).exists() else None

    def check(self, record: Mapping[str, Any]) -> None:
        """Check that files are those that were recorded."""
        name = changed(self.path, record)
        if name is not None:
            told = f"{name} {NOT_THE_SAME}"
            raise self.lost(told) if name in ONCE else self.incomplete(f"{told}; delete it, and it is made again")
