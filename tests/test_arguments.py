"""Each argument of the command line reaches the experiment that it stands for."""

import gymnasium as gym
import numpy as np
import pytest

from irl_gym.arguments import Arguments
from irl_gym.bases import Fourier, Polynomial, RadialBasis
from irl_gym.datasets import write_minari
from irl_gym.demonstrations import Episode
from irl_gym.errors import DatasetMissing, InvalidFeatures, InvalidParameter
from irl_gym.features import OneHot, Unravel
from irl_gym.learners.feature import FeatureLP
from irl_gym.learners.finite import FiniteLP
from irl_gym.learners.trajectory import TrajectoryLP
from irl_gym.planners import FOR_ADVANTAGES, FOR_CONTROL, SB3, ValueIteration

CAR = {"env_id": "MountainCar-v0"}


def asked(**arguments):
    return Arguments(**arguments).experiment()


def learner(**arguments):
    return asked(**arguments).learner


def test_nothing_asked_for_is_the_finite_lp_on_frozen_lake():
    one = asked()
    assert (one.env_id, one.gamma, one.learner) == ("FrozenLake-v1", 0.99, FiniteLP(report_lambda_0=True))


@pytest.mark.parametrize(
    ("arguments", "field", "expected"),
    [
        ({"env_id": "Taxi-v4"}, "env_id", "Taxi-v4"),
        ({"env_kwargs": ("map_name=8x8", "is_slippery=false")}, "env_kwargs", {"map_name": "8x8", "is_slippery": False}),
        ({"gamma": 0.9}, "gamma", 0.9),
        ({"bins": (20,)}, "bins", 20),
        ({"bins": (20, 30)}, "bins", (20, 30)),
        ({"bins": ()}, "bins", None),
        ({"samples": 4}, "samples", 4),
        ({"expert": "value-iteration"}, "expert", ValueIteration()),
        ({"expert": None}, "expert", None),
        ({"expert": "dqn", "total_timesteps": 99}, "expert", SB3("DQN", 99)),
        ({"episodes": 7}, "episodes", 7),
        ({"inner": "value-iteration"}, "inner", ValueIteration()),
        ({"inner": "a2c"}, "inner", SB3("A2C")),
        ({"shaping": False}, "shaping", False),
        ({"retrain": "value-iteration"}, "retrain", ValueIteration()),
        ({"retrain": "ppo"}, "retrain", SB3(hyperparameters=FOR_ADVANTAGES)),
        ({"retrain": "ppo", "shaping": False}, "retrain", SB3()),
        ({"retrain": "ppo", "total_timesteps": 99}, "retrain", SB3("PPO", 99, FOR_ADVANTAGES)),
        ({"seed": 5}, "seed", 5),
    ],
)
def test_an_argument_reaches_the_experiment(arguments, field, expected):
    assert getattr(asked(**arguments), field) == expected


@pytest.mark.parametrize(
    ("arguments", "field", "expected"),
    [
        ({"l1": 0.5}, "l1", 0.5),
        ({"l1": "auto", "margin_cap": "none"}, "l1", "auto"),
        ({"margin_cap": 0.1}, "margin_cap", 0.1),
        ({"margin_cap": "auto"}, "margin_cap", "auto"),
        ({"margin_cap": "none"}, "margin_cap", None),
        ({"reward_on": "state-action"}, "reward_on", "state-action"),
        ({"learner": "feature-lp", "l1": 0.5}, "l1", 0.5),
        ({"learner": "feature-lp", "margin_cap": 0.1}, "margin_cap", 0.1),
        ({"learner": "feature-lp"}, "margin_cap", "auto"),
        ({"learner": "feature-lp", "margin_cap": "none"}, "margin_cap", None),
        ({"learner": "feature-lp", "sample": 9}, "S_0", 9),
        ({"learner": "feature-lp", "seed": 5}, "seed", 5),
        ({"learner": "trajectory-lp", "l1": 0.5}, "l1", 0.5),
        ({"learner": "trajectory-lp", "seed": 5}, "seed", 5),
        ({"learner": "trajectory-lp", "rounds": 3}, "max_rounds", 3),
        ({"learner": "trajectory-lp"}, "max_rounds", 30),
        ({"learner": "trajectory-lp", "env_id": "CartPole-v1"}, "max_rounds", 8),
        ({"learner": "trajectory-lp", "bins": (9,), **CAR}, "max_rounds", 30),
    ],
)
def test_an_argument_reaches_the_learner(arguments, field, expected):
    assert getattr(learner(**arguments), field) == expected


