"""What is true of what a file holds, whatever file it was."""

import numpy as np
from gymnasium import spaces

from irl_gym.mdp.rewards import TabularReward
from irl_gym.mdp.shaping import ShapedReward
from irl_gym.spaces.states import StateIndex

SPACE = spaces.Discrete(16)


def sound_table(table):
    """P's rows sum to 1 or 0, its indices are inside, and all is finite."""
    mdp, P = table.mdp, table.mdp.P
    sums = P.sum(axis=1)
    assert ((abs(sums - 1) < 1e-6) | (sums == 0)).all() and P.shape == (mdp.n_states * mdp.n_actions, mdp.n_states)
    assert P.indices.min(initial=0) >= 0 and P.indices.max(initial=0) < mdp.n_states and P.indptr[-1] == P.nnz == P.data.size
    assert abs(mdp.d0.sum() - 1) < 1e-6 and 0 < mdp.gamma < 1 and table.states.n_states == mdp.n_states
    for array in (P.data, mdp.d0, table.reward.values, table.payments.mean, table.payments.deviation):
        assert array.dtype.kind == "f" and np.isfinite(array).all()
    assert table.reward.values.shape == table.payments.mean.shape == (mdp.n_states, mdp.n_actions)
    assert table.payments.entries is None or table.payments.entries.shape == (P.nnz,)
    assert str(table.evidence)


def sound_reward(reward):
    if isinstance(reward, ShapedReward):
        assert reward.values.shape[: reward.learned.values.ndim] == reward.learned.values.shape
        sound_reward(reward.paid)
        reward = reward.learned
    if isinstance(reward, TabularReward):
        assert np.isfinite(reward.values).all() and reward.values.ndim in (1, 2) and np.isfinite(reward.tolerance)
        return
    assert np.isfinite(reward.alpha).all() and reward.alpha.shape == (reward.features.n_features,)
    assert np.isfinite(reward.tabular(StateIndex(SPACE)).values).all() and reward.features.scaling


def sound_episode(one, n_actions=4):
    assert len(one.rewards) == len(one.observations) - 1 >= 1 and np.isfinite(one.rewards).all()
    if one.actions is not None:  # of states alone
        assert one.actions.shape == one.rewards.shape and one.actions.dtype.kind in "iu"
        assert (one.actions >= 0).all() and (one.actions < n_actions).all()
