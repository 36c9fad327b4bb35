"""Export: any number of episodes to a Minari dataset, in flat memory, and through any number of kills.

Beside the datasets of a root there is, while an export is under way, a hidden folder named after the digest of its id:

    plan.json      what is exported; another plan is refused
    shards/        the episodes drawn so far, in closed files
    expert.*       what the demonstrator keeps, such as an agent that it trained
    assembled/     the dataset, being written from the shards
    ready          the plan again, once the dataset is whole

A demonstrator gives episode i the same whenever it is asked, so an export that was killed goes on after its last shard and ends
in the dataset that it would have ended in. When the dataset has its id, `ready` is moved beside the folder before anything is
removed, and goes last, in one step: as long as there is a trace of an export, the same again finishes it.
Axes: T steps, N episodes.
"""

import contextlib
import hashlib
import json
import os
import shutil
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import minari

from irl_gym.checks import checked_number
from irl_gym.demonstrations.datasets import writable_root
from irl_gym.demonstrations.minari_files import Description, check_free, publish, write_files
from irl_gym.demonstrations.shards import SHARD_BYTES, Shards, size_of
from irl_gym.errors import InvalidDemonstrations, InvalidParameter, RunConflict
from irl_gym.files.own_files import LOCK, held, write_bytes
from irl_gym.files.run_folder import read_json, write_json
from irl_gym.mdp.episodes import Episode
from irl_gym.mdp.rewards import plain_json

PLAN = "plan.json"
SHARD_SECONDS = 1.0
"""What a kill can cost of drawing."""

OnProgress = Callable[[str, float], None]
"""Told the stage, "episodes" or "writing", and the share of it that is done."""


@runtime_checkable
class Demonstrator(Protocol):
    """Gives episodes by their number."""

    def episodes(self, first: int) -> Iterator[Episode]:
        """Episodes first, first + 1, ... without end: each the same whenever, and from whichever `first`, it is asked for."""
        ...


@dataclass(frozen=True)
class Amount:
    """How much is exported: whole episodes, until one of the two is reached.

    Raises:
        InvalidParameter: neither, or fewer than 1.
    """

    episodes: int | None = None
    """N."""
    steps: int | None = None
    """Of all episodes together; the last one is finished."""

    def __post_init__(self) -> None:
        if self.episodes is None and self.steps is None:
            raise InvalidParameter("episodes and steps are None: expected a number of one of them.")
        for name in ("episodes", "steps"):
            if getattr(self, name) is not None:
                checked_number(name, getattr(self, name), "a whole number of at least 1", least=1, whole=True)
                object.__setattr__(self, name, int(getattr(self, name)))

    def share(self, episodes: int, steps: int) -> float:
        """How much of it so many episodes and steps are; 1 when it is reached."""
        return min(1.0, max(episodes / (self.episodes or float("inf")), steps / (self.steps or float("inf"))))


def export_dataset(
    begin: Callable[[Path], Demonstrator],
    about: Description,
    amount: Amount,
    plan: Mapping[str, Any],
    *,
    root: Path | str | None = None,
    on_progress: OnProgress | None = None,
) -> minari.MinariDataset:
    """Export episodes as a Minari dataset, going on where an export of the same plan was cut off.

    Args:
        begin: makes the demonstrator; it may keep files in the folder it is given, and finds them again after a kill. It is not
            called when nothing is left to draw.
        about: the dataset's description.
        amount: how much.
        plan: json of everything else that makes the episodes what they are.
        root: Minari's root folder; None for the one in force.
        on_progress: told how far it is.

    Raises:
        DatasetExists: the id is taken; said before anything is drawn.
        RunConflict: an export of another plan to this id was begun, another process is at it, or a link in its folder
            leads out of it.
        WriteFailed: the disk became full, or the folder was deleted meanwhile.
        InvalidParameter: a root that cannot be written.
        InvalidDemonstrations: the demonstrator ended before the amount was reached; what it gave is kept.
    """
    report = on_progress or (lambda stage, share: None)
    wanted = json.loads(json.dumps({
        **plan, "dataset_id": about.dataset_id, "data_format": about.data_format, "episodes": amount.episodes,
        "steps": amount.steps,
    }, default=plain_json))  # fmt: skip
    with writable_root(root) as base:
        folder = base / f".exporting-{hashlib.sha256(about.dataset_id.encode()).hexdigest()[:16]}"
        if not folder.exists() and not _cleared(folder).exists():
            check_free(base, about.dataset_id)
        with _alone(folder, about.dataset_id):
            finished = _published(folder, base, about.dataset_id)
            if finished is not None:
                _remove(folder)
            if finished != wanted:
                check_free(base, about.dataset_id)
                _take(folder, about.dataset_id, wanted)
                _make(folder, base, about, amount, begin, report)
                _remove(folder)
        _cleared(folder).unlink(missing_ok=True)
        return minari.load_dataset(about.dataset_id)


