"""A folder is claimed for a run: what identifies the run is compared, and two files say who wrote it and where it takes place.

run.json          the format, the version of irl_gym, and the command: no part of what identifies the run
environment.json  its id, the observation space, the names of the actions and what it was made with (large arrays by a
                  digest): so that a run can be read where the environment is not installed
"""

import importlib.metadata
import re
import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import gymnasium as gym
import minari
from minari.serialization import serialize_space

from irl_gym.demonstrations.datasets import digest_of
from irl_gym.errors import RunConflict, RunNewer
from irl_gym.files.run_folder import (
    NOT_THE_SAME,
    STAGE_RECORDS,
    START,
    RunFolder,
    changed,
    digests,
    is_empty,
    read_json,
    read_record,
    write_json,
    write_record,
)
from irl_gym.runs.choices import PROGRAM, TAKEN
from irl_gym.spaces.names import action_names
from irl_gym.tables.table_files import TABLE, UNDER_WAY

NUMBER = 1
FORMAT = f"irl_gym.Run/{NUMBER}"
FIRST = ("expert", "demonstrations", "reward", "agent", "metrics", "figures")
"""Stages of every version, after the table."""
STAGES = (*FIRST[:4], "clone", *FIRST[4:], "record", "ambiguity", "report")
"""All stages after the table."""
VERSION, ENVIRONMENT = "run.json", "environment.json"
SWITCHES = {"--shaping": "--no-shaping"}
"""Flags of mends that have no value, and their opposites."""
NEW_FOLDER = "runs/again"
"""The folder of a run that is made again."""


def claim(path: Path, config: dict[str, Any]) -> None:
    """Refuse a folder of another run before any work, but take over one in which no stage was finished, without its table.

    Raises:
        RunConflict: it holds another run, files that are no run at all, or a file that is not the one that the run left.
        RunNewer: it holds a run of a newer version.
    """
    if not path.exists() or is_empty(path):
        return
    if (path / VERSION).exists():
        try:
            told = read_json(path / VERSION)
        except (OSError, ValueError) as error:
            raise RunConflict(f"{path / VERSION} cannot be read ({error}): expected a run's. Delete that file.") from error
        check_format(path, told)
    known = path / "config.json"
    before = known.read_bytes() if known.exists() else None
    RunFolder(path, config)
    if before not in (None, known.read_bytes()):
        for name in (TABLE, UNDER_WAY, VERSION, ENVIRONMENT, f"{STAGE_RECORDS}/{START}.json"):
            (path / name).unlink(missing_ok=True)
    recorded = (read_record(path, START) or {}).get("sha256", {})
    other = changed(path, {"sha256": {name: one for name, one in recorded.items() if name in (VERSION, ENVIRONMENT)}})
    if other is not None:
        raise RunConflict(f"{path / other} {NOT_THE_SAME}. Delete it, and it is written again.")


def check_format(path: Path, told: Mapping[str, Any]) -> None:
    """Check the content of a folder's run.json; empty for a run of a version that wrote none.

    Raises:
        RunNewer: a newer version wrote it.
        RunConflict: it is no run's.
    """
    found = told.get("format")
    if not told or found == FORMAT:
        return
    number = re.fullmatch(r"irl_gym\.Run/([0-9]{1,9})", str(found))
    if number is None or int(number[1]) <= NUMBER:
        raise RunConflict(
            f"{path / VERSION} has format {found!r}: expected {FORMAT!r}. If irl_gym made the run, delete that file."
        )
    raise RunNewer(
        f"{path} has format {found!r}, written by irl_gym {told.get('irl_gym')}: expected {FORMAT!r}, which is what irl_gym "
        f"{_version()} reads. Upgrade irl_gym."
    )


def write_version(path: Path, command: Sequence[str] | None) -> None:
    """Write run.json, unless it stands already: a run that continues keeps the command of its start."""
    if not (path / VERSION).exists():
        write_json(
            path / VERSION, {"format": FORMAT, "irl_gym": _version(), "command": None if command is None else [*command]}
        )


def write_environment(path: Path, env: gym.Env, env_id: str | None, kwargs: Any = None) -> None:
    """Write environment.json, unless it stands already; `kwargs`, what it was made with as json, are for who reads the file."""
    if not (path / ENVIRONMENT).exists():
        observations = serialize_space(env.observation_space)  # text, as Minari keeps it: bounds may be infinite
        told = {"id": env_id, "observations": observations, "actions": [*action_names(env)], "kwargs": kwargs}
        write_json(path / ENVIRONMENT, told)


