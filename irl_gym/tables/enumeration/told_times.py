"""Where a time limit is part of what an environment does, the time has to be part of what it shows."""

import numpy as np
from gymnasium import spaces

from irl_gym.errors import NotTabular
from irl_gym.tables.copies.time_limits import Reader
from irl_gym.tables.enumeration.explored import Explored
from irl_gym.tables.enumeration.hidden_state import shown


def check_times_told(explored: Explored, space: spaces.Space, reader: Reader) -> None:
    """Check that each observation is seen after one number of steps only.

    A walk to a state is as long as the way on which it was found if and only if each line leads from a time to the next. An
    observation that comes at two times would be the end of two walks, whatever it hides besides: the first line on the longer
    one that the search did not find would begin in such an observation, too.

    Args:
        explored: all that was found.
        space: of the observations.
        reader: who reads the limit.

    Raises:
        NotTabular: one is seen at two times.
    """
    time = np.zeros(len(explored.keys), dtype=np.int64)
    for number, parent in enumerate(explored.parents):
        time[number] = 0 if parent < 0 else time[parent] + 1
    rows, successors = np.array(explored.rows, dtype=np.int64), np.array(explored.successors, dtype=np.int64)
    goes_on = successors >= 0
    arrives, states = time[rows[goes_on] // explored.n_actions] + 1, successors[goes_on]
    wrong = np.flatnonzero(arrives != time[states])
    if wrong.size:
        first, other = int(time[states[wrong[0]]]), int(arrives[wrong[0]])
        seen = shown(space, explored.keys[int(states[wrong[0]])])
        raise NotTabular(
            f"the wrapper {reader.wrapper} {reader.what}, and observation {seen} is seen after {first} of them and after "
            f"{other}: expected the time to be shown, since what comes then depends on it. Show it, with "
            "`gymnasium.wrappers.TimeAwareObservation(env, flatten=False)`; or leave the wrapper out."
        )
