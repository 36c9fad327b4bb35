"""The files of a run's folder, which anybody may have written, read one at a time; what is wrong is said with its mend."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from gymnasium import spaces

from irl_gym.errors import DamagedFile, IrlGymError, RunIncomplete
from irl_gym.files.run_folder import NOT_THE_SAME, STAGE_RECORDS, changed, checked_record, read_json
from irl_gym.files.run_schema import EnvironmentFile
from irl_gym.runs.identity import ENVIRONMENT, NEW_FOLDER, into_folder, ours, shell_command
from irl_gym.spaces.space_json import told_space

ONCE = ("config.json", "run.json")
"""Files that no stage writes: they are there from the start."""


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
        told = f"with another --out: {again}" if again else f"in a new folder: recover_and_retrain(experiment, {NEW_FOLDER!r})"
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
        except (OSError, ValueError, IrlGymError) as error:
            what = f"{name} cannot be read ({type(error).__name__}: {error})"
            if name in ONCE:
                raise self.lost(what) from error
            raise self.incomplete(f"{what}; delete it, and its stage is run again") from error

    def maybe(self, name: str, read: Callable[[Path], Any]) -> Any:
        """The content of a file that not every run has."""
        return self.read(name, read) if (self.path / name).exists() else None

    def record(self, stage: str) -> dict[str, Any] | None:
        """The record of a stage; None where it has none."""
        name = f"{STAGE_RECORDS}/{stage}.json"
        if not (self.path / name).exists():
            return None
        try:
            return checked_record(self.path, stage)
        except (OSError, DamagedFile) as error:
            raise self.incomplete(f"the stage {stage!r} was not finished, as {name} cannot be read: {error}") from error

    def check(self, record: Mapping[str, Any]) -> None:
        """Check that files are those that were recorded."""
        name = changed(self.path, record)
        if name is not None:
            told = f"{name} {NOT_THE_SAME}"
            raise self.lost(told) if name in ONCE else self.incomplete(f"{told}; delete it, and it is made again")

    def environment(self) -> tuple[str | None, spaces.Space, tuple[str, ...]]:
        """Id, observation space and names of the actions, which are read: no environment is made on the word of a folder."""
        if (told := self.maybe(ENVIRONMENT, _told)) is None:
            raise self.incomplete(
                f"it has no {ENVIRONMENT}, which says what is observed (earlier versions wrote none), and no environment is "
                "made to read a run; in Python, `irl_gym.runs.identity.write_environment(path, env, env_id)` adds it"
            )
        return told


def _told(path: Path) -> tuple[str | None, spaces.Space, tuple[str, ...]]:
    content = read_json(path, EnvironmentFile)
    return content["id"], told_space("observations", content["observations"]), tuple(content["actions"])
