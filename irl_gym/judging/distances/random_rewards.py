"""Random MDPs and rewards to try distances on, drawn as in the experiments of Skalse et al. (2024), and changes of a reward.

Rewards are (S, A, S). Axes: S states, A actions.
"""

import numpy as np
from scipy.special import softmax

from irl_gym.judging.metrics import policy_value
from irl_gym.mdp.planning.dynamic_programming import policy_iteration
from irl_gym.mdp.tabular_mdp import TabularMDP


def random_mdp(rng: np.random.Generator, S: int = 32, A: int = 4, gamma: float = 0.95) -> TabularMDP:
    """Successors by a softmax over those of S normal numbers that are above 1; uniform starts; nothing is terminal."""
    drawn = rng.normal(size=(S, A, S))
    return TabularMDP.from_dense(softmax(np.where(drawn > 1, drawn, -20.0), axis=2), gamma, np.full(S, 1 / S))


def random_reward(rng: np.random.Generator, mdp: TabularMDP) -> np.ndarray:
    """Normal numbers; in one draw of five only those above 3 are kept; every other draw is shaped.

    A reward that pays nothing on any possible transition is drawn again.
    """
    shape = (mdp.n_states, mdp.n_actions, mdp.n_states)
    possible = mdp.P.toarray().reshape(shape) > 1e-6
    sparse = rng.random() > 0.8
    while True:
        R = rng.normal(size=shape)
        R = np.where(R > 3, R, 0.0) if sparse else R
        if R[possible].any():
            return shaped(rng, mdp, R) if rng.random() > 0.5 else R


def shaped(rng: np.random.Generator, mdp: TabularMDP, R: np.ndarray) -> np.ndarray:
    """R + gamma Phi(s') - Phi(s) with a random potential, 0 at terminal states."""
    Phi = np.where(mdp.terminal, 0.0, 10 * rng.random() * rng.normal(size=mdp.n_states))
    return R + mdp.gamma * Phi - Phi[:, None, None]


def redistributed(rng: np.random.Generator, mdp: TabularMDP, R: np.ndarray) -> np.ndarray:
    """R with payments moved among the successors of each (s, a), their mean kept, and others on impossible transitions."""
    moved = rng.normal(size=R.shape)
    return R + moved - (mdp.P.toarray().reshape(R.shape) * moved).sum(axis=2, keepdims=True)


def relative_regret(mdp: TabularMDP, first: np.ndarray, second: np.ndarray) -> float:
    """What a policy that is best under the second reward loses under the first, over the range of values: from 0 to 1."""
    R, other = ((mdp.P.toarray().reshape(one.shape) * one).sum(axis=2) for one in (first, second))
    best, worst, got = (policy_value(mdp, R, policy_iteration(mdp, one).policy) for one in (R, -R, other))
    return (best - got) / (best - worst)
