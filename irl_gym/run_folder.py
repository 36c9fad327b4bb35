"""A folder that holds one run, stage by stage.

Each stage writes into a hidden folder beside and its files are renamed into place; then a record says it is done. A run that
was killed and is started again with the same configuration continues after the last stage recorded. Another configuration
in the same folder is refused, never overwritten.
"""

import json
import os
import shutil
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from irl_gym.errors import RunConflict

_RECORDS = ".stages"


def write_json(path: Path, content: Any) -> None:
    """Write json with sorted keys, beside first and then renamed."""
    beside = path.with_name(f".{path.name}.tmp")
    beside.write_text(json.dumps(content, indent=2, sort_keys=True, allow_nan=False) + "\n")
    beside.replace(path)


class RunFolder:
    """The folder of one run; made if it does not exist.

    Args:
        path: the folder.
        config: what identifies the run; json values.

    Raises:
        RunConflict: the folder holds a run of another configuration, or files that are no run at all.
    """

    def __init__(self, path: str | os.PathLike, config: Mapping[str, Any]):
        self.path = Path(path)
        wanted = json.loads(json.dumps(config))
        known = self.path / "config.json"
        if known.exists():
            self._compare(known, wanted)
        elif self.path.exists() and (not self.path.is_dir() or any(self.path.iterdir())):
            raise RunConflict(f"{self.path} exists and holds no run: expected a new or empty folder. Choose another --out.")
        else:
            self.path.mkdir(parents=True, exist_ok=True)
            write_json(known, wanted)

    def _compare(self, known: Path, wanted: dict[str, Any]) -> None:
        try:
            found = json.loads(known.read_text())
        except (json.JSONDecodeError, UnicodeDecodeError) as error:
            raise RunConflict(
                f"{known} is not json ({error}): expected a run's configuration. Choose another --out."
            ) from error
        if not isinstance(found, dict):
            found = {}
        changed = [key for key in sorted({*found, *wanted}) if found.get(key) != wanted.get(key)]
        if changed:
            key = changed[0]
            raise RunConflict(
                f"{self.path} holds another run: its {key} is {found.get(key)!r}, this one's is {wanted.get(key)!r}. Choose "
                "another --out, or delete the folder."
            )

    def _record(self, stage: str) -> Path:
        return self.path / _RECORDS / f"{stage}.json"

    def done(self, stage: str) -> bool:
        """Was this stage finished, now or in an earlier run?"""
        return self._record(stage).exists()

    def run(self, stage: str, make: Callable[[Path], Mapping[str, Any]]) -> dict[str, Any]:
        """Run a stage, unless it was finished before; return its record.

        Args:
            stage: its name.
            make: writes the stage's files into the folder it is given, and returns a record of json values.
        """
        if self.done(stage):
            return json.loads(self._record(stage).read_text())
        beside = self.path / f".{stage}.tmp"
        shutil.rmtree(beside, ignore_errors=True)
        beside.mkdir()
        start = time.perf_counter()
        record = {**make(beside), "seconds": time.perf_counter() - start}
        for made in sorted(beside.iterdir()):
            final = self.path / made.name
            if final.is_dir():
                shutil.rmtree(final)
            made.replace(final)
        beside.rmdir()
        self._record(stage).parent.mkdir(exist_ok=True)
        write_json(self._record(stage), record)
        return record
