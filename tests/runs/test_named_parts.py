"""What names on a command line stand for."""

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces

from irl_gym.agents.planners import FOR_ADVANTAGES, FOR_CONTROL, SB3, ValueIteration
from irl_gym.demonstrations.datasets import write_minari
from irl_gym.environments.reveal import Reveal
from irl_gym.errors import DatasetMismatch, DatasetMissing, InvalidFeatures, InvalidParameter, UnknownEnvironment
from irl_gym.features.bases import Fourier, Polynomial, RadialBasis
from irl_gym.features.feature_maps import OneHot, Unravel
from irl_gym.mdp.episodes import Episode
from irl_gym.runs.named_parts import MOST_FEATURES, environment_of, features_named, planner_named, steps_only

CAR = "irl_gym_envs:irl_gym/MountainCar-v0"


class Shows(gym.Env):
    """An environment that shows elements of a space."""

    action_space = spaces.Discrete(2)

    def __init__(self, space):
        self.observation_space = space


# --- environments ---


def test_environment_of_an_id_is_made_with_its_arguments():
    assert environment_of("FrozenLake-v1", {"map_name": "8x8"}, None, None).observation_space.n == 64


def test_environment_of_an_id_offers_the_closest_name():
    with pytest.raises(UnknownEnvironment, match="FrozenLake-v1"):
        environment_of("FrozenLaek-v1", {}, None, None)


def test_environment_of_an_id_shows_what_is_known_to_be_hidden():
    env = environment_of("Taxi-v4", {"fickle_passenger": True})
    assert isinstance(env, Reveal) and env.shown == {"fickle_step": 2}


@pytest.mark.parametrize("reveal", [{}, "known"])
def test_environment_of_an_id_is_left_as_it_is_when_nothing_is_to_be_shown(reveal):
    assert not isinstance(environment_of("Taxi-v4", {}, reveal=reveal), Reveal)


def test_environment_of_an_id_shows_what_is_asked_for():
    assert environment_of("Taxi-v4", {}, reveal={"fickle_step": 2}).observation_space["fickle_step"].n == 2


def test_environment_of_an_id_draws_its_layouts_from_the_start_seeds():
    env = environment_of("Taxi-v4", {}, start_seeds=(3, 5))
    expected = {gym.make("Taxi-v4").reset(seed=seed)[0] for seed in (3, 5)}
    assert {env.reset(seed=seed)[0] for seed in range(20)} == expected


@pytest.mark.parametrize(
    ("wrong", "match"),
    [
        ({"start_seeds": (-1,)}, "-1.*a whole number"),
        ({"reveal": {"fickle_stop": 2}}, "no attribute 'fickle_stop'.*fickle_step"),
        ({"reveal": {"fickle_step": 0}}, "at least 1"),
        ({"reveal": {"observation": 2}}, "the key of the environment's own"),
        ({"reveal": {"": 2}}, "has the name ''"),
    ],
)
def test_environment_of_an_id_refuses(wrong, match):
    with pytest.raises(InvalidParameter, match=match):
        environment_of("Taxi-v4", {}, **wrong).reset()


def one_step(env, observation):
    return Episode(np.array([observation] * 2), np.array([0]), np.zeros(1), False, True)


@pytest.mark.parametrize(("env_id", "kwargs"), [("FrozenLake-v1", {"map_name": "8x8"}), (CAR, {"task": "park"})])
def test_environment_of_a_dataset_is_the_one_it_was_recorded_in(tmp_path, env_id, kwargs):
    env = gym.make(env_id, **kwargs)
    write_minari([one_step(env, env.reset(seed=0)[0])], "some/data-v0", env, root=tmp_path, algorithm="x")
    found = environment_of(None, {}, "some/data-v0", str(tmp_path))
    assert (found.spec.id, found.spec.kwargs) == (env.spec.id, env.spec.kwargs)


