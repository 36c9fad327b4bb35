"""Exact planning in rational arithmetic: the oracle of every bound. The numbers of a table are taken as they are stored.

Axes: S states, A actions.
"""

from fractions import Fraction

import numpy as np

from irl_gym.mdp.tabular_mdp import TabularMDP

ONE, NOTHING = Fraction(1), Fraction(0)


def rational(array):
    """Floats as they are, in nested lists."""
    return [rational(row) for row in array] if np.ndim(array) else Fraction(float(array))


def solve(matrix, right):
    """X with matrix x = right, by Gauss-Jordan elimination."""
    rows = [[*row, value] for row, value in zip(matrix, right, strict=True)]
    for i in range(len(rows)):
        pivot = next(r for r in range(i, len(rows)) if rows[r][i] != 0)
        rows[i], rows[pivot] = rows[pivot], rows[i]
        rows[i] = [x / rows[i][i] for x in rows[i]]
        for r in range(len(rows)):
            if r != i and rows[r][i] != 0:
                factor = rows[r][i]
                rows[r] = [x - factor * y for x, y in zip(rows[r], rows[i], strict=True)]
    return [row[-1] for row in rows]


class ExactMDP:
    """P (S, A, S), gamma and R (S, A) as fractions; a reward on states is paid on arrival."""

    def __init__(self, mdp: TabularMDP, values: np.ndarray):
        S, A = mdp.n_states, mdp.n_actions
        self.S, self.A, self.gamma = S, A, Fraction(mdp.gamma)
        self.P = rational(mdp.P.toarray().reshape(S, A, S))
        self.d0, self.terminal = rational(mdp.d0), mdp.terminal
        if values.ndim == 1:
            paid = rational(values)
            self.R = [[sum(p * r for p, r in zip(row, paid, strict=True)) for row in rows] for rows in self.P]
        else:
            self.R = [[NOTHING] * A if mdp.terminal[s] else rational(values[s]) for s in range(S)]

    def evaluate(self, distribution):
        """(S,) values of a policy given as probabilities (S, A), taken in proportion."""
        weights = [[Fraction(float(p)) for p in row] for row in distribution]
        weights = [[p / sum(row) for p in row] for row in weights]
        matrix = [
            [
                (ONE if s == t else NOTHING)
                - self.gamma * sum(weights[s][a] * self.P[s][a][t] for a in range(self.A) if weights[s][a])
                for t in range(self.S)
            ]
            for s in range(self.S)
        ]
        return solve(matrix, [sum(w * r for w, r in zip(weights[s], self.R[s], strict=True)) for s in range(self.S)])

    def Q(self, V):
        """(S, A) values of one step and then V."""
        return [
            [self.R[s][a] + self.gamma * sum(p * v for p, v in zip(self.P[s][a], V, strict=True) if p) for a in range(self.A)]
            for s in range(self.S)
        ]

    def optimum(self, start):
        """(S,) optimal values and (S, A) their Q, by policy iteration from a policy (S,)."""
        policy = list(start)
        while True:
            V = self.evaluate(np.eye(self.A)[policy])
            Q = self.Q(V)
            better = [
                max(range(self.A), key=lambda a, s=s: Q[s][a]) if max(Q[s]) > Q[s][policy[s]] else policy[s]
                for s in range(self.S)
            ]
            if better == policy:
                return V, Q
            policy = better
