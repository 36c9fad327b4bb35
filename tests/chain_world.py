"""A world that can be run and solved, on a random MDP with two ends."""

import models
import numpy as np
from gymnasium import spaces

from irl_gym.features.feature_sums import discounted_sums
from irl_gym.mdp.episodes import Episode
from irl_gym.mdp.planning.dynamic_programming import occupancy, value_iteration
from irl_gym.mdp.policies import TabularPolicy, as_distribution
from irl_gym.mdp.rewards import TabularReward
from irl_gym.mdp.sampling import Successors
from irl_gym.spaces.states import StateIndex

GAMMA = 0.9


class Chain:
    """A world on a random MDP with two ends, that keeps what it was asked."""

    gamma = GAMMA

    def __init__(self, seed=0, S=8):
        self.model = models.episodic_model(seed, S, 3, GAMMA)
        self.states = StateIndex(spaces.Discrete(S))
        self.asked, self.seen = [], []

    def policy(self, R):
        mdp = self.model.mdp
        actions = value_iteration(mdp, TabularReward(R)).policy
        return TabularPolicy(as_distribution(actions, mdp.n_states, mdp.n_actions), self.states)

    def plan(self, reward, *, seed=0):
        self.asked.append(reward.alpha)
        return self.policy(reward.tabular(self.states).values)

    def episodes(self, policy, n, *, horizon=400, seed=0):
        """n episodes, cut after `horizon` steps; all are stepped together."""
        mdp, rng = self.model.mdp, np.random.default_rng(seed)
        successors, best = Successors(mdp), None if policy is None else policy.probabilities.argmax(axis=1)
        rows, taken = [successors.start(n, rng)], []
        while len(taken) < horizon and not mdp.terminal[rows[-1]].all():
            going = ~mdp.terminal[rows[-1]]
            taken.append(rng.integers(3, size=n) if best is None else best[rows[-1]])
            rows.append(rows[-1].copy())
            rows[-1][going] = successors.draw(rows[-2][going], taken[-1][going], rng)
        visited, actions = np.array(rows).T, np.array(taken).T
        ended = mdp.terminal[visited]
        steps = np.where(ended.any(axis=1), ended.argmax(axis=1), len(taken))
        parts = zip(visited, actions, steps, ended, strict=True)
        return [Episode(v[: t + 1], a[:t], np.zeros(t), bool(e.any()), not e.any()) for v, a, t, e in parts]

    def sums(self, policy, features, n, *, horizon, seed):
        self.seen.append(discounted_sums(self.episodes(policy, n, horizon=horizon, seed=seed), features, GAMMA))
        return self.seen[-1]

    def expert(self, n=100, seed=1000, **kwargs):
        return self.episodes(self.policy(self.model.R), n, seed=seed, **kwargs)

    def exact(self, policy, phi):
        """(K,) the value of a policy in the features."""
        mdp = self.model.mdp
        taken = occupancy(mdp, np.full((mdp.n_states, 3), 1 / 3) if policy is None else policy.probabilities)
        return (taken.sum(axis=1) + np.where(mdp.terminal, mdp.gamma * (mdp.P.T @ taken.ravel()), 0)) @ phi
