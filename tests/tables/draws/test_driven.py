"""The distribution of each driven method: against its closed form, and against real draws of the same call."""

import itertools
import random
import re
from collections import Counter

import numpy as np
import pytest
from scipy.stats import chi2

from irl_gym.errors import NotEnumerable
from irl_gym.tables.draws.exact_draws import Draws

REAL = {
    "generator": lambda: np.random.default_rng(1),
    "state": lambda: np.random.RandomState(1),
    "random": lambda: random.Random(1),
}
BITS = list(itertools.product((0, 1), repeat=2))
PAIRS = list(itertools.permutations(range(3), 2))
DECK = [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 10, 10, 10]


def plain(value):
    """A result that can be counted: nested tuples of Python's numbers."""
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    return tuple(plain(part) for part in value) if isinstance(value, list | tuple) else value


def shuffled(generator, items):
    generator.shuffle(items)
    return items


def equally(outcomes):
    outcomes = list(outcomes)
    return dict.fromkeys(outcomes, 1 / len(outcomes))


def table(kind, call, most=20_000):
    """Probabilities of what a call returns."""
    draws = Draws(most)
    twin = draws.twin(REAL[kind]())
    found = Counter()
    for probability, _, result in draws.outcomes(lambda: call(twin)):
        found[plain(result)] += probability
    return dict(found)


def assert_table(found, expected):
    assert found.keys() == expected.keys()
    assert max(abs(found[key] - expected[key]) for key in expected) <= 1e-15


