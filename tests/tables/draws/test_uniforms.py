"""Uniform numbers: every answer that they give, with its probability, and the uses that need the number itself."""

import bisect
import copy
import math
import pickle
from collections import Counter
from fractions import Fraction

import numpy as np
import pytest
from gymnasium.envs.toy_text.utils import categorical_sample
from scipy.stats import chi2

from irl_gym.errors import NotEnumerable
from irl_gym.tables.draws.exact_draws import Draws


def table(use, most=20_000):
    """Probabilities of what a use of one uniform number gives."""
    draws = Draws(most)
    generator = draws.twin(np.random.default_rng())
    found = Counter()
    for probability, _, result in draws.outcomes(lambda: use(generator.random())):
        found[tuple(result.tolist()) if isinstance(result, np.ndarray) else result] += probability
    return dict(found)


LESS = {True: 0.25, False: 0.75}
QUARTERS = dict.fromkeys(range(4), 0.25)
SPLITS = {
    "less": (lambda u: u < 0.25, LESS),
    "at most": (lambda u: u <= 0.25, LESS),
    "greater": (lambda u: 0.25 > u, LESS),
    "at least": (lambda u: 0.25 >= u, LESS),
    "not greater": (lambda u: not u > 0.25, LESS),
    "not at least": (lambda u: not u >= 0.25, LESS),
    "a whole number": (lambda u: u < 1, {True: 1.0}),
    "a fraction": (lambda u: u < Fraction(1, 4), LESS),
    "a NumPy number": (lambda u: bool(u < np.float64(0.25)), LESS),
    "a NumPy number first": (lambda u: bool(np.float64(0.25) > u), LESS),
    "a 32-bit number first": (lambda u: bool(np.float32(0.25) > u), LESS),
    "an array of no dimension": (lambda u: bool(np.array(0.25) > u), LESS),
    "zero": (lambda u: (u < 0, u <= 0, u > 0, u >= 0), {(False, False, True, True): 1.0}),
    "one": (lambda u: (u < 1, u <= 1, u > 1, u >= 1), {(True, True, False, False): 1.0}),
    "infinity": (lambda u: (u < math.inf, u > -math.inf, u > math.inf), {(True, True, False): 1.0}),
    "not a number": (lambda u: (u < math.nan, u > math.nan, u == math.nan), {(False, False, False): 1.0}),
    "equality": (lambda u: (u == 0.5, u != 0.5, u == "u"), {(False, True, False): 1.0}),
    "itself": (lambda u: (u == u, u <= u, u < u, u >= u, u > u), {(True, True, False, True, False): 1.0}),
    "its own image": (lambda u: u < 1 - u, {True: 0.5, False: 0.5}),
    "truth": (lambda u: bool(u), {True: 1.0}),
    "between": (lambda u: 0.25 < u < 0.75, {True: 0.5, False: 0.5}),
    "twice the same": (lambda u: (u < 0.25, u < 0.25), {(True, True): 0.25, (False, False): 0.75}),
    "narrower": (lambda u: (u < 0.75, u < 0.25), {(True, True): 0.25, (True, False): 0.5, (False, False): 0.25}),
    "an array": (lambda u: u < np.array([0.5, 0.25]), {(True, True): 0.25, (True, False): 0.25, (False, False): 0.5}),
    "an array first": (lambda u: np.array([0.5, 0.25]) <= u, {(False, False): 0.25, (False, True): 0.25, (True, True): 0.5}),
    "an array of integers": (lambda u: np.array([0, 1]) > u, {(False, True): 1.0}),
    "an array and minus": (lambda u: -u > np.array([-0.5, -1]), {(True, True): 0.5, (False, True): 0.5}),
    "an array and a ufunc": (lambda u: np.greater(u, np.array([0.25])), {(True,): 0.75, (False,): 0.25}),
    "a moved array": (lambda u: u + np.array([0.0, 0.5]) < 0.5, {(True, False): 0.5, (False, False): 0.5}),
    "twice, minus one": (lambda u: u * 2 - 1 > 0.5, LESS),
    "one minus": (lambda u: 1 - u < 0.25, LESS),
    "halved": (lambda u: u / 2 < 0.125, LESS),
    "a NumPy factor": (lambda u: np.float64(2) * u < 0.5, LESS),
    "times nothing": (lambda u: u * 0 + 3, {3.0: 1.0}),
    "minus itself": (lambda u: 2 * u - u - u, {0.0: 1.0}),
    "int": (lambda u: int(u * 4), QUARTERS),
    "int about zero": (lambda u: int(4 * u - 2), {-1: 0.25, 0: 0.5, 1: 0.25}),
    "floor": (lambda u: math.floor(4 * u - 2), {k - 2: 0.25 for k in range(4)}),
    "NumPy's floor": (lambda u: int(np.floor(u * 4)), QUARTERS),
    "NumPy's rint": (lambda u: int(np.rint(u * 2)), {0: 0.25, 1: 0.5, 2: 0.25}),
    "ceil": (lambda u: math.ceil(4 * u), {k + 1: 0.25 for k in range(4)}),
    "trunc": (lambda u: math.trunc(-4 * u), {-k: 0.25 for k in range(4)}),
    "round": (lambda u: round(u * 2), {0: 0.25, 1: 0.5, 2: 0.25}),
    "round to tens": (lambda u: round(u * 20, -1), {0.0: 0.25, 10.0: 0.5, 20.0: 0.25}),
    "divided and floored": (lambda u: u // 0.25, {float(k): 0.25 for k in range(4)}),
    "remainder": (lambda u: (u * 4) % 1 < 0.25, LESS),
    "divmod": (lambda u: (divmod(u * 2, 1)[0], divmod(u * 2, 1)[1] < 1), {(0.0, True): 0.5, (1.0, True): 0.5}),
    "absolute": (lambda u: abs(2 * u - 1) < 0.25, LESS),
    "least": (lambda u: min(u, 0.25) == 0.25, {True: 0.75, False: 0.25}),
    "largest of NumPy": (lambda u: bool(np.maximum(u, 0.25) > 0.25), {True: 0.75, False: 0.25}),
    "searchsorted": (lambda u: int(np.searchsorted([0.25, 0.5, 0.75], u)), QUARTERS),
    "digitize": (lambda u: int(np.digitize(u, [0.25, 0.5, 0.75])), QUARTERS),
    "bisect": (lambda u: bisect.bisect([0.25, 0.5, 0.75], u), QUARTERS),
    "copied": (lambda u: (u < 0.25, copy.deepcopy(u) < 0.25), {(True, True): 0.25, (False, False): 0.75}),
}  # fmt: skip


@pytest.mark.parametrize("name", SPLITS)
def test_uniform_number_splits_as_the_real_one_does(name):
    use, expected = SPLITS[name]
    found = table(use)
    assert found.keys() == expected.keys()
    assert max(abs(found[key] - expected[key]) for key in expected) <= 1e-15


@pytest.mark.parametrize("name", SPLITS)
def test_uniform_number_agrees_with_4000_real_numbers(name):
    use, expected = SPLITS[name]
    rng = np.random.default_rng(3)
    seen = Counter()
    for _ in range(4000):
        result = use(rng.random())
        seen[tuple(result.tolist()) if isinstance(result, np.ndarray) else result] += 1
    assert seen.keys() == expected.keys()
    statistic = sum((seen[key] - 4000 * expected[key]) ** 2 / (4000 * expected[key]) for key in expected)
    assert len(expected) == 1 or chi2.sf(statistic, len(expected) - 1) > 1e-4


@pytest.mark.parametrize(
    "p", [[1 / 3] * 3, [0.1] * 10, [0.7, 0.1, 0.1, 0.1], [0.0, 0.2, 0.0, 0.8, 0.0], [1 / 7] * 7, [1.0]], ids=str
)
def test_categorical_sample_of_toy_text_has_the_given_probabilities(p):
    draws = Draws()
    generator = draws.twin(np.random.default_rng())
    found = np.zeros(len(p))
    for probability, _, result in draws.outcomes(lambda: categorical_sample(p, generator)):
        found[result] += probability
    np.testing.assert_allclose(found, p, rtol=0, atol=1e-15)


def test_rounding_at_the_end_of_a_cumulated_sum_is_no_outcome():
    below = math.nextafter(1.0, 0.0)
    assert table(lambda u: u < below) == {True: 1.0}


def test_numbers_of_an_array_are_independent():
    draws = Draws()
    generator = draws.twin(np.random.default_rng())
    found = {tuple(hits): p for p, _, hits in draws.outcomes(lambda: generator.random(2) < np.array([0.25, 0.5]))}
    assert found == {(True, True): 0.125, (True, False): 0.125, (False, True): 0.375, (False, False): 0.375}


def test_numbers_of_an_array_round_as_multi_discrete_spaces_do():
    draws = Draws()
    generator = draws.twin(np.random.default_rng())
    rounded = [tuple(r) for _, _, r in draws.outcomes(lambda: (generator.random(2) * [2, 3]).astype(np.int64))]
    assert rounded == [(a, b) for a in range(2) for b in range(3)]


AS_SUCH = {
    "float": lambda u: float(u),
    "math.sqrt": lambda u: math.sqrt(u),
    "np.sqrt": lambda u: np.sqrt(u),
    "np.float64": lambda u: np.float64(u),
    "np.exp": lambda u: np.exp(u),
    "a power": lambda u: u**2,
    "an inverse": lambda u: 1 / u,
    "an array's element": lambda u: np.zeros(2).__setitem__(0, u),
    "an array in place": lambda u: np.zeros(2).__iadd__(u),
    "a set": lambda u: {u},
    "text": lambda u: f"{u:.2f}",
    "str": lambda u: str(u),
    "pickle": lambda u: pickle.dumps(u),
    "interpolation": lambda u: np.interp(u, [0, 1], [0, 1]),
    "times itself": lambda u: u * u,
    "infinitely often": lambda u: u * math.inf,
}


@pytest.mark.parametrize("name", AS_SUCH)
def test_use_of_the_number_itself_is_refused(name):
    with pytest.raises(NotEnumerable, match=r"a uniform number of random\(\) is"):
        table(AS_SUCH[name])


def test_refusal_is_raised_even_where_the_environment_catches_it():
    def use(u):
        try:
            return float(u)
        except Exception:
            return 0.5

    with pytest.raises(NotEnumerable, match="is used as such, by __float__"):
        table(use)


def test_refusal_is_raised_where_the_environment_makes_another_error_of_it():
    def use(u):
        try:
            return float(u)
        except NotEnumerable as error:
            raise KeyError from error

    with pytest.raises(NotEnumerable, match="is used as such, by __float__"):
        table(use)


def test_two_uniform_numbers_cannot_be_compared():
    draws = Draws()
    generator = draws.twin(np.random.default_rng())
    with pytest.raises(NotEnumerable, match="is compared with another uniform number"):
        list(draws.outcomes(lambda: generator.random() < generator.random()))


def test_two_uniform_numbers_compare_where_their_intervals_lie_apart():
    draws = Draws()
    generator = draws.twin(np.random.default_rng())
    pairs = draws.outcomes(
        lambda: (generator.uniform(0, 1) < generator.uniform(1, 2), generator.random() - 2 >= generator.random())
    )
    assert [result for _, _, result in pairs] == [(True, False)]


def test_two_uniform_numbers_cannot_be_added():
    with pytest.raises(NotEnumerable, match="is added to another uniform number"):
        list((draws := Draws()).outcomes(lambda: draws.twin(np.random.default_rng()).random(2).sum()))


def test_rounding_to_too_many_numbers_is_refused():
    with pytest.raises(NotEnumerable, match=r"is rounded to one of 1,000,000: expected at most 20,000 outcomes"):
        table(lambda u: int(u * 1e6))


def test_number_that_outlives_its_run_is_refused():
    kept = []

    def use(u):
        kept.append(u)
        return kept[0] < 0.5

    with pytest.raises(NotEnumerable, match="is used after the call that drew it"):
        table(use)


def test_comparison_with_what_is_no_number_is_a_type_error():
    with pytest.raises(TypeError, match="not supported between instances"):
        table(lambda u: u < "a")
