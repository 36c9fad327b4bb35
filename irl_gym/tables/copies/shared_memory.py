"""Arrays that share memory, and copies of them that share it too.

`row = big[0]` is a second array over the memory of `big`: what is written through one is read through the other. A pickle or a
deep copy writes each array for itself. So the arrays that were met in a copy are looked at by their addresses: where some
overlap, the memory from the first byte of them to the last, a *block*, is copied once, and each is an array over that copy,
at the same offset.
"""

import array
import copy
import ctypes
import mmap
import sys
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.lib.array_utils import byte_bounds
from numpy.lib.stride_tricks import as_strided

from irl_gym.errors import NotCopied, with_article

T = TypeVar("T")
Extent = tuple[int, int]
"""The addresses of the first byte of an object's memory and of the first after it."""
_BUFFERS = (bytearray, array.array, ctypes.Array, ctypes.Structure, ctypes.Union, ctypes.c_int.__mro__[1])


@dataclass(frozen=True, eq=False)
class Block:
    """Memory that several arrays share."""

    extent: Extent
    arrays: list[Any]
    memory: np.ndarray
    """All of it, in a row: bytes, or objects."""

    def part(self, one: np.ndarray) -> tuple[int, tuple[int, ...], tuple[int, ...], np.dtype, bool]:
        """Where an array lies in it: what `placed` is told."""
        at = one.__array_interface__["data"][0] - self.extent[0]
        return at, one.shape, one.strides, one.dtype, one.flags.writeable


