"""Which rows of (4) a reward can make strict (Ng & Russell 2000, section 3.1), row by row.

Rewards that satisfy (4) form a convex cone, and margins of two of them add up: so one reward makes strict, at once, every row
that any reward can. A program that pays for the margins of some rows and keeps the others at 0 or above finds out which.
A row that none makes strict is *unbreakable*: it is left out alone, and the other rows of its state keep their margins.
Axes: n rows of (4).
"""

from collections.abc import Callable

import numpy as np

from irl_gym.errors import DegenerateExpert
from irl_gym.mdp.optimality_rows import Comparisons
from irl_gym.mdp.tabular_mdp import TabularMDP

SERVED = 0.5
"""A row whose margin comes to this, where 1 is asked for, is strict."""


def strict_rows(states: np.ndarray, wanted: np.ndarray, serve: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """(n,) the wanted rows that can be strict: first whole states, then in what is left one row a state at a time.

    Args:
        states: (n,) state of each row, increasing.
        wanted: (n,) rows in question.
        serve: given (n,) rows, maximise for each state the least margin of those, up to 1; returns the margins of all (n,).
    """
    found = wanted & (serve(wanted) > SERVED)
    left = wanted & ~found
    while left.any():
        rows = np.flatnonzero(left)
        first = rows[np.unique(states[rows], return_index=True)[1]]
        asked = np.zeros_like(wanted)
        asked[first] = True
        found |= wanted & (serve(asked) > SERVED)
        left &= ~(found | asked)
    return found


def nothing_to_compare(c: Comparisons, part: TabularMDP) -> DegenerateExpert:
    """Why no row of (4) among the reachable states can have a margin, as an error."""
    where = f"the {part.n_states} reachable states"
    if part.terminal.all():
        return DegenerateExpert("every start is terminal, so no action is ever taken: expected an episode of a step at least.")
    if c.equal.all():
        return DegenerateExpert(f"the expert takes every action in each of {where}: expected one that it leaves out.")
    if (c.equal | c.trivial).all():
        return DegenerateExpert(
            f"none of {where} compares the expert with an action of other successors: every reward on states makes it "
            f'optimal. Use reward_on="state-action".{c.caveat}'
        )
    return DegenerateExpert(
        f"each of {where} has an action with the expert's own successors, which takes its margin in the paper's LP. Use "
        'margin_cap="auto", which leaves such rows out.'
    )
