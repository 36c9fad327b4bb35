import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from irl_gym.demonstrations.demonstrated import (
    as_likely,
    confidence,
    intervals,
    maximum_likelihood,
    most_frequent,
    smoothed,
    supported,
    visits,
)
from irl_gym.errors import InvalidDemonstrations, InvalidParameter
from irl_gym.mdp.episodes import EmpiricalPolicy

COUNTS = np.array([[3, 1, 0], [0, 0, 0], [2, 2, 5], [0, 40, 1]])
SEEN = EmpiricalPolicy(COUNTS)
TABLES = {
    "maximum_likelihood": maximum_likelihood,
    "smoothed": smoothed,
    "most_frequent": most_frequent,
    "supported": supported,
}


def counted(seed, S=6, A=3):
    rng = np.random.default_rng(seed)
    counts = rng.poisson(rng.choice([0.0, 1.0, 20.0], size=(S, A)))
    counts[0, 0] += 1
    return EmpiricalPolicy(counts)


@pytest.mark.parametrize("table", TABLES.values(), ids=TABLES.keys())
@given(seed=st.integers(0, 999))
def test_tables_are_distributions_in_the_states_visited_and_nan_elsewhere(table, seed):
    seen = counted(seed)
    rows = table(seen)
    np.testing.assert_array_equal(np.isnan(rows), np.tile(~seen.visited[:, None], 3))
    np.testing.assert_allclose(rows[seen.visited].sum(axis=1), 1)


def test_maximum_likelihood_is_the_share_of_each_action():
    np.testing.assert_allclose(maximum_likelihood(SEEN)[[0, 2]], [[0.75, 0.25, 0], [2 / 9, 2 / 9, 5 / 9]])


def test_smoothed_adds_the_concentration_to_each_count():
    np.testing.assert_allclose(smoothed(SEEN, 0.5)[0], np.array([3.5, 1.5, 0.5]) / 5.5)


def test_most_frequent_takes_the_lowest_of_those_that_tie():
    assert most_frequent(EmpiricalPolicy(np.array([[1, 4, 4]]))).tolist() == [[0, 1, 0]]


def test_as_likely_is_the_posterior_probability_of_the_larger_share():
    rng = np.random.default_rng(0)
    drawn = rng.dirichlet(COUNTS[0] + 1, size=200_000)
    np.testing.assert_allclose(as_likely(SEEN)[0, 1:], (drawn[:, 1:] > drawn[:, :1]).mean(axis=0), atol=0.005)


def test_as_likely_is_one_half_for_actions_as_frequent():
    assert as_likely(EmpiricalPolicy(np.array([[7, 7]])))[0] == pytest.approx(0.5)


def test_supported_leaves_out_what_the_data_tell_from_the_most_frequent():
    np.testing.assert_allclose(supported(SEEN)[[2, 3]], [[1 / 3, 1 / 3, 1 / 3], [0, 1, 0]])


@pytest.mark.parametrize(("times", "kept"), [(3, 2), (4, 1)])
def test_supported_takes_four_visits_of_one_action_alone_to_leave_the_other_out(times, kept):
    assert (supported(EmpiricalPolicy(np.array([[times, 0]]))) > 0).sum() == kept


@given(seed=st.integers(0, 999))
def test_supported_always_keeps_the_most_frequent(seed):
    seen = counted(seed)
    assert (supported(seen, 0.501)[most_frequent(seen) == 1] > 0).all()


def test_confidence_is_exact_with_two_actions():
    found = confidence(EmpiricalPolicy(np.array([[5, 2]])))
    assert found[0] == pytest.approx(stats.beta(6, 3).sf(0.5))


@given(seed=st.integers(0, 999))
def test_confidence_is_at_most_the_posterior_probability(seed):
    seen = counted(seed)
    found = confidence(seen)
    rng = np.random.default_rng(seed)
    for s in np.flatnonzero(seen.visited):
        drawn = rng.dirichlet(seen.counts[s] + 1.0, size=4000)
        right = (drawn.argmax(axis=1) == seen.counts[s].argmax()).mean()
        assert found[s] <= right + 0.04


def test_confidence_in_a_noisy_expert_grows_with_the_visits():
    found = confidence(EmpiricalPolicy(np.array([[2, 0, 0, 0], [9, 1, 0, 0], [90, 4, 3, 3]])))
    assert (np.diff(found) > 0).all() and found[1] > 0.98 and found[2] > 1 - 1e-9


def test_the_most_frequent_action_of_a_noisy_expert_is_right_after_a_few_visits():
    rng = np.random.default_rng(0)
    counts = rng.multinomial(7, [0.925, 0.025, 0.025, 0.025], size=20_000)
    assert (counts.argmax(axis=1) == 0).mean() > 0.999


def test_intervals_are_those_of_the_beta_marginals():
    low, high = intervals(SEEN, 0.9, 0.5)
    np.testing.assert_allclose([low[0, 1], high[0, 1]], stats.beta(1.5, 4.0).interval(0.9))


def test_intervals_hold_the_truth_as_often_as_they_say():
    rng = np.random.default_rng(0)
    truth = rng.dirichlet(np.ones(3), size=20_000)  # the prior itself, so the share is exact
    low, high = intervals(EmpiricalPolicy(rng.multinomial(12, truth)), 0.8)
    assert ((low < truth) & (truth < high)).mean() == pytest.approx(0.8, abs=0.01)


def test_intervals_say_nothing_of_states_not_visited():
    assert all(np.isnan(end).all(axis=1).tolist() == [False, True, False, False] for end in intervals(SEEN))


def test_visits_are_the_sums_of_the_counts():
    assert visits(SEEN).tolist() == [4, 0, 9, 41]


@pytest.mark.parametrize("function", [*TABLES.values(), as_likely, confidence, intervals, visits])
@pytest.mark.parametrize(
    ("counts", "message"),
    [
        (np.zeros((2, 2), dtype=int), "no action was seen"),
        (np.array([[1, 0], [0, -2]]), r"counts\[s=1, a=1\] is -2"),
        (np.array([1, 2]), r"shape \(2,\)"),
        (np.array([[0.5, 1.0]]), "float64"),
    ],
)
def test_counts_that_no_episodes_gave_are_refused(function, counts, message):
    with pytest.raises(InvalidDemonstrations, match=message):
        function(EmpiricalPolicy(counts))


@pytest.mark.parametrize(
    ("function", "wrong", "name"),
    [
        (smoothed, 0.0, "concentration"),
        (smoothed, float("nan"), "concentration"),
        (supported, 0.5, "level"),
        (supported, 1.0, "level"),
        (intervals, 0.0, "level"),
        (intervals, 1.0, "level"),
    ],
)
def test_levels_and_concentrations_outside_their_range_are_refused(function, wrong, name):
    with pytest.raises(InvalidParameter, match=f"{name} is {wrong}"):
        function(SEEN, wrong)


def test_intervals_refuse_a_single_action():
    with pytest.raises(InvalidParameter, match="one action"):
        intervals(EmpiricalPolicy(np.array([[3]])))


@pytest.mark.parametrize("counts", [np.full((1, 3), 2**62), np.array([[2**63, 1]], dtype=np.uint64)])
def test_counts_too_large_to_add_up_are_refused(counts):
    with pytest.raises(InvalidDemonstrations, match=r"the counts of a state add up to .*: expected less than 2\^63"):
        maximum_likelihood(EmpiricalPolicy(counts))