def record_start(path: Path, *, table_kept: bool) -> None:
    """Record the digests of what a run begins with. The table has to be the one that its stages were made from.

    Args:
        path: the folder.
        table_kept: the table was there; else it has just been made.

    Raises:
        RunConflict: it is another table.
    """
    names = [name for name in ("config.json", VERSION, ENVIRONMENT, TABLE) if (path / name).exists()]
    now = {"files": names, "sha256": digests(path, names)}
    before = read_record(path, START) or {}
    if changed(path, {"sha256": {name: one for name, one in before.get("sha256", {}).items() if name == TABLE}}):
        told = (
            f"{NOT_THE_SAME}. Delete it, and it is made again"
            if table_kept
            else "was made again, and is another than the run's stages were made from: expected the same bytes. Was the run "
            "begun by another version of irl_gym? Choose another --out"
        )
        raise RunConflict(f"{path / TABLE} {told}.")
    now |= {"dataset": before["dataset"]} if "dataset" in before else {}
    if before != now:
        write_record(path, START, now)


def record_dataset(path: Path, dataset: minari.MinariDataset) -> None:
    """Record the digest of a dataset that a run reads, which lies anywhere. Later stages have to read the same files.

    Raises:
        RunConflict: it is another than the one that stages were made from.
    """
    now, before = digest_of(dataset), read_record(path, START) or {}
    made = [one for one in (path / STAGE_RECORDS).glob("*.json") if one.stem != START]
    if made and before.get("dataset", now) != now:
        told = f"dataset {dataset.spec.dataset_id!r} is not the one that stages of {path} were made from, by its sha256"
        raise RunConflict(f"{told}: expected the same files. Choose another --out.")
    if before.get("dataset") != now:
        write_record(path, START, {"files": [], **before, "dataset": now})


def into_folder(command: Sequence[str], folder: str = NEW_FOLDER) -> list[str]:
    """The command with another --out.

    The default makes the run again: in the run's own folder everything is there already, and would be kept. A run that was
    moved or copied is continued where it is now: the folder that the command names may hold another one.
    """
    return [*without(command, "--out"), "--out", folder]


def without(command: Sequence[str], *flags: str) -> list[str]:
    """The command without some flags and their values, which go on to the next flag."""
    kept: list[str] = []
    skipped = False
    for word in map(str, command):
        if word.startswith("--"):
            skipped = flag_of(word) in flags
        if not skipped:
            kept.append(word)
    return kept


def mended(command: Sequence[str], flags: Sequence[str]) -> list[str] | None:
    """A command of `irl-gym run` with the flags of a mend in place of its own, in a folder that the run chooses.

    Args:
        command: of the run.
        flags: such as "--l1 0", as a `Finding` has them.

    Returns:
        The command; None where a flag is still without its value, or the learner has no such option.
    """
    given = {flag: values for flag, *values in map(str.split, flags)}
    if not given or any(not values and flag not in SWITCHES for flag, values in given.items()):
        return None
    before = _learner_of(command)
    learner = given.get("--learner", [before])[0]
    own = {f"--{name.replace('_', '-')}" for name in TAKEN.get(learner, ())}
    others = {f"--{name.replace('_', '-')}" for names in TAKEN.values() for name in names} - own
    if others & set(given):
        return None
    replaced = {*given, "--out", *(SWITCHES[flag] for flag in given if flag in SWITCHES)}
    if learner != before:
        replaced |= {*others, "--options"}
    return [*without(command, *replaced), *(word for flag, values in given.items() for word in (flag, *values))]


def _learner_of(command: Sequence[str]) -> str:
    """The learner that a command names, or leaves as it is."""
    words = [*map(str, command)]
    for word, after in zip(words, [*words[1:], ""], strict=True):
        if flag_of(word) == "--learner":
            return word.partition("=")[2] or after
    return "finite-lp"


def ours(command: Sequence[str]) -> bool:
    """Is a command that a file names this library's own? Any other could be anything, and is said to be."""
    return list(map(str, command[:2])) == PROGRAM


def flag_of(word: str) -> str:
    """The flag that a word of a command gives, as --help spells it; tyro takes --env_id for --env-id."""
    return word.partition("=")[0].replace("_", "-") if word.startswith("--") else ""


def shell_command(command: Sequence[str] | None) -> str | None:
    """A command as a shell reads it; None for None."""
    return None if command is None else shlex.join(command)


def _version() -> str:
    return importlib.metadata.version("irl_gym")
