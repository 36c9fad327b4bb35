"""Export: any number of episodes to a Minari dataset, in flat memory, and through any number of kills.

Beside the datasets of a root there is, while an export is under way, a hidden folder named after the digest of its id:

    plan.json      what is exported; another plan is refused
    shards/        the episodes drawn so far, in closed files
    expert.*       what the demonstrator keeps, such as an agent that it trained
    assembled/     the dataset, being written from the shards
    ready          the dataset is whole

A demonstrator gives episode i the same whenever it is asked, so an export that was killed goes on after its last shard and ends
in the dataset that it would have ended in. Shards are removed after the dataset has its id, the plan last.
Axes: T steps, N episodes.
"""

import contextlib
import hashlib
import json
import shutil
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import minari

from irl_gym.checks import checked_number
from irl_gym.datasets import writable_root
from irl_gym.demonstrations import Episode
from irl_gym.errors import InvalidDemonstrations, InvalidParameter, RunConflict
from irl_gym.minari_files import Description, check_free, publish, write_files
from irl_gym.rewards import plain_json
from irl_gym.run_folder import write_json
from irl_gym.shards import SHARD_BYTES, Shards, size_of

try:
    import fcntl
except ModuleNotFoundError:  # not on Windows; there two processes in one folder are not kept apart
    fcntl = None

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
        RunConflict: an export of another plan to this id was begun, or another process is at it.
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
        if not folder.exists():
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
        return minari.load_dataset(about.dataset_id)


def _published(folder: Path, base: Path, dataset_id: str) -> dict[str, Any] | None:
    """The plan of an export that gave its dataset the id and was killed before it had cleared away; None if it was not."""
    ready = folder / "ready"
    if not ready.exists() or (folder / "assembled" / dataset_id).exists() or not (base / dataset_id).exists():
        return None
    return json.loads(ready.read_text())


@contextlib.contextmanager
def _alone(folder: Path, dataset_id: str) -> Iterator[None]:
    """Hold the folder of an export; the system lets go when the process ends, however it does. It goes if nothing is in it."""
    folder.mkdir(exist_ok=True)
    with (folder / "lock").open("w") as file:
        if fcntl is not None:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError as error:
                raise RunConflict(f"another process exports {dataset_id!r} into {folder.parent}: wait for it.") from error
        try:
            yield
        finally:
            if folder.exists() and not _begun(folder):
                _remove(folder)


def _begun(folder: Path) -> bool:
    """Is there anything that would be lost with this folder?"""
    return any(one.name not in ("lock", "plan.json") for one in folder.iterdir())


def _take(folder: Path, dataset_id: str, wanted: dict[str, Any]) -> None:
    """Write the plan, or check that it is the one that was begun."""
    known = folder / "plan.json"
    if known.exists() and _begun(folder):
        try:
            found = dict(json.loads(known.read_text()))
        except (ValueError, TypeError) as error:
            raise RunConflict(f"{known} cannot be read ({error}): expected the plan of an export. Delete {folder}.") from error
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
        shutil.copyfile(folder / "plan.json", folder / ".ready.tmp")
        (folder / ".ready.tmp").replace(ready)
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
    """Clear away what is left of an export; `ready` last, which tells that it is finished."""
    for path in sorted(folder.iterdir(), key=lambda one: one.name == "ready"):
        if path.is_dir():
            shutil.rmtree(path)
        else:
            path.unlink()
    folder.rmdir()
