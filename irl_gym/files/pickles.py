"""A pickle read as data: nothing in it is imported, called or built, whatever it names.

`pickle.load` runs what a file says. Here its opcodes, as the standard library's `pickletools` lists them, are carried out on
plain values only: a name stays a name, and a call stays a record of what would have been called. Numbers and arrays of NumPy
are then recognised in such records. What is not of this kind is refused.
"""

import pickletools
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from irl_gym.errors import a_type

MOST_BYTES = 8 << 20
"""Of a pickle that is read."""


@dataclass(frozen=True)
class PickledName:
    """What would have been imported."""

    module: str
    """Where from."""
    name: str
    """What."""


@dataclass(eq=False)
class PickledCall:
    """What would have been called, and put into what came of it."""

    maker: Any
    """A Name, in every pickle that Python writes."""
    args: Any
    """Its arguments."""
    state: Any = None
    """Given to `__setstate__`, or the attributes."""
    items: list[Any] = field(default_factory=list)
    """Appended."""

    def is_of(self, name: str, *modules: str) -> bool:
        """Does it call this name of one of these modules?"""
        return isinstance(self.maker, PickledName) and self.maker.name == name and self.maker.module in modules


_VALUES = {
    "INT", "BININT", "BININT1", "BININT2", "LONG", "LONG1", "LONG4", "FLOAT", "BINFLOAT", "STRING", "BINSTRING",
    "SHORT_BINSTRING", "UNICODE", "BINUNICODE", "SHORT_BINUNICODE", "BINUNICODE8", "BINBYTES", "SHORT_BINBYTES", "BINBYTES8",
    "BYTEARRAY8",
}  # fmt: skip
"""Opcodes that push the value beside them."""
_MULTIARRAY = ("numpy.core.multiarray", "numpy._core.multiarray")
_NUMERIC = ("numpy.core.numeric", "numpy._core.numeric")
_KINDS = "biuf"
_KEYS = (str, bytes, int, float, PickledName, type(None))
"""Of dictionaries; a tuple of these, too."""


def read_pickle(raw: bytes) -> Any:
    """The content: numbers, texts, bytes, lists, tuples, dictionaries, and a Call for everything else.

    Raises:
        ValueError: no pickle, too large, or one with opcodes that plain data have no need of.
    """
    if len(raw) > MOST_BYTES:
        raise ValueError(f"it has {len(raw):,} bytes: expected {MOST_BYTES:,} at most")
    machine = _Machine()
    try:
        for opcode, argument, _ in pickletools.genops(raw):
            if opcode.name == "STOP":
                return machine.stack[-1]
            machine.step(opcode.name, argument)
    except (ValueError, IndexError, KeyError, TypeError, AttributeError, OverflowError, RecursionError) as error:
        raise ValueError(f"it is no pickle of plain data ({type(error).__name__}: {error})") from error
    raise ValueError("it ends before its end")


