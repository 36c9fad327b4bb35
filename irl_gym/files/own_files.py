"""Files of our own: there whole or not at all, never written through a link, and in a folder that no other process works in.

Who writes a file writes a new one beside it, under a name that nobody can foresee, and renames it. Who writes several
writes them into a new folder that is nobody else's. Both are locked while their writer lives, so that what a killed writer
left is told from what is being written: it is removed when something is next written beside it, or when the folder is next
held. Nothing is forced onto the disk, so that this holds for kills and not for power cuts (docs/security.md).

Locks are the system's (flock), which lets go when a process ends, however it does. On Windows, and on a file system that has no
locks, there are none: there two processes in one folder are not kept apart, and what a killed writer left stays.
"""

import contextlib
import errno
import hashlib
import os
import re
import secrets
import shutil
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from irl_gym.errors import InvalidParameter, RunConflict, WriteFailed

try:
    import fcntl
except ModuleNotFoundError:  # not on Windows
    fcntl = None

LOCK = ".lock"
"""In a folder that is held."""
UNFINISHED = re.compile(r"\.irl_gym-[0-9a-f]{16}\.tmp")
"""Names of what is being written."""
_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
_OURS_ALONE = os.O_CREAT | os.O_EXCL
_NO_LINK = getattr(os, "O_NOFOLLOW", 0)
_BYTES = getattr(os, "O_BINARY", 0)


@contextlib.contextmanager
def whole(path: str | os.PathLike) -> Iterator[BinaryIO]:
    """A new file, open for bytes, that takes the place of `path` at the end of the block; where that fails nothing is left.

    A link at `path` is replaced, not followed.

    Raises:
        InvalidParameter: there is a folder of the file's own name.
        WriteFailed: the disk is full.
        OSError: the system refused otherwise.
    """
    path = Path(path)
    if path.is_dir():
        raise InvalidParameter(f"{path} is a folder: expected a file, or nothing yet. Move it away, or write elsewhere.")
    sweep(path.parent)
    with _room(path), contextlib.ExitStack() as stack:
        beside, number = _new(path.parent, lambda one: os.open(one, os.O_WRONLY | _OURS_ALONE | _NO_LINK | _BYTES, 0o666))
        try:
            file = stack.enter_context(os.fdopen(number, "wb"))
            yield file
            file.flush()
            if fcntl is None:
                file.close()  # Windows renames no open file
            os.replace(beside, path)
        except BaseException:
            with contextlib.suppress(OSError):
                beside.unlink()
            raise


def write_bytes(path: str | os.PathLike, content: bytes) -> None:
    """Write a file, as `whole`."""
    with whole(path) as file:
        file.write(content)


def write_arrays(path: str | os.PathLike, arrays: Mapping[str, Any]) -> None:
    """Write an npz without compression, as `whole`; the same arrays make the same bytes."""
    with whole(path) as file:
        np.savez(file, **arrays)


@contextlib.contextmanager
def scratch(parent: Path) -> Iterator[Path]:
    """A new folder in another, for files that are not finished; what is still in it at the end is removed.

    Raises:
        WriteFailed: the disk is full.
    """
    sweep(parent)

    def make(folder: Path) -> int | None:
        folder.mkdir(mode=0o700)
        return None if fcntl is None else os.open(folder, os.O_RDONLY)  # Windows opens no folder

    with _room(parent):
        folder, number = _new(parent, make)
        try:
            yield folder
        finally:
            shutil.rmtree(folder, ignore_errors=True)
            if number is not None:
                os.close(number)


def sweep(folder: Path) -> None:
    """Remove what killed writers left in a folder."""
    with contextlib.suppress(OSError), os.scandir(folder) as inside:
        for one in inside:
            if UNFINISHED.fullmatch(one.name) and not one.is_symlink():
                _remove_if_nobodys(Path(one.path), one.is_dir(follow_symlinks=False))