CLOSED_FORMS = {
    "integers": ("generator", lambda g: g.integers(3), {0: 1 / 3, 1: 1 / 3, 2: 1 / 3}),
    "integers from low": ("generator", lambda g: g.integers(-1, 1), {-1: 0.5, 0: 0.5}),
    "integers with endpoint": ("generator", lambda g: g.integers(4, 5, endpoint=True), {4: 0.5, 5: 0.5}),
    "integers, a float": ("generator", lambda g: g.integers(2.0), {0: 0.5, 1: 0.5}),
    "integers of arrays": ("generator", lambda g: g.integers([1, 2]), {(0, 0): 0.5, (0, 1): 0.5}),
    "integers, bits": ("generator", lambda g: g.integers(0, 2, size=2, dtype=np.int8), equally(BITS)),
    "randint of a state": ("state", lambda g: g.randint(1, 3), {1: 0.5, 2: 0.5}),
    "choice of a number": ("generator", lambda g: g.choice(2), {0: 0.5, 1: 0.5}),
    "choice of a deck": ("generator", lambda g: g.choice(DECK), {**dict.fromkeys(range(1, 10), 1 / 13), 10: 4 / 13}),
    "choice of words": ("generator", lambda g: g.choice(("a", "bc")), {"a": 0.5, "bc": 0.5}),
    "choice of rows": ("generator", lambda g: g.choice([(0, 1), (2, 3), (0, 1), (0, 1)]), {(0, 1): 0.75, (2, 3): 0.25}),
    "choice of columns": ("generator", lambda g: g.choice(np.array([[1, 2], [3, 4]]), axis=1), {(1, 3): 0.5, (2, 4): 0.5}),
    "choice of objects": ("generator", lambda g: g.choice(np.array(["y", "x", "y", "y"], object)), {"y": 0.75, "x": 0.25}),
    "choice with p": ("generator", lambda g: g.choice(3, p=[0.2, 0.3, 0.5]), {0: 0.2, 1: 0.3, 2: 0.5}),
    "choice with p and equals": ("generator", lambda g: g.choice([7, 8, 7], p=[0.25, 0.5, 0.25]), {7: 0.5, 8: 0.5}),
    "choice with an impossible one": ("generator", lambda g: g.choice(3, p=[0.5, 0.0, 0.5]), {0: 0.5, 2: 0.5}),
    "choice of two": ("generator", lambda g: g.choice([0, 1], size=2), equally(BITS)),
    "choice of two apart": ("generator", lambda g: g.choice(3, 2, replace=False), equally(PAIRS)),
    "choice of two apart with p": (
        "generator", lambda g: g.choice(3, 2, replace=False, p=[0.5, 0.25, 0.25]),
        {(0, 1): 1 / 4, (0, 2): 1 / 4, (1, 0): 1 / 6, (1, 2): 1 / 12, (2, 0): 1 / 6, (2, 1): 1 / 12},
    ),
    "choice of none": ("generator", lambda g: g.choice(3, size=0), {(): 1.0}),
    "permutation": ("generator", lambda g: g.permutation(3), equally(itertools.permutations(range(3)))),
    "permutation with equals": ("state", lambda g: g.permutation([5, 6, 5]), equally([(5, 5, 6), (5, 6, 5), (6, 5, 5)])),
    "permuted": ("generator", lambda g: g.permuted([[1, 2]]), {((1, 2),): 0.5, ((2, 1),): 0.5}),
    "shuffle": ("generator", lambda g: shuffled(g, [0, 0, 0, 1]), equally(plain(np.eye(4)))),
    "shuffle of an array": ("state", lambda g: shuffled(g, np.arange(2)), {(0, 1): 0.5, (1, 0): 0.5}),
    "binomial": ("generator", lambda g: g.binomial(3, 0.25), {0: 27 / 64, 1: 27 / 64, 2: 9 / 64, 3: 1 / 64}),
    "hypergeometric": ("state", lambda g: g.hypergeometric(3, 2, 2), {0: 0.1, 1: 0.6, 2: 0.3}),
    "multinomial": ("generator", lambda g: g.multinomial(1, [0.25, 0.75]), {(1, 0): 0.25, (0, 1): 0.75}),
    "random.randint": ("random", lambda g: g.randint(1, 2), {1: 0.5, 2: 0.5}),
    "random.randrange": ("random", lambda g: g.randrange(0, 6, 3), {0: 0.5, 3: 0.5}),
    "random.getrandbits": ("random", lambda g: g.getrandbits(1), {0: 0.5, 1: 0.5}),
    "random.choice": ("random", lambda g: g.choice(DECK), {**dict.fromkeys(range(1, 10), 1 / 13), 10: 4 / 13}),
    "random.choice of a word": ("random", lambda g: g.choice("aab"), {"a": 2 / 3, "b": 1 / 3}),
    "random.choices": ("random", lambda g: g.choices("ab", weights=[1, 3]), {("a",): 0.25, ("b",): 0.75}),
    "random.choices cumulated": ("random", lambda g: g.choices("ab", cum_weights=[1, 4]), {("a",): 0.25, ("b",): 0.75}),
    "random.sample": ("random", lambda g: g.sample(range(3), 2), equally(PAIRS)),
    "random.sample with counts": ("random", lambda g: g.sample("ab", 1, counts=[2, 1]), {("a",): 2 / 3, ("b",): 1 / 3}),
    "random.shuffle": ("random", lambda g: shuffled(g, [1, 2]), {(1, 2): 0.5, (2, 1): 0.5}),
    "random.uniform": ("random", lambda g: g.uniform(-1, 3) < 0, {True: 0.25, False: 0.75}),
    "random.random": ("random", lambda g: g.random() < 0.3, {True: 0.3, False: 0.7}),
}  # fmt: skip


@pytest.mark.parametrize("name", CLOSED_FORMS)
def test_method_has_the_distribution_of_its_closed_form(name):
    kind, call, expected = CLOSED_FORMS[name]
    assert_table(table(kind, call), expected)


@pytest.mark.parametrize("name", CLOSED_FORMS)
def test_method_returns_the_type_that_the_real_one_returns(name):
    kind, call, _ = CLOSED_FORMS[name]
    draws, real = Draws(), call(REAL[kind]())
    twin = draws.twin(REAL[kind]())
    _, _, found = next(draws.outcomes(lambda: call(twin)))
    if isinstance(real, np.ndarray):
        assert (found.shape, found.dtype) == (real.shape, real.dtype)
    else:
        assert type(found) is type(real)


@pytest.mark.parametrize("dtype", [np.int64, int, bool, np.int8])
def test_integers_returns_the_type_that_was_asked_for(dtype):
    draws = Draws()
    twin = draws.twin(np.random.default_rng())
    real = np.random.default_rng().integers(2, dtype=dtype)
    assert {type(result) for _, _, result in draws.outcomes(lambda: twin.integers(2, dtype=dtype))} == {type(real)}


