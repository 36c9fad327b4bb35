"""The inner states that an enumeration once met, by playing its paths again: no copy of an environment is ever in a file."""

from collections.abc import Callable
from typing import Any

from gymnasium import spaces

from irl_gym.errors import NotEnumerable, RunConflict
from irl_gym.tables.enumeration.explored import Explored
from irl_gym.tables.enumeration.hidden_state import shown
from irl_gym.tables.enumeration.trials import Trials


class Replays:
    """The paths of one search.

    Args:
        explored: states, and how each was reached.
        trials: calls of the environment.
        space: of observations.
        key: observation -> its key.
    """

    def __init__(self, explored: Explored, trials: Trials, space: spaces.Space, key: Callable[[Any], Any]):
        self.explored, self.trials, self.space, self.key = explored, trials, space, key

    def state(self, number: int) -> Any:
        """The inner state in which a state was found first."""
        state = None
        for one in self.explored.path(number):
            state = self._again(one, state)
        return state

    def waiting(self) -> dict[int, Any]:
        """The inner states of all states that have not been expanded, and of those on the ways to them."""
        explored = self.explored
        wanted = [False] * len(explored.keys)
        for waiting in range(explored.n_expanded, len(explored.keys)):
            number = waiting
            while number >= 0 and not wanted[number]:
                wanted[number] = True
                number = explored.parents[number]
        states: dict[int, Any] = {}
        for number, one in enumerate(wanted):  # parents before children
            if one:
                states[number] = self._again(number, states.get(explored.parents[number]))
        return states

    def _again(self, number: int, before: Any) -> Any:
        """The inner state of a state, from its parent's."""
        explored, trials = self.explored, self.trials
        parent, action, script = explored.parents[number], explored.actions[number], explored.scripts[number]
        call = trials.reset() if parent < 0 else trials.step(before, action)
        row = -1 if parent < 0 else parent * explored.n_actions + action
        try:
            observation, _, _ = trials.again(call, row, script)
        except NotEnumerable as error:
            raise another(f"has draws that the environment does not make now ({error})") from error
        if self.key(observation) != explored.keys[number]:
            now = shown(self.space, self.key(observation))
            raise another(f"led to {shown(self.space, explored.keys[number])} where the environment now leads to {now}")
        return trials.snapshots.take()


def another(how: str) -> RunConflict:
    """The error for an enumeration of something else."""
    return RunConflict(
        f"the enumeration that was kept {how}: expected the same environment. Name another file, or remove it to begin anew."
    )