def test_environment_of_a_dataset_that_does_not_say_asks_for_an_id(tmp_path):
    write_minari([one_step(None, 0)], "some/data-v0", Shows(spaces.Discrete(2)), root=tmp_path, algorithm="x")
    with pytest.raises(DatasetMismatch, match=r"does not say where it was recorded.*Name one with --env-id"):
        environment_of(None, {}, "some/data-v0", str(tmp_path))


def test_environment_of_a_dataset_that_is_missing_is_refused(tmp_path):
    with pytest.raises(DatasetMissing, match="There is none"):
        environment_of(None, {}, "some/data-v0", str(tmp_path))


@pytest.mark.parametrize(
    ("env_id", "expected"),
    [("FrozenLake-v1", False), ("CartPole-v1", True), ("Blackjack-v1", False), ("Pendulum-v1", True),
     ("irl_gym_envs:irl_gym/MiniGrid-v0", False)],
)  # fmt: skip
def test_steps_only_are_environments_that_show_coordinates(env_id, expected):
    assert steps_only(gym.make(env_id)) == expected


# --- planners ---


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        (None, None),
        ("value-iteration", ValueIteration()),
        ("ppo", SB3("PPO")),
        ("dqn", SB3("DQN")),
        ("a2c", SB3("A2C")),
    ],
)
def test_planner_named(name, expected):
    assert planner_named(name, None) == expected


def test_planner_named_takes_the_steps_that_are_asked_for():
    assert planner_named("dqn", 123).total_timesteps == 123


def test_planner_named_ppo_suits_classic_control():
    assert planner_named("ppo", None, control=True) == FOR_CONTROL


def test_planner_named_ppo_suits_advantages():
    assert planner_named("ppo", None, advantages=True).hyperparameters == FOR_ADVANTAGES


@pytest.mark.parametrize("name", ["dqn", "a2c"])
def test_planner_named_leaves_other_algorithms_their_own_settings(name):
    assert planner_named(name, None, control=True, advantages=True).hyperparameters == {}


# --- features ---


def test_features_named_auto_is_one_hot_for_integers():
    assert features_named("auto", gym.make("Taxi-v4")).n_features == 500


def test_features_named_auto_is_radial_for_coordinates():
    phi = features_named("auto", gym.make("CartPole-v1"))
    assert isinstance(phi, RadialBasis) and phi.n_features == 4**4


def test_features_named_auto_is_radial_when_integers_have_coordinates():
    phi = features_named("auto", gym.make("Taxi-v4"), coordinates=(5, 5, 5, 4))
    assert isinstance(phi, RadialBasis) and phi(np.arange(500)).shape == (500, 256)


@pytest.mark.parametrize(
    ("name", "kind", "size", "expected"),
    [
        ("radial", RadialBasis, 7, 49), ("fourier", Fourier, 3, 16), ("polynomial", Polynomial, 2, 6),
        ("radial", RadialBasis, None, 225), ("fourier", Fourier, None, 225), ("polynomial", Polynomial, None, 6),
    ],
)  # fmt: skip
def test_features_named_have_the_size_asked_for(name, kind, size, expected):
    phi = features_named(name, gym.make("MountainCar-v0"), size=size)
    assert type(phi) is kind and phi.n_features == expected


def test_features_named_lie_between_the_bounds_of_several_integers():
    phi = features_named("radial", Shows(spaces.MultiDiscrete([2, 5], start=[0, 3])), size=3)
    assert phi.centres.min(axis=0).tolist() == [0, 3] and phi.centres.max(axis=0).tolist() == [1, 7]


@pytest.mark.parametrize("d", [1, 2, 3, 4, 8])
@pytest.mark.parametrize("name", ["radial", "fourier"])
def test_features_named_are_256_at_most_by_default(name, d):
    assert features_named(name, Shows(spaces.Box(-1, 1, (d,)))).n_features <= MOST_FEATURES


