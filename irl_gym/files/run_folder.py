"""A folder that holds one run, stage by stage.

Each stage writes into a hidden folder beside and its files are renamed into place; then a record says it is done. A run that
was killed and is started again with the same configuration continues after the last stage recorded. Another configuration
in the same folder is refused, never overwritten. Whoever runs stages holds the folder meanwhile (`own_files.held`).

A record holds the sha256 of each file of its stage that is read again, and whoever reads or continues the run compares them.
That tells a file that was damaged, changed, or copied from another run. It is no seal: who rewrites the records too can forge
a run.
"""

import json
import math
import os
import shutil
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from irl_gym.errors import DamagedFile, RunConflict
from irl_gym.files.own_files import LOCK, digest, scratch, write_bytes
from irl_gym.files.run_schema import RECORDS_OF, Stage, checked

NOT_THE_SAME = "is not the file that the run left, by its sha256: it was changed, damaged, or copied from another run"
LONGEST = 255
"""Bytes of a file's name in a record; file systems have no longer ones."""
DEEPEST = 100
"""Objects and lists inside each other."""
STAGE_RECORDS = ".stages"
"""Where the records of finished stages are, in the folder of a run."""

LOGS = "tensorboard"
"""A folder that several stages write into. No record lists its files, which hold the time and the host's name: who deletes
them loses no result, and no stage is run again."""


START = "start"
"""The record of what a run begins with: its configuration, who made it, where it takes place, and its table."""

FOR_PEOPLE = ("figures/", "report.html", "metrics.csv")
"""Files that no stage and no page is made from. Who changes them, or makes them again, changes nothing that is read."""


def write_text(path: Path, text: str) -> None:
    """Write a file in UTF-8, as `own_files.whole`."""
    write_bytes(path, text.encode())


def write_json(path: Path, content: Any) -> None:
    """Write json with sorted keys; errors as `write_text`."""
    write_text(path, json.dumps(content, indent=2, sort_keys=True, allow_nan=False) + "\n")


def read_json(path: Path, shape: Any = dict[str, Any]) -> dict[str, Any]:
    """Read a json object of plain text and finite numbers.

    Args:
        path: the file.
        shape: what it holds, of `run_schema` or `metrics_schema`.

    Raises:
        OSError: it cannot be read now.
        DamagedFile: it is something else; its first entry that is not of the shape is named.
    """
    try:
        content = json.loads(path.read_bytes(), parse_float=_finite, parse_int=_finite, parse_constant=_finite)
        json.dumps(content, ensure_ascii=False).encode()  # half a character is none
    except RecursionError as error:
        raise DamagedFile("it is nested too deeply") from error
    except ValueError as error:
        raise DamagedFile(f"it is no json of text and numbers: {str(error)[:200]}") from error
    if not isinstance(content, dict) or not content:
        raise DamagedFile(f"it is {content!r:.40}: expected an object with something in it")
    _check_depth(content, DEEPEST)
    return checked(content, shape)


def _finite(word: str) -> int | float:
    """A number of json, which may be as large as floats are; NaN and the infinities are none."""
    value = float(word)
    if not math.isfinite(value):
        raise ValueError(f"{word:.40} is no finite number")
    return int(word) if word.lstrip("-").isdecimal() else value


def _check_depth(content: dict | list, left: int) -> None:
    for one in content.values() if isinstance(content, dict) else content:
        if isinstance(one, dict | list):
            if not left:
                raise DamagedFile("it is nested too deeply")
            _check_depth(one, left - 1)


def digests(folder: Path, names: Iterable[str]) -> dict[str, str]:
    """The sha256 of those of a folder's files that are read again, by their names."""
    return {name: digest(folder / name) for name in names if not name.startswith(FOR_PEOPLE)}


def read_record(folder: Path, stage: str) -> dict[str, Any] | None:
    """The record of a finished stage; None where there is none, or it is no record of files in the folder."""
    try:
        return checked_record(folder, stage)
    except (OSError, DamagedFile):
        return None


def checked_record(folder: Path, stage: str) -> dict[str, Any]:
    """The same.

    Raises:
        OSError: it cannot be read now, or there is none.
        DamagedFile: it is no record of files in the folder.
    """
    record = read_json(folder / STAGE_RECORDS / f"{stage}.json", RECORDS_OF.get(stage, Stage))
    for name in (*record["files"], *record.get("sha256", {})):
        long = len(name.encode("utf-8", "surrogatepass")) > LONGEST
        if long or Path(name).is_absolute() or ".." in Path(name).parts or "\0" in name:
            raise DamagedFile(f"it is of {name!r:.80}: expected a file in the folder")
    return record


