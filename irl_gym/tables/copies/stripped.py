"""An environment stripped of what is no part of the MDP: a copy of its own, without watchers, with driven generators.

Enumeration moves an environment about at will. It needs a copy that nobody else steps, without the wrappers that only
watch or limit (a TimeLimit counts steps, and would make a state of every count), and with each random generator
replaced by a stand-in that the caller drives. A chain of wrappers is copied layer by layer and attribute by attribute,
so that an attribute that cannot be copied is named.
"""

import copy
import weakref
from typing import Any

import gymnasium as gym
from gymnasium.wrappers import TimeLimit

from irl_gym.environments.learned_reward import LearnedReward
from irl_gym.environments.watching_wrappers import only_watches
from irl_gym.errors import NotCopied, a_type
from irl_gym.tables.copies.apart import check_apart, held_outside, inside, joined
from irl_gym.tables.copies.object_graphs import SHARED, attributes, children
from irl_gym.tables.copies.own_dictionaries import rejoin
from irl_gym.tables.copies.replacing import renew_functions
from irl_gym.tables.copies.shared_memory import copied


def layers(env: gym.Env) -> list[gym.Env]:
    """The chain of an environment, from the outermost wrapper to the unwrapped environment."""
    chain = [env]
    while isinstance(env, gym.Wrapper):
        env = env.env
        chain.append(env)
    return chain


def without_watchers(env: gym.Env, *, limits: bool = False) -> gym.Env:
    """A deep copy of a chain of wrappers without those that only watch or limit it; a LearnedReward is left out too.

    Wrappers that change observations, actions or rewards stay. The copy renders nothing: its `render_mode` is None and
    windows are not copied. An unwrapped environment that cannot be copied but has `get_state` and `set_state` is used as
    it is, under copied wrappers.

    Args:
        env: the chain.
        limits: keep each TimeLimit.

    Raises:
        NotCopied: an attribute cannot be copied; it is named.
    """
    kept = [layer for layer in layers(env) if not looked_through(layer) or (limits and isinstance(layer, TimeLimit))]
    return _copied(kept, layers(env))


def duplicate(env: gym.Env) -> gym.Env | None:
    """A deep copy of the whole chain, or None where the unwrapped environment cannot be copied."""
    made = _copied(layers(env), layers(env))
    return None if made.unwrapped is env.unwrapped else made


def settable(env: gym.Env) -> bool:
    """Does the unwrapped environment offer `get_state()` and `set_state(state)`?"""
    return all(callable(getattr(env.unwrapped, name, None)) for name in ("get_state", "set_state"))


def looked_through(layer: gym.Env) -> bool:
    """Is it a wrapper that only watches, limits or pays a learned reward?"""
    return isinstance(layer, LearnedReward) or (isinstance(layer, gym.Wrapper) and only_watches(layer))


def _copied(kept: list[gym.Env], chain: list[gym.Env]) -> gym.Env:
    """Copies of the kept layers, with arrays that share memory where the originals do."""
    try:
        return _apart(kept, chain, {})
    except NotCopied:
        if not settable(chain[-1]):
            raise
        return _apart(kept, chain, {id(chain[-1]): chain[-1]})


def _apart(kept: list[gym.Env], chain: list[gym.Env], memo: dict[int, Any]) -> gym.Env:
    known = memo | {id(one): one for _, value in held_outside(kept) for one in inside(value)}
    made, _, memo = copied(lambda told: _layers_copied(kept, chain, told), known)
    if made.unwrapped is not chain[-1]:  # else it speaks for itself
        rejoin(joined(kept), memo)
        cells = renew_functions(made, memo)
        check_apart(layers(made), kept, memo, cells)
    return made


def _layers_copied(kept: list[gym.Env], chain: list[gym.Env], memo: dict[int, Any]) -> gym.Env:
    """The innermost first: what points to a layer left out points to the next one inside."""
    current: gym.Env = chain[-1]
    for layer in reversed(chain):
        if not any(layer is one for one in kept):
            memo |= {id(layer): current} | _weakly(layer, current)
        elif id(layer) not in memo:  # else it is used as it is
            current = _copied_layer(layer, memo)
    return current


