"""Arguments of environments, as text."""

import pytest

from irl_gym.errors import InvalidParameter
from irl_gym.experiment import Experiment, parse_keywords


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
    assert Experiment(seed=0).name != Experiment(seed=1).name


def test_an_experiments_name_does_not_change():
    assert Experiment(env_id="a:b/C-v0").name == Experiment(env_id="a:b/C-v0").name
