"""HDF5 files from anybody, looked through before they are read: what they hold stays within them and within memory.

An HDF5 file can name other files whose bytes stand for its numbers, link to objects elsewhere or in a circle, hold pointers in
place of numbers, and declare terabytes in a few bytes. Neither Minari nor D4RL writes any of these. So the tree is walked from
its root, without reading a number, and everything but groups, and arrays of numbers, booleans or text that lie in the file
itself, is refused. Values of any length, which are text and pictures, may all be one that lies in the file once: what they
take together is counted, a few at a time. They lie in heaps, lists of objects of which each tells where the next one begins;
HDF5's library goes for ever round one that tells its own place, so that these are walked first.
"""

import mmap
import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5py

from irl_gym.errors import DamagedFile
from irl_gym.files.archives import check_declared, most_of

_low: Any = h5py  # what its high level is made of, which type checkers do not see
DEEPEST = 32
"""Groups within groups; observations of a Dict within a Dict are two."""
FILTERS = frozenset((1, 2, 3, 4, 5, 6, 32_000))
"""HDF5's own, and h5py's lzf; any other is code that the library would look for and load."""
MOST_BYTES = 1 << 16
"""Of one number or text."""
OF_ANY_LENGTH = 128
"""Bytes that a value of any length takes beside its content: it is an object of Python's."""
BROKEN = (
    OSError, ValueError, KeyError, TypeError, IndexError, AttributeError, AssertionError, ArithmeticError, RuntimeError,
    MemoryError,
)  # fmt: skip
"""What h5py, and Minari with it, raise on files that are cut off or changed."""


