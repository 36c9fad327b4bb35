"""Arguments of environments, as text."""

import numpy as np
import pytest

from irl_gym.errors import InvalidDiscount, InvalidParameter
from irl_gym.experiment import Experiment, parse_keywords


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
    ],
)
def test_parse_keywords_reads(parts, expected):
    assert parse_keywords(parts) == expected


@pytest.mark.parametrize("part", ["8x8", "=1", "a b=1", "{1}"])
def test_parse_keywords_refuses(part):
    with pytest.raises(InvalidParameter, match="expected"):
        parse_keywords((part,))


def test_experiments_that_differ_have_names_that_differ():
    assert lake(seed=0).name != lake(seed=1).name


def test_an_experiments_name_does_not_change():
    assert Experiment("a:b/C-v0", 0.9).name == Experiment("a:b/C-v0", 0.9).name


@pytest.mark.parametrize("seed", [-1, 2**32])
def test_a_seed_that_sb3_does_not_take_is_refused(seed):
    with pytest.raises(InvalidParameter, match=f"seed is {seed}"):
        lake(seed=seed)


def test_a_discount_outside_the_interval_is_refused():
    with pytest.raises(InvalidDiscount, match="gamma is 1"):
        Experiment("FrozenLake-v1", 1.0)


@pytest.mark.parametrize("wrong", [{"episodes": 1.5}, {"seed": 0.5}, {"num_envs": 2.5}, {"eval_episodes": True}])
def test_counts_that_are_not_whole_are_refused(wrong, unchecked):
    with pytest.raises(InvalidParameter, match="a whole number"):
        lake(**wrong)


def test_numpys_numbers_name_the_same_experiment(unchecked):
    assert lake(seed=np.int64(3), episodes=np.int32(7)).name == lake(seed=3, episodes=7).name
