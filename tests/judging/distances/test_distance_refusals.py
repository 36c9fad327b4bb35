"""What distances refuse, and how they say so."""

import numpy as np
import pytest
from models import random_model

from irl_gym.errors import InvalidMDP, InvalidParameter, InvalidReward, UndefinedDistance
from irl_gym.judging.distances import (
    EPIC,
    STARC,
    MinimalNorm,
    TableModel,
    dard,
    distance_matrix,
    epic,
    pearson,
    spearman,
    starc,
)
from irl_gym.judging.distances.bounds import epic_bound
from irl_gym.judging.distances.random_rewards import shaped
from irl_gym.learners.linear_programs.finite import FiniteLP
from irl_gym.mdp.tabular_mdp import TabularMDP

MODEL = random_model(0, 6, 2, "terminal")  # states 4 and 5 are terminal
MDP, R = MODEL.mdp, MODEL.R
ACTING = np.repeat(~MDP.terminal[:, None], 2, axis=1) / 8


@pytest.mark.parametrize("distance", [epic, dard, starc, pearson, spearman])
@pytest.mark.parametrize("wrong", [np.zeros(5), np.zeros((6, 3)), np.zeros((6, 2, 5)), np.zeros((1, 6, 2, 6)), np.array(1.0)])
def test_a_reward_of_another_table_is_refused(distance, wrong):
    with pytest.raises(InvalidReward, match=r"the second reward has shape .*: expected \(6,\), \(6, 2\) or \(6, 2, 6\)"):
        distance(MDP, R, wrong)


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_reward_that_is_not_finite_is_named(value):
    wrong = np.zeros((6, 2))
    wrong[3, 1] = value
    with pytest.raises(InvalidReward, match=r"the first reward is (nan|inf) at \[3, 1\]"):
        starc(MDP, wrong, R)


def test_a_result_is_told_from_its_reward(unchecked):
    result = FiniteLP().fit(MDP, MODEL.expert)
    with pytest.raises(InvalidReward, match="the second reward is an Outcome, which holds a reward: pass its"):
        epic(MDP, R, result)


def test_text_is_no_reward():
    with pytest.raises(InvalidReward, match="cannot be read as numbers"):
        epic(MDP, "sparse", R)


@pytest.mark.parametrize("constant", [np.zeros(6), np.zeros((6, 2)), np.zeros((6, 2, 6))])
@pytest.mark.parametrize("distance", [epic, dard, pearson, spearman])
def test_a_constant_reward_has_no_correlation(distance, constant):
    with pytest.raises(UndefinedDistance, match="the canonical form of the second reward has deviation 0"):
        distance(MDP, R, constant)


@pytest.mark.parametrize("distance", [epic, spearman])
def test_a_potential_alone_has_no_correlation(distance):
    with pytest.raises(UndefinedDistance, match="only a potential"):
        distance(MDP, shaped(np.random.default_rng(0), MDP, np.zeros((6, 2, 6))), R)


def test_the_reward_of_a_mapping_is_named():
    with pytest.raises(UndefinedDistance, match="the canonical form of Zero"):
        distance_matrix(EPIC(), MDP, {"True": R, "Zero": np.zeros(6)})


@pytest.mark.parametrize("distance", [EPIC, STARC])
@pytest.mark.parametrize(
    ("coverage", "said"),
    [
        (np.full((6, 3), 1 / 18), r"coverage has shape \(6, 3\)"),
        (np.zeros((6, 2)), "coverage misses all transitions"),
        (np.eye(6)[[5]].repeat(2, axis=0).T / 2, "coverage misses all transitions"),
        (np.where(MODEL.P == 0, 1.0, 0.0) / (MODEL.P == 0).sum(), "coverage misses all transitions"),
        (ACTING / 2, "coverage sums to 0.5"),
        (np.full((6, 2), 1 / 12), r"coverage\[4, 0\] is 0.0833, but state 4 is terminal"),
        (-ACTING, r"coverage\[0, 0\] is -0.125"),
        (np.where(ACTING, np.nan, 0), r"coverage\[0, 0\] is nan"),
        ("uniform", "cannot be read as numbers"),
    ],
)
def test_a_coverage_that_is_no_distribution_of_transitions_is_refused(distance, coverage, said, unchecked):
    with pytest.raises(InvalidParameter, match=said):
        distance(coverage=coverage).distance(MDP, R, -R)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"states": np.ones(5) / 5}, r"states has shape \(5,\): expected \(6,\)"),
        ({"states": np.ones(6)}, "states sums to 6"),
        ({"actions": [1.5, -0.5]}, r"actions\[1\] is -0.5"),
    ],
)
def test_distributions_of_the_canonical_form_are_checked(given, said, unchecked):
    with pytest.raises(InvalidParameter, match=said):
        epic(MDP, R, -R, **given)


