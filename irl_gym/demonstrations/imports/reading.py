"""How a log is to be read: what its rows are checked against, and what is done where a last observation is missing.

Made once, from the arguments that every `from_*` has, and handed down. Actions have two numberings. The environment's own
starts where its action space does; an `Episode` counts from 0. An action space (given, or the environment's) means the first,
`n_actions` alone means the second.
"""

from dataclasses import dataclass
from typing import get_args

import gymnasium as gym
from gymnasium import spaces

from irl_gym.checks import checked_number, is_word
from irl_gym.demonstrations.choices import Last
from irl_gym.errors import InvalidParameter, NotDiscrete


@dataclass(frozen=True, eq=False)
class Reading:
    """Where demonstrations are meant to come from, and how their episodes end.

    Raises:
        InvalidParameter: an unknown rule for the last observation.
    """

    space: spaces.Space
    """Of the observations."""
    n_actions: int
    """A."""
    first_action: int = 0
    """What the source calls action 0."""
    last: Last = "keep"
    """What to do where an episode's last observation is missing; see `irl_gym.demonstrations.imports.rows`."""
    noun: str = "episode"
    """What the source calls an episode."""

    def __post_init__(self) -> None:
        if not is_word(self.last, *get_args(Last)):
            raise InvalidParameter(
                f"last is {self.last!r}: expected 'keep', 'drop', 'repeat' or 'row', what to do where an episode's last "
                "observation is missing."
            )


def reading(
    space: spaces.Space | None,
    n_actions: int | None,
    action_space: spaces.Space | None,
    env: gym.Env | None,
    last: Last = "keep",
    noun: str = "episode",
) -> Reading:
    """Make one of what the caller of `from_*` gave; what is named beside `env` counts before what `env` has.

    Raises:
        InvalidParameter: no space of observations, no actions, two numbers of actions, or an unknown rule.
        NotDiscrete: actions that are not Discrete.
    """
    if space is None:
        if env is None:
            raise InvalidParameter(
                "no space of observations is given: expected env=..., or space=... with n_actions=... or action_space=..., so "
                "that every row can be checked."
            )
        space = env.observation_space
    if action_space is None and env is not None:
        action_space = env.action_space
    if action_space is not None and not isinstance(action_space, spaces.Discrete):
        raise NotDiscrete(
            f"the actions are {action_space}: expected Discrete, since irl_gym learns from finitely many. Give each action the "
            "number of a bin, and n_actions with space in place of env and action_space."
        )
    if n_actions is not None:
        count = int(checked_number("n_actions", n_actions, "a whole number of at least 1", least=1, whole=True))
        if action_space is not None and count != int(action_space.n):
            raise InvalidParameter(
                f"n_actions is {count}: expected {int(action_space.n)}, as {action_space} has. Leave one out."
            )
        return Reading(space, count, 0, last, noun)
    if action_space is None:
        raise InvalidParameter("no number of actions is given: expected env=..., action_space=Discrete(...) or n_actions=...")
    return Reading(space, int(action_space.n), int(action_space.start), last, noun)