def _copied_layer(layer: gym.Env, memo: dict[int, Any]) -> Any:
    kind = type(layer)
    if hasattr(kind, "__deepcopy__"):
        return _whole(layer, memo)
    made: Any = object.__new__(kind)
    tried = memo | {id(layer): made} | _weakly(layer, made)
    try:
        for name, value in attributes(layer).items():
            object.__setattr__(made, name, _copied_attribute(layer, name, value, tried))
    except NotCopied:
        own = ("__getstate__", "__setstate__", "__reduce__", "__reduce_ex__")
        # EzPickle builds a fresh environment from its arguments: no copy. A class with a way of its own knows better.
        if isinstance(layer, gym.utils.EzPickle) or all(
            getattr(kind, name, None) is getattr(object, name, None) for name in own
        ):
            raise
        return _whole(layer, memo)
    memo.update(tried)
    memo.setdefault(id(memo), []).append(tried)  # deepcopy knows `tried` by its address, which may not be given to another dict
    return made


def _weakly(layer: gym.Env, made: gym.Env) -> dict[int, Any]:
    """For `copy.deepcopy`: weak references to a layer, as a renderer holds one, lead to its copy."""
    plain = (one for one in weakref.getweakrefs(layer) if type(one) is weakref.ref and one.__callback__ is None)
    return {id(one): weakref.ref(made) for one in plain}


def _whole(layer: gym.Env, memo: dict[int, Any]) -> Any:
    try:
        made = copy.deepcopy(layer, memo)
    except MemoryError:
        raise
    except Exception as error:
        raise NotCopied(
            f"{type(layer).__name__} cannot be copied ({type(error).__name__}: {error}): expected an environment that "
            "copy.deepcopy copies. Give it get_state() and set_state(state), or mend its __deepcopy__."
        ) from error
    if "render_mode" in vars(made):
        made.render_mode = None
    return made


def _copied_attribute(layer: gym.Env, name: str, value: Any, memo: dict[int, Any]) -> Any:
    if name == "render_mode":
        return None
    if name in SHARED:
        return None if name == "_cached_spec" else value
    try:
        return copy.deepcopy(value, memo)
    except MemoryError:
        raise
    except Exception as error:
        if _draws(value):
            return None
        where, culprit = _culprit(value, f"{type(layer).__name__}.{name}", layers(layer))
        raise NotCopied(
            f"{where} is {a_type(culprit)}, which cannot be copied ({type(error).__name__}: {error}): expected an "
            f"environment that copy.deepcopy copies. Give {type(layer.unwrapped).__name__} get_state() and set_state(state), "
            "or a __deepcopy__ that leaves this attribute out."
        ) from error


def _draws(value: Any) -> bool:
    """Is it a window, a clock or a font (or made of them)? Nothing is rendered, so nothing needs it."""
    held = value.values() if isinstance(value, dict) else value if isinstance(value, list | tuple) else [value]
    return all(type(one).__module__.partition(".")[0] in ("pygame", "pyglet") for one in held)


def _culprit(value: Any, where: str, known: list[Any]) -> tuple[str, Any]:
    """The innermost object that cannot be copied, and its dotted name. Each part is tried with a memo of its own."""
    named = (
        list(value.items()) if isinstance(value, dict) else list(enumerate(value)) if isinstance(value, list | tuple) else []
    )
    parts = [(f"{where}[{key!r}]", part) for key, part in named]
    parts += [(f"{where}.{name}", part) for name, part in attributes(value).items()]
    for name, part in parts:
        try:
            copy.deepcopy(part, {id(one): one for one in known})
        except MemoryError:
            raise
        except Exception:  # whatever it was that the whole raised
            return _culprit(part, name, [*known, value])
    return where, value


def awaken_generators(env: gym.Env) -> None:
    """Have the generators made that Gymnasium makes at the first draw: those of the environment and of its spaces."""
    _ = env.unwrapped.np_random
    waiting = [space for layer in layers(env) for space in attributes(layer).values() if isinstance(space, gym.Space)]
    while waiting:
        space = waiting.pop()
        _ = space.np_random
        for part in children(space):
            inner = part.values() if isinstance(part, dict) else part if isinstance(part, list | tuple) else [part]
            waiting += [one for one in inner if isinstance(one, gym.Space)]
