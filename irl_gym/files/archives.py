"""NumPy archives (npz) from anybody, read as data: nothing is unpickled, and nothing is held that was not checked.

An npz is a zip of arrays, each a header (dtype, shape) and its numbers. Both may lie: a few kilobytes can declare terabytes. So
what the zip declares is compared with the size of the file before anything is decompressed, each header with what the zip
declares before anything is allocated, and no more bytes are read than were declared. Whoever reads one says in its own words
where, and what was expected: the errors here say what is wrong with it.
"""

import errno
import json
import math
import os
import struct
import tokenize
import warnings
import zipfile
import zlib
from collections.abc import Callable, Container, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib import format as npy

from irl_gym.errors import DamagedFile

FREE = 128 << 20
"""Bytes that a file of any size may declare."""
RATIO = 100
"""Times its size that a larger one may: arrays of a real run, compressed, are seldom below a hundredth."""
KINDS = "biufU"
"""Of dtype: booleans, whole numbers, floats, text. No complex numbers, no objects, no records."""
LONGEST = 1 << 40
"""Of an axis; NumPy itself stumbles over longer ones."""
MOST_AXES = 32
"""Of an array."""
_PIECE = 1 << 24
_HEADERS = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}
"""Readers of NumPy's headers by their version; a third is for the names of records, which are not read."""
_BROKEN = (
    ValueError, KeyError, EOFError, TypeError, IndexError, RuntimeError, AttributeError, ArithmeticError, MemoryError,
    SyntaxError, tokenize.TokenError, struct.error, zipfile.BadZipFile, zlib.error,
)  # fmt: skip
"""What zipfile and NumPy's reader of headers raise of other bytes than they expect."""


def most_of(size: int) -> int:
    """Bytes that a file of so many may take in memory."""
    return max(FREE, RATIO * size)


def check_declared(declared: int, size: int) -> None:
    """Check, before it is unpacked, that what a file declares is in proportion to its size.

    Args:
        declared: bytes that it would take in memory.
        size: bytes that it takes on the disk.

    Raises:
        DamagedFile: it is not.
    """
    most = most_of(size)
    if declared > most:
        raise DamagedFile(
            f"it has {size:,} bytes and declares {declared:,}: expected at most {most:,}. If it is yours, write it without "
            "compression"
        )


def read_arrays(path: str | os.PathLike, names: Container[str] | None = None) -> dict[str, np.ndarray]:
    """The arrays of an npz, by name, in this machine's byte order.

    Args:
        path: the file.
        names: those that are read, if they are there; None for all.

    Raises:
        FileNotFoundError: no such file.
        OSError: it cannot be read now, which says nothing about what is in it.
        DamagedFile: it is no npz, was cut off or changed, declares more than it can hold, or holds something else than
            booleans, numbers or text.
    """

    def read(archive: zipfile.ZipFile) -> dict[str, np.ndarray]:
        found = _members(path, archive)
        return {name: _array(archive, one) for name, one in found.items() if names is None or name in names}

    return _read(path, read)


def json_in(arrays: Mapping[str, np.ndarray], name: str) -> Any:
    """What an array of text says, which is json.

    Args:
        arrays: by name.
        name: of the one that is text.

    Raises:
        DamagedFile: it is not there, or is something else.
    """
    try:
        text = arrays[name]
        if text.dtype.kind != "U" or text.ndim:
            raise ValueError(f"shape {text.shape} and dtype {text.dtype}")
        return json.loads(text.item())
    except KeyError as error:
        raise DamagedFile(f"it has no {name}, only {sorted(arrays)[:9]}") from error
    except (ValueError, RecursionError) as error:
        raise DamagedFile(f"its {name} is no json: {str(error)[:200]}") from error


def read_settings(path: str | os.PathLike, name: str) -> tuple[list[str], Any]:
    """The names of a zip's members, sorted, and what one of them says in json, such as an agent's settings; None if it is not
    there.

    Raises:
        FileNotFoundError, OSError, DamagedFile: as `read_arrays`.
    """

    def read(archive: zipfile.ZipFile) -> tuple[list[str], Any]:
        names = sorted(archive.namelist())
        if name not in names:
            return names, None
        check_declared(archive.getinfo(name).file_size, os.path.getsize(path))
        return names, json.loads(archive.read(name))

    return _read(path, read)


