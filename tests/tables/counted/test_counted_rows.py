import gymnasium as gym
import numpy as np
import pytest
from counted import counted, dense, episode
from scipy.stats import beta, chi2

from irl_gym.errors import InvalidParameter
from irl_gym.mdp.planning.dynamic_programming import policy_iteration
from irl_gym.tables.counted.counting import Counting, interact
from irl_gym.tables.tabulate import tabulate


@pytest.fixture(scope="module")
def lake():
    """FrozenLake's exact table, and one counted in 100,000 random steps."""
    env = gym.make("FrozenLake-v1")
    exact = tabulate(env, gamma=0.99, check_steps=0)
    return exact, Counting().count(interact(env, 100_000, seed=0), env.observation_space, 4, gamma=0.99)


def truth_of(lake):
    """The true probability of each entry of the counted P."""
    exact, found = lake
    coo = found.table.mdp.P.tocoo()
    return exact.mdp.P.toarray()[coo.row, coo.col]


def test_counts_of_frozen_lake_have_the_support_of_its_table(lake):
    exact, found = lake
    assert ((exact.mdp.P != 0) != (found.table.mdp.P != 0)).nnz == 0


def test_counts_of_frozen_lake_are_as_far_from_its_table_as_chance_has_it(lake):
    _, found = lake
    expected = truth_of(lake) * np.repeat(found.counts.visits.ravel(), np.diff(found.table.mdp.P.indptr))
    statistic = ((found.counts.successors.data - expected) ** 2 / expected).sum()
    degrees = expected.size - (found.counts.visits > 0).sum()
    assert 1e-4 < chi2.sf(statistic, degrees) < 1 - 1e-4


def test_counted_rewards_of_frozen_lake_are_those_of_its_table(lake):
    exact, found = lake
    off = np.abs(found.table.reward.values - exact.reward.values)
    assert (off <= 4 * exact.payments.deviation / np.sqrt(np.maximum(found.counts.visits, 1))).all()


def test_counted_payments_of_frozen_lake_are_of_single_transitions(lake):
    coo = lake[1].table.mdp.P.tocoo()
    assert (lake[1].table.payments.entries == (coo.col == 15)).all()


def test_counted_optimum_of_frozen_lake_is_near_the_true_one(lake):
    exact, found = (policy_iteration(one.mdp, one.reward).V @ one.mdp.d0 for one in (lake[0], lake[1].table))
    assert found == pytest.approx(exact, abs=0.05)


def test_intervals_hold_the_truth_about_as_often_as_they_say(lake):
    low, high = lake[1].counts.interval(0.95)
    truth = truth_of(lake)
    uncertain = truth < 1
    inside = ((low <= truth) & (truth <= high))[uncertain].mean()
    assert 0.88 < inside < 1 and uncertain.sum() > 100


def test_interval_of_what_always_happened_reaches_one_but_is_not_sure():
    low, high = counted([episode([0, 1], [0])] * 10, n_actions=1).counts.interval(0.9)
    assert high.tolist() == [1] and low[0] == pytest.approx(beta(10.5, 0.5).ppf(0.05))


def test_row_errors_bound_what_the_rows_are_off(lake):
    exact, found = lake
    off = np.abs((exact.mdp.P - found.table.mdp.P).toarray()).sum(axis=1).reshape(16, 4)
    assert (off <= found.counts.row_error(0.95, most_successors=3)).all()


def test_row_errors_are_smaller_where_fewer_states_can_follow(lake):
    counts = lake[1].counts
    acting = counts.visits > 0
    assert (counts.row_error(most_successors=3)[acting] < counts.row_error()[acting]).all()


def test_evidence_bounds_every_entry_at_once(lake):
    exact, found = lake
    assert np.abs((exact.mdp.P - found.table.mdp.P).data).max() <= found.table.evidence.error < 0.2


def test_invented_rows_have_no_interval_and_any_error():
    counts = counted([episode([0, 1], [0])]).counts
    low, high = counts.interval()
    assert np.isnan(low).tolist() == np.isnan(high).tolist() == [False, True]
    assert counts.row_error()[0, 1] == 2 and counts.row_error()[1].tolist() == [0, 0] and counts.largest_error() == 1


def test_prior_counts_on_successors_seen_under_any_action():
    episodes = [episode([0, 1], [0]), episode([0, 1], [0]), episode([0, 2], [1])]
    found = counted(episodes, prior=0.5)
    np.testing.assert_allclose(dense(found)[0], [[0, 2.5 / 3, 0.5 / 3], [0, 0.5 / 2, 1.5 / 2]])


def test_prior_leaves_unvisited_pairs_to_their_rule():
    found = counted([episode([0, 1], [0]), episode([0, 2], [0])], prior=0.5)
    assert dense(found)[0, 1].tolist() == [1, 0, 0]


def test_step_that_only_the_prior_allows_pays_what_other_actions_were_paid():
    found = counted([episode([0, 1], [0], [4]), episode([0, 2], [1], [1])], prior=1.0)
    np.testing.assert_allclose(found.table.payments.entries[:4], [4, 1, 4, 1])
    np.testing.assert_allclose(found.table.reward.values[0], [3, 2])


def test_prior_widens_the_row_error_by_what_it_moved():
    episodes = [episode([0, 1], [0])] * 1000 + [episode([0, 2], [1])] * 1000
    plain, moved = (counted(episodes, prior=prior).counts.row_error()[0, 0] for prior in (0.0, 10.0))
    assert moved == pytest.approx(plain + 2 * 10 / 1020)


def test_interval_with_a_prior_is_the_marginal_of_its_dirichlet():
    found = counted([episode([0, 1], [0]), episode([0, 2], [0])], n_actions=1, prior=1.0)
    low, high = found.counts.interval(0.9)
    np.testing.assert_allclose([low[0], high[1]], beta(2, 2).ppf([0.05, 0.95]))


def test_interval_of_a_successor_that_only_the_prior_allows_begins_at_zero():
    low, high = counted([episode([0, 1], [0]), episode([0, 2], [1])], prior=0.5).counts.interval()
    assert low[1] == 0 and 0 < high[1] < 1


@pytest.mark.parametrize("level", [0.0, 1.0, np.nan])
def test_levels_that_are_no_probabilities_are_refused(level):
    counts = counted([episode([0, 1], [0])]).counts
    for bound in (counts.interval, counts.row_error, counts.largest_error):
        with pytest.raises(InvalidParameter, match="level is"):
            bound(level)
