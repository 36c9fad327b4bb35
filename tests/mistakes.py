"""Worlds in which undiscounted rewards of T steps are added up, so that what mistakes cost is known in closed form."""

import numpy as np

from irl_gym.mdp.tabular_mdp import TransitionTable


def world(right, after_mistake, n_actions):
    """A table, and what is earned (S, A): 1 for the right action in the good states, which are drawn uniformly.

    A wrong action leads to a place that is never left (stay), that is left at once (back), or by action 1 only (by the way).
    """
    good = len(right)
    S = good + 1
    uniform, last = np.append(np.full(good, 1 / good), 0.0), np.eye(S)[good]
    P, R = np.zeros((S, n_actions, S)), np.zeros((S, n_actions))
    P[:good] = last
    P[np.arange(good), right] = uniform
    P[good] = uniform if after_mistake == "back" else last
    R[np.arange(good), right] = 1.0
    if after_mistake == "back":
        R[good] = 1.0  # no mistake is made there
    if after_mistake == "by the way":
        P[good, 1], R[good, 1] = uniform, 1.0
    return TransitionTable.from_dense(P, uniform), R


def earned(table, R, policy, T):
    """Expected undiscounted rewards of T steps, by the law of the state at each."""
    law, total, paid, P = table.d0, 0.0, (policy * R).sum(axis=1), table.P_pi(policy)
    for _ in range(T):
        total, law = total + law @ paid, law @ P
    return total
