"""What FeatureLP refuses, and how it says so; and its outcome on worlds that can only be set and run."""

import gymnasium as gym
import models
import numpy as np
import pytest
from gymnasium import spaces

from irl_gym.environments.generative import GenerativeModel
from irl_gym.errors import (
    DegenerateExpert,
    InvalidFeatures,
    InvalidMDP,
    InvalidParameter,
    InvalidPolicy,
    NotSettable,
    SolverTimeout,
)
from irl_gym.features.bases import RadialBasis
from irl_gym.features.feature_maps import Functions, OneHot
from irl_gym.learners.linear_programs.feature import FeatureLP
from irl_gym.programs.solvers import Status
from irl_gym.spaces.states import StateIndex

DRIVE = "irl_gym_envs:irl_gym/ContinuousGridWorld-v0"
MODEL = models.random_model(0)


class Upwards:
    """Moves up and right towards the corner of the continuous grid world, whichever is further away."""

    def predict(self, observation, state=None, episode_start=None, deterministic=False):
        return (observation[:, 0] <= observation[:, 1]).astype(int), state


def fit(features=None, world=MODEL.mdp, expert=MODEL.expert, **fields):
    return FeatureLP(OneHot(7) if features is None else features, **fields).fit(world, expert)


def with_nan(rows, columns=2):
    values = np.ones((7, columns))
    values[4, 1] = np.nan
    return values[rows]


# --- fields ---


@pytest.mark.parametrize(
    ("field", "value"),
    [
        *[("penalty", bad) for bad in (0.5, -2.0, np.inf, np.nan, "two")],
        *[("l1", bad) for bad in (-0.5, np.inf, np.nan, "auto")],
        *[("samples", bad) for bad in (0, 1.5, -1)],
        *[("horizon", bad) for bad in (0, 2.5)],
        *[("seed", bad) for bad in (-1, 0.5)],
        *[("S_0", bad) for bad in (0, -3, 2.5, True, "all")],
        *[("solver", bad) for bad in ("simplex", None)],
        *[("time_limit", bad) for bad in (0.0, -1.0)],
    ],
)
def test_feature_lp_refuses_a_field_outside_its_range(field, value, unchecked):
    with pytest.raises(InvalidParameter, match=rf"{field} is '?{value}'?:"):
        FeatureLP(OneHot(7), **{field: value})


@pytest.mark.parametrize("S_0", [[], np.zeros(0, dtype=int), np.zeros((0, 2))])
def test_feature_lp_refuses_an_empty_sample(S_0):
    with pytest.raises(InvalidParameter, match="S_0 is empty: expected at least one state"):
        FeatureLP(OneHot(7), S_0=S_0)


# --- features ---


@pytest.mark.parametrize(("features", "message"), [("phi", "cannot be read"), (np.zeros(7), r"shape \(7,\)")])
def test_feature_lp_refuses_features_that_are_none(features, message, unchecked):
    with pytest.raises(InvalidFeatures, match=message):
        FeatureLP(features)


def test_feature_lp_names_the_state_and_column_of_a_nan_in_an_array():
    with pytest.raises(InvalidFeatures, match="feature 1 of state 4 is nan"):
        FeatureLP(with_nan(np.arange(7)))


def test_feature_lp_names_the_observation_and_column_of_a_nan():
    with pytest.raises(InvalidFeatures, match="feature 1 of observation number 4 is nan"):
        fit(Functions(with_nan, 2))


@pytest.mark.parametrize("features", [OneHot(6), np.zeros((8, 2))])
def test_feature_lp_refuses_features_of_another_length(features):
    with pytest.raises(InvalidFeatures, match="states: expected 7, one row of phi a state"):
        fit(features)


@pytest.mark.parametrize("width", [1, 3])
def test_feature_lp_refuses_features_of_another_width(width):
    with pytest.raises(InvalidFeatures, match=rf"shape \(7, {width}\): expected \(N, 2\)"):
        fit(Functions(lambda rows: np.zeros((len(rows), width)), 2))


def test_feature_lp_refuses_features_of_coordinates_that_rows_do_not_have():
    with pytest.raises(InvalidFeatures, match=r"1 coordinates: expected 2.*Unravel"):
        fit(RadialBasis.grid([0, 0], [1, 1], 2))


# --- tables ---


@pytest.mark.parametrize(
    ("S_0", "message"),
    [
        ([0, 7], "S_0 holds state 7: expected 0 to 6"),
        ([-1], "S_0 holds state -1"),
        ([0.0, 1.0], r"shape \(2,\) and dtype float64"),
        ([[0, 1]], r"shape \(1, 2\) and dtype int64"),
        ([True] * 7, "dtype bool"),
    ],
)
def test_feature_lp_refuses_a_sample_of_states_that_are_not_in_the_table(S_0, message):
    with pytest.raises(InvalidParameter, match=message):
        fit(S_0=np.array(S_0))


def test_feature_lp_refuses_states_of_another_size():
    with pytest.raises(InvalidParameter, match="states has 8 states: expected 7"):
        FeatureLP(OneHot(7)).fit(MODEL.mdp, MODEL.expert, states=StateIndex(spaces.Discrete(8)))


