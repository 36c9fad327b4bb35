"""What errors say in the same words everywhere: what a value is, and what was probably meant."""

import numpy as np
import pytest

from irl_gym.errors import a_type, did_you_mean, with_article


@pytest.mark.parametrize(
    ("value", "told"),
    [(3, "an int"), ([], "a list"), (np.zeros(1), "an ndarray"), (np.uint8(1), "a uint8"), (None, "None"), ({}, "a dict")],
)
def test_what_a_value_is_is_told_as_it_is_spoken(value, told):
    assert a_type(value) == told


@pytest.mark.parametrize(
    ("name", "article"),
    [("Outcome", "an"), ("Episode", "an"), ("TabularMDP", "a"), ("MDPView", "an"), ("FeatureLP", "a"), ("SB3", "an"),
     ("PPO", "a"), ("A2C", "an"), ("OneHot", "a"), ("UserDict", "a"), ("UnicodeError", "a"), ("UninitializedError", "an"),
     ("UnknownLearner", "an"), ("URLError", "a"), ("numpy.ndarray", "a"), ("io.BytesIO", "an")],
)  # fmt: skip
def test_a_type_has_the_article_of_its_sound(name, article):
    assert with_article(name) == f"{article} {name}"


def test_the_closest_name_is_asked_for_and_none_where_none_is_close():
    assert did_you_mean("finte-lp", ["finite-lp", "clone"]) == " Did you mean 'finite-lp'?" and did_you_mean("x", ["y"]) == ""
