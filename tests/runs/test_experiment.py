"""What a run is asked to do: its checks, its json, and arguments of environments as text."""

import json

import numpy as np
import pytest

from irl_gym.agents.planners import SB3, ValueIteration
from irl_gym.commands.arguments import parse_reveal
from irl_gym.errors import InvalidDiscount, InvalidParameter
from irl_gym.features.bases import Fourier, RadialBasis
from irl_gym.features.feature_maps import Functions, OneHot, Table, Unravel
from irl_gym.learners.linear_programs.feature import FeatureLP
from irl_gym.learners.linear_programs.finite import FiniteLP
from irl_gym.learners.linear_programs.trajectory import TrajectoryLP
from irl_gym.runs.choices import parse_keywords
from irl_gym.runs.experiment import MOST_LISTED, Experiment
from irl_gym.tables.counted.counting import Counting, Interaction
from irl_gym.tables.enumeration.table import Enumeration


def lake(**kwargs):
    return Experiment("FrozenLake-v1", 0.99, **kwargs)


@pytest.mark.parametrize(
    ("parts", "expected"),
    [
        ((), {}),
        (("map_name=8x8", "is_slippery=false", "slip=0.2"), {"map_name": "8x8", "is_slippery": False, "slip": 0.2}),
        (('{"size": [3, 4]}',), {"size": [3, 4]}),
        (('desc=["SF", "FG"]',), {"desc": ["SF", "FG"]}),
        (("name=a=b",), {"name": "a=b"}),
        (("cap=Infinity", "low=-Infinity", "far=1e999"), {"cap": np.inf, "low": -np.inf, "far": np.inf}),
    ],
)
def test_parse_keywords_reads(parts, expected):
    assert parse_keywords(parts) == expected


@pytest.mark.parametrize("part", ["8x8", "=1", "a b=1", "{1}"])
def test_parse_keywords_refuses(part):
    with pytest.raises(InvalidParameter, match="expected"):
        parse_keywords((part,))


@pytest.mark.parametrize("read", [parse_keywords, parse_reveal])
def test_a_name_that_is_given_twice_is_refused_with_both_values(read):
    with pytest.raises(InvalidParameter, match=r"has 'a=2' after a=1: expected each name once\. Leave one out\."):
        read(("a=1", "a=2"))


def test_experiments_that_differ_have_names_that_differ():
    assert lake(seed=0).name != lake(seed=1).name


def test_an_experiments_name_does_not_change():
    assert Experiment("a:b/C-v0", 0.9).name == Experiment("a:b/C-v0", 0.9).name


@pytest.mark.parametrize("seed", [-1, 2**32])
def test_a_seed_that_sb3_does_not_take_is_refused(seed):
    with pytest.raises(InvalidParameter, match=f"seed is {seed}"):
        lake(seed=seed)


def test_a_discount_outside_the_interval_is_refused():
    with pytest.raises(InvalidDiscount, match=r"gamma is 1.* such as 0\.99\.$"):
        Experiment("FrozenLake-v1", 1.0)


@pytest.mark.parametrize("wrong", [{"episodes": 1.5}, {"seed": 0.5}, {"num_envs": 2.5}, {"eval_episodes": True}])
def test_counts_that_are_not_whole_are_refused(wrong, unchecked):
    with pytest.raises(InvalidParameter, match="a whole number"):
        lake(**wrong)


def test_numpys_numbers_name_the_same_experiment(unchecked):
    assert lake(seed=np.int64(3), episodes=np.int32(7)).name == lake(seed=3, episodes=7).name


def test_neither_environment_nor_dataset_is_refused():
    with pytest.raises(InvalidParameter, match="env_id and dataset are None"):
        Experiment(None, 0.99)


@pytest.mark.parametrize(("asked", "expected"), [({}, False), ({"epsilon": 0.1}, True), ({"dataset": "some/data-v0"}, True)])
def test_learners_see_episodes_only_when_the_expert_errs_or_is_a_dataset(asked, expected):
    assert lake(**asked).from_episodes == expected


