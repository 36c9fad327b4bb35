"""Whatever is given as an argument, only errors of ours come out."""

import warnings

import hypothesis.strategies as st
import pytest
from fuzz.arguments import call, texts
from hypothesis import HealthCheck, given, settings

from irl_gym.errors import IrlGymError

SMALL, MANY = 300, 5_000
NUMBERS = st.integers(0, 10**6)


def fuzz(function, inputs):
    @settings(max_examples=inputs, suppress_health_check=list(HealthCheck))
    @given(NUMBERS, NUMBERS, NUMBERS)
    def read(which, key, value):
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                function(*(which, key, value)[: function.__code__.co_argcount])
        except IrlGymError:
            pass

    read()


@pytest.mark.parametrize("function", [call, texts])
def test_an_argument_that_cannot_be_right_is_refused_by_an_error_of_ours(function, unchecked):
    fuzz(function, SMALL)


@pytest.mark.slow
@pytest.mark.parametrize("function", [call, texts])
def test_many_arguments_that_cannot_be_right_are_refused_by_errors_of_ours(function, unchecked):
    fuzz(function, MANY)