@pytest.mark.parametrize("wrong", [0, 3, "2", True, None, [1, 2], np.array([1, 2])])
def test_a_norm_is_1_2_or_infinite(wrong, unchecked):
    with pytest.raises(InvalidParameter, match=r"metric is .*: expected 1, 2 or infinity"):
        starc(MDP, R, -R, metric=wrong)


@pytest.mark.parametrize("distance", [EPIC(), STARC(), STARC(MinimalNorm())])
def test_a_table_without_transitions_has_no_distances(distance):
    ended = TabularMDP(np.zeros((4, 2)), 0.9, [1, 0])
    with pytest.raises(UndefinedDistance, match="every state is terminal"):
        distance.distance(ended, np.ones(2), np.arange(2.0))


def test_the_bound_is_for_tables_without_terminal_states():
    with pytest.raises(InvalidMDP, match="state 4 is terminal"):
        epic_bound(MDP, R, -R)


@pytest.mark.parametrize("call", [
    lambda mdp: epic(mdp, R, -R),
    lambda mdp: starc(mdp, R, -R),
    lambda mdp: distance_matrix(EPIC(), mdp, [R, -R]),
    lambda mdp: epic_bound(mdp, R, -R),
    TableModel,
])  # fmt: skip
def test_something_else_than_a_table_is_refused(call, unchecked):
    with pytest.raises(InvalidMDP, match="mdp is a str: expected a TabularMDP"):
        call("FrozenLake-v1")


@pytest.mark.parametrize("distance", [starc, pearson, spearman])
@pytest.mark.parametrize("wrong", ["VAL", MinimalNorm, EPIC(), 0, ""])
def test_something_else_than_a_canonical_form_is_refused(distance, wrong, unchecked):
    with pytest.raises(InvalidParameter, match=r"canonical is .*: expected a canonical form, such as `MinimalNorm\(\)`"):
        distance(MDP, R, -R, canonical=wrong)


@pytest.mark.parametrize("wrong", [epic, EPIC, "EPIC"])
def test_a_matrix_is_of_a_record(wrong, unchecked):
    with pytest.raises(InvalidParameter, match=r"expected a record, such as `EPIC\(\)`"):
        distance_matrix(wrong, MDP, [R, -R])


@pytest.mark.parametrize("nothing", [[], {}])
def test_a_matrix_of_no_rewards_is_refused(nothing):
    with pytest.raises(InvalidReward, match="rewards is empty"):
        distance_matrix(EPIC(), MDP, nothing)


@pytest.mark.parametrize("distance", [epic, dard, starc, spearman])
def test_a_reward_whose_sums_overflow_is_refused(distance):
    with pytest.raises(
        InvalidReward, match=r"the second reward is 1e\+305 at \[0\]: a reward is a finite number, 1e\+300 at most"
    ):
        distance(MDP, R, np.full(6, 1e305))


def test_a_matrix_is_of_several_rewards(unchecked):
    with pytest.raises(InvalidReward, match="rewards is None"):
        distance_matrix(EPIC(), MDP, None)


@pytest.mark.parametrize("scale", [1e-200, 1e200])
@pytest.mark.parametrize("distance", [epic, dard, starc])
def test_a_very_small_or_large_scale_is_ignored_too(distance, scale):
    assert distance(MDP, R, scale * R) < 1e-8
