import pickle

import numpy as np
import pytest
from gymnasium import spaces

from irl_gym.errors import InvalidPolicy, UnknownObservation
from irl_gym.mdp.policies import Policy, TabularPolicy, as_distribution, support
from irl_gym.spaces.states import StateIndex

HALVES = np.array([[0.5, 0.5, 0.0], [0.0, 0.25, 0.75]])


def two_state_policy(probabilities=HALVES, seed=0):
    return TabularPolicy(probabilities, StateIndex(spaces.Discrete(2)), seed=seed)


@pytest.mark.parametrize("dtype", [np.int64, np.int32, np.uint8])
def test_as_distribution_puts_all_on_the_action(dtype):
    assert as_distribution(np.array([2, 0], dtype=dtype), 2, 3).tolist() == [[0, 0, 1], [1, 0, 0]]


def test_as_distribution_takes_a_set_uniformly():
    chosen = np.array([[True, True, False], [False, False, True]])
    assert as_distribution(chosen, 2, 3).tolist() == [[0.5, 0.5, 0], [0, 0, 1]]


def test_as_distribution_keeps_probabilities():
    np.testing.assert_array_equal(as_distribution(HALVES, 2, 3), HALVES)


def test_as_distribution_does_not_share_memory_with_the_policy():
    mine = HALVES.copy()
    as_distribution(mine, 2, 3)[0, 0] = 7
    np.testing.assert_array_equal(mine, HALVES)


def test_support_is_the_actions_with_positive_probability():
    assert support(HALVES, 2, 3).tolist() == [[True, True, False], [False, True, True]]


@pytest.mark.parametrize(
    ("policy", "message"),
    [
        (np.array([0, 3]), r"policy\[s=1\] is action 3: expected an action from 0 to 2"),
        (np.array([-1, 0]), r"policy\[s=0\] is action -1"),
        (np.array([0, 1, 2]), r"shape \(3,\) and dtype int64: expected \(2,\)"),
        (np.array([0.0, 1.0]), r"shape \(2,\) and dtype float64"),
        (np.full((2, 4), 0.25), r"shape \(2, 4\)"),
        (np.array([[True, True, True], [False, False, False]]), r"policy\[s=1\] is an empty set"),
        (np.array([[1, 0, 0], [0, 1, 0]]), r"dtype int64 and shape \(2, 3\).*astype\(bool\)"),
        (np.array([[1.5, -0.5, 0], [1, 0, 0]]), r"policy\[s=0, a=1\] is -0\.5"),
        (np.array([[1.0, 0, 0], [np.nan, 1, 0]]), r"policy\[s=1, a=0\] is nan"),
        (np.array([[1.0, 0, 0], [0.5, 0.25, 0]]), r"policy\[s=1\] sums to 0\.75"),
        (None, "policy is None: expected a table"),
    ],
)
def test_as_distribution_names_what_makes_it_no_policy(policy, message):
    with pytest.raises(InvalidPolicy, match=message):
        as_distribution(policy, 2, 3)


def test_tabular_policy_is_a_policy():
    assert isinstance(two_state_policy(), Policy)


@pytest.mark.parametrize(("observation", "action"), [(0, 0), (1, 2), (np.int64(1), 2), (np.array(1), 2)])
def test_predict_takes_the_likeliest_action_when_deterministic(observation, action):
    assert two_state_policy().predict(observation, deterministic=True)[0] == action


def test_predict_of_a_batch_equals_predict_of_each():
    policy, batch = two_state_policy(), np.array([0, 1, 1, 0])
    each = [policy.predict(observation, deterministic=True)[0] for observation in batch]
    assert policy.predict(batch, deterministic=True)[0].tolist() == each


def test_predict_draws_actions_by_their_probabilities():
    drawn = two_state_policy().predict(np.ones(40_000, dtype=int))[0]
    np.testing.assert_allclose(np.bincount(drawn, minlength=3) / 40_000, HALVES[1], atol=0.01)


def test_predict_never_draws_an_action_without_probability():
    assert two_state_policy().predict(np.zeros(10_000, dtype=int))[0].max() == 1


def test_predict_repeats_itself_with_the_same_seed():
    batch = np.zeros(50, dtype=int)
    draws = [two_state_policy(seed=4).predict(batch)[0].tolist() for _ in range(2)]
    assert draws[0] == draws[1]


def test_predict_differs_from_one_seed_to_another():
    batch = np.zeros(50, dtype=int)
    assert (two_state_policy(seed=1).predict(batch)[0] != two_state_policy(seed=2).predict(batch)[0]).any()


def test_predict_passes_the_hidden_state_through():
    assert two_state_policy().predict(0, state="hidden")[1] == "hidden"


@pytest.mark.parametrize("observation", [2, -1, 0.5, np.array([0, 5])])
def test_predict_refuses_an_observation_outside_the_index(observation):
    with pytest.raises(UnknownObservation, match="observation"):
        two_state_policy().predict(observation)


def test_tabular_policy_survives_pickle():
    policy = two_state_policy()
    again = pickle.loads(pickle.dumps(policy))
    batch = np.zeros(50, dtype=int)
    np.testing.assert_array_equal(again.predict(batch)[0], policy.predict(batch)[0])


def test_tabular_policy_probabilities_are_not_writeable():
    with pytest.raises(ValueError, match="read-only"):
        two_state_policy().probabilities[0, 0] = 1


@pytest.mark.parametrize(
    ("probabilities", "message"),
    [(HALVES * 2, r"policy\[s=0\] sums to 2"), (np.full((3, 2), 0.5), r"shape \(3, 2\)")],
)
def test_tabular_policy_refuses_what_is_no_distribution(probabilities, message):
    with pytest.raises(InvalidPolicy, match=message):
        two_state_policy(probabilities)


def test_a_policy_of_actions_is_not_taken_for_probabilities(unchecked):
    with pytest.raises(InvalidPolicy, match=r"shape \(3,\): expected \(S, A\)"):
        TabularPolicy(np.zeros(3), StateIndex(spaces.Discrete(3)))


def test_a_policy_comes_back_from_pickle_immutable():
    again = pickle.loads(pickle.dumps(TabularPolicy(np.eye(3), StateIndex(spaces.Discrete(3)))))
    assert not again.probabilities.flags.writeable


def test_a_tabular_policy_is_its_own_distribution():
    policy = TabularPolicy(np.array([[0.25, 0.75], [1.0, 0.0]]), StateIndex(spaces.Discrete(2)))
    assert as_distribution(policy, 2, 2) == pytest.approx(policy.probabilities)
