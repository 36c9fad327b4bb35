"""Small tables on which float64 goes wrong: discounts up to 0.999999, rewards with an outlier up to 1e12, ties."""

import numpy as np
from exact import ExactMDP

from irl_gym.mdp.rewards import TabularReward
from irl_gym.mdp.tabular_mdp import TabularMDP

GAMMAS = (0.9, 0.99, 0.9999, 0.999999)


def hard_case(seed: int) -> tuple[TabularMDP, TabularReward, np.random.Generator]:
    """A random table of 3 to 6 states, all reachable, with a reward of either kind; and the generator to go on with."""
    rng = np.random.default_rng(seed)
    S, A = int(rng.integers(3, 7)), int(rng.integers(2, 4))
    P, deterministic = np.zeros((S, A, S)), rng.integers(3) == 0
    for s in range(S):
        for a in range(A):
            n = 1 if deterministic else int(rng.integers(1, min(S, 4) + 1))
            P[s, a, rng.choice(S, n, replace=False)] = rng.dirichlet(np.ones(n)) if n > 1 else 1.0
    if rng.random() < 0.4:
        P[-1] = 0
    d0 = rng.dirichlet(np.ones(S)) if rng.random() < 0.3 else np.eye(S)[rng.integers(S - 1)]
    shape = (S,) if rng.random() < 0.5 else (S, A)
    R = rng.normal(size=shape) if rng.random() < 0.5 else rng.integers(-1, 2, shape).astype(float)
    if rng.random() < 0.6:
        R[tuple(rng.integers(n) for n in shape)] = rng.choice([-1, 1]) * 10.0 ** rng.integers(0, 13)
    mdp = TabularMDP(P.reshape(S * A, S), GAMMAS[seed % 4], d0)
    rows = np.flatnonzero(mdp.reachable)
    return mdp.restrict(rows), TabularReward(R[rows]), rng


def some_expert(exact: ExactMDP, Q: list, rng: np.random.Generator) -> np.ndarray:
    """(S, A) probabilities: at random, the best, the best but for one state, or all of the best actions."""
    kind, best = rng.integers(4), np.array([max(range(exact.A), key=row.__getitem__) for row in Q])
    if kind == 0:
        best = rng.integers(exact.A, size=exact.S)
    elif kind == 1:
        best[rng.integers(exact.S)] = rng.integers(exact.A)
    elif kind == 2:
        good = np.array([[q == max(row) for q in row] for row in Q])
        return good / good.sum(axis=1, keepdims=True)
    return np.eye(exact.A)[best]