def _read(path: str | os.PathLike, read: Callable[[zipfile.ZipFile], Any]) -> Any:
    """What is read of a zip; whatever zipfile, zlib, NumPy and json say of damage is one error of ours."""
    if not (Path(path).is_file() or Path(path).is_dir()) and Path(path).exists():
        raise DamagedFile("it is no regular file")  # a pipe would be waited for
    with Path(path).open("rb") as file:
        try:
            with zipfile.ZipFile(file) as archive:
                return read(archive)
        except DamagedFile:
            raise
        except OSError as error:
            if error.errno != errno.EINVAL:  # zipfile sought a place before the file's start
                raise
            raise DamagedFile("it is cut off") from error
        except _BROKEN as error:
            if isinstance(error, zipfile.BadZipFile) and not zipfile.is_zipfile(file):
                raise DamagedFile("it is no npz archive") from error
            raise DamagedFile(f"it is damaged: {' '.join(str(error).split())[:200] or type(error).__name__}") from error


def _members(path: str | os.PathLike, archive: zipfile.ZipFile) -> dict[str, zipfile.ZipInfo]:
    """The arrays of an archive by name, which declare no more than it can hold."""
    found: dict[str, zipfile.ZipInfo] = {}
    for info in archive.infolist():
        name = info.filename.removesuffix(".npy")
        if name in found or info.flag_bits & 1 or info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise ValueError(f"{name[:80]!r} is there twice, encrypted, or packed in a way that NumPy does not use")
        found[name] = info
    check_declared(sum(one.file_size for one in found.values()), os.path.getsize(path))
    return found


def _array(archive: zipfile.ZipFile, info: zipfile.ZipInfo) -> np.ndarray:
    """One array: its header is compared with what the zip declares before anything is allocated."""
    file: Any
    data: Any
    with archive.open(info) as file:
        version = npy.read_magic(file)
        if version not in _HEADERS:
            raise ValueError(f"{info.filename} has the format {version}")
        with warnings.catch_warnings():  # of Python's parser, about what a changed header looks like
            warnings.simplefilter("ignore")
            shape, in_columns, dtype = _HEADERS[version](file)
        here = f"{info.filename} has shape {str(shape)[:80]} and dtype {str(dtype)[:80]}"
        if dtype.kind == "O":
            raise TypeError(f"{here}, pickled objects, which are never read")
        if dtype.kind not in KINDS:
            raise TypeError(f"{here}, and no booleans, numbers or text")
        count, size = math.prod(shape), info.file_size - file.tell()
        if len(shape) > MOST_AXES or max(shape, default=0) > LONGEST or count * max(dtype.itemsize, 1) != size:
            raise ValueError(f"{here}, and {size} bytes")
        data = np.empty(count, dtype=dtype)
        place = memoryview(data.view(np.uint8))
        while place and (n := file.readinto(place[:_PIECE])):
            place = place[n:]
        if place or file.read(1):
            raise EOFError(f"{here}, and another number of bytes than it declares")
    data = data.astype(dtype.newbyteorder("="), copy=False)
    _check_bits(data, here)
    return data.reshape(shape, order="F" if in_columns else "C")


def _check_bits(data: np.ndarray, here: str) -> None:
    """Refuse booleans that are neither 0 nor 1, and text that is none: NumPy believes them."""
    if data.dtype.kind == "b" and data.view(np.uint8).max(initial=0) > 1:
        raise ValueError(f"{here}, and a boolean that is neither 0 nor 1")
    if data.dtype.kind == "U" and data.dtype.itemsize:
        codes = data.view(np.uint32)
        if ((codes > 0x10FFFF) | ((codes >= 0xD800) & (codes < 0xE000))).any():
            raise ValueError(f"{here}, and text that is no Unicode")