@pytest.mark.parametrize(
    ("wrong", "match"),
    [
        ({"epsilon": 1.1}, "epsilon is 1.1: expected a probability"),
        ({"epsilon": -0.1}, "epsilon is -0.1"),
        ({"dataset": "some/data-v0", "epsilon": 0.1}, "epsilon 0.1: expected the episodes as they are"),
        ({"dataset": "some/data-v0", "expert": ValueIteration()}, "Leave expert and epsilon out"),
        ({"env_id": None, "dataset": "some/data-v0", "start_seeds": (0,)}, "start_seeds is .*Name env_id"),
        ({"env_id": None, "dataset": "some/data-v0", "reveal": {"a": 2}}, "reveal {'a': 2}.*Name env_id"),
        ({"table": Interaction(), "bins": 5}, "bins 5.*Leave one out"),
        ({"table": "sample"}, r"table is 'sample'.*Interaction\(\.\.\.\)"),
    ],
)
def test_an_experiment_that_contradicts_itself_is_refused(wrong, match, unchecked):
    with pytest.raises(InvalidParameter, match=match):
        Experiment(**{"env_id": "FrozenLake-v1", "gamma": 0.99, **wrong})


def test_a_dataset_names_the_run_when_no_environment_does():
    asked = Experiment(None, 0.99, dataset="some/data-v0", learner=TrajectoryLP(OneHot(4)))
    assert asked.name.startswith("some-data-v0-")


def test_negative_samples_are_refused():
    with pytest.raises(InvalidParameter, match="samples is -1"):
        lake(samples=-1)


RADIAL = RadialBasis.grid([0, 0], [1, 1], 20)


@pytest.mark.parametrize(
    "asked",
    [
        {"learner": FeatureLP(OneHot(16), S_0=[1, 2], margin_cap="auto")},
        {"learner": TrajectoryLP(RADIAL), "inner": SB3(hyperparameters={"n_steps": 8})},
        {"learner": TrajectoryLP(np.zeros((16, 9))), "bins": (3, 4), "samples": 2},
        {"learner": FeatureLP(Functions(np.atleast_2d, 2))},
        {"learner": FiniteLP(slack=2.0), "table": Enumeration(max_states=9), "start_seeds": (0, 1), "reveal": {"a": 2}},
        {"learner": FiniteLP(), "table": Interaction(77, Counting(prior=0.5)), "epsilon": 0.2},
    ],
)
def test_every_experiment_is_json(asked):
    told = json.loads(json.dumps(lake(**asked).to_json()))
    assert told["learner"]["type"] == type(asked["learner"]).__name__ and told["gamma"] == 0.99


def test_json_tells_the_features_and_their_numbers():
    told = lake(learner=FeatureLP(Fourier([0, 0], [7, 7], 3, Unravel((8, 8))))).to_json()["learner"]["features"]
    assert (told["type"], told["order"], told["coordinates"]["shape"]) == ("Fourier", 3, [8, 8])


def test_json_tells_large_arrays_by_their_digest():
    told = lake(learner=FeatureLP(RADIAL)).to_json()["learner"]["features"]["centres"]
    assert told["array"] == [400, 2] and len(told["sha256"]) == 16


def test_names_differ_when_large_features_do():
    large = np.zeros((MOST_LISTED, 2))
    other = large.copy()
    other[-1, -1] = 1
    assert lake(learner=FeatureLP(Table(large))).name != lake(learner=FeatureLP(Table(other))).name


@pytest.mark.parametrize(
    "other",
    [{"start_seeds": (0,)}, {"reveal": {}}, {"table": Interaction()}, {"table": Enumeration()}, {"epsilon": 0.1},
     {"expert": ValueIteration()}],
)  # fmt: skip
def test_names_differ_when_anything_else_does(other):
    assert lake(**other).name != lake().name


def test_names_differ_when_the_learner_does():
    names = {lake(learner=one).name for one in (FeatureLP(OneHot(16)), TrajectoryLP(OneHot(16)), FiniteLP())}
    assert len(names) == 3


def test_a_number_beyond_floats_is_refused_in_words():
    with pytest.raises(InvalidParameter, match=r"^episodes is 10{400}: expected"):
        Experiment("FrozenLake-v1", 0.9, episodes=10**400)