@contextlib.contextmanager
def held(folder: Path, busy: str) -> Iterator[None]:
    """Hold a folder, made if it is not there, so that no other process works in it. What was made goes again if it is empty.

    Args:
        folder: what is held. It may be a link; what is in it may not lead out of it.
        busy: what is said where another process holds it.

    Raises:
        RunConflict: another process holds it, it cannot be made or written, or something in it leads out of it.
        WriteFailed: in place of any other error, where the disk became full or the folder was deleted meanwhile.
    """
    made = [one for one in (folder, *folder.parents) if not one.exists()]
    number = _locked(folder, busy)
    try:
        check_links(folder)
        sweep(folder)
        yield
        if not _is_at(number, folder / LOCK):
            raise _gone(folder)
    except Exception as error:
        told = _told(error, folder) if _is_at(number, folder / LOCK) else _gone(folder)
        if told is None:
            raise
        raise told from error
    finally:
        with contextlib.suppress(OSError):
            if _is_at(number, folder / LOCK):
                (folder / LOCK).unlink()
        os.close(number)
        for one in made:
            with contextlib.suppress(OSError):  # something was written
                one.rmdir()


def check_links(folder: Path) -> None:
    """Check that a folder holds files and folders alone, and no link that leads out of it.

    Raises:
        RunConflict: it does not; the first is named.
    """
    root = os.path.realpath(folder)
    for place, folders, files in os.walk(folder):
        for name in (*folders, *files):
            one = os.path.join(place, name)
            if os.path.islink(one):
                target = os.path.realpath(one)
                if os.path.commonpath([root, target]) != root:
                    raise RunConflict(
                        f"{one} is a link to {target}, out of {folder}: expected a file of its own. Copy what it leads to into "
                        "its place, or delete it."
                    )
            elif not os.path.isfile(one) and not os.path.isdir(one) and os.path.lexists(one):
                raise RunConflict(f"{one} is neither a file nor a folder: expected what a run leaves. Delete it.")


def digest(path: str | os.PathLike) -> str:
    """The sha256 of a file, in hexadecimal digits."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _new(parent: Path, make: Callable[[Path], int | None]) -> tuple[Path, Any]:
    """Something new in a folder and what it is open as, locked; made again if it was taken for something that was left."""
    while True:
        beside = parent / f".irl_gym-{secrets.token_hex(8)}.tmp"
        number = make(beside)
        if number is None or (_lock(number) is not False and _is_at(number, beside)):
            return beside, number
        os.close(number)


def _remove_if_nobodys(path: Path, is_folder: bool) -> None:
    """Remove what nobody has locked; what is new and not yet locked by its writer is made again."""
    with contextlib.suppress(OSError):
        number = os.open(path, (os.O_RDONLY if is_folder else os.O_RDWR) | _NO_LINK)
        try:
            if _lock(number):
                shutil.rmtree(path) if is_folder else path.unlink()
        finally:
            os.close(number)


def _locked(folder: Path, busy: str) -> int:
    """The lock of a folder, held."""
    while True:
        try:
            folder.mkdir(parents=True, exist_ok=True)
            number = os.open(folder / LOCK, os.O_RDWR | os.O_CREAT | _NO_LINK, 0o666)
        except OSError as error:
            raise RunConflict(
                f"{folder} cannot be written ({error}): expected a folder of yours. Choose another place."
            ) from error
        if _lock(number) is False:
            os.close(number)
            raise RunConflict(busy)
        if _is_at(number, folder / LOCK):
            return number
        os.close(number)  # whoever held it has just gone, and taken the lock along


def _lock(number: int) -> bool | None:
    """Lock an open file; False if another process has, None where there are no locks."""
    if fcntl is None:
        return None
    try:
        fcntl.flock(number, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        return None
    return True


def _is_at(number: int, path: Path) -> bool:
    """Is this open file the one at a path?"""
    try:
        return os.path.samestat(os.fstat(number), os.lstat(path))
    except OSError:
        return False


def _gone(folder: Path) -> WriteFailed:
    return WriteFailed(
        f"{folder / LOCK} is gone: expected it to stay while {folder} is written into. Was the folder moved or deleted? The "
        "same command begins anew where there is none."
    )


@contextlib.contextmanager
def _room(place: Path) -> Iterator[None]:
    """A block of writing, in which a full disk is told with the place and a mend."""
    try:
        yield
    except OSError as error:
        if (told := _told(error, place)) is None:
            raise
        raise told from error


def _told(error: Exception, folder: Path) -> WriteFailed | None:
    """What is said of an error where the disk is full; None where it is not."""
    if not isinstance(error, OSError) or error.errno not in _FULL:
        return None
    return WriteFailed(
        f"{folder} cannot be written any more ({error}): expected room on its disk. What was finished is kept: make room, and "
        "the same command continues."
    )
