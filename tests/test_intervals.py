import numpy as np
import pytest

from irl_gym.errors import InvalidParameter
from irl_gym.intervals import interquartile_mean, iqm_interval, mean_interval


def test_mean_interval_holds_the_true_mean_about_as_often_as_it_says():
    rng = np.random.default_rng(0)
    intervals = [mean_interval(rng.normal(3, 1, size=60), rng=rng, resamples=500) for _ in range(200)]
    covered = np.mean([one.low <= 3 <= one.high for one in intervals])
    assert 0.88 <= covered <= 0.99


@pytest.mark.parametrize(("n", "share"), [(3, 0.75), (5, 0.83), (10, 0.90), (100, 0.95)])
def test_mean_interval_of_few_values_is_too_narrow_as_its_module_says(n, share):
    rng = np.random.default_rng(n)
    intervals = [mean_interval(rng.normal(size=n), rng=rng) for _ in range(1500)]
    assert np.mean([one.low <= 0 <= one.high for one in intervals]) == pytest.approx(share, abs=0.03)


@pytest.mark.parametrize("interval", [mean_interval, iqm_interval])
def test_an_interval_ends_at_the_quantiles_of_the_resamples(interval):
    values = np.random.default_rng(0).exponential(size=12)
    drawn = values[np.random.default_rng(5).integers(12, size=(2000, 12))]
    statistic = (drawn if interval is mean_interval else np.sort(drawn, axis=1)[:, 3:9]).mean(axis=1)
    found = interval(values, rng=np.random.default_rng(5))
    assert (found.low, found.high) == pytest.approx(tuple(np.quantile(statistic, [0.025, 0.975])))


@pytest.mark.parametrize("interval", [mean_interval, iqm_interval])
def test_an_interval_is_a_point_when_all_values_are_equal(interval):
    assert interval(np.full(10, 2.5), rng=np.random.default_rng(0)) == (2.5, 2.5, 2.5)


def test_interquartile_mean_leaves_a_quarter_out_at_each_end():
    assert interquartile_mean(np.array([-1000.0, 1, 2, 3, 4, 5, 6, 1000])) == 3.5


def test_interquartile_mean_of_two_values_is_their_mean():
    assert interquartile_mean(np.array([1.0, 4.0])) == 2.5


def test_iqm_interval_of_several_tasks_pools_their_scores():
    scores = np.random.default_rng(0).normal(size=(3, 8))
    found = iqm_interval(scores, rng=np.random.default_rng(1))
    assert found.estimate == interquartile_mean(scores) and found.low < found.estimate < found.high


def test_iqm_interval_draws_seeds_within_each_task():
    """Tasks whose seeds agree leave nothing to chance, however far apart the tasks are."""
    scores = np.repeat([[0.0], [10.0]], 5, axis=1)
    found = iqm_interval(scores, rng=np.random.default_rng(0))
    assert found.low == found.high == found.estimate == 5.0


def test_iqm_interval_is_narrower_than_the_mean_s_when_there_are_outliers():
    values = np.r_[np.random.default_rng(0).normal(size=38), 60.0, -70.0]
    middle, mean = (interval(values, rng=np.random.default_rng(1)) for interval in (iqm_interval, mean_interval))
    assert middle.high - middle.low < (mean.high - mean.low) / 4


def test_an_interval_is_the_same_for_the_same_generator():
    values = np.random.default_rng(0).normal(size=9)
    assert iqm_interval(values, rng=np.random.default_rng(3)) == iqm_interval(values, rng=np.random.default_rng(3))


def test_an_interval_reads_as_text():
    assert str(mean_interval(np.array([1.0, 1.0]), rng=np.random.default_rng(0))) == "1.000 (1.000 to 1.000)"


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize(
    ("values", "told"),
    [
        ([], "empty"),
        ([1.0, np.nan], "holds nan"),
        (np.ones((2, 2, 2)), r"shape \(2, 2, 2\)"),
        (["a"], "list"),
        ([1e308, 1.0], "holds 1e.308"),
    ],
)
def test_an_interval_refuses_values_that_it_cannot_resample(values, told):
    with pytest.raises(InvalidParameter, match=told):
        iqm_interval(values, rng=np.random.default_rng(0))


def test_an_interval_refuses_no_resamples():
    with pytest.raises(InvalidParameter, match="resamples is 0"):
        mean_interval(np.ones(3), rng=np.random.default_rng(0), resamples=0)


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize("rng", [0, None, np.random.RandomState(0)])
def test_an_interval_refuses_a_seed_for_a_generator(rng):
    with pytest.raises(InvalidParameter, match=r"rng is .*: expected a generator. Make one of a seed: `np.random.default_rng"):
        mean_interval(np.ones(3), rng=rng)
