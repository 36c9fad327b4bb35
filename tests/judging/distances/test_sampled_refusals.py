"""What sampled distances refuse, and how they say so."""

import numpy as np
import pytest
from judging.distances.samples import CONTINUING, drawn, function, random_actions, rewards_of

from irl_gym.errors import InvalidDemonstrations, InvalidParameter, InvalidReward, UndefinedDistance
from irl_gym.judging.distances import (
    FreshSample,
    TableModel,
    Transitions,
    sampled_dard,
    sampled_epic,
    sampled_pearson,
    sampled_starc,
)


@pytest.mark.parametrize(
    ("returned", "said"),
    [
        (np.zeros(3), r"gives shape \(3,\) for 1000"),
        (np.full(1000, np.nan), r"what the reward function returns is nan at \[0\]"),
        ("no", "cannot be read"),
    ],
)
def test_a_function_that_gives_no_numbers_is_refused(returned, said):
    transitions, _, _ = drawn(CONTINUING, 0)
    with pytest.raises(InvalidReward, match=said):
        sampled_pearson(lambda *_: returned, lambda *_: returned, transitions, None)


def test_samples_that_do_not_fit_together_are_refused():
    with pytest.raises(InvalidParameter, match=r"there are 4 actions and \{'next_observations': 3\}"):
        Transitions(np.zeros(4), np.zeros(4), np.zeros(3))
    with pytest.raises(InvalidParameter, match=r"there are 4 actions and \{'states': 3\}"):
        FreshSample(0.9, np.zeros(3), np.zeros(4))
    with pytest.raises(UndefinedDistance, match="there are 1 transitions"):
        Transitions(np.zeros(1), np.zeros(1), np.zeros(1))
    with pytest.raises(UndefinedDistance, match="there are no episodes"):
        Transitions.from_episodes([])


def test_one_group_has_no_error():
    a, b = map(function, rewards_of(CONTINUING))
    with pytest.raises(UndefinedDistance, match="all transitions are of one group"):
        sampled_pearson(a, b, Transitions(np.arange(8), np.zeros(8, int), np.arange(8), groups=np.zeros(8, int)), None)


def test_replicates_and_horizons_are_checked():
    transitions, _, rng = drawn(CONTINUING, 0)
    a = function(rewards_of(CONTINUING)[0])
    given = {"gamma": 0.9, "model": TableModel(CONTINUING.mdp), "rng": rng}
    with pytest.raises(InvalidParameter, match="replicates is 1"):
        sampled_dard(a, a, transitions, actions=np.arange(3), replicates=1, **given)
    with pytest.raises(InvalidParameter, match="horizon is 0"):
        sampled_starc(a, a, transitions, policy=random_actions, horizon=0, **given)


def test_a_table_is_no_function(unchecked):
    transitions, _, _ = drawn(CONTINUING, 0)
    with pytest.raises(InvalidReward, match=r"the reward is an ndarray: expected a function of \(observations, actions"):
        sampled_pearson(CONTINUING.R, CONTINUING.R, transitions, None)


@pytest.mark.parametrize("wrong", [[0, 1, 2], None, 3, {"s": [0, 1, 2]}])
def test_observations_that_are_not_stacked_are_refused(wrong, unchecked):
    with pytest.raises(InvalidParameter, match=r"next_observations is .*: expected an array, or a dict or tuple of arrays"):
        Transitions(np.arange(3), np.zeros(3, int), wrong)


def test_something_else_than_a_sample_is_refused(unchecked):
    transitions, _, _ = drawn(CONTINUING, 0)
    a = function(CONTINUING.R)
    with pytest.raises(InvalidParameter, match=r"expected Transitions, such as `Transitions\.from_episodes"):
        sampled_pearson(a, a, [0, 1], None)
    with pytest.raises(InvalidParameter, match=r"expected FreshSample, such as `FreshSample\.from_transitions"):
        sampled_epic(a, a, transitions, None)
    with pytest.raises(InvalidDemonstrations, match="there is a str where an episode is expected"):
        Transitions.from_episodes(["CartPole-v1"])


@pytest.mark.parametrize("change, said", [
    ({"model": None}, "model is None: expected a function, such as `TableModel"),
    ({"model": lambda observations, actions, rng: observations}, "the model gives an ndarray for 1000 actions"),
    ({"actions": 3}, "actions is 3: expected an array of actions"),
    ({"actions": []}, "expected an array of actions"),
    ({"actions": np.array([3])}, "actions hold 3: expected 0 to 2"),
    ({"rng": 0}, "rng is 0: expected a generator"),
])  # fmt: skip
def test_what_dard_draws_from_is_checked(change, said, unchecked):
    transitions, _, rng = drawn(CONTINUING, 0)
    a, b = map(function, rewards_of(CONTINUING))
    given = {"gamma": 0.9, "model": TableModel(CONTINUING.mdp), "actions": np.arange(3), "rng": rng} | change
    with pytest.raises(InvalidParameter, match=said):
        sampled_dard(a, b, transitions, **given)


def test_a_policy_of_starc_is_a_function(unchecked):
    transitions, _, rng = drawn(CONTINUING, 0)
    a = function(CONTINUING.R)
    with pytest.raises(InvalidParameter, match="policy is an ndarray: expected a function, such as `lambda"):
        sampled_starc(a, a, transitions, gamma=0.9, model=TableModel(CONTINUING.mdp), policy=np.zeros(8), horizon=3, rng=rng)


@pytest.mark.parametrize("part, wrong, said", [
    ("terminated", np.zeros((8, 1), bool), r"terminated has shape \(8, 1\): expected \(8,\).*ravel"),
    ("terminated", np.full(8, np.nan), "terminated holds nan: expected True and False"),
    ("terminated", np.full(8, 2), "terminated holds 2: expected True and False"),
    ("groups", np.zeros((8, 1), int), r"groups has shape \(8, 1\): expected \(8,\)"),
])  # fmt: skip
def test_flags_and_groups_are_one_for_each_transition(part, wrong, said, unchecked):
    with pytest.raises(InvalidParameter, match=said):
        Transitions(np.arange(8), np.zeros(8, int), np.arange(8), **{part: wrong})


def test_flags_of_fresh_draws_are_one_for_each(unchecked):
    with pytest.raises(InvalidParameter, match=r"terminal has shape \(8, 1\): expected \(8,\)"):
        FreshSample(0.9, np.arange(8), np.zeros(8, int), np.zeros((8, 1)))
    with pytest.raises(InvalidParameter, match="transitions is a list: expected Transitions"):
        FreshSample.from_transitions([1, 2], 0.9, rng=np.random.default_rng(0))


@pytest.mark.parametrize("policy", [lambda observations, rng: (np.zeros(1000), None), lambda observations, rng: np.zeros(3)])
def test_a_policy_of_starc_gives_an_action_for_each_observation(policy, unchecked):
    transitions, _, rng = drawn(CONTINUING, 0)
    a = function(rewards_of(CONTINUING)[0])
    with pytest.raises(InvalidParameter, match=r"the policy gives .*: expected an array with one action for each"):
        sampled_starc(a, a, transitions, gamma=0.9, model=TableModel(CONTINUING.mdp), policy=policy, horizon=3, rng=rng)
