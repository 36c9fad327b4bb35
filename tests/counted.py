"""Episodes written by hand, and the tables counted in them."""

import numpy as np
from gymnasium import spaces

from irl_gym.mdp.episodes import Episode
from irl_gym.tables.counted.counting import Counting


def episode(observations, actions, rewards=None, *, terminated=True):
    paid = np.zeros(len(actions)) if rewards is None else np.array(rewards, dtype=float)
    stacked = observations if isinstance(observations, tuple | dict) else np.array(observations)
    return Episode(stacked, np.array(actions), paid, terminated, not terminated)


def counted(episodes, n=4, n_actions=2, **settings):
    return Counting(**settings).count(episodes, spaces.Discrete(n), n_actions, gamma=0.9)


def dense(found):
    mdp = found.table.mdp
    return mdp.P.toarray().reshape(mdp.n_states, mdp.n_actions, mdp.n_states)
