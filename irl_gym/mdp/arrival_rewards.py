"""A reward on steps, told as one on states where that is what the environment pays. Axes: S states, A actions.

A table holds what a step (s, a) pays on average. Often that is a payment on arrival: a goal pays 1, whatever led there. Many
rewards on states can have the same averages, and a least-squares solution may spread them over states that pay nothing. So a
solution is told only where it is the plain one: paid at the ends of episodes alone, or else never more or less than the steps.
"""

import numpy as np
from scipy.sparse.linalg import lsmr

from irl_gym._typing import Matrix, Vector
from irl_gym.mdp.tabular_mdp import TransitionTable

EXACT = 1e-7
"""A share of the largest payment; what is missed by less is rounding."""


def paid_on_arrival(R: Matrix, mdp: TransitionTable) -> Vector | None:
    """The reward on states that the steps of R stand for, or None where it is better told step by step.

    Args:
        R: (S, A) expected reward of steps.
        mdp: S states, A actions.

    Returns:
        (S,) a reward on states with exactly these expectations in every step that an episode can take: 0 except where episodes
        end, if there is such a one; else within the range of R.
    """
    rows = np.repeat(mdp.reachable & ~mdp.terminal, mdp.n_actions)
    wanted = R.ravel()[rows]
    largest = float(np.abs(wanted).max(initial=0.0))
    if not largest:
        return np.zeros(mdp.n_states)
    entered = mdp.P[rows]
    reached = np.asarray(entered.sum(axis=0)).ravel() > 0
    for on in (reached & mdp.terminal, reached):
        if not on.any():
            continue
        found = np.zeros(mdp.n_states)
        found[on] = lsmr(entered[:, np.flatnonzero(on)], wanted, atol=1e-13, btol=1e-13, maxiter=20_000)[0]
        found[np.abs(found) < 1e-9 * largest] = 0.0  # what the least squares leave
        if np.abs(entered @ found - wanted).max() > EXACT * largest:
            continue
        within = wanted.min() - EXACT * largest <= found[on].min() and found[on].max() <= wanted.max() + EXACT * largest
        if within or not on[~mdp.terminal].any():
            return found
    return None
