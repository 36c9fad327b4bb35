"""Show in the observation what an environment hides of its state.

A transition table takes the observation for the state. An environment that remembers more than it shows, such as a counter,
has no table: two visits to one observation may go on differently. The mend is to show what is hidden, where policies, learned
rewards and datasets see it too: `Reveal` adds integer attributes of the environment to its observation.

`KNOWN` lists what is hidden in environments of Gymnasium:

    TaxiEnv, fickle_passenger=True              fickle_step: will the passenger still change their mind?
    BlackjackEnv, natural=True or sab=True      natural: is the hand an ace and a ten, with no card drawn?
"""

import difflib
import numbers
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from gymnasium.envs.toy_text.blackjack import BlackjackEnv, is_natural
from gymnasium.envs.toy_text.taxi import TaxiEnv

from irl_gym.checks import checked_number
from irl_gym.errors import InvalidParameter, UnknownObservation

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


class Reveal(gym.ObservationWrapper, gym.utils.RecordConstructorArgs):
    """Adds integer attributes to the observation: {"observation": as it was, name: 0..n-1, ...}.

    It can be rebuilt from the spec of the environment, as `gym.make(env.spec)` and Minari do.

    Args:
        env: any environment.
        shown: name of an integer or boolean attribute -> number of its values n, which are 0 to n - 1. Attributes are those of
            `env.unwrapped`, else of a wrapper; a dot leads into an attribute's own, as in "agent.energy". The default is
            `known_hidden(env)`. Attributes that exist only after `reset` are looked for then.

    Raises:
        InvalidParameter: nothing to show, a count below 1, or a name that is taken.
    """

    def __init__(self, env: gym.Env, shown: Mapping[str, int] | None = None):
        self.shown: dict[str, int] = _checked_shown(env, known_hidden(env) if shown is None else shown)
        gym.utils.RecordConstructorArgs.__init__(self, shown=self.shown)
        gym.ObservationWrapper.__init__(self, env)
        parts = {OBSERVATION: env.observation_space} | {name: spaces.Discrete(n) for name, n in self.shown.items()}
        self.observation_space = spaces.Dict(parts)

    def observation(self, observation: Any) -> dict[str, Any]:
        """The observation with what is shown beside it.

        Raises:
            InvalidParameter: an attribute that does not exist or is not an integer.
            UnknownObservation: a value outside 0..n-1.
        """
        return {OBSERVATION: observation} | {name: self._value(name, n) for name, n in self.shown.items()}

    def _value(self, name: str, n: int) -> int:
        known = _known(self.unwrapped).get(name)
        value = _attribute(self.env, name) if known is None else known.read(self.unwrapped)
        if not isinstance(value, numbers.Integral | np.bool_):
            raise InvalidParameter(
                f"{name} is {str(value)[:90]}, a {type(value).__name__}: expected an integer or a boolean. Give the "
                "environment an integer attribute that says the same, and show that."
            )
        number = int(value)
        if not 0 <= number < n:
            mend = f"Say so with shown={{{name!r}: {number + 1}}}" if number >= 0 else "Show an attribute that counts from 0"
            raise UnknownObservation(f"{name} is {number}: expected 0 to {n - 1}, as n is {n}. {mend}.")
        return number


def _known(base: gym.Env) -> Mapping[str, Hidden]:
    return next((KNOWN[kind] for kind in type(base).__mro__ if kind in KNOWN), {})


def layers(env: gym.Env) -> Iterator[gym.Env]:
    """The environment and its wrappers, from the outermost."""
    while isinstance(env, gym.Wrapper):
        yield env
        env = env.env
    yield env


def _attribute(env: gym.Env, name: str) -> Any:
    """The attribute of a dotted name: of the environment itself, else of the innermost wrapper that has it."""
    head, *rest = name.split(".")
    inside_out = [*layers(env)][::-1]
    value: Any = next((layer for layer in inside_out if hasattr(layer, head)), None)
    if value is None:
        raise _no_attribute(type(env.unwrapped).__name__, head, inside_out)
    for part in (head, *rest):
        if not hasattr(value, part):
            raise _no_attribute(type(value).__name__, part, [value])
        value = getattr(value, part)
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


def _checked_shown(env: gym.Env, shown: Any) -> dict[str, int]:
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
        if name == OBSERVATION:
            raise InvalidParameter(
                f"shown has the name {name!r}, which is the key of the environment's own observation: expected another. Give "
                "the attribute a property of another name."
            )
        checked_number(f"shown[{name!r}]", n, "a whole number of at least 1, the number of its values", least=1, whole=True)
    return {name: int(n) for name, n in shown.items()}