SAMPLED = {
    "choice of 4 of a deck apart": ("generator", lambda g: sorted(g.choice(DECK, 3, replace=False).tolist())),
    "choice apart with p": ("generator", lambda g: g.choice(4, 2, replace=False, p=[0.1, 0.2, 0.3, 0.4])),
    "choice of a state apart": ("state", lambda g: g.choice(4, 2, replace=False, p=[0.1, 0.2, 0.3, 0.4])),
    "multinomial": ("generator", lambda g: g.multinomial(4, [0.2, 0.3, 0.5])),
    "binomial of a state": ("state", lambda g: g.binomial(6, 0.3)),
    "permuted": ("generator", lambda g: g.permuted([1, 1, 2, 3])),
    "two scales of one number": ("generator", lambda g: (lambda u: (int(u * 4), bool(u < 0.6), round(u, 1)))(g.random())),
    "numbers of an array": ("state", lambda g: g.rand(3) < np.array([0.2, 0.5, 0.9])),
    "sample with counts": ("random", lambda g: g.sample("abc", 3, counts=[2, 1, 4])),
    "choices": ("random", lambda g: g.choices("abc", weights=[2, 1, 4], k=2)),
    "triangular steps": ("random", lambda g: sum(g.randrange(k + 1) for k in range(4))),
}  # fmt: skip


@pytest.mark.parametrize("name", SAMPLED)
def test_method_agrees_with_20000_real_draws(name):
    kind, call = SAMPLED[name]
    expected, real = table(kind, call), REAL[kind]()
    seen = Counter(plain(call(real)) for _ in range(20_000))
    assert seen.keys() <= expected.keys()
    often = [key for key, probability in expected.items() if probability * 20_000 >= 5]
    statistic = sum((seen[key] - 20_000 * expected[key]) ** 2 / (20_000 * expected[key]) for key in often)
    assert chi2.sf(statistic, len(often) - 1) > 1e-4


def test_choice_keeps_elements_apart_that_may_be_changed():
    first, second = [0], [0]
    draws = Draws()
    twin = draws.twin(random.Random())
    chosen = [result for _, _, result in draws.outcomes(lambda: twin.choice([first, second]))]
    assert [item is first for item in chosen] == [True, False]


def test_choice_keeps_equal_elements_of_two_types_apart():
    assert len(list((draws := Draws()).outcomes(lambda: draws.twin(random.Random()).choice([1, True, 1.0])))) == 3


WRONG = {
    "an empty range": ("generator", lambda g: g.integers(0)),
    "a number out of the type's range": ("generator", lambda g: g.integers(300, dtype=np.int8)),
    "a choice of nothing": ("generator", lambda g: g.choice([])),
    "probabilities that do not sum to 1": ("generator", lambda g: g.choice(2, p=[0.5, 0.4])),
    "a negative probability": ("generator", lambda g: g.choice(2, p=[1.5, -0.5])),
    "more than there are": ("generator", lambda g: g.choice(2, size=3, replace=False)),
    "rows for a state": ("state", lambda g: g.choice([[1, 2]])),
    "random.choice of nothing": ("random", lambda g: g.choice([])),
    "random.randrange of nothing": ("random", lambda g: g.randrange(3, 3)),
    "random.sample of a set": ("random", lambda g: g.sample({1, 2}, 1)),
    "random.choices with both weights": ("random", lambda g: g.choices("ab", [1, 2], cum_weights=[1, 3])),
}  # fmt: skip


@pytest.mark.parametrize("name", WRONG)
def test_method_raises_the_error_of_the_real_one(name):
    kind, call = WRONG[name]
    with pytest.raises((ValueError, TypeError, IndexError)) as real:
        call(REAL[kind]())
    with pytest.raises(real.type, match="^" + re.escape(str(real.value)) + "$"):
        table(kind, call)


