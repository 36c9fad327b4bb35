"""Show in the observation what an environment hides of its state.

A transition table takes the observation for the state. An environment that remembers more than it shows, such as a counter,
has no table: two visits to one observation may go on differently. The mend is to show what is hidden, where policies, learned
rewards and datasets see it too: `Reveal` adds attributes of the environment, or parts of them, to its observation.

`KNOWN` lists what is hidden in environments of Gymnasium:

    TaxiEnv, fickle_passenger=True              fickle_step: will the passenger still change their mind?
    BlackjackEnv, natural=True or sab=True      natural: is the hand an ace and a ten, with no card drawn?
"""

import ast
import difflib
import numbers
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from gymnasium.envs.toy_text.blackjack import BlackjackEnv, is_natural
from gymnasium.envs.toy_text.taxi import TaxiEnv

from irl_gym.checks import checked_number
from irl_gym.errors import InvalidParameter, UnknownObservation, a_type

ABSENT = object()
OBSERVATION = "observation"
"""The key of the original observation."""


@dataclass(frozen=True)
class Hidden:
    """A part of the state that a known environment does not show."""

    n: int
    """Its values are 0 to n - 1."""
    read: Callable[[Any], Any]
    """Environment -> the value now."""
    when: Callable[[Any], bool]
    """Environment -> is it hidden there, with the options that it was made with?"""


KNOWN: Mapping[type[gym.Env], Mapping[str, Hidden]] = {
    TaxiEnv: {"fickle_step": Hidden(2, lambda env: env.fickle_step, lambda env: bool(env.fickle_passenger))},
    # Not BlackjackEnv.natural, which is the rule: the hand.
    BlackjackEnv: {"natural": Hidden(2, lambda env: is_natural(env.player), lambda env: bool(env.natural or env.sab))},
}
"""Class -> name -> what it hides. A name that is listed here goes before an attribute of that name."""


def known_hidden(env: gym.Env) -> Mapping[str, int]:
    """What is known to be hidden in an environment and is not shown yet: name -> number of values; empty if nothing is."""
    base = env.unwrapped
    shown = {name for layer in layers(env) if isinstance(layer, Reveal) for name in layer.shown}
    return {name: hidden.n for name, hidden in _known(base).items() if hidden.when(base) and name not in shown}


def can_be_shown(name: str) -> bool:
    """Is it a name that `Reveal` reads, such as goal[1] or agent.energy?"""
    return re.fullmatch(rf"\w+(?:{_PART.pattern})*", name) is not None


class Reveal(gym.ObservationWrapper, gym.utils.RecordConstructorArgs):
    """Adds attributes to the observation, as integers: {"observation": as it was, name: 0..n-1, ...}.

    It can be rebuilt from the spec of the environment, as `gym.make(env.spec)` and Minari do.

    Args:
        env: any environment.
        shown: name of an integer or boolean attribute -> number of its values n, which are 0 to n - 1; or a list of its
            values, such as [None, 0, 1] or ["red", "green"], of which the place in the list is shown. Attributes are those of
            `env.unwrapped`, else of a wrapper; dots and brackets lead into an attribute, as in "agent.energy", "goal[1]" and
            "bag['key']". The default is `known_hidden(env)`. Attributes that exist only after `reset` are looked for then.

    Raises:
        InvalidParameter: nothing to show, a count below 1, a list with a value twice, or a name that is taken.
    """

    def __init__(self, env: gym.Env, shown: Mapping[str, int | Sequence[Any]] | None = None):
        self.shown: dict[str, Any] = _checked_shown(env, known_hidden(env) if shown is None else shown)
        gym.utils.RecordConstructorArgs.__init__(self, shown=self.shown)
        gym.ObservationWrapper.__init__(self, env)
        parts = {OBSERVATION: env.observation_space} | {
            name: spaces.Discrete(n if isinstance(n, int) else len(n)) for name, n in self.shown.items()
        }
        self.observation_space = spaces.Dict(parts)

    def observation(self, observation: Any) -> dict[str, Any]:
        """The observation with what is shown beside it.

        Raises:
            InvalidParameter: an attribute that does not exist or is not an integer.
            UnknownObservation: a value outside 0..n-1, or that is not listed.
        """
        return {OBSERVATION: observation} | {name: self._value(name, n) for name, n in self.shown.items()}

    def _value(self, name: str, values: Any) -> int:
        known = _known(self.unwrapped).get(name)
        value = _attribute(self.env, name) if known is None else known.read(self.unwrapped)
        return _number(name, value, values) if isinstance(values, int) else _place(name, value, values)


def _number(name: str, value: Any, n: int) -> int:
    """A value as a number of 0..n-1."""
    if not isinstance(value, numbers.Integral | np.bool_):
        if value is None or isinstance(value, str | float | np.floating):
            mend = f"List its values, as in shown={{{name!r}: {sorted({None, value}, key=str)!r}}}"
        elif isinstance(value, dict | Sequence | np.ndarray) and len(value):
            parts = f"{next(iter(value))!r}" if isinstance(value, dict) else ", ".join("0" * np.ndim(value))
            mend = f"Show the parts of it, as in {f'{name}[{parts}]'!r}"
        else:
            mend = "Give the environment an integer attribute that says the same, and show that"
        raise InvalidParameter(f"{name} is {str(value)[:90]}, {a_type(value)}: expected an integer or a boolean. {mend}.")
    number = int(value)
    if not 0 <= number < n:
        listed = f"List its values, as in shown={{{name!r}: {list(range(number, n))[:99]}}}"
        mend = f"Say so with shown={{{name!r}: {number + 1}}}" if number >= 0 else listed
        raise UnknownObservation(f"{name} is {number}: expected 0 to {n - 1}, as n is {n}. {mend}.")
    return number