@pytest.mark.parametrize(
    ("name", "kind"), [("finite-lp", FiniteLP), ("feature-lp", FeatureLP), ("trajectory-lp", TrajectoryLP)]
)
def test_a_learner_is_chosen_by_name(name, kind):
    assert type(learner(learner=name)) is kind


@pytest.mark.parametrize("name", ["feature-lp", "trajectory-lp"])
@pytest.mark.parametrize(
    ("arguments", "kind", "count"),
    [
        ({}, OneHot, 16),
        ({"env_kwargs": ("map_name=8x8",)}, OneHot, 64),
        ({"features": "radial", "size": 3}, RadialBasis, 9),
        ({"features": "fourier", "size": 3}, Fourier, 16),
        ({"features": "polynomial", "size": 3}, Polynomial, 10),
        ({"coordinates": (2, 8), "size": 2}, RadialBasis, 4),
    ],
)
def test_features_are_chosen_by_name(name, arguments, kind, count):
    phi = learner(learner=name, **arguments).phi
    assert type(phi) is kind and phi.n_features == count


def test_coordinates_unravel_integers():
    assert learner(learner="feature-lp", env_id="Taxi-v4", coordinates=(5, 5, 5, 4)).phi.coordinates == Unravel((5, 5, 5, 4))


# --- environments that are stepped ---


@pytest.mark.parametrize("role", ["expert", "inner", "retrain"])
def test_ppo_suits_classic_control_when_there_is_no_table(role):
    one = asked(env_id="CartPole-v1", learner="trajectory-lp", **{role: "ppo"})
    assert getattr(one, role) == FOR_CONTROL


def test_ppo_suits_advantages_when_there_are_bins():
    one = asked(learner="trajectory-lp", bins=(9,), **CAR)
    assert one.retrain == SB3(hyperparameters=FOR_ADVANTAGES)


# --- datasets ---


@pytest.fixture
def dataset(tmp_path):
    env = gym.make("FrozenLake-v1", map_name="8x8")
    one = Episode(np.array([0, 1]), np.array([2]), np.zeros(1), False, True)
    write_minari([one], "some/lake-v0", env, root=tmp_path, algorithm="x")
    return {"dataset": "some/lake-v0", "dataset_root": str(tmp_path)}


@pytest.mark.parametrize("name", ["feature-lp", "trajectory-lp"])
def test_a_dataset_names_its_environment(dataset, name):
    one = asked(learner=name, **dataset)
    assert (one.env_id, one.dataset, one.dataset_root) == (None, *dataset.values()) and one.learner.phi.n_features == 64


def test_a_dataset_is_refused_by_the_finite_lp(dataset):
    with pytest.raises(InvalidParameter, match="Use FeatureLP or TrajectoryLP"):
        asked(**dataset)


def test_a_dataset_that_is_missing_is_refused_with_those_that_are_there(dataset):
    with pytest.raises(DatasetMissing, match="There are some/lake-v0"):
        asked(learner="feature-lp", **(dataset | {"dataset": "other-v0"}))


# --- refusals ---


@pytest.mark.parametrize(
    ("arguments", "error", "match"),
    [
        ({"learner": "feature-lp", "env_id": "CartPole-v1", "features": "one-hot"}, InvalidFeatures, "choose radial"),
        (
            {"learner": "feature-lp", "env_id": "Taxi-v4", "features": "radial"},
            InvalidFeatures,
            "coordinates are None.*5 5 5 4",
        ),
        ({"learner": "feature-lp", "l1": "auto"}, InvalidParameter, "l1 is 'auto'"),
        ({"learner": "trajectory-lp", "rounds": 0}, InvalidParameter, "max_rounds is 0"),
        ({"learner": "trajectory-lp", "features": "radial", "size": 0}, InvalidFeatures, "at least one centre"),
        ({"learner": "feature-lp", "sample": 0}, InvalidParameter, "S_0 is 0"),
        ({"total_timesteps": 0}, InvalidParameter, "total_timesteps is 0"),
        ({"env_kwargs": ("8x8",)}, InvalidParameter, "env-kwargs"),
        ({"samples": -1}, InvalidParameter, "samples is -1"),
    ],
)
def test_a_mistake_is_refused(arguments, error, match, unchecked):
    with pytest.raises(error, match=match):
        asked(**arguments)
