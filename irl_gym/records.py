"""Records that say what they hold: a repr of a few lines, and a `help` that lists their fields with their documentation."""

import ast
import inspect
import textwrap
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from itertools import pairwise
from typing import Any

import numpy as np

LINES, WIDTH = 6, 110
"""Of a repr, at most."""
FEW = 6
"""Numbers, or entries, that are shown one by one."""
LONG = 90
"""Characters of one field that are shown."""
LONG_NUMBER = 10
"""A float of more characters is shown in six digits."""


class Record:
    """A dataclass that is shown in at most six lines, arrays by their shape and range, and whose fields `help` lists.

    What a field is stands in a string under it, in the source; where there is none, `help` has names and types.
    """

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        if "__repr__" not in cls.__dict__:  # the one that `dataclass` would write shows all numbers
            setattr(cls, "__repr__", _repr)  # noqa: B010
        setattr(cls, "__doc__", _Documented(cls.__dict__.get("__doc__") or ""))  # noqa: B010


class _Documented:
    """A class's documentation, to which the fields are added when it is read."""

    def __init__(self, text: str):
        self.text = text

    def __get__(self, instance: Any, kind: type) -> str:
        if "__match_args__" not in kind.__dict__:  # `dataclass` is still at work on the class
            return self.text
        told = documented(kind)
        lines = [textwrap.indent(f"{name}: {textwrap.indent(text, '    ').strip()}", " " * 4) for name, text in told.items()]
        return "\n".join([inspect.cleandoc(self.text), "", "Attributes:", *lines]) if lines else self.text


def documented(kind: type) -> dict[str, str]:
    """What each field of a dataclass is; its type where nobody says, or the source is not there."""
    said: dict[str, str] = {}
    for base in reversed(kind.__mro__):
        if base is object or "__dataclass_fields__" not in base.__dict__:
            continue
        try:
            body = ast.parse(textwrap.dedent(inspect.getsource(base))).body[0]
        except (OSError, TypeError, SyntaxError, IndexError):
            continue
        for field, text in pairwise(getattr(body, "body", ())):
            if isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name) and isinstance(text, ast.Expr):
                found = ast.literal_eval(text.value) if isinstance(text.value, ast.Constant) else None
                if isinstance(found, str):
                    said[field.target.id] = inspect.cleandoc(found)
    of_kind: Any = kind
    return {
        one.name: said.get(one.name) or str(getattr(one.type, "__name__", one.type))
        for one in fields(of_kind)
        if not one.name.startswith("_")
    }


def _repr(self: Any) -> str:
    told = (f"{one.name}={short(getattr(self, one.name))}" for one in fields(self) if one.repr)
    whole = f"{type(self).__name__}({', '.join(told)})"
    lines = textwrap.wrap(whole, WIDTH, subsequent_indent="    ", break_long_words=False, break_on_hyphens=False)
    return "\n".join(lines if len(lines) <= LINES else [*lines[: LINES - 1], "    ...)"])


def short(value: Any) -> str:
    """A value in a few words, on one line."""
    if isinstance(value, np.ndarray):
        return _of_array(value)
    if isinstance(value, str):
        return repr(value) if len(value) <= LONG else f"{value[:LONG]!r}..."
    if isinstance(value, Mapping):
        if len(value) > FEW:
            return f"{{{len(value)} entries}}"
        return _cut(f"{{{', '.join(f'{key!r}: {short(one)}' for key, one in value.items())}}}", f"{{{len(value)} entries}}")
    if type(value) in (list, tuple):
        left, right = "[]" if isinstance(value, list) else "()"
        many = f"{type(value).__name__} of {len(value)}"
        return many if len(value) > FEW else _cut(left + ", ".join(map(short, value)) + right, many)
    if isinstance(value, Record) and type(value).__repr__ is _repr:
        told = [f"{one.name}={short(getattr(value, one.name))}" for one in fields(value) if one.repr]  # type: ignore[arg-type]
        return _cut(f"{type(value).__name__}({', '.join(told)})", f"{type(value).__name__}(...)")
    if isinstance(value, float) and len(repr(value)) > LONG_NUMBER:
        return f"{value:.6g}"
    text = repr(value)
    if is_dataclass(value) and ("\n" in text or len(text) > LONG):
        return f"{type(value).__name__}(...)"
    text = " ".join(text.split())
    return _cut(text, f"{text[:LONG]}...")


def _cut(text: str, otherwise: str) -> str:
    return text if len(text) <= LONG else otherwise


def _of_array(array: np.ndarray) -> str:
    """Its numbers where they are few, else its type, shape and range."""
    if array.ndim == 1 and array.size <= FEW:
        return _cut(str(array.tolist()), f"{array.dtype} {array.shape}")
    told = f"{array.dtype} {array.shape}".replace(",)", ")")
    if array.dtype == bool:
        return f"<{told}, {int(array.sum())} true>"
    if array.size == 0 or array.dtype.kind not in "iuf" or not (known := array[np.isfinite(array)]).size:
        return f"<{told}>"
    return f"<{told}, {known.min():.4g} to {known.max():.4g}{'' if known.size == array.size else ', some not finite'}>"