@pytest.mark.parametrize(
    ("expert", "message"),
    [
        (np.array([0, 3, 0, 0, 0, 0, 0]), r"policy\[s=1\] is action 3"),
        (np.zeros(6, dtype=int), r"shape \(6,\)"),
        (np.full((7, 3), 0.25), r"policy\[s=0\] sums to 0.75"),
        (Upwards(), "policy"),
    ],
)
def test_feature_lp_refuses_an_expert_that_is_no_policy_of_the_table(expert, message):
    with pytest.raises(InvalidPolicy, match=message):
        fit(expert=expert)


@pytest.mark.parametrize("S_0", [None, 3, [0, 1]])
def test_feature_lp_refuses_a_sample_without_anything_to_compare(S_0):
    with pytest.raises(DegenerateExpert, match="states of S_0 compares the expert with an action of other successors"):
        FeatureLP(OneHot(2), S_0=S_0).fit(models.ring([[1, 1], [0, 0]]), np.array([0, 0]))


@pytest.mark.parametrize("world", [MODEL.P, gym.make("FrozenLake-v1"), None])
def test_feature_lp_refuses_a_world_that_is_none(world, unchecked):
    with pytest.raises(InvalidMDP, match=r"expected a TabularMDP.* or a GenerativeModel"):
        fit(world=world)


def test_feature_lp_stops_when_its_time_is_up():
    model = models.random_model(0, S=100, A=4, kind="sparse")
    with pytest.raises(SolverTimeout, match="1e-09 s"):
        FeatureLP(OneHot(100), solver="clarabel", time_limit=1e-9).fit(model.mdp, model.expert)


# --- generative models ---


@pytest.fixture(scope="module")
def drive():
    return GenerativeModel(gym.make(DRIVE), 0.9)


PHI = RadialBasis.grid([0, 0], [1, 1], 4)


@pytest.mark.parametrize(
    ("S_0", "message"),
    [
        (None, "S_0 is None, all states: expected a number of states to draw"),
        ([0.5, 0.5], r"shape \(2,\): expected \(m, 2\)"),
        ([[0.5, 0.5, 0.5]], r"shape \(1, 3\): expected \(m, 2\)"),
        ([[0.5, 0.5], [0.5, 1.5]], r"S_0\[1\] has \w+ 1.5: expected 0 to 1"),
        ([[np.nan, 0.5]], r"S_0\[0\] has \w+ nan"),
    ],
)
def test_feature_lp_refuses_a_sample_of_states_that_the_model_does_not_have(drive, S_0, message, unchecked):
    with pytest.raises(InvalidParameter, match=message):
        FeatureLP(PHI, S_0=S_0).fit(drive, Upwards())


@pytest.mark.parametrize("expert", [np.zeros(7, dtype=int), None, lambda observation: 0])
def test_feature_lp_refuses_an_expert_that_is_no_policy_of_a_model(drive, expert, unchecked):
    with pytest.raises(InvalidPolicy, match="expected a policy with `predict`"):
        FeatureLP(PHI, S_0=5).fit(drive, expert)


def test_feature_lp_passes_on_that_an_environment_cannot_be_set():
    with pytest.raises(NotSettable, match="BlackjackEnv"):
        FeatureLP(OneHot(7), S_0=5).fit(GenerativeModel(gym.make("Blackjack-v1"), 0.9), Upwards())


def test_feature_lp_refuses_a_model_in_which_nothing_moves_the_features(drive):
    with pytest.raises(DegenerateExpert, match="no other action leads from the 5 states of S_0 to other features"):
        FeatureLP(Functions(lambda x: np.ones((len(x), 1)), 1), S_0=5, horizon=3).fit(drive, Upwards())


@pytest.fixture(scope="module")
def driven(drive):
    return FeatureLP(PHI, S_0=40, samples=40, seed=1).fit(drive, Upwards())


def test_feature_lp_on_a_model_makes_the_expert_optimal_within_the_noise(driven):
    assert driven.status is Status.OPTIMAL and driven.proof.worst_violation <= 3 * driven.proof.standard_error


def test_feature_lp_on_a_model_pays_most_in_the_corner_that_the_expert_seeks(driven):
    corner, away = driven.reward.of(np.array([[0.95, 0.95], [0.2, 0.2]]))
    assert corner > away


def test_feature_lp_on_a_model_closes_the_gap(driven):
    assert -1e-6 < driven.proof.duality_gap < 1e-6


def test_feature_lp_on_a_model_judges_the_sample(driven):
    assert driven.proof.margin.shape == (40,) and driven.proof.states + driven.proof.trivial == 40


def test_feature_lp_on_a_model_says_where_it_was_cut(driven):
    assert driven.stats["horizon"] == 44
    assert driven.stats["truncation_per_unit_of_reward"] == pytest.approx(0.9**45 / 0.1)


def test_feature_lp_on_a_model_has_no_standard_error_of_one_rollout(drive):
    assert FeatureLP(PHI, S_0=5, horizon=3).fit(drive, Upwards()).proof.standard_error is None


def test_feature_lp_on_a_model_repeats_itself(drive):
    once, again = (FeatureLP(PHI, S_0=5, samples=2, horizon=5, seed=3).fit(drive, Upwards()).reward.alpha for _ in range(2))
    np.testing.assert_array_equal(once, again)
