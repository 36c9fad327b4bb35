"""What is near on a table: states that are few transitions apart, whichever way these lead.

Numbers of states say nothing of that: in FrozenLake state 8 lies below state 0, and 3 and 4 at opposite ends. Transitions into
terminal states are left out, else a goal would join all that leads to it. Axes: S states.
"""

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import breadth_first_order

from irl_gym._typing import Actions, StateMask
from irl_gym.mdp.tabular_mdp import TransitionTable


def nearest(table: TransitionTable, among: StateMask) -> tuple[Actions, Actions]:
    """The nearest of some states, for every state, and how many transitions apart they are.

    Args:
        table: P, of which only matters what is possible.
        among: (S,) the states to choose from; terminal ones are near themselves only.

    Returns:
        (S,) rows, of several as near the lowest; and (S,) numbers of transitions. Both -1 where none can be reached.
    """
    S, steps = table.n_states, table.P.tocoo()
    inside = ~table.terminal[steps.col]
    rows, columns, chosen = steps.row[inside] // table.n_actions, steps.col[inside], np.flatnonzero(among)
    ends = np.concatenate([rows, columns, np.full(chosen.size, S)]), np.concatenate([columns, rows, chosen])
    graph = sp.csr_array((np.ones(ends[0].size), ends), shape=(S + 1, S + 1))  # one more node, next to all that is chosen
    graph.sum_duplicates()
    _, before = breadth_first_order(graph, S)  # the queue begins with the lowest, so that its neighbours are its own
    found, apart = np.arange(S), np.zeros(S, dtype=np.int64)
    linked = (before[:S] >= 0) & (before[:S] < S)
    found[linked], apart[linked] = before[:S][linked], 1
    while (found[found] != found).any():  # each time twice as far
        apart, found = apart + apart[found], found[found]
    lost = ~among[found]
    found[lost], apart[lost] = -1, -1
    return found, apart
