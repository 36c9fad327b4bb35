"""An agent is judged by the worse of two shares: of value, and of mean return."""

import numpy as np
import pytest

from irl_gym.intervals import Interval, as_interval, mean_interval
from irl_gym.judging.shares import GOOD, judge, judged, share_of_return

UNKNOWN = (float("nan"), float("nan"))
TAXI = {"agent": Interval(-139, -155, -123), "expert": Interval(7.8, 7.4, 8.2), "random": Interval(-770, -785, -755)}
CART = {"agent": Interval(425, 408, 442), "expert": Interval(500, *UNKNOWN), "random": Interval(22, 20.5, 23.5)}


def score(value):
    return as_interval(value, value, value)


@pytest.mark.parametrize(
    ("value", "means", "brief"),
    [
        (0.82, TAXI, "not good (0.820 of value, 0.811 of mean return)"),
        (0.977, CART, "not good (0.977 of value, 0.843 of mean return)"),
        (0.977, CART | {"agent": Interval(475, 465, 485)}, "good (0.977 of value, 0.948 of mean return)"),
        (0.7, CART | {"agent": Interval(475, 465, 485)}, "not good (0.700 of value, 0.948 of mean return)"),
    ],
)
def test_the_worse_of_the_two_shares_decides(value, means, brief):
    assert judge(score(value), **means).brief == brief


@pytest.mark.parametrize("value", [1.0, 0.95, 0.5])
def test_it_is_left_open_what_sampling_alone_may_have_made_short(value):
    found = judge(score(value), Interval(430, 400, 460), Interval(480, 465, 495), Interval(22, 20, 24))
    assert found.mood == ("open" if value >= GOOD else "bad")
    assert ("which by its 95 % interval it may reach" in found.told) == (value >= GOOD)


def test_a_score_over_seeds_is_left_open_when_its_interval_reaches_good():
    means = CART | {"agent": Interval(475, 465, 485)}
    assert judge(Interval(0.89, 0.85, 0.93), **means).mood == "open"
    assert judge(Interval(0.89, 0.88, 0.895), **means).mood == judge(Interval(0.89, *UNKNOWN), **means).mood == "bad"


@pytest.mark.parametrize("random", [Interval(0.5, 0.4, 0.6), Interval(0.6, 0.5, 0.7)])
def test_the_score_alone_decides_when_the_expert_returns_no_more_than_random_actions(random):
    found = judge(score(0.95), Interval(0.1, 0.0, 0.2), Interval(0.5, 0.4, 0.6), random)
    assert found.share is None and found.brief == "good (0.950 of value)"
    assert "Mean returns do not count: the expert's mean return is no better" in found.told


def test_mean_returns_do_not_count_when_the_scale_is_not_known_to_a_quarter():
    wide, narrow = (Interval(0.5, 0.5 - half, 0.5 + half) for half in (0.3, 0.1))
    agent, random = Interval(0.1, 0.0, 0.2), Interval(0.0, 0.0, 0.0)
    assert judge(score(0.95), agent, wide, random).mood == "good" and judge(score(0.95), agent, narrow, random).mood == "bad"


def test_nothing_is_judged_when_the_table_is_an_estimate_and_the_episodes_are_no_scale():
    means = Interval(25.8, 25.3, 26.3), Interval(25.8, 25.3, 26.3), Interval(22.8, 21, 24.6)
    found = judge(score(1.0), *means, estimated=True)
    assert found.brief == "not judged" and "table which is an estimate" in found.told
    assert judge(score(1.0), *means).mood == "good"


def test_nothing_is_judged_without_a_score():
    found = judge(None, **CART)
    assert (found.mood, found.told) == ("plain", "not at all, as there is no score.") and found.share == pytest.approx(
        0.843, abs=1e-3
    )


def test_rows_without_returns_are_judged_by_the_score_alone():
    found = judged({"retrained": {"score": 0.95}, "expert": {"score": 1.0}, "random": {"score": 0.0}}, None)
    assert found.brief == "good (0.950 of value)" and "they are not known" in found.told


def test_rows_of_metrics_are_judged():
    rows = {"retrained": (425, 408, 442), "expert": (500, None, None), "random": (22, 20.5, 23.5)}
    policies = {
        name: {"mean_return": mean, "return_low": low, "return_high": high, "score": 0.977}
        for name, (mean, low, high) in rows.items()
    }
    assert judged(policies, {"exact": True}).mood == "bad"


def test_what_is_below_good_does_not_read_as_good():
    assert judge(score(0.8996), **CART).brief == "not good (just below 0.9 of value, 0.843 of mean return)"
    assert judge(score(0.9), **CART | {"agent": CART["expert"]}).brief == "good (0.900 of value, 1.000 of mean return)"


def test_the_share_of_random_actions_is_0_and_the_experts_1():
    means = (TAXI["expert"], TAXI["random"])
    assert [share_of_return(TAXI[name], *means) for name in ("random", "expert")] == [0.0, 1.0]


def test_an_agent_that_is_just_good_is_seldom_called_bad():
    rng, wrong, n = np.random.default_rng(0), 0, 1_000
    for _ in range(n):
        means = [mean_interval(rng.normal(mean, sd, 40)) for mean, sd in ((90.0, 15.0), (100.0, 10.0), (0.0, 5.0))]
        wrong += judge(score(1.0), *means).mood == "bad"
    assert 0.005 < wrong / n < 0.04