NOT_DRIVEN = {
    "out": ("generator", lambda g: g.random(out=np.empty(1))),
    "float32": ("generator", lambda g: g.random(dtype=np.float32)),
    "an order that is not shuffled": ("generator", lambda g: g.choice(5, 2, replace=False, shuffle=False)),
    "permuted along an axis": ("generator", lambda g: g.permuted(np.eye(2), axis=1)),
    "half a number": ("generator", lambda g: g.integers(2.5)),
    "many multinomials": ("generator", lambda g: g.multinomial(2, [0.5, 0.5], size=2)),
    "a large binomial": ("generator", lambda g: g.binomial(5000, 0.5)),
}  # fmt: skip


@pytest.mark.parametrize("name", NOT_DRIVEN)
def test_arguments_that_are_right_and_not_driven_are_refused(name):
    with pytest.raises(NotEnumerable, match=r"is asked for .* which is not driven here"):
        table(*NOT_DRIVEN[name])


PUBLIC = [
    (kind, name)
    for kind, base in (("generator", np.random.Generator), ("state", np.random.RandomState), ("random", random.Random))
    for name in dir(base)
    if not name.startswith("_") and name != "VERSION"
]
DRIVEN = {
    "generator": "binomial choice hypergeometric integers multinomial permutation permuted random shuffle uniform",
    "state": "binomial choice hypergeometric multinomial permutation rand randint random random_sample shuffle uniform",
    "random": "choice choices getrandbits randint random randrange sample shuffle uniform",
}  # fmt: skip


NORMAL = {"normal", "standard_normal", "randn", "gauss", "normalvariate"}


@pytest.mark.parametrize(("kind", "name"), [pair for pair in PUBLIC if pair[1] in NORMAL])
def test_a_normal_number_can_be_multiplied_by_zero_and_is_refused_where_it_is_used(kind, name):
    draws = Draws()
    generator = draws.twin(REAL[kind]())
    assert [paid for _, _, paid in draws.outcomes(lambda: 2.0 + 0 * getattr(generator, name)())] == [2.0]
    for use in (lambda x: x < 0, float, round, abs, lambda x: np.array([0.0]) < x):
        with pytest.raises(NotEnumerable, match=rf"a number of {name}\(\) is used"):
            list(draws.outcomes(lambda use=use: use(getattr(generator, name)())))


@pytest.mark.parametrize(("kind", "name"), [("generator", "normal"), ("state", "normal"), ("random", "gauss")])
def test_a_normal_number_that_does_not_deviate_is_its_mean(kind, name):
    draws = Draws()
    generator = draws.twin(REAL[kind]())
    assert [drawn for _, _, drawn in draws.outcomes(lambda: getattr(generator, name)(3.0, 0.0))] == [3.0]


OTHERS = [pair for pair in PUBLIC if pair[1] not in DRIVEN[pair[0]].split() and pair[1] not in NORMAL]


@pytest.mark.parametrize(("kind", "name"), OTHERS)
def test_every_other_method_is_refused_by_name(kind, name):
    def call(generator):
        found = getattr(generator, name)
        return found() if callable(found) else found

    with pytest.raises(NotEnumerable, match=rf"\.{name}\(\) has outcomes that cannot be listed one by one: expected integers"):
        table(kind, call)


@pytest.mark.parametrize(
    ("kind", "call", "message"),
    [
        ("generator", lambda g: g.integers(2_000_000), r"integers\(\) has 2,000,000 outcomes: expected at most 20,000"),
        ("generator", lambda g: g.integers(0, 2, size=100), r"integers\(\) has more than 10\*\*12 outcomes"),
        ("generator", lambda g: g.permutation(8), r"permutation\(\) has 40,320 outcomes"),
        ("state", lambda g: g.shuffle(list(range(52))), r"shuffle\(\) has more than 10\*\*12 outcomes"),
        ("random", lambda g: g.getrandbits(100_000), r"getrandbits\(\) has more than 10\*\*12 outcomes"),
        ("random", lambda g: g.choices("ab", k=20), r"choices\(\) has 1,048,576 outcomes"),
    ],
)
def test_method_with_too_many_outcomes_is_refused_before_it_is_tried(kind, call, message):
    with pytest.raises(NotEnumerable, match=message):
        table(kind, call)
