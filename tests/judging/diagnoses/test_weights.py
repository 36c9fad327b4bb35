"""Equal weights are told, only as far as they are known to say nothing, and the mend is tried."""

from dataclasses import replace

import numpy as np
import pytest
from patients import corridor, finding, names, right, sampled

from irl_gym.features.feature_maps import Table
from irl_gym.features.linear_reward import LinearReward
from irl_gym.learners.linear_programs.feature import FeatureLP
from irl_gym.mdp.tabular_mdp import TabularMDP


def balancing():
    """States 0 to 3 in a row; action 0 goes on, from 3 to 3 or 0; action 1 ends it all in 4, of which phi says nothing."""
    P = np.zeros((5, 2, 5))
    P[:3, 0] = np.eye(5)[1:4]
    P[3, 0, [3, 0]] = 0.7, 0.3
    P[:4, 1, 4] = 1
    return TabularMDP.from_dense(P, 0.9, np.eye(5)[0]), np.zeros(5, dtype=int), np.eye(5)[:, :4]


def of_weights(alpha, features):
    return replace(sampled(), reward=LinearReward(np.asarray(alpha, dtype=float), Table(np.asarray(features, dtype=float))))


def test_weights_that_are_all_at_one_bound_are_told():
    mdp, expert, phi = balancing()
    result = FeatureLP(phi).fit(mdp, expert)
    assert result.reward.alpha == pytest.approx(np.ones(4))
    said = finding("flat-weights", result, mdp, expert)
    assert "All 4 weights are 1, the same bound" in said.sentence and "every reachable state" not in said.sentence


def test_a_price_mends_flat_weights():
    mdp, expert, phi = balancing()
    priced = FeatureLP(phi, l1=7.0).fit(mdp, expert)
    assert priced.reward.alpha.any() and "flat-weights" not in names(priced, mdp, expert)


def test_weights_of_a_sampled_result_without_a_table_are_told():
    said = finding("flat-weights", of_weights([-1, -1], np.eye(2)), None, None)
    assert "All 2 weights are -1" in said.sentence and "shorter episodes" in said.sentence
    assert "every reachable state" not in said.sentence and said.flags == ("--l1",)


def test_equal_weights_below_the_bound_are_told_only_where_the_reward_is_constant():
    mdp = corridor(6, 0.9)
    assert "flat-weights" not in names(of_weights([-0.5, -0.5], np.eye(2)), None, None)
    said = finding("flat-weights", LinearReward(np.full(6, -0.5), Table(np.eye(6))), mdp, right(mdp))
    assert "-0.5 in every reachable state, so it prefers shorter episodes" in said.sentence
    assert "flat-weights" not in names(LinearReward(np.full(2, -0.5), Table(np.arange(12.0).reshape(6, 2))), mdp, right(mdp))


@pytest.mark.parametrize("alpha", [[1, -1], [1, 0.999], [0, 0]])
def test_weights_that_differ_or_are_0_are_not_flat(alpha):
    assert "flat-weights" not in names(of_weights(alpha, np.eye(2)), None, None)


def test_one_weight_is_not_flat():
    assert "flat-weights" not in names(of_weights([1], np.eye(1)), None, None)
