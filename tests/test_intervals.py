import numpy as np
import pytest

from irl_gym.errors import InvalidParameter
from irl_gym.intervals import as_interval, interquartile_mean, iqm_interval, mean_interval

TRIALS = 1500
SLACK = 3 * np.sqrt(0.93 * 0.07 / TRIALS)
"""Three standard errors of a share of 93 % of the trials."""


def covered(interval, draw, truth, seed):
    """The share of intervals that hold the truth; one that is unknown does not."""
    rng = np.random.default_rng(seed)
    found = [interval(draw(rng)) for _ in range(TRIALS)]
    return np.mean([one.low <= truth <= one.high for one in found])


@pytest.mark.parametrize("n", [20, 200])
def test_mean_interval_covers_when_two_returns_are_given(n):
    def interval(values):
        return mean_interval(values, possible=(0.0, 1.0))

    assert covered(interval, lambda rng: (rng.random(n) < 0.02).astype(float), 0.02, n) >= 0.93 - SLACK


@pytest.mark.parametrize("n", [3, 5, 60])
def test_mean_interval_covers_normal_values(n):
    assert 0.93 - SLACK <= covered(mean_interval, lambda rng: rng.normal(3, 1, size=n), 3, n) <= 0.98


def test_mean_interval_covers_skewed_values():
    share = covered(mean_interval, lambda rng: rng.lognormal(0, 0.5, size=200), np.exp(0.125), 2)
    assert 0.93 - SLACK <= share <= 0.98


@pytest.mark.parametrize("n", [3, 4, 5, 10])
def test_iqm_interval_covers_normal_scores(n):
    assert 0.93 - SLACK <= covered(iqm_interval, lambda rng: rng.normal(size=n), 0, n) <= 0.98


@pytest.mark.parametrize(("tasks", "n"), [(2, 3), (2, 5), (5, 3), (5, 10)])
def test_iqm_interval_covers_the_scores_of_several_tasks(tasks, n):
    middle, apart = (tasks - 1) / 2, np.arange(tasks)[:, None]
    assert covered(iqm_interval, lambda rng: rng.normal(size=(tasks, n)) + apart, middle, 10 * tasks + n) >= 0.93 - SLACK


def test_mean_interval_of_two_observed_values_holds_what_they_say_of_a_share():
    values = np.r_[1.0, np.zeros(199)]
    assert mean_interval(values).high >= mean_interval(values, possible=(0, 1)).high > 0.02


def test_mean_interval_of_no_success_ends_where_none_in_twenty_is_as_likely_as_one_in_forty():
    found = mean_interval(np.zeros(200), possible=(5.0, 0.0))
    assert found.estimate == found.low == 0 and found.high == pytest.approx(5 * (1 - 0.025 ** (1 / 200)))


def test_mean_interval_of_successes_alone_ends_at_what_is_possible():
    found = mean_interval(np.ones(20), possible=(0.0, 1.0))
    assert found.high == found.estimate == 1 and found.low == pytest.approx(0.025 ** (1 / 20))


@pytest.mark.parametrize("interval", [mean_interval, iqm_interval])
@pytest.mark.parametrize("values", [np.full(10, 2.5), [0.1 + 0.2, 0.3], np.zeros(200), [4.0]])
def test_an_interval_is_unknown_when_all_values_are_equal(interval, values):
    found = interval(np.array(values))
    assert not found.known and found.ends == (None, None) and np.isnan([found.low, found.high]).all()


def test_an_interval_of_the_largest_values_is_finite():
    assert mean_interval(np.array([-1e300, 1e300, 5e299])).known and iqm_interval(np.array([-1e300, 1e300, 5e299])).known


def test_an_interval_survives_json():
    found = mean_interval(np.zeros(3))
    assert not as_interval(found.estimate, *found.ends).known and as_interval(1.0, 0.5, 1.5) == (1.0, 0.5, 1.5)


def test_interquartile_mean_leaves_a_quarter_out_at_each_end():
    assert interquartile_mean(np.array([-1000.0, 1, 2, 3, 4, 5, 6, 1000])) == 3.5


def test_interquartile_mean_of_two_values_is_their_mean():
    assert interquartile_mean(np.array([1.0, 4.0])) == 2.5


def test_iqm_interval_of_several_tasks_pools_their_scores():
    scores = np.random.default_rng(0).normal(size=(3, 8))
    found = iqm_interval(scores)
    assert found.estimate == interquartile_mean(scores) and found.low < found.estimate < found.high


def test_iqm_interval_is_of_what_varies_within_each_task():
    """How far apart the tasks are is not left to chance."""
    scores = np.random.default_rng(0).normal(size=(2, 8))
    near, far = iqm_interval(scores), iqm_interval(np.add(scores, [[0.0], [1000.0]]))
    assert far.high - far.low < 3 * (near.high - near.low)


def test_iqm_interval_is_unknown_when_the_seeds_of_a_task_agree():
    assert not iqm_interval(np.array([[0.0, 0.0, 0.0], [1.0, 2.0, 3.0]])).known


def test_iqm_interval_of_several_tasks_is_unknown_with_two_seeds():
    assert not iqm_interval(np.array([[0.0, 1.0], [1.0, 2.0]])).known


def test_iqm_interval_is_unknown_when_the_middle_half_agrees():
    assert not iqm_interval(np.array([0.0, 1.0, 1.0, 1.0, 2.0])).known


def test_iqm_interval_is_narrower_than_the_mean_s_when_there_are_outliers():
    values = np.r_[np.random.default_rng(0).normal(size=38), 60.0, -70.0]
    middle, mean = iqm_interval(values), mean_interval(values)
    assert middle.high - middle.low < (mean.high - mean.low) / 4


def test_an_interval_reads_as_text():
    assert str(mean_interval(np.array([0.0, 1.0, 2.0]))) == "1.000 (-1.484 to 3.484)"
    assert str(mean_interval(np.zeros(200))) == "0.000 (too few to say)"


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize(
    ("values", "message"),
    [
        ([], "empty"),
        ([1.0, np.nan], "holds nan"),
        (np.ones((2, 2, 2)), r"shape \(2, 2, 2\)"),
        (["a"], "list"),
        ([1e308, 1.0], "holds 1e.308"),
    ],
)
def test_an_interval_refuses_values_that_are_no_numbers(values, message):
    with pytest.raises(InvalidParameter, match=message):
        iqm_interval(values)


@pytest.mark.parametrize(("possible", "message"), [((0.0, 1.0), "values holds 0.5"), ((0.5, 0.5), "two different returns")])
def test_mean_interval_refuses_returns_that_are_not_possible(possible, message):
    with pytest.raises(InvalidParameter, match=message):
        mean_interval(np.full(3, 0.5), possible=possible)