@pytest.mark.parametrize("name", ["radial", "fourier", "polynomial"])
def test_features_named_take_the_rows_and_columns_of_a_grid(name):
    phi = features_named(name, gym.make("FrozenLake-v1", map_name="8x8"))
    assert phi.coordinates == Unravel((8, 8)) and np.isfinite(phi(np.arange(64))).all()


def test_features_named_of_unbounded_coordinates_lie_between_what_is_known_of_them():
    centres = features_named("radial", gym.make("CartPole-v1"), size=3).centres
    np.testing.assert_allclose(centres.max(axis=0), [2.4, 3, 0.2094, 3.5], atol=1e-3)
    np.testing.assert_allclose(centres.min(axis=0), -centres.max(axis=0))


def test_features_named_take_the_observations_of_the_environment():
    for env_id in ("CartPole-v1", "MountainCar-v0", "Acrobot-v1", CAR, "irl_gym_envs:irl_gym/ContinuousGridWorld-v0"):
        env = gym.make(env_id)
        phi = features_named("auto", env)
        assert phi(env.reset(seed=0)[0][None]).shape == (1, phi.n_features)


@pytest.mark.parametrize(
    ("name", "space", "match"),
    [
        ("one-hot", spaces.Box(0, 1, (2,)), "integers from 0.*choose radial"),
        ("one-hot", spaces.Discrete(4, start=1), "integers from 0"),
        ("radial", spaces.Discrete(6), "product.*5 5 5 4 for Taxi"),
        ("auto", spaces.Tuple([spaces.Discrete(2)]), "expected a Box, Discrete or MultiDiscrete"),
        ("auto", spaces.Dict(a=spaces.Discrete(2)), "Flatten them"),
        ("radial", spaces.MultiBinary(4), "expected a Box, Discrete or MultiDiscrete"),
        ("radial", spaces.Box(-np.inf, np.inf, (2,)), "finite bounds"),
        ("fourier", spaces.Box(-np.inf, np.inf, (2, 2)), "finite bounds"),
    ],
)
def test_features_named_refuse_observations_that_they_cannot_be_of(name, space, match):
    with pytest.raises(InvalidFeatures, match=match):
        features_named(name, Shows(space))


def test_features_named_radial_asks_taxi_for_its_coordinates():
    with pytest.raises(InvalidFeatures, match=r"coordinates are None.*Discrete\(500\)"):
        features_named("radial", gym.make("Taxi-v4"))


@pytest.mark.parametrize("coordinates", [(5, 5), (500, 0), (-5, -100)])
def test_features_named_refuse_coordinates_of_another_number(coordinates):
    with pytest.raises(InvalidFeatures):
        features_named("radial", gym.make("Taxi-v4"), coordinates=coordinates)


@pytest.mark.parametrize("name", ["radial", "fourier", "polynomial"])
@pytest.mark.parametrize("size", [0, -1])
def test_features_named_refuse_a_size_below_the_least(name, size):
    if (name, size) == ("fourier", 0) or (name, size) == ("polynomial", 0):
        assert features_named(name, gym.make("MountainCar-v0"), size=size).n_features == 1
        return
    with pytest.raises(InvalidFeatures):
        features_named(name, gym.make("MountainCar-v0"), size=size)


@pytest.mark.parametrize("name", ["radial", "fourier", "polynomial"])
def test_features_named_refuse_pictures(name):
    with pytest.raises(InvalidFeatures, match="of 7056 coordinates would be"):
        features_named(name, Shows(spaces.Box(0, 255, (84, 84), np.uint8)))


def test_features_named_refuse_a_size_that_makes_too_many():
    with pytest.raises(InvalidFeatures, match=r"would be 10\^12: expected 65,536 at most"):
        features_named("radial", gym.make("CartPole-v1"), size=1000)


def test_one_hot_is_the_identity():
    assert isinstance(features_named("one-hot", gym.make("FrozenLake-v1")), OneHot)
