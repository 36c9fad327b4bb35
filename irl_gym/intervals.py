"""What a few sampled returns say, and how surely: means, interquartile means and 95 % intervals.

Returns of a handful of training seeds are few and have outliers, so their mean is a poor summary. The *interquartile mean*, the
mean of the middle half, resists outliers as the median does and wastes less (Agarwal et al. 2021, "Deep Reinforcement
Learning at the Edge of the Statistical Precipice", section 4.3). Departs: their percentile bootstraps hold the true mean of
three normal values 75 times in 100; intervals here are

    mean of two possible returns    Clopper & Pearson (1934), where the two are given: no sample reveals them
    other means                     Student's t
    interquartile means             Tukey & McLaughlin (1963): t by the winsorised variance, within each task

Values that are all equal, or one value, do not say what else could have been: their interval is unknown, with ends NaN, told as
"too few to say". Of values that are two numbers only, t is widened to hold what Clopper and Pearson say. Coverage, in
`tests/test_intervals.py`: 95 in 100 of three or five normal values and of 200 lognormal ones (sigma 0.5), 99 and 96 of 20 and
200 Bernoulli(0.02) with both returns given. Strongly skewed returns need more: of 20 exponential ones it is 92.
Axes: N values, T tasks, n seeds.
"""

from typing import NamedTuple

import numpy as np
from scipy.stats import beta, t, trim_mean

from irl_gym.checks import LARGEST, float_array
from irl_gym.errors import InvalidParameter

LEVEL = 0.95
"""Confidence of an interval."""
TOO_FEW = "too few to say"
"""In place of an interval that is unknown."""
SAME = 1e-12
"""Values whose range is below this share of the largest are equal but for rounding."""
CUT = 0.25
"""Share of all values that an interquartile mean leaves out at each end."""


class Interval(NamedTuple):
    """An estimate with the ends of its interval."""

    estimate: float
    """Of all the values."""
    low: float
    """The lower end; NaN where the interval is unknown."""
    high: float
    """The upper end; NaN where the interval is unknown."""

    @property
    def known(self) -> bool:
        """Do the values say how surely?"""
        return bool(np.isfinite(self.low) and np.isfinite(self.high))

    @property
    def ends(self) -> tuple[float | None, float | None]:
        """The ends as json holds them: None where unknown."""
        return (self.low, self.high) if self.known else (None, None)

    def __str__(self) -> str:
        return f"{self.estimate:.3f} " + (f"({self.low:.3f} to {self.high:.3f})" if self.known else f"({TOO_FEW})")


def as_interval(estimate: float, low: float | None, high: float | None) -> Interval:
    """The interval of numbers read from json, in which ends that are unknown are None."""
    return Interval(estimate, float("nan"), float("nan")) if low is None or high is None else Interval(estimate, low, high)


def interquartile_mean(values: np.ndarray) -> float:
    """The mean of the middle half of all values; a quarter of them, rounded down, is left out at each end."""
    return float(trim_mean(_checked(values).ravel(), CUT))


def mean_interval(values: np.ndarray, *, possible: tuple[float, float] | None = None) -> Interval:
    """The mean of returns with its interval.

    Args:
        values: (N,) returns.
        possible: the only two returns that can be, where that is known.

    Raises:
        InvalidParameter: no values, values that are not finite, or one that is not possible.
    """
    array = _checked(values).ravel()
    estimate = float(array.mean())
    if possible is not None:
        return Interval(estimate, *_clopper_pearson(array, possible))
    if _equal(array):
        return _unknown(estimate)
    scale = float(np.abs(array).max())
    error = float((array / scale).std(ddof=1)) * scale / np.sqrt(array.size)
    half = float(t.ppf((1 + LEVEL) / 2, array.size - 1)) * error
    low, high = estimate - half, estimate + half
    few = np.unique(array)
    if few.size == 2:
        least, most = _clopper_pearson(array, (float(few[0]), float(few[1])))
        low, high = min(low, least), max(high, most)
    return Interval(estimate, low, high)


def iqm_interval(values: np.ndarray) -> Interval:
    """The interquartile mean of scores with its interval, of what varies within tasks.

    It is unknown where the seeds of a task agree, where the middle half does, and of fewer than three seeds of several tasks.

    Args:
        values: (n,) scores of seeds, or (T, n) of several tasks; `metrics.normalised_score` makes tasks comparable.

    Raises:
        InvalidParameter: no values, values that are not finite, or more than two axes.
    """
    tasks = np.atleast_2d(_checked(values))
    if tasks.ndim != 2:
        raise InvalidParameter(f"values has shape {tasks.shape}: expected (n,) scores, or (T, n) of several tasks.")
    estimate, (T, n), N = float(trim_mean(tasks.ravel(), CUT)), tasks.shape, tasks.size
    if any(_equal(task) for task in tasks) or (T > 1 and n < 3):
        return _unknown(estimate)
    cut = int(CUT * N)
    kept, ordered, scale = N - 2 * cut, np.sort(tasks.ravel()), float(np.abs(tasks).max())
    winsorised = np.clip(tasks, ordered[cut], ordered[N - cut - 1])
    if _equal(winsorised.ravel()):
        return _unknown(estimate)
    # the variance that each task adds to the mean of the middle half; of one task it is Tukey and McLaughlin's
    parts = n * (winsorised / scale).var(axis=1, ddof=1) * (N - 1) / N / (kept * (kept - 1))
    if T == 1:
        freedom = kept - 1.0
    else:  # Welch and Satterthwaite's, of the values that are kept
        freedom = max((n - 1) * float(parts.sum() ** 2 / (parts**2).sum()) * kept / N, 1.0)
    half = float(t.ppf((1 + LEVEL) / 2, freedom)) * float(np.sqrt(parts.sum())) * scale
    return Interval(estimate, estimate - half, estimate + half)


def _clopper_pearson(values: np.ndarray, possible: tuple[float, float]) -> tuple[float, float]:
    """The ends of the interval of the mean of values that are one of two numbers."""
    least, most = sorted(map(float, possible))
    near = 1e-9 * max(abs(least), abs(most))
    upper = np.abs(values - most) <= near
    wrong = values[~(upper | (np.abs(values - least) <= near))]
    if wrong.size or not most - least > near:
        raise InvalidParameter(
            f"possible is {possible}{f', and values holds {wrong[0]}' if wrong.size else ''}: expected the two different "
            "returns that can be, and no other value."
        )
    count, N, tail = int(upper.sum()), values.size, (1 - LEVEL) / 2
    low = 0.0 if count == 0 else float(beta.ppf(tail, count, N - count + 1))
    high = 1.0 if count == N else float(beta.ppf(1 - tail, count + 1, N - count))
    return least + low * (most - least), least + high * (most - least)


def _equal(values: np.ndarray) -> bool:
    """Are values the same, but for rounding?"""
    return bool(np.ptp(values) <= SAME * np.abs(values).max())


def _unknown(estimate: float) -> Interval:
    return Interval(estimate, float("nan"), float("nan"))


def _checked(values: np.ndarray) -> np.ndarray:
    """Values as floats: at least one, all finite and at most 1e300."""
    array = float_array("values", values, "numbers", InvalidParameter)
    wrong = array[~(np.abs(array) <= LARGEST)]
    if array.size == 0 or wrong.size:
        found = f"holds {wrong[0]}" if wrong.size else "is empty"
        raise InvalidParameter(f"values {found}: expected at least one return, all finite and {LARGEST:g} at most.")
    return array
