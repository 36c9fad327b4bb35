"""Arrays and plain values over a pipe between two processes of ours: json, then the arrays' bytes. Nothing is pickled.

Numbers, text, None, lists, dictionaries with keys of text, namespaces, arrays, and sparse ones by columns. Tuples arrive as
lists; every bit arrives, and the order of an array in memory.
"""

import json
import math
import struct
from types import SimpleNamespace
from typing import Any

import numpy as np
import scipy.sparse as sp


def send(pipe: Any, message: Any) -> None:
    """Write a message.

    Raises:
        OSError: nobody reads.
        TypeError: a value of another kind.
    """
    arrays: list[np.ndarray] = []
    told = json.dumps(_told(message, arrays)).encode()
    pipe.write(struct.pack("<q", len(told)) + told)
    for array in arrays:
        pipe.write(array.tobytes(order="A"))
    pipe.flush()


def receive(pipe: Any) -> Any:
    """Wait for a message and read it.

    Raises:
        EOFError: the other process is gone.
        OSError: the pipe is.
    """
    (size,) = struct.unpack("<q", _read(pipe, 8))
    return _meant(json.loads(_read(pipe, size)), pipe)


def _told(value: Any, arrays: list[np.ndarray]) -> Any:
    if sp.issparse(value):
        return {"sparse": [_told(one, arrays) for one in (value.data, value.indices, value.indptr, value.shape)]}
    if isinstance(value, np.ndarray):
        value = value if value.flags.forc else np.ascontiguousarray(value)
        arrays.append(value)
        return {"array": [value.dtype.str, value.shape, "C" if value.flags.c_contiguous else "F"]}
    if isinstance(value, SimpleNamespace):
        return {"names": _told(vars(value), arrays)}
    if isinstance(value, dict):
        return {"items": {key: _told(one, arrays) for key, one in value.items()}}
    return [_told(one, arrays) for one in value] if isinstance(value, list | tuple) else value


def _meant(value: Any, pipe: Any) -> Any:
    if isinstance(value, list):
        return [_meant(one, pipe) for one in value]
    if not isinstance(value, dict):
        return value
    ((kind, one),) = value.items()
    if kind == "items":
        return {key: _meant(each, pipe) for key, each in one.items()}
    if kind == "names":
        return SimpleNamespace(**_meant(one, pipe))
    if kind == "array":
        dtype, shape, order = np.dtype(one[0]), one[1], one[2]
        return np.ndarray(shape, dtype, _read(pipe, dtype.itemsize * math.prod(shape)), order=order)
    data, indices, indptr, shape = _meant(one, pipe)
    return sp.csc_array((data, indices, indptr), shape=tuple(shape))


def _read(pipe: Any, size: int) -> bytearray:
    found = bytearray(size)
    if size and pipe.readinto(found) < size:  # a buffered pipe: short only at its end
        raise EOFError(f"the pipe ended within {size} bytes")
    return found