def write_record(folder: Path, stage: str, record: Mapping[str, Any]) -> None:
    """Write the record of a stage, which is finished with it."""
    (folder / STAGE_RECORDS).mkdir(exist_ok=True)
    write_json(folder / STAGE_RECORDS / f"{stage}.json", record)


def changed(folder: Path, record: Mapping[str, Any]) -> str | None:
    """The first file that is there and not the one that was recorded; None where there is none, or nothing was recorded."""
    recorded = record.get("sha256", {})
    there = (name for name in sorted(recorded) if (folder / name).is_file())
    return next((name for name in there if digest(folder / name) != recorded[name]), None)


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
            return
        if self.path.exists() and not is_empty(self.path):
            raise RunConflict(f"{self.path} exists and holds no run: expected a new or empty folder. Choose another --out.")
        self.path.mkdir(parents=True, exist_ok=True)
        write_json(known, wanted)

    def _compare(self, known: Path, wanted: dict[str, Any]) -> None:
        try:
            found = json.loads(known.read_text())
            before = dict(_leaves(found)) if isinstance(found, dict) else {}
        except (OSError, ValueError, RecursionError) as error:
            raise RunConflict(
                f"{known} is not json ({error}): expected a run's configuration. Choose another --out."
            ) from error
        now = dict(_leaves(wanted))
        different = [key for key in sorted({*before, *now}) if before.get(key) != now.get(key)]
        finished = [one for one in (self.path / STAGE_RECORDS).glob("*.json") if one.stem != START]
        if before and different and not finished:  # nothing is lost
            write_json(known, wanted)
            return
        if different:
            key = different[0]
            raise RunConflict(
                f"{self.path} holds another run: its {key} is {before.get(key)!r}, this one's is {now.get(key)!r}. Choose "
                "another --out, or delete the folder."
            )

    def done(self, stage: str) -> bool:
        """Was this stage finished, now or in an earlier run, and are its files still there?"""
        return self._read(stage) is not None

    def _read(self, stage: str) -> dict[str, Any] | None:
        """The record of a finished stage; None if there is none, it cannot be read, or a file of the stage is gone."""
        record = read_record(self.path, stage)
        if record is None or not all((self.path / name).exists() for name in record["files"]):
            return None
        other = changed(self.path, record)
        if other is not None:
            raise RunConflict(f"{self.path / other} {NOT_THE_SAME}. Delete it, and its stage is run again.")
        return record

    def load(self, name: str, read: Callable[[Path], Any]) -> Any:
        """Read a file that a stage left.

        Raises:
            RunConflict: it cannot be read.
        """
        try:
            return read(self.path / name)
        except (OSError, ValueError) as error:
            raise RunConflict(
                f"{self.path / name} cannot be read ({type(error).__name__}: {error}): it was changed after the run. Delete "
                "it, and its stage is run again."
            ) from error

    def run(self, stage: str, make: Callable[[Path], Mapping[str, Any]]) -> dict[str, Any]:
        """Run a stage, unless it was finished before; return its record.

        Args:
            stage: its name.
            make: writes the stage's files into the folder it is given, and returns a record of json values.

        Returns:
            The record, with `seconds`, `files` and their `sha256`; and `kept`, true, if an earlier run finished the stage.

        Raises:
            RunConflict: a file of a finished stage is not the one that it left.
        """
        finished = self._read(stage)
        if finished is not None:
            return {**finished, "kept": True}
        with scratch(self.path) as beside:
            start = time.perf_counter()
            record = {**make(beside), "seconds": time.perf_counter() - start}
            made = [one.relative_to(beside) for one in beside.rglob("*") if one.is_file()]
            record["files"] = sorted(one.as_posix() for one in made if one.parts[0] != LOGS)
            record["sha256"] = digests(beside, record["files"])
            _move(beside, self.path)
        write_record(self.path, stage, record)
        return record


def _move(beside: Path, final: Path) -> None:
    """Move what is in a folder into another, in place of what has the same name there; the folder of logs is added to."""
    for made in sorted(beside.iterdir()):
        there = final / made.name
        if made.name == LOGS and there.is_dir() and not there.is_symlink():
            _move(made, there)
            continue
        if there.is_dir() and not there.is_symlink():
            shutil.rmtree(there)
        elif made.is_dir():
            there.unlink(missing_ok=True)
        made.replace(there)


def _leaves(content: Any, prefix: str = "") -> Iterator[tuple[str, Any]]:
    """The values of nested objects with their dotted names."""
    if not isinstance(content, dict):
        yield prefix, content
        return
    for key, value in content.items():
        yield from _leaves(value, f"{prefix}.{key}" if prefix else key)


def is_empty(path: Path) -> bool:
    """Is this a folder with nothing in it but what holds it, or what a write left that was cut off?"""
    return path.is_dir() and all(one == LOCK or (one.startswith(".") and ".tmp" in one) for one in os.listdir(path))
