"""Keys and the actions they stand for.

A key is one character, or the name of one: up, down, left, right, space, enter, escape. Digits are actions by number in every
environment, counted from 0; where an environment is known, its actions have names, and letters and arrows that fit them. Three
keys are never actions: q ends, r begins the episode again, ? shows the keys.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import gymnasium as gym
import numpy as np

from irl_gym.checks import discrete_actions
from irl_gym.errors import InvalidParameter
from irl_gym.spaces.names import ACTIONS, of_class

QUIT, RESTART, HELP = "q", "r", "?"
NAMED = ("up", "down", "left", "right", "space", "enter", "escape")
"""Keys that are more than a character."""
_SIGNS = {"up": "↑", "down": "↓", "left": "←", "right": "→"}

KEYS: dict[str, tuple[str, ...]] = {
    "up": ("w", "up"), "left": ("a", "left"), "down": ("s", "down"), "right": ("d", "right"),
    "pick up": ("p",), "drop off": ("o",), "drop": ("o",), "toggle": ("t", "space"),
    "stick": ("s",), "hit": ("h",),
    "push left": ("a", "left"), "coast": ("s", "down"), "push right": ("d", "right"),
    "torque -1": ("a", "left"), "no torque": ("s", "down"), "torque +1": ("d", "right"),
    "left engine": ("a", "left"), "no engine": ("s", "down"), "right engine": ("d", "right"), "main engine": ("w", "up"),
    "turn left": ("a", "left"), "turn right": ("d", "right"), "forward": ("w", "up"),
}  # fmt: skip
"""Keys of the actions with these names; an action that is not here has its digit."""

PARTS: dict[str, tuple[str, ...]] = {
    "BlackjackEnv": ("your sum", "dealer shows", "usable ace"),
    "CartPoleEnv": ("position", "velocity", "angle", "angular velocity"),
    "MountainCarEnv": ("position", "velocity"),
}
"""Names of the numbers that an observation is made of."""
MOST_SHOWN = 8
"""Numbers of an observation that are shown; one of more is left to the picture."""

_SENT = {"\x1b[A": "up", "\x1b[B": "down", "\x1b[C": "right", "\x1b[D": "left", " ": "space", "\r": "enter", "\n": "enter"}
_SENT |= {"\x04": QUIT, "\x1b": "escape"} | {f"\x1bO{code[2]}": name for code, name in _SENT.items() if code[:2] == "\x1b["}


@dataclass(frozen=True)
class Controls:
    """Which key is which action."""

    actions: Mapping[str, int]
    """Key -> action, counted from 0."""
    names: tuple[str, ...]
    """Of the actions."""

    def action(self, key: str) -> int | None:
        """The action of a key, None where it has none; a capital is its small letter unless it has an action of its own."""
        return self.actions.get(key, self.actions.get(key.lower()))

    def __str__(self) -> str:
        said, by_number = [], []
        for action, name in enumerate(self.names):
            keys = [_SIGNS.get(key, key) for key, its in self.actions.items() if its == action]
            if keys == [name]:  # a digit that is its own action
                by_number.append(name)
            elif keys:
                said.append(f"{f'action {name}' if name.isdigit() else name} ({' '.join(keys)})")
        if by_number:
            said.append(f"actions by number ({' '.join(by_number)})")
        out_of_reach = len(self.names) - len(set(self.actions.values()))
        missing = f" {out_of_reach} of {len(self.names)} actions have no key." if out_of_reach else ""
        return f"Keys: {', '.join(said)}; again ({RESTART}), end ({QUIT}), keys ({HELP}).{missing}"


def controls_of(env: gym.Env, overrides: str = "") -> Controls:
    """The keys of an environment.

    Args:
        env: with Discrete actions.
        overrides: keys of the player's own, such as "w=3,a=0,space=2": key=action, counted from 0. They come first.

    Raises:
        NotDiscrete: actions that are not Discrete.
        InvalidParameter: overrides with a key or an action that does not exist, or with one of the three that never are.
    """
    n = int(discrete_actions(env.action_space).n)
    known = of_class(env, ACTIONS, n)
    actions = {key: action for action, name in enumerate(known) for key in KEYS.get(name, ())}
    actions |= {str(action): action for action in range(min(n, 10))}
    return Controls(actions | _parsed(overrides, n), known or tuple(map(str, range(n))))


def _parsed(overrides: str, n: int) -> dict[str, int]:
    asked: dict[str, int] = {}
    for part in filter(None, (piece.strip() for piece in overrides.split(","))):
        key, equals, text = part.rpartition("=")
        fine = key in NAMED or (len(key) == 1 and key.isprintable() and key != " ")
        if not equals or not fine:
            raise InvalidParameter(
                f"keys has {part!r}: expected key=action, where a key is one character or one of {', '.join(NAMED)}. For "
                'example "w=3,a=0,space=2".'
            )
        if key.lower() in (QUIT, RESTART, HELP):
            raise InvalidParameter(
                f"keys has {part!r}: {QUIT}, {RESTART} and {HELP} end, begin again and help. Use another key."
            )
        if not (text.isascii() and text.isdigit() and len(text) < 10 and int(text) < n):
            raise InvalidParameter(f"keys has {part!r}: expected an action from 0 to {n - 1}, counted from 0.")
        if asked.setdefault(key, int(text)) != int(text):
            raise InvalidParameter(f"keys has {key!r} twice, for {asked[key]} and {text}: expected each key once.")
    return asked


def described(env: gym.Env, observation: Any) -> str:
    """An observation in a few words; empty where it is too large for that."""
    try:
        numbers = np.asarray(observation, dtype=float).ravel()
    except (TypeError, ValueError):  # dicts, ragged tuples
        return ""
    if numbers.size > MOST_SHOWN:
        return ""
    names = of_class(env, PARTS, numbers.size)
    if names:
        return ", ".join(f"{name} {number:.4g}" for name, number in zip(names, numbers, strict=True))
    return "observation " + " ".join(f"{number:.4g}" for number in numbers)


def keys_typed(text: str) -> Iterator[str]:
    """The keys of what a terminal sends: characters, and escape sequences, of which only arrows are keys."""
    while text:
        sequence = text[:3] if text[:2] in ("\x1b[", "\x1bO") else text[:1]
        if len(sequence) == 3 and sequence not in _SENT:  # another key's, to the letter or ~ that ends it
            end = next((i for i, sign in enumerate(text[2:], 3) if sign.isalpha() or sign == "~"), len(text))
            text = text[end:]
            continue
        yield _SENT.get(sequence, sequence)
        text = text[len(sequence) :]


def keys_of_line(line: str) -> Iterator[str]:
    """The keys of a line: the one that it names, or else its characters one by one."""
    word = line.strip()
    yield from (word,) if word in NAMED else (key for key in word if not key.isspace())
