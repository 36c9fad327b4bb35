"""Each argument of the command line reaches the experiment that it stands for."""

import hashlib
from dataclasses import fields, is_dataclass

import gymnasium as gym
import numpy as np
import pytest

from irl_gym.agents.planners import FOR_ADVANTAGES, FOR_CONTROL, SB3, ValueIteration
from irl_gym.commands.arguments import Arguments
from irl_gym.demonstrations.datasets import write_minari
from irl_gym.errors import DatasetMissing, InvalidFeatures, InvalidParameter
from irl_gym.features.bases import Fourier, Polynomial, RadialBasis
from irl_gym.features.feature_maps import OneHot, Unravel
from irl_gym.learners.linear_programs.feature import FeatureLP
from irl_gym.learners.linear_programs.finite import FiniteLP
from irl_gym.learners.linear_programs.trajectory import TrajectoryLP
from irl_gym.mdp.episodes import Episode
from irl_gym.tables.counted.counting import Interaction
from irl_gym.tables.enumeration.table import Enumeration

CAR = {"env_id": "MountainCar-v0"}


def asked(**arguments):
    """The experiment of arguments without their groups."""
    groups = {field.name: field.type for field in fields(Arguments) if is_dataclass(field.type)}
    grouped = {
        name: group(**{one.name: arguments.pop(one.name) for one in fields(group) if one.name in arguments})
        for name, group in groups.items()
    }
    return Arguments(**grouped, **arguments).experiment()


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
        ({"learner": "trajectory-lp", "inner": "value-iteration"}, "inner", ValueIteration()),
        ({"learner": "trajectory-lp", "inner": "a2c"}, "inner", SB3("A2C")),
        ({"shaping": False}, "shaping", False),
        ({"retrain": "value-iteration"}, "retrain", ValueIteration()),
        ({"retrain": "ppo"}, "retrain", SB3(hyperparameters=FOR_ADVANTAGES)),
        ({"retrain": "ppo", "shaping": False}, "retrain", SB3()),
        ({"warm_start": "clone"}, "warm_start", "clone"),
        ({"retrain": "ppo", "total_timesteps": 99}, "retrain", SB3("PPO", 99, FOR_ADVANTAGES)),
        ({"seed": 5}, "seed", 5),
        ({}, "start_seeds", ()),
        ({"start_seeds": (0, 7)}, "start_seeds", (0, 7)),
        ({}, "reveal", "known"),
        ({"reveal": ("none",)}, "reveal", {}),
        ({"reveal": ()}, "reveal", {}),
        ({"reveal": ("step_count=100", "key=2")}, "reveal", {"step_count": 100, "key": 2}),
        ({}, "table", None),
        ({"table": "enumerate"}, "table", Enumeration()),
        ({"table": "sample", "seed": 5}, "table", Interaction(seed=5)),
        ({"table": "sample", "steps": 99}, "table", Interaction(99)),
        ({"max_states": 9}, "table", Enumeration(known=True, max_states=9)),
        ({"table": "enumerate", "max_states": 9}, "table", Enumeration(max_states=9)),
        ({}, "epsilon", 0.0),
        ({"epsilon": 0.1}, "epsilon", 0.1),
    ],
)
def test_an_argument_reaches_the_experiment(arguments, field, expected):
    assert getattr(asked(**arguments), field) == expected


LIMITED = ("finite-lp", "feature-lp", "trajectory-lp", "softmax-clone", "neural-clone", "dagger")


@pytest.mark.parametrize(
    ("arguments", "field", "expected"),
    [
        ({"l1": 0.5}, "l1", 0.5),
        ({"l1": "auto", "margin_cap": "none"}, "l1", "auto"),
        ({"margin_cap": 0.1}, "margin_cap", 0.1),
        ({"margin_cap": "auto"}, "margin_cap", "auto"),
        ({"margin_cap": "none"}, "margin_cap", None),
        ({"reward_on": "state-action"}, "reward_on", "state-action"),
        ({"horizon": 8}, "horizon", 8),
        ({}, "slack", None),
        ({"epsilon": 0.1}, "slack", 1.0),
        ({"epsilon": 0.1, "slack": "none"}, "slack", None),
        ({"epsilon": 0.1, "reward_on": "state-action"}, "slack", None),
        ({"slack": 2.5}, "slack", 2.5),
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
        *[({"learner": one, "time_limit": 9.0}, "time_limit", 9.0) for one in LIMITED],
    ],
)
def test_an_argument_reaches_the_learner(arguments, field, expected):
    assert getattr(learner(**arguments), field) == expected


