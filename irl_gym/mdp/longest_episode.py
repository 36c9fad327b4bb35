"""How long an episode can be, whatever is done. Axes: S states, A actions."""

import numpy as np

from irl_gym._typing import Sparse


def longest_episode(P: Sparse, n_actions: int) -> int | None:
    """Steps of the longest episode from any state; None where one can go on for ever.

    Ends are taken away first, then the states of which all that follows is gone, and so on: each row is looked at once.

    Args:
        P: (S*A, S) transitions; the rows of terminal states are empty.
        n_actions: A.
    """
    into, waits_for = P.tocsc(), np.diff(P.indptr[::n_actions])
    ended, steps, left = np.flatnonzero(waits_for == 0), -1, P.shape[1]
    while ended.size:
        left, steps = left - ended.size, steps + 1
        before = into[:, ended].indices // n_actions
        np.subtract.at(waits_for, before, 1)
        before = np.unique(before)
        ended = before[waits_for[before] == 0]
    return None if left else steps