def _place(name: str, value: Any, values: Sequence[Any]) -> int:
    """The place of a value among those listed."""
    plain = value.item() if isinstance(value, np.generic) else value
    try:
        return values.index(plain)
    except ValueError:
        raise UnknownObservation(
            f"{name} is {repr(plain)[:90]}: expected one of {list(values)}. List it too, in `shown`."
        ) from None


def _known(base: gym.Env) -> Mapping[str, Hidden]:
    return next((KNOWN[kind] for kind in type(base).__mro__ if kind in KNOWN), {})


def layers(env: gym.Env) -> Iterator[gym.Env]:
    """The environment and its wrappers, from the outermost."""
    while isinstance(env, gym.Wrapper):
        yield env
        env = env.env
    yield env


def shown_by(env: gym.Env) -> dict[str, int]:
    """What `Reveal` shows around an environment of the state that it hides: name -> number of values."""
    shown: dict[str, int] = {}
    for layer in layers(env):
        if isinstance(layer, Reveal):
            shown |= {name: n if isinstance(n, int) else len(n) for name, n in layer.shown.items()}
    return shown


_PART = re.compile(r"\.(\w+)|\[(-?\d+(?:, ?-?\d+)*|'[^']*'|\"[^\"]*\")\]")
"""What may follow an attribute's name: `.energy`, `[1]`, `[0, 2]`, `['key']`."""


def _attribute(env: gym.Env, name: str) -> Any:
    """What a name leads to: an attribute of the environment itself, else of the innermost wrapper that has it; and on."""
    head = re.match(r"\w*", name).group()  # pyright: ignore[reportOptionalMemberAccess]
    inside_out = [*layers(env)][::-1]
    value: Any = next((layer for layer in inside_out if hasattr(layer, head)), None)
    if value is not None:
        value = getattr(value, head)
    else:
        value = next((layer for layer in inside_out[1:] if type(layer).__name__ == head), None)
    if value is None and not any(hasattr(layer, head) for layer in inside_out):
        raise _no_attribute(type(env.unwrapped).__name__, head, inside_out)
    for part in _PART.finditer(name, len(head)):
        attribute, item = part.groups()
        if attribute is not None:
            if not hasattr(value, attribute):
                raise _no_attribute(type(value).__name__, attribute, [value])
            value = getattr(value, attribute)
            continue
        holder: Any = value
        try:
            value = holder[ast.literal_eval(item)]
        except (LookupError, TypeError, ValueError, SyntaxError) as error:  # the last two of a number such as 01
            raise InvalidParameter(
                f"{name[: part.start()]} has no part [{item}] ({type(error).__name__}: {error}): expected one that it has. It "
                f"is {str(value)[:90]}."
            ) from error
    return value


def _no_attribute(owner: str, name: str, objects: list[Any]) -> InvalidParameter:
    """The error of a name that is not there, with the names that are close, or else all."""
    found = {key for each in objects for key, value in getattr(each, "__dict__", {}).items()
             if isinstance(value, numbers.Integral | np.bool_)}  # fmt: skip
    close = difflib.get_close_matches(name, sorted(found), n=3, cutoff=0.5)
    some = sorted(found, key=lambda one: (one.startswith("_"), one))[:9]
    offer = f"Its integer attributes are {', '.join(some)}." if some else "It has no integer attributes."
    offer = f"The integer attributes closest to it are {', '.join(close)}." if close else offer
    return InvalidParameter(f"{owner} has no attribute {name!r}: expected the name of an integer or boolean one. {offer}")


def _checked_shown(env: gym.Env, shown: Any) -> dict[str, Any]:
    if not isinstance(shown, Mapping):
        raise InvalidParameter(
            f"shown is {shown!r}: expected names with their numbers of values, such as {{'fickle_step': 2}}."
        )
    if not shown:
        raise InvalidParameter(
            f"nothing to show of {type(env.unwrapped).__name__}: expected names with their numbers of values, as nothing is "
            "known to be hidden in it. Give `shown`, such as {'fickle_step': 2}."
        )
    for name, n in shown.items():
        if not isinstance(name, str) or not name:
            raise InvalidParameter(f"shown has the name {name!r}: expected that of an attribute.")
        if not can_be_shown(name):
            raise InvalidParameter(f"shown has the name {name!r}: expected an attribute's, such as agent.energy or goal[1].")
        if name == OBSERVATION:
            raise InvalidParameter(
                f"shown has the name {name!r}, which is the key of the environment's own observation: expected another. Give "
                "the attribute a property of another name."
            )
        if isinstance(n, list | tuple):
            _check_listed(name, n)
        else:
            expected = "a whole number of at least 1, the number of its values, or a list of them"
            checked_number(f"shown[{name!r}]", n, expected, least=1, whole=True)
    return {name: list(n) if isinstance(n, list | tuple) else int(n) for name, n in shown.items()}


def _check_listed(name: str, values: Sequence[Any]) -> None:
    wrong = next((one for one in values if not isinstance(one, bool | int | float | str | None)), ABSENT)
    if wrong is not ABSENT or not values:
        raise InvalidParameter(
            f"shown[{name!r}] lists {'nothing' if wrong is ABSENT else repr(wrong)[:90]}: expected values that are numbers, "
            "text, true, false or None."
        )
    twice = next((one for i, one in enumerate(values) if one in values[:i]), ABSENT)
    if twice is not ABSENT:
        raise InvalidParameter(f"shown[{name!r}] lists {twice!r} twice: expected each value once. Leave one out.")
