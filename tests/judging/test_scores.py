"""The scale of scores, and when there is none."""

import numpy as np
import pytest

from irl_gym.judging.scores import BLUR, FEWEST, Scale, half_width


def noisy(n, seed=0):
    return np.random.default_rng(seed).normal(1.0, 0.5, n)


def test_a_score_is_0_for_random_actions_and_1_for_the_expert():
    scale = Scale(-2.0, 6.0)
    assert [scale.score(value) for value in (-2.0, 6.0, 0.0)] == [0.0, 1.0, 0.25] and scale.share(2.0) == 0.25


@pytest.mark.parametrize("half", [0.26, 1.0, 2.0, np.inf])
def test_there_is_no_score_when_the_interval_is_wider_than_a_quarter_of_the_scale_either_way(half):
    scale = Scale(0.0, 1.0, half=half, episodes=20)
    assert scale.few and scale.score(0.5) is scale.share(0.5) is None
    assert scale.reason is not None and "the mean of 20 episodes, too few" in scale.reason


def test_there_is_a_score_when_the_interval_is_narrow():
    assert Scale(0.0, 1.0, half=BLUR, episodes=20).score(0.5) == 0.5


def test_an_expert_that_seems_worse_than_random_by_few_episodes_is_not_called_worse():
    assert "too few" in (Scale(1.0, 0.0, half=2.0, episodes=20).reason or "")


def test_an_expert_that_is_surely_worse_than_random_is_called_worse():
    assert Scale(1.0, 0.0, half=0.1, episodes=20).reason == "the expert earns no more than random actions"


@pytest.mark.parametrize("expert", [0.0, 5e-7, -5e-7])
def test_values_that_differ_by_rounding_blame_the_discount(expert):
    reason = Scale(0.0, expert, 1e-6, gamma=0.1).reason
    assert reason is not None and reason.startswith("at gamma 0.1") and "larger gamma" in reason


def test_returns_that_happen_to_be_equal_are_not_believed_when_they_are_few():
    assert half_width(np.ones(FEWEST - 1), False) == np.inf and half_width(np.ones(FEWEST), False) == 0.0


def test_returns_without_chance_are_exact_however_few():
    assert half_width(np.ones(1), True) == 0.0


def test_another_outcome_than_those_seen_has_a_chance_of_at_most_a_quarter():
    assert 0.05 ** (1 / FEWEST) > 1 - BLUR > 0.05 ** (1 / (FEWEST - 1))


def test_the_interval_holds_the_mean_as_often_as_it_says():
    held = [abs(one.mean() - 1.0) <= half_width(one, False) for one in (noisy(15, seed) for seed in range(2_000))]
    assert abs(np.mean(held) - 0.95) < 0.02


def test_the_episodes_that_are_called_enough_are():
    returns = noisy(12)
    scale = Scale(0.5, float(returns.mean()), half=half_width(returns, False), episodes=12)
    assert scale.few and scale.needed is not None and scale.needed > 12
    more = noisy(2 * scale.needed, seed=1)
    assert not Scale(0.5, float(more.mean()), half=half_width(more, False), episodes=more.size).few


def test_an_interval_without_ends_says_so():
    assert Scale(0.0, 1.0, half=np.inf, episodes=2).interval == (None, None) and Scale(0.0, 1.0).interval == (1.0, 1.0)
