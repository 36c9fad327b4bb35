"""Objects whose `__dict__` is held in another way too: a dictionary with `self.__dict__ = self`, or `vars(args)` beside `args`.

A copy and a pickle write into the `__dict__` that a new object has, and so part it from the copy of what else was that
dictionary. Here the copy's `__dict__` becomes that copy.
"""

import copyreg
from collections.abc import Collection, Iterable
from typing import Any

import gymnasium as gym

from irl_gym.tables.copies.object_graphs import slots


def rejoinable(kind: type) -> bool:
    """Are objects of this type copied by their `__dict__` and items alone, so that another can be put in its place?"""
    plain = all(getattr(kind, name) is getattr(object, name) for name in ("__reduce_ex__", "__reduce__", "__getstate__"))
    own = slots(kind) or kind in copyreg.dispatch_table or hasattr(kind, "__setstate__") or hasattr(kind, "__deepcopy__")
    return plain and not own and not issubclass(kind, gym.Env)


def rejoin(copied: Iterable[Any], memo: dict[int, Any]) -> None:
    """Have the copies of objects hold the copies of their `__dict__`.

    Args:
        copied: the objects.
        memo: of `copy.deepcopy`: the id of what was copied -> the copy.
    """
    for one in copied:
        made, own = memo.get(id(one), one), memo.get(id(vars(one)))
        if made is not one and own is not None:
            _have(made, own)


def reduced(one: Any) -> tuple[Any, ...]:
    """How a pickler writes an object of such a type."""
    make, arguments, _, *items = one.__reduce_ex__(4)
    return make, arguments, vars(one), *items, _have


def own(one: Any, kinds: Collection[type]) -> tuple[Any, ...]:
    """The `__dict__` of an object of these types; nothing of another."""
    return (vars(one),) if type(one) in kinds else ()


def _have(one: Any, dictionary: dict[str, Any]) -> None:
    object.__setattr__(one, "__dict__", dictionary)