@pytest.mark.parametrize(
    ("name", "options", "told"),
    [("clone", (), "unexpected keyword argument 'time_limit'"),
     ("dagger", ("time_limit=3",), r"time_limit is 9, and 3 among options: expected it once\. Leave one out\.")],
)  # fmt: skip
def test_a_time_limit_is_given_once_and_to_who_has_one(name, options, told):
    with pytest.raises(InvalidParameter, match=told):
        learner(learner=name, time_limit=9.0, options=options)
    assert getattr(learner(learner=name, options=options), "time_limit", None) == (3 if options else None)


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


@pytest.mark.parametrize("file", ["expert.npz", "agent.zip", "without_suffix"])
def test_an_expert_may_be_a_file(tmp_path, file):
    (tmp_path / file).write_bytes(b"anything")
    one = asked(expert=str(tmp_path / file)).expert
    assert one.path == str(tmp_path / file) and one.sha256 == hashlib.sha256(b"anything").hexdigest()


def test_an_experts_file_is_known_by_its_content(tmp_path):
    (tmp_path / "agent.zip").write_bytes(b"one")
    first = asked(expert=str(tmp_path / "agent.zip"))
    (tmp_path / "agent.zip").write_bytes(b"two")
    assert asked(expert=str(tmp_path / "agent.zip")).name != first.name


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


@pytest.mark.parametrize(
    ("arguments", "slack"),
    [({}, 1.0), ({"slack": "none"}, None), ({"slack": 3.0}, 3.0), ({"reward_on": "state-action"}, None)],
)
def test_the_finite_lp_learns_from_a_dataset_with_slack_for_errors(dataset, arguments, slack):
    one = asked(**dataset, **arguments)
    assert (one.env_id, one.dataset, one.learner.slack) == (None, dataset["dataset"], slack)


def test_a_dataset_that_is_missing_is_refused_with_those_that_are_there(dataset):
    with pytest.raises(DatasetMissing, match="Name one of these: some/lake-v0"):
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
        ({"expert": "pppo"}, InvalidParameter, "expert is 'pppo': expected one of value-iteration, ppo, dqn, a2c, or a file"),
        ({"expert": "gone.npz"}, InvalidParameter, "'gone.npz', which is no file"),
        ({"expert": "."}, InvalidParameter, "'.', which is no file"),
        ({"reveal": ("key",)}, InvalidParameter, "reveal has 'key': expected name=number"),
        ({"reveal": ("key=two",)}, InvalidParameter, "reveal has 'key=two'"),
        ({"reveal": ("key=-2",)}, InvalidParameter, "reveal has 'key=-2'"),
        ({"reveal": (f"key={'9' * 5_000}",)}, InvalidParameter, "reveal has 'key=9999"),  # more digits than Python reads
        ({"reveal": ("key=[{[]: 0}]",)}, InvalidParameter, "reveal has 'key="),
        ({"reveal": ("key=[0, key]",)}, InvalidParameter, r"reveal has 'key=\[0, key\]'"),
        ({"reveal": ("known", "key=2")}, InvalidParameter, "reveal has 'known'"),
        ({"start_seeds": (-1,), "learner": "feature-lp"}, InvalidParameter, "-1"),
        ({"epsilon": 1.5}, InvalidParameter, "epsilon is 1.5"),
        ({"slack": 0.5}, InvalidParameter, "slack is 0.5: expected a price of at least 1"),
        ({"slack": 1.0, "reward_on": "state-action"}, InvalidParameter, "slack is 1.0: expected None"),
        ({"table": "sample", "steps": 0}, InvalidParameter, "steps is 0"),
        ({"steps": 9}, InvalidParameter, "steps is 9, but table is 'auto'"),
        ({"table": "enumerate", "steps": 9}, InvalidParameter, "expected --table sample"),
        ({"table": "sample", "max_states": 9}, InvalidParameter, "expected --steps"),
        ({"max_states": 0}, InvalidParameter, "max_states is 0"),
        ({"table": "sample", "bins": (9,), **CAR}, InvalidParameter, "Leave one out"),
        ({"dataset": "some/lake-v0", "epsilon": 0.1}, InvalidParameter, "Leave expert and epsilon out"),
        ({"dataset": "some/lake-v0", "expert": "ppo"}, InvalidParameter, "Leave expert and epsilon out"),
    ],
)
def test_a_mistake_is_refused(arguments, error, match, unchecked):
    with pytest.raises(error, match=match):
        asked(**arguments)