def placed(
    memory: np.ndarray, at: int, shape: tuple[int, ...], strides: tuple[int, ...], dtype: np.dtype, writeable: bool
) -> np.ndarray:
    """An array over a block's memory."""
    if memory.dtype == object:
        made = as_strided(memory[at // memory.itemsize :], shape, strides)
    else:
        made = np.ndarray(shape, dtype, memory.data, at, strides)
    if not writeable:
        made.flags.writeable = False
    return made


def holds_memory(kind: type) -> bool:
    """Are objects of this type memory that another object may share?"""
    torch: Any = sys.modules.get("torch")  # whoever holds a tensor has imported it
    return issubclass(kind, (np.ndarray, np.void, *_BUFFERS)) or (torch is not None and issubclass(kind, torch.Tensor))


def written_as_another(kind: type) -> bool:
    """Is a pickle of such an object one of another over the same memory, made for it? So is a parameter's: of its `data`."""
    torch: Any = sys.modules.get("torch")
    return torch is not None and kind is torch.nn.Parameter


def extent(one: Any) -> Extent:
    """The addresses of an object that holds memory."""
    if isinstance(one, np.ndarray):
        low, high = byte_bounds(one) if one.size else (0, 0)
        return int(low), int(high)
    if isinstance(one, (np.void, *_BUFFERS)):
        return extent(np.frombuffer(one, np.uint8)) if memoryview(one).nbytes else (0, 0)
    storage = one.untyped_storage() if one.layout == sys.modules["torch"].strided else None
    return (0, 0) if storage is None else (storage.data_ptr(), storage.data_ptr() + storage.nbytes())


def overlap(a: Extent, b: Extent) -> bool:
    """Do they share a byte?"""
    return max(a[0], b[0]) < min(a[1], b[1])


def blocks(met: Iterable[Any]) -> list[Block]:
    """The memory that several of these objects share.

    Raises:
        NotCopied: they are not all plain arrays.
    """
    found: list[tuple[Extent, list[Any]]] = []
    each = sorted(((extent(one), one) for one in {id(one): one for one in met}.values()), key=lambda pair: pair[0])
    for (low, high), one in each:
        if found and overlap(found[-1][0], (low, high)):
            (first, last), arrays = found[-1]
            found[-1] = (first, max(last, high)), [*arrays, one]
        else:
            found.append(((low, high), [one]))
    return [_block(bounds, arrays) for bounds, arrays in found if len(arrays) > 1]


def _block(bounds: Extent, arrays: list[Any]) -> Block:
    objects = arrays[0].dtype == object if isinstance(arrays[0], np.ndarray) else False
    for one in arrays:
        if type(one) is not np.ndarray or (one.dtype != object if objects else one.dtype.hasobject):
            raise shared(one, next(other for other in arrays if other is not one))
    if objects:  # the first one begins where the memory does, unless it runs backwards
        start = min(arrays, key=lambda one: one.__array_interface__["data"][0])
        if start.__array_interface__["data"][0] != bounds[0]:
            raise shared(*arrays[:2])
        return Block(bounds, arrays, as_strided(start, ((bounds[1] - bounds[0]) // start.itemsize,), (start.itemsize,)))
    raw: Any = (ctypes.c_ubyte * (bounds[1] - bounds[0])).from_address(bounds[0])
    return Block(bounds, arrays, np.frombuffer(raw, np.uint8))


def shared(one: Any, other: Any, *where: str) -> NotCopied:
    """The error for memory whose sharing a copy would end, and where the two are, if that is known."""
    told = " and ".join(_told(part) + at for part, at in zip((one, other), where or ("", ""), strict=True))
    return NotCopied(
        f"{told} share memory, which copies of them would not: expected memory shared by NumPy arrays of the class np.ndarray "
        "alone, of which none is in what copies itself, as a table of pandas does. Hold one of them, and make the other where "
        "it is needed; hold a copy of it where neither changes; or give the environment get_state() and set_state(state)."
    )


def mapped(one: Any) -> bool:
    """Is an array's memory a file's (or of processes that share it), so that what is written to it is read elsewhere too?"""
    while isinstance(one, np.ndarray | memoryview):
        if isinstance(one, np.memmap) and one.mode is not None:
            return one.mode in ("r+", "w+")
        if isinstance(one, memoryview) and one.readonly:
            return False
        one = one.obj if isinstance(one, memoryview) else one.base
    return isinstance(one, mmap.mmap) and not memoryview(one).readonly


def of_a_file(one: Any, where: str = "an attribute") -> NotCopied:
    """The error for memory that is a file's, and the attribute that leads there, if that is known."""
    return NotCopied(
        f"{where} leads to {_told(one)} that writes to a file (numpy.memmap in mode 'r+', say), which copies of it would not: "
        "expected arrays whose memory is their own. Load it in __init__, as by numpy.array(...) of it; open it with mode='r' "
        "where it is only read, or 'c' where no other reads the file; or give the environment get_state() and "
        "set_state(state)."
    )


def _told(one: Any) -> str:
    shape = getattr(one, "shape", None)
    return with_article(f"{type(one).__module__}.{type(one).__name__}") + (
        f" of shape {tuple(shape)}" if shape is not None else ""
    )


def copied(make: Callable[[dict[int, Any]], T], memo: dict[int, Any]) -> tuple[T, list[Any], dict[int, Any]]:
    """A deep copy whose arrays share memory where the originals do, the originals that hold memory, and the memo afterwards.

    Args:
        make: copies by `copy.deepcopy`, with the memo that it is given; called again where arrays share memory.
        memo: for `copy.deepcopy`.

    Raises:
        NotCopied: they cannot share it.
    """
    told = dict(memo)
    made, met = make(told), [*_met(told)]
    found = blocks(met)
    if not found:
        return made, met, told
    told = dict(memo)
    fresh = [block.memory.copy() for block in found]
    for block, memory in zip(found, fresh, strict=True):
        told |= {id(one): placed(memory, *block.part(one)) for one in block.arrays}
    made = make(told)
    for block, memory in zip(found, fresh, strict=True):
        if memory.dtype == object:
            memory[:] = copy.deepcopy([*block.memory], told)
        for one in _met(told):
            if overlap(extent(one), block.extent):
                raise shared(one, block.arrays[0])
    return made, met, told


def _met(memo: Any) -> Iterator[Any]:
    """What holds memory among all that was copied with a memo."""
    return (one for one in alive(memo) if holds_memory(type(one)))


def alive(memo: Any) -> Iterator[Any]:
    """All that was copied with a memo: `copy.deepcopy` keeps it alive there."""
    kept = memo.get(id(memo))
    for one in kept if isinstance(kept, list) else ():
        if type(one) is dict:
            yield from alive(one)  # the memo of a layer
        yield one


class Sharing:
    """How a pickler writes arrays of some blocks: called with each object, as `reducer_override`."""

    def __init__(self, found: list[Block]):
        self._blocks = found

    def __call__(self, one: Any) -> Any:
        """An array as one over its block's memory, which is written once."""
        if not isinstance(one, np.ndarray) or any(one is block.memory for block in self._blocks):
            return NotImplemented
        for block in self._blocks:
            if overlap(extent(one), block.extent):
                if type(one) is not np.ndarray or not one.size:
                    raise shared(one, block.arrays[0])
                return placed, (block.memory, *block.part(one))
        return NotImplemented
