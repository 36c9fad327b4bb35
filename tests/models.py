"""Models to test on: seeded random MDPs of several kinds, strategies that draw them, and the paper's 5x5 grid."""

from dataclasses import dataclass, replace

import numpy as np
import reference
import scipy.sparse as sp
from hypothesis import strategies as st

from irl_gym.mdp.tabular_mdp import TabularMDP

KINDS = ("dense", "sparse", "terminal", "deterministic", "walls")


@dataclass(frozen=True, eq=False)
class Model:
    """An MDP, the same table dense, a true reward on states, and a policy that is optimal for it."""

    mdp: TabularMDP
    P: np.ndarray
    """(S, A, S)."""
    R: np.ndarray
    """(S,) paid on arrival."""
    expert: np.ndarray
    """(S,) optimal actions."""

    @property
    def step_reward(self) -> np.ndarray:
        """(S, A) the expected reward of a step."""
        return self.P @ self.R


def random_table(rng: np.random.Generator, S: int, A: int, kind: str) -> np.ndarray:
    """A dense (S, A, S) table.

    dense           each state follows each with positive probability
    sparse          at most three successors a row
    terminal        sparse, and the last two states are terminal
    deterministic   one successor a row, often the same for several actions: ties everywhere
    walls           sparse; in a third of the states the last action has the successors of the first; one terminal state
    """
    P = np.zeros((S, A, S))
    for s in range(S):
        for a in range(A):
            if kind == "dense":
                P[s, a] = rng.dirichlet(np.ones(S))
            elif kind == "deterministic":
                P[s, a, rng.integers(S)] = 1
            else:
                following = rng.choice(S, size=min(3, S), replace=False)
                P[s, a, following] = rng.dirichlet(np.ones(following.size))
    if kind == "walls":
        same = rng.choice(S, size=S // 3 + 1, replace=False)
        P[same, -1] = P[same, 0]
        P[-1] = 0
    if kind == "terminal":
        P[-2:] = 0
    return P


def random_model(seed: int, S: int = 7, A: int = 3, kind: str = "dense", gamma: float = 0.9) -> Model:
    """A random MDP in which every state can be the first, and so is reachable."""
    rng = np.random.default_rng(seed)
    P = random_table(rng, S, A, kind)
    R = rng.uniform(-1, 1, S)
    mdp = TabularMDP.from_dense(P, gamma, rng.dirichlet(np.ones(S)))
    return Model(mdp, P, R, reference.optimal_actions(P, gamma, P @ R))


def episodic_model(seed: int, S: int, A: int, gamma: float = 0.9) -> Model:
    """A random MDP with two terminal states, whose episodes begin in the first state."""
    model = random_model(seed, S, A, "terminal", gamma)
    return replace(model, mdp=TabularMDP(model.mdp.P, gamma, np.eye(S)[0]))


def models(kinds: tuple[str, ...] = KINDS) -> st.SearchStrategy[Model]:
    """Random MDPs of 4 to 10 states and 2 to 4 actions, in which the expert is strictly best in some state."""
    drawn = st.builds(
        random_model,
        seed=st.integers(0, 2**32 - 1),
        S=st.integers(4, 10),
        A=st.integers(2, 4),
        kind=st.sampled_from(kinds),
        gamma=st.sampled_from([0.5, 0.9, 0.99]),
    )
    return drawn.filter(lambda m: reference.margins(m.P, m.mdp.gamma, m.expert, m.R).max() > 1e-6)


def ring(successors: list[list[int]]) -> TabularMDP:
    """A deterministic MDP from a table of successors, [state][action]."""
    P = np.eye(len(successors))[np.array(successors)]
    return TabularMDP.from_dense(P, 0.9, np.full(len(successors), 1 / len(successors)))


UP_RIGHT_DOWN_LEFT = ((-1, 0), (0, 1), (1, 0), (0, -1))


def paper_grid(gamma: float = 0.9) -> Model:
    """Experiment 1 of Ng & Russell: 5x5 cells from the top left, start lower left, goal upper right and terminal.

    With 30 % a uniform one of all four moves; moves off the grid stay; ties broken up, right, down, left.
    """
    n, goal = 5, 4
    moves = np.zeros((n * n, 4, n * n))
    for s in range(n * n):
        for a, (down, right) in enumerate(UP_RIGHT_DOWN_LEFT):
            row, column = np.clip((s // n + down, s % n + right), 0, n - 1)
            moves[s, a, row * n + column] = 1
    P = 0.7 * moves + 0.3 * moves.mean(axis=1, keepdims=True)
    P[goal] = 0
    R = np.eye(n * n)[goal]
    mdp = TabularMDP.from_dense(P, gamma, np.eye(n * n)[n * (n - 1)])
    return Model(mdp, P, R, reference.optimal_actions(P, gamma, P @ R))


def scattered(S: int, successors: int, A: int = 4, gamma: float = 0.99) -> tuple[TabularMDP, np.ndarray]:
    """A sparse table whose factors fill up, since successors are drawn anywhere, and a reward (S, A)."""
    rng = np.random.default_rng(0)
    rows, columns = np.repeat(np.arange(S * A), successors), rng.integers(S, size=S * A * successors)
    P = sp.csr_array((rng.dirichlet(np.ones(successors), size=S * A).ravel(), (rows, columns)), shape=(S * A, S))
    return TabularMDP(P, gamma, np.full(S, 1 / S)), (P @ rng.normal(size=S)).reshape(S, A)


def random_features(seed, S):
    """(S, K) features of any K from 1 to S + 2, and a sample of at least half of the states."""
    rng = np.random.default_rng([seed, 1])
    Phi = rng.normal(size=(S, rng.integers(1, S + 3)))
    return Phi, np.sort(rng.choice(S, size=rng.integers(S // 2, S + 1), replace=False))


def with_features(seed, kind):
    """A random model of 8 states, features and a sample."""
    return random_model(seed, S=8, kind=kind), *random_features(seed, 8)


featured = st.builds(with_features, seed=st.integers(0, 2**32 - 1), kind=st.sampled_from(KINDS))