def _cleared(folder: Path) -> Path:
    """Where `ready` is while the folder of a finished export is removed, and until that is done."""
    return folder.with_name(f"{folder.name}.ready")


def _published(folder: Path, base: Path, dataset_id: str) -> dict[str, Any] | None:
    """The plan of an export that gave its dataset the id and was killed before it had cleared away; None if it was not."""
    if not (base / dataset_id).exists() or (folder / "assembled" / dataset_id).exists():
        return None
    told = next((one for one in (folder / "ready", _cleared(folder)) if one.exists()), None)
    return None if told is None else _plan(told, folder)


@contextlib.contextmanager
def _alone(folder: Path, dataset_id: str) -> Iterator[None]:
    """Hold the folder of an export, as `held`; it goes if nothing is in it."""
    try:
        _check_ours(folder)
        with held(folder, f"another process exports {dataset_id!r} into {folder.parent}: wait for it."):
            try:
                yield
            finally:
                if folder.exists() and not _begun(folder):
                    (folder / PLAN).unlink(missing_ok=True)
    finally:
        with contextlib.suppress(OSError):  # something is in it, or somebody
            folder.rmdir()


def _check_ours(folder: Path) -> None:
    """Check that nobody put something in the place of an export's folder, whose name can be foreseen: an agent in it is loaded.

    Raises:
        RunConflict: somebody did.
    """
    for one in (folder, _cleared(folder)):
        if one.is_symlink() or (one.exists() and hasattr(os, "geteuid") and one.stat().st_uid != os.geteuid()):
            raise RunConflict(f"{one} is a link, or another user's: expected what an export of yours left. Delete it.")


def _begun(folder: Path) -> bool:
    """Is there anything that would be lost with this folder?"""
    return any(one.name not in (LOCK, PLAN) for one in folder.iterdir())


def _plan(path: Path, folder: Path) -> dict[str, Any]:
    """The plan of the export in a folder, from one of the files that keep it."""
    try:
        return read_json(path)
    except (OSError, ValueError) as error:
        told = f"{path} cannot be read ({error}): expected the plan of an export."
        raise RunConflict(f"{told} Delete {folder if path.is_relative_to(folder) else path}.") from error


def _take(folder: Path, dataset_id: str, wanted: dict[str, Any]) -> None:
    """Write the plan, or check that it is the one that was begun."""
    known = folder / PLAN
    if known.exists() and _begun(folder):
        found = _plan(known, folder)
        for key in sorted({*found, *wanted}):
            if found.get(key) != wanted.get(key):
                raise RunConflict(
                    f"an export of {dataset_id!r} is under way with {key} {found.get(key)!r}: expected that, not "
                    f"{wanted.get(key)!r}. Ask for the same again to finish it, choose another id, or delete {folder}."
                )
    write_json(known, wanted)


def _make(
    folder: Path, base: Path, about: Description, amount: Amount, begin: Callable[[Path], Demonstrator], report: OnProgress
) -> None:
    assembled, ready = folder / "assembled", folder / "ready"
    if not (ready.exists() and (assembled / about.dataset_id).exists()):
        ready.unlink(missing_ok=True)
        shutil.rmtree(assembled, ignore_errors=True)
        shards = Shards(folder / "shards", about.observation_space)
        if amount.share(shards.n_episodes, shards.n_steps) < 1:
            _draw(shards, begin(folder), amount, report)
        assembled.mkdir()
        report("writing", 0.0)
        often = max(1, shards.n_episodes // 200)

        def written(n: int) -> None:
            if n % often == 0:
                report("writing", n / shards.n_episodes)

        write_files(assembled, about, shards, written)
        write_bytes(ready, (folder / PLAN).read_bytes())
        report("writing", 1.0)
    publish(assembled, base, about.dataset_id)


def _draw(shards: Shards, demonstrator: Demonstrator, amount: Amount, report: OnProgress) -> None:
    """Draw what is missing, and close a shard now and then."""
    episodes, steps = shards.n_episodes, shards.n_steps
    report("episodes", amount.share(episodes, steps))
    held: list[Episode] = []
    size, closed = 0, time.monotonic()
    for episode in demonstrator.episodes(episodes):
        held.append(episode)
        episodes, steps, size = episodes + 1, steps + len(episode), size + size_of(shards.space, episode)
        share = amount.share(episodes, steps)
        if share == 1 or size > SHARD_BYTES or time.monotonic() - closed > SHARD_SECONDS:
            shards.append(held)
            report("episodes", share)
            held, size, closed = [], 0, time.monotonic()
        if share == 1:
            return
    shards.append(held)
    raise InvalidDemonstrations(
        f"the demonstrator ended after episode {episodes - 1}: expected episodes without end. Give one that goes on."
    )


def _remove(folder: Path) -> None:
    """Clear away what is left of an export whose dataset has its id, but for what tells that it is finished."""
    if (folder / "ready").exists():
        (folder / "ready").replace(_cleared(folder))
    for path in folder.iterdir():
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path)
        elif path.name != LOCK:
            path.unlink()