def check_hdf5(path: str | os.PathLike) -> None:
    """Look through a file.

    Raises:
        FileNotFoundError: no such file.
        DamagedFile: it is no HDF5 file, or holds what its numbers cannot be read of: naming the first such object.
    """
    if not Path(path).is_file():
        raise FileNotFoundError(f"{path} is no file: expected one in HDF5.")
    size, declared, of_any_length = os.path.getsize(path), 0, []
    try:
        with h5py.File(path, "r") as file:
            _check_heaps(path, file.id.get_create_plist().get_sizes()[1])
            for name, one in _objects(file.id):
                if isinstance(one, _low.h5d.DatasetID):
                    declared += _size(name, one)
                    of_any_length += [one] if _varies(one.get_type()) else []
            check_declared(declared, size)
            for one in of_any_length:
                for content in _contents(one, most_of(size) // size):
                    declared += content
                    check_declared(declared, size)
    except DamagedFile:
        raise
    except BROKEN as error:
        raise DamagedFile(f"it is damaged: {' '.join(str(error).split())[:200] or type(error).__name__}") from error


def read_attributes(file: Any, name: str) -> dict[str, Any]:
    """What is told of a group of an open file that was looked through.

    Raises:
        DamagedFile: something else than numbers, booleans or text, or more text than the file is in proportion to.
    """
    told, size, most = file[name].attrs, os.path.getsize(file.filename), 0
    for key in told:
        one = told.get_id(key)
        if not _plain(one.get_type()):
            raise DamagedFile(f"{name[:80]} has the attribute {key[:80]!r}, and no numbers, booleans or text in it")
        most += one.get_space().get_simple_extent_npoints() * (size if _varies(one.get_type()) else one.get_type().get_size())
    check_declared(most, size)  # an attribute is read whole, and each of its texts may be nearly the file
    return dict(told)


def _objects(root: Any) -> Iterator[tuple[str, Any]]:
    """The groups and datasets under a group, each once, with their names."""
    hard, seen, waiting = _low.h5l.TYPE_HARD, {_low.h5o.get_info(root).addr}, [("", root)]
    while waiting:
        inside, group = waiting.pop()
        links: list[tuple[bytes, int, int]] = []
        group.links.iterate(lambda name, link, links=links: links.append((name, link.type, link.u)), info=True)
        for raw, kind, place in links:
            name = f"{inside}/{raw.decode('utf-8', 'replace')}"
            if kind != hard:
                raise DamagedFile(f"{name[:80]} is a link to something else, here or in another file: no link is followed")
            if place in seen or name.count("/") > DEEPEST:
                raise DamagedFile(
                    f"{name[:80]} leads back to an object that has a name already, or deeper than {DEEPEST} groups"
                )
            seen.add(place)
            one = _low.h5o.open(group, raw)
            if isinstance(one, _low.h5g.GroupID):
                waiting.append((name, one))
            elif not isinstance(one, _low.h5d.DatasetID):
                raise DamagedFile(f"{name[:80]} is a type, and neither a group nor an array")
            yield name, one


def _check_heaps(path: str | os.PathLike, width: int) -> None:
    """Walk each list of values of any length, in which a number takes `width` bytes, as HDF5's library does (format, III.E).

    Raises:
        DamagedFile: one that does not come to its end.
    """
    head = -(-(8 + width) // 8) * 8  # bytes before the first object, and before the content of each
    with open(path, "rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as raw:

        def number(place: int) -> int:
            return int.from_bytes(raw[place + 8 : place + 8 + width], "little")

        for found in re.finditer(rb"GCOL\x01\0\0\0", raw):
            at, end = found.start() + head, found.start() + number(found.start())
            while at + head <= min(end, len(raw)):
                length = number(at)
                step = head + -(-length // 8) * 8 if raw[at : at + 2] != b"\0\0" else length
                if not 0 < step <= end - at:
                    raise DamagedFile(f"its values of any length do not follow each other: one at byte {at} takes {step} bytes")
                at += step


def _size(name: str, dataset: Any) -> int:
    """Bytes that an array takes in memory.

    Raises:
        DamagedFile: its numbers lie elsewhere, or are none.
    """
    kind, how, space = dataset.get_type(), dataset.get_create_plist(), dataset.get_space()
    if how.get_external_count() or how.get_layout() == _low.h5d.VIRTUAL:
        raise DamagedFile(f"{name[:80]} has its numbers in other files, which are not opened")
    if any(how.get_filter(i)[0] not in FILTERS for i in range(how.get_nfilters())):
        raise DamagedFile(f"{name[:80]} is packed by a plug-in, which is not loaded")
    if not _plain(kind) or space.get_simple_extent_type() == _low.h5s.NULL:
        raise DamagedFile(f"{name[:80]} holds neither numbers, booleans nor text")
    varies = _varies(kind)
    if varies and space.get_simple_extent_ndims() > 1:
        raise DamagedFile(f"{name[:80]} has text or pictures of any length in more than one row, as no dataset has")
    return space.get_simple_extent_npoints() * (OF_ANY_LENGTH if varies else kind.get_size())


def _contents(dataset: Any, together: int) -> Iterator[int]:
    """Bytes of the content of values of any length, some at a time; each of them takes no more than the file."""
    array = h5py.Dataset(dataset)
    if not array.shape:
        yield len(array[()])
        return
    for first in range(0, array.shape[0], together):
        yield sum(map(len, array[first : first + together]))


def _varies(kind: Any) -> bool:
    """Is this a type of values of any length, which lie elsewhere in the file?"""
    return kind.get_class() == _low.h5t.VLEN or (kind.get_class() == _low.h5t.STRING and kind.is_variable_str())


def _plain(kind: Any) -> bool:
    """Is this a type of numbers, booleans, text or, for pictures, bytes of any length?"""
    h5t = _low.h5t
    if kind.get_class() == h5t.VLEN:
        kind = kind.get_super()
        return kind.get_class() == h5t.INTEGER and kind.get_size() == 1
    return kind.get_class() in (h5t.INTEGER, h5t.FLOAT, h5t.ENUM, h5t.STRING) and kind.get_size() <= MOST_BYTES
