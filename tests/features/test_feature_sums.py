"""Discounted sums of features along episodes."""

import numpy as np
import pytest
from gymnasium import spaces

from irl_gym.errors import InvalidDemonstrations, InvalidDiscount, InvalidFeatures, UnknownObservation
from irl_gym.features.bases import RadialBasis
from irl_gym.features.feature_maps import Functions, OneHot
from irl_gym.features.feature_sums import discounted_sums, feature_expectations
from irl_gym.mdp.episodes import Episode, collect_from_table
from irl_gym.mdp.planning.dynamic_programming import occupancy, policy_iteration
from irl_gym.spaces.states import StateIndex

STATES = StateIndex(spaces.Discrete(4))
TWO = ([0, 1, 1], [2, 3])


def episode(observations):
    steps = len(observations) - 1
    return Episode(np.array(observations), np.zeros(steps, dtype=int), np.zeros(steps), True, False)


def episodes():
    return [episode(observations) for observations in TWO]


def test_discounted_sums_are_from_the_first_state_of_each_episode():
    found = discounted_sums(episodes(), OneHot(4), 0.5)
    assert found.tolist() == [[1, 0.75, 0, 0], [0, 0, 1, 0.5]]


def test_discounted_sums_count_the_state_of_the_end_once():
    assert discounted_sums([episode([0, 3])], OneHot(4), 0.5).tolist() == [[1, 0, 0, 0.5]]


@pytest.mark.parametrize(("horizon", "expected"), [(1, [1, 0.5]), (2, [1, 0.75]), (9, [1, 0.75])])
def test_discounted_sums_are_cut_after_the_horizon(horizon, expected):
    assert discounted_sums(episodes()[:1], OneHot(2), 0.5, horizon=horizon).tolist() == [expected]


def test_discounted_sums_are_of_rows_when_states_are_given():
    shifted = StateIndex(spaces.Discrete(4, start=10))
    found = discounted_sums([episode([10, 13])], OneHot(4), 0.5, states=shifted)
    assert found.tolist() == [[1, 0, 0, 0.5]]


def test_discounted_sums_are_of_the_terminal_copy_when_an_episode_ends_in_it():
    states = StateIndex(spaces.Discrete(3), terminal_copies={1: 3})
    assert discounted_sums([episode([1, 0, 1])], OneHot(4), 0.5, states=states).tolist() == [[0.5, 1, 0, 0.25]]


def test_discounted_sums_are_of_observations_of_a_box():
    phi = RadialBasis(np.array([[0.0], [1.0]]), 1.0)
    x = np.array([[0.0], [1.0], [3.0]])
    np.testing.assert_allclose(discounted_sums([episode(x)], phi, 0.9), [[1, 0.9, 0.81] @ phi(x)])


def test_discounted_sums_take_an_array_for_features():
    phi = np.arange(8.0).reshape(4, 2)
    np.testing.assert_array_equal(discounted_sums(episodes(), phi, 0.5), discounted_sums(episodes(), OneHot(4), 0.5) @ phi)


def test_discounted_sums_take_episodes_as_they_come():
    assert len(discounted_sums(iter(episodes()), OneHot(4), 0.5)) == 2


def test_feature_expectations_are_discounted_sums_from_the_first_state():
    found = feature_expectations(episodes(), np.eye(4), STATES, 0.5)
    assert np.array_equal(found, np.array([1, 0.75, 1, 0.5]) / 2)


def test_feature_expectations_are_of_observations_without_states():
    np.testing.assert_array_equal(
        feature_expectations(episodes(), OneHot(4), None, 0.5), feature_expectations(episodes(), OneHot(4), STATES, 0.5)
    )


def test_feature_expectations_approach_the_occupancy(toy_text):
    lake = toy_text("FrozenLake 4x4 slippery")
    expert = policy_iteration(lake.mdp, lake.reward.values).policy
    settings = {"seed": 0, "max_episode_steps": 2000}
    made = collect_from_table(lake.mdp, lake.payments.entries, lake.states, expert, 4000, **settings)
    found = feature_expectations(made, np.eye(16), lake.states, 0.99)
    exact = occupancy(lake.mdp, expert).sum(axis=1)
    acting = ~lake.mdp.terminal
    assert np.allclose(found[acting], exact[acting], atol=0.35)
    assert found[acting].sum() == pytest.approx(exact.sum(), rel=0.03)


# --- bad input ---


@pytest.mark.parametrize("sums", [discounted_sums, lambda e, phi, gamma: feature_expectations(e, phi, STATES, gamma)])
def test_no_episodes_have_no_sums(sums):
    with pytest.raises(InvalidDemonstrations, match="no episodes"):
        sums([], np.eye(4), 0.9)


def test_feature_expectations_refuse_features_of_the_wrong_length():
    with pytest.raises(InvalidFeatures, match="5 states: expected 4"):
        feature_expectations(episodes(), np.eye(5), STATES, 0.9)


def test_feature_expectations_refuse_a_discount_outside_the_interval():
    with pytest.raises(InvalidDiscount, match="gamma is 2"):
        feature_expectations(episodes(), np.eye(4), STATES, 2.0)


def test_discounted_sums_refuse_an_observation_that_the_features_do_not_have():
    with pytest.raises(InvalidFeatures, match="observation 3 has no features: expected 0 to 2"):
        discounted_sums(episodes(), OneHot(3), 0.9)


def test_discounted_sums_refuse_an_observation_that_the_states_do_not_have():
    with pytest.raises(UnknownObservation, match="9"):
        discounted_sums([episode([0, 9])], OneHot(4), 0.9, states=STATES)


def test_discounted_sums_name_the_observation_and_column_of_a_nan():
    phi = Functions(lambda rows: np.where(rows[:, None] == 3, np.nan, np.ones(2)), 2)
    with pytest.raises(InvalidFeatures, match="feature 0 of observation number 1 is nan"):
        discounted_sums(episodes(), phi, 0.9)