class _Machine:
    """The stack, the places of its marks, and the memo."""

    def __init__(self) -> None:
        self.stack: list[Any] = []
        self.marks: list[int] = []
        self.memo: dict[int, Any] = {}

    def step(self, name: str, argument: Any) -> None:
        """Carry out an opcode."""
        stack = self.stack
        if name in _VALUES:
            stack.append(argument)
        elif name in ("NONE", "NEWTRUE", "NEWFALSE"):
            stack.append({"NONE": None, "NEWTRUE": True, "NEWFALSE": False}[name])
        elif name.startswith("EMPTY_"):
            stack.append({"EMPTY_LIST": [], "EMPTY_TUPLE": (), "EMPTY_DICT": {}, "EMPTY_SET": []}[name])
        elif name == "MARK":
            self.marks.append(len(stack))
        elif name == "POP":
            stack.pop()
        elif name in ("TUPLE", "LIST", "DICT", "FROZENSET"):
            found = self._marked()
            made = {"TUPLE": tuple, "LIST": list, "FROZENSET": list}.get(name)
            stack.append(_dictionary(found) if made is None else made(found))
        elif name in ("TUPLE1", "TUPLE2", "TUPLE3"):
            count = int(name[-1])
            stack[-count:] = [tuple(stack[-count:])]
        elif name in ("APPEND", "APPENDS", "ADDITEMS", "SETITEM", "SETITEMS"):
            self._put(name)
        elif name in ("MEMOIZE", "PUT", "BINPUT", "LONG_BINPUT"):
            self.memo[len(self.memo) if name == "MEMOIZE" else int(argument)] = stack[-1]
        elif name in ("GET", "BINGET", "LONG_BINGET"):
            stack.append(self.memo[int(argument)])
        elif name not in ("PROTO", "FRAME"):
            self._call(name, argument)

    def _marked(self) -> list[Any]:
        """What stands behind the last mark."""
        at = self.marks.pop()
        found = self.stack[at:]
        del self.stack[at:]
        return found

    def _put(self, name: str) -> None:
        pairs = name.startswith("SETITEM")
        if name.endswith("S"):
            found = self._marked()
        else:
            found = self.stack[-2:] if pairs else self.stack[-1:]
            del self.stack[-len(found) :]
        target = self.stack[-1]
        if pairs and isinstance(target, dict):
            target.update(_dictionary(found))
        else:
            (target.items if isinstance(target, PickledCall) else target).extend(found)

    def _call(self, name: str, argument: Any) -> None:
        stack = self.stack
        if name == "GLOBAL":
            module, _, what = str(argument).partition(" ")
            stack.append(PickledName(module, what))
        elif name == "STACK_GLOBAL":
            module, what = stack.pop(-2), stack.pop()
            if not isinstance(module, str) or not isinstance(what, str):
                raise ValueError("it has a name that is no text")
            stack.append(PickledName(module, what))
        elif name in ("REDUCE", "NEWOBJ"):
            args, maker = stack.pop(), stack.pop()
            stack.append(PickledCall(maker, args))
        elif name == "BUILD":
            state = stack.pop()
            if not isinstance(stack[-1], PickledCall):
                raise ValueError("it gives a state to what has none")
            stack[-1].state = state
        else:
            raise ValueError(f"it has the opcode {name}: expected plain data")


def _dictionary(flat: list[Any]) -> dict[Any, Any]:
    """Keys and values in turn. Python hashes a tuple by hashing what it holds, however deep: so keys are plain."""
    for key in flat[::2]:
        if not all(isinstance(one, _KEYS) for one in (key if isinstance(key, tuple) else (key,))):
            raise ValueError(f"it has a dictionary with {a_type(key)} as a key")
    return dict(zip(flat[::2], flat[1::2], strict=True))


def as_numbers(found: Any) -> np.ndarray:
    """A number, or an array of NumPy, out of what `read_pickle` gave.

    Raises:
        ValueError: anything else.
    """
    try:
        if isinstance(found, bool | int | float):
            return np.asarray(found, dtype=np.float64)
        if isinstance(found, PickledCall) and found.is_of("_reconstruct", *_MULTIARRAY):
            _, shape, dtype, fortran, raw = found.state
            return _array(raw, dtype, shape, "F" if fortran else "C")
        if isinstance(found, PickledCall) and found.is_of("_frombuffer", *_NUMERIC):
            raw, dtype, shape, order = found.args
            return _array(raw, dtype, shape, order)
        if isinstance(found, PickledCall) and found.is_of("scalar", *_MULTIARRAY):
            dtype, raw = found.args
            return _array(raw, dtype, (), "C")
    except (TypeError, OverflowError, LookupError) as error:
        raise ValueError(f"it has an array that is none ({error})") from error
    raise ValueError(f"it has {type(found).__name__} where a number or an array is expected")


def _array(raw: Any, dtype: Any, shape: Any, order: Any) -> np.ndarray:
    """An array of its bytes."""
    if not isinstance(dtype, PickledCall) or not dtype.is_of("dtype", "numpy") or not isinstance(raw, bytes | bytearray):
        raise ValueError("it has an array without numbers")
    kind, byteorder = dtype.args[0], (dtype.state or (3, "="))[1]
    if not isinstance(kind, str) or not isinstance(byteorder, str):
        raise ValueError("it has an array of numbers without a name")
    if kind[:1] not in _KINDS or kind[1:] not in ("1", "2", "4", "8") or byteorder not in ("<", ">", "=", "|"):
        raise ValueError(f"it has an array of {kind}: expected numbers")
    return np.frombuffer(bytes(raw), dtype=byteorder + kind).reshape(tuple(map(int, shape)), order="F" if order == "F" else "C")
