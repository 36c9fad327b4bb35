"""What a function needs is what its parameters are called, and whoever has the parts hands them over by name.

A stage of the loop and a section of the page are plain functions of what they use. A source is an object whose fields and
properties are parts; of several sources the first that has a part gives it, and nothing else is worked out. A part that is None
is not there: a function whose parameter admits None does without it, any other cannot be called.
"""

import inspect
from collections.abc import Callable, Mapping
from functools import cache, cached_property
from types import NoneType
from typing import Any, get_args, get_type_hints

from irl_gym.errors import InvalidParameter


@cache
def parts(kind: type) -> Mapping[str, Any]:
    """What objects of a class can give: the names of their public fields and properties, with the types."""
    found = get_type_hints(kind)
    for name, one in inspect.getmembers(kind):
        if isinstance(one, property | cached_property):
            found[name] = get_type_hints(one.fget if isinstance(one, property) else one.func)["return"]
    return {name: typed for name, typed in found.items() if not name.startswith("_")}


def needs(function: Callable[..., Any]) -> dict[str, Any]:
    """The parameters of a function, with their types."""
    return {name: one.annotation for name, one in inspect.signature(function, eval_str=True).parameters.items()}


def part(name: str, *sources: Any, asked_by: str) -> Any:
    """A part, by the first source that has it; None where it is not there.

    Raises:
        InvalidParameter: no source knows of it.
    """
    for source in sources:
        if name in parts(type(source)):
            return getattr(source, name)
    known = ", ".join(sorted({name for source in sources for name in parts(type(source))}))
    raise InvalidParameter(f"{asked_by} needs {name!r}: expected a part that there can be. There can be {known}.")


def missing(function: Callable[..., Any], *sources: Any, **given: Any) -> str | None:
    """The first part that a function cannot do without and that is not there; None where it can be called.

    Raises:
        InvalidParameter: it needs what no source knows of.
    """
    for name, typed in needs(function).items():
        without = name in given or typed is Any or NoneType in get_args(typed)
        if not without and part(name, *sources, asked_by=function.__name__) is None:
            return name
    return None


def supplied(function: Callable[..., Any], *sources: Any, **given: Any) -> Any:
    """Call a function with the parts that it needs, those that are given first.

    Raises:
        InvalidParameter: it needs what no source knows of.
    """
    found = {name: part(name, *sources, asked_by=function.__name__) for name in needs(function) if name not in given}
    return function(**found, **{name: one for name, one in given.items() if name in needs(function)})
