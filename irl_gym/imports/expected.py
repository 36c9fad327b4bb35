"""What demonstrations are checked against: a space of observations and a range of actions.

Actions have two numberings. The environment's own starts where its action space does; an `Episode` counts from 0. An action
space (given, or the environment's) means the first, `n_actions` alone means the second.
"""

from dataclasses import dataclass

import gymnasium as gym
from gymnasium import spaces

from irl_gym.checks import checked_number
from irl_gym.errors import InvalidParameter, NotDiscrete


@dataclass(frozen=True, eq=False)
class Expected:
    """Where demonstrations are meant to come from."""

    space: spaces.Space
    """Of the observations."""
    n_actions: int
    """A."""
    first_action: int = 0
    """What the source calls action 0."""

    @property
    def range(self) -> str:
        """The numbers that the source may use, in words."""
        return f"a whole number from {self.first_action} to {self.first_action + self.n_actions - 1}"


def expect(
    space: spaces.Space | None, n_actions: int | None, action_space: spaces.Space | None, env: gym.Env | None
) -> Expected:
    """Make one of what the caller of `from_*` gave; what is named beside `env` counts before what `env` has.

    Raises:
        InvalidParameter: no space of observations, no actions, or two numbers of actions.
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
    if action_space is None and n_actions is None:
        raise InvalidParameter("no number of actions is given: expected env=..., action_space=Discrete(...) or n_actions=...")
    if action_space is not None and not isinstance(action_space, spaces.Discrete):
        raise NotDiscrete(f"the actions are {action_space}: expected Discrete. Irl_gym learns from finitely many actions.")
    if n_actions is None:
        assert action_space is not None  # one of the two is given
        return Expected(space, int(action_space.n), int(action_space.start))
    count = int(checked_number("n_actions", n_actions, "a whole number of at least 1", least=1, whole=True))
    if action_space is not None and count != int(action_space.n):
        raise InvalidParameter(f"n_actions is {count}: expected {int(action_space.n)}, as {action_space} has. Leave one out.")
    return Expected(space, count)
