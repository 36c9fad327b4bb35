"""The search through a call's outcomes, its limits, seeded runs, and whole environments."""

import copy
import pickle
import random

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces
from hypothesis import given
from hypothesis import strategies as st

from irl_gym.errors import InvalidParameter, NotEnumerable
from irl_gym.tables.draws.exact_draws import Draws


@pytest.fixture
def draws():
    return Draws()


@pytest.fixture
def rng(draws):
    return draws.twin(np.random.default_rng())


def test_call_without_draws_has_one_outcome(draws):
    assert list(draws.outcomes(lambda: "done")) == [(1.0, (), "done")]


def test_draws_with_one_outcome_are_not_in_the_script(draws, rng):
    assert list(draws.outcomes(lambda: (rng.integers(1), rng.integers(2)))) == [(0.5, (0,), (0, 0)), (0.5, (1,), (0, 1))]


def test_second_draw_happens_only_where_the_first_hits(draws, rng):
    found = list(draws.outcomes(lambda: rng.choice(["hit", "miss"], p=[0.25, 0.75]) == "hit" and int(rng.integers(2))))
    assert found == [(0.125, (0, 0), 0), (0.125, (0, 1), 1), (0.75, (1,), False)]


def test_draws_of_all_kinds_of_generators_are_of_one_tree(draws, rng):
    state, python = draws.twin(np.random.RandomState()), draws.twin(random.Random())
    found = list(draws.outcomes(lambda: (rng.random() < 0.5, state.rand() < 0.5, python.random() < 0.5)))
    assert [probability for probability, _, _ in found] == [0.125] * 8
    assert len({result for _, _, result in found}) == 8


def test_two_searches_may_take_turns(draws, rng):
    def run():
        return int(rng.integers(3))

    assert [(a[2], b[2]) for a, b in zip(draws.outcomes(run), draws.outcomes(run), strict=True)] == [(0, 0), (1, 1), (2, 2)]


def test_search_goes_on_inside_a_call(draws, rng):
    def count_and_draw():
        return len(list(draws.outcomes(lambda: rng.integers(3)))), int(rng.integers(2))

    assert [result for _, _, result in draws.outcomes(count_and_draw)] == [(3, 0), (3, 1)]


def test_loop_that_may_never_end_is_followed_until_it_is_all_but_impossible(draws, rng):
    def tosses():
        count = 1
        while rng.random() < 0.5:
            count += 1
        return count

    found = {count: probability for probability, _, count in draws.outcomes(tosses)}
    assert [found[k] for k in range(1, 40)] == [0.5**k for k in range(1, 40)]
    assert sum(found.values()) == pytest.approx(1, abs=1e-12)


def test_rare_outcomes_are_kept_where_they_matter_together(draws, rng):
    found = [p for p, _, _ in draws.outcomes(lambda: rng.random() < 1e-11 and rng.integers(500))]
    assert len(found) == 501 and sum(found) == pytest.approx(1, abs=1e-15)


def test_outcomes_too_rare_to_follow_are_refused_where_they_matter_together(draws, rng):
    with pytest.raises(NotEnumerable, match=r"too rare to follow have probability 1e-11 together"):
        list(draws.outcomes(lambda: rng.random() < 1e-11 and (rng.integers(500), rng.integers(100))))


def test_script_replays_its_outcome(draws, rng):
    def run():
        return int(rng.integers(3)), rng.random() < 0.3, rng.choice([1, 2, 2])

    for _, script, result in list(draws.outcomes(run)):
        assert draws.replay(script, run) == result


@pytest.mark.parametrize("script", [(), (0,), (0, 0, 0), (2, 0), (-1, 0)])
def test_script_of_another_call_is_refused(draws, rng, script):
    with pytest.raises(NotEnumerable, match="does not follow the script"):
        draws.replay(script, lambda: (rng.integers(2), rng.integers(2)))


def test_seeded_run_gives_the_numbers_of_numpy(draws, rng):
    def run(generator):
        return generator.normal(), generator.random(), generator.integers(100), generator.bit_generator.state

    assert draws.seeded([1, 2], lambda: run(rng)) == run(np.random.default_rng([1, 2]))


@pytest.mark.parametrize("real", [np.random.RandomState(), random.Random()], ids=["RandomState", "Random"])
def test_seeded_run_is_reproduced(draws, real):
    twin = draws.twin(real)
    first, second, third = (draws.seeded(seed, lambda: (twin.random(), twin.uniform(2, 3))) for seed in (7, 7, 8))
    assert first == second != third


def test_search_goes_on_after_a_seeded_run(draws, rng):
    draws.seeded(0, rng.normal)
    assert len(list(draws.outcomes(lambda: rng.integers(3)))) == 3


@pytest.mark.parametrize("name", ["integers", "normal", "random"])
def test_draw_outside_a_call_is_refused(rng, name):
    with pytest.raises(NotEnumerable, match=rf"{name}\(\) was drawn from a stand-in generator outside the calls"):
        getattr(rng, name)(3)


def test_draw_after_an_error_of_the_call_is_refused(draws, rng):
    with pytest.raises(ZeroDivisionError):
        list(draws.outcomes(lambda: 1 / 0))
    with pytest.raises(NotEnumerable, match="outside the calls"):
        rng.integers(3)


def test_more_outcomes_than_the_limit_are_refused():
    draws = Draws(most=7)
    rng = draws.twin(np.random.default_rng())
    with pytest.raises(NotEnumerable, match=r"the draws of one call, random\(\), integers\(\), have more than 7 outcomes"):
        list(draws.outcomes(lambda: (rng.random() < 0.5, rng.integers(4))))


def test_as_many_outcomes_as_the_limit_are_listed():
    draws = Draws(most=8)
    rng = draws.twin(np.random.default_rng())
    assert len(list(draws.outcomes(lambda: (rng.random() < 0.5, rng.integers(4))))) == 8


@pytest.mark.parametrize("most", [0, 2.5, None])
def test_limit_that_is_no_count_is_refused(most, unchecked):
    with pytest.raises(InvalidParameter, match=f"most is {most}: expected a whole number of at least 1"):
        Draws(most)


HIDDEN = {
    "fewer outcomes": lambda rng, time: rng.integers(4 - time),
    "more outcomes": lambda rng, time: rng.integers(2 + time),
    "other probabilities": lambda rng, time: rng.random() < 0.5 + time / 10,
    "another method": lambda rng, time: rng.integers(2) if time % 2 else rng.choice(2),
    "fewer draws": lambda rng, time: time or rng.integers(2),
}


@pytest.mark.parametrize("name", HIDDEN)
def test_call_with_a_clock_in_it_is_refused(draws, rng, name):
    clock = iter(range(10))
    with pytest.raises(NotEnumerable, match=r"draw 1 of a call differs when it is repeated, .*Something else changes"):
        list(draws.outcomes(lambda: HIDDEN[name](rng, next(clock))))


@pytest.mark.parametrize(
    "real",
    [np.random.default_rng(), np.random.RandomState(), random.Random(), random.SystemRandom()],
    ids=lambda real: type(real).__name__,
)
def test_twin_is_a_subclass_and_its_own_copy_and_twin(draws, real):
    twin = draws.twin(real)
    base = random.Random if isinstance(real, random.Random) else type(real)
    assert isinstance(twin, base)
    assert twin is draws.twin(real) is draws.twin(twin) is copy.copy(twin) is copy.deepcopy({"rng": twin})["rng"]


def test_twin_does_not_pickle(rng):
    with pytest.raises(NotEnumerable, match="a DrivenGenerator was pickled"):
        pickle.dumps(rng)


class OwnGenerator(np.random.Generator):
    """Somebody's, whose methods may be anything."""


@pytest.mark.parametrize(
    "other", [None, 3, np.random, OwnGenerator(np.random.PCG64())], ids=["None", "3", "module", "subclass"]
)
def test_what_is_no_known_generator_has_no_twin(draws, other):
    assert draws.twin(other) is None


@st.composite
def programs(draw, depth=4):
    """A tree: what is drawn at a node, and a program for each outcome."""
    if depth == 0:
        return None
    kind = draw(st.sampled_from(["integers", "choice", "compare", "deck", "none"]))
    if kind == "none":
        return None
    p = draw(st.floats(0, 1))
    return kind, p, [draw(programs(depth - 1)) for _ in range(2)]


def execute(program, rng):
    """The path through a program, as text."""
    if program is None:
        return ""
    kind, p, branches = program
    taken = {
        "integers": lambda: rng.integers(2),
        "choice": lambda: rng.choice(2, p=[p, 1 - p]),
        "compare": lambda: rng.random() < p,
        "deck": lambda: rng.choice([0, 1, 1]),
    }[kind]()
    return f"{int(taken)}{execute(branches[int(taken)], rng)}"


@given(programs())
def test_probabilities_sum_to_one(program):
    draws = Draws()
    rng = draws.twin(np.random.default_rng())
    found = list(draws.outcomes(lambda: execute(program, rng)))
    assert sum(probability for probability, _, _ in found) == pytest.approx(1, abs=1e-12)
    assert len({result for _, _, result in found}) == len(found)
    assert all(draws.replay(script, lambda: execute(program, rng)) == result for _, script, result in found)


def outcomes_of(env, draws, call):
    """Added probabilities of what a call on an environment returns, which has the stand-in as its generator."""
    env._np_random = draws.twin(env.np_random)
    found = {}
    for probability, _, result in draws.outcomes(call):
        found[result] = found.get(result, 0) + probability
    return found


@pytest.mark.parametrize(
    ("env_id", "kwargs"),
    [
        ("FrozenLake-v1", {}),
        ("FrozenLake-v1", {"success_rate": 0.8}),
        ("CliffWalkingSlippery-v1", {}),
        ("Taxi-v4", {"is_rainy": True}),
    ],
)
def test_step_has_the_published_probabilities(draws, env_id, kwargs):
    env = gym.make(env_id, **kwargs).unwrapped
    for s in range(0, env.observation_space.n, max(env.observation_space.n // 30, 1)):
        for a in range(env.action_space.n):
            published = {}
            for probability, successor, reward, terminated in env.P[s][a]:
                key = int(successor), float(reward), bool(terminated)
                published[key] = published.get(key, 0) + probability

            def step(s=s, a=a):
                env.s, env.fickle_step = s, False
                observation, reward, terminated, _, _ = env.step(a)
                return int(observation), float(reward), bool(terminated)

            found = outcomes_of(env, draws, step)
            assert found.keys() == {key for key, probability in published.items() if probability}
            assert max(abs(found[key] - published[key]) for key in found) <= 1e-15


@pytest.mark.parametrize("env_id", ["Taxi-v4", "FrozenLake-v1"])
def test_reset_has_the_published_start(draws, env_id):
    env = gym.make(env_id).unwrapped
    found = outcomes_of(env, draws, lambda: int(env.reset()[0]))
    start = np.zeros(env.observation_space.n)
    start[list(found)] = list(found.values())
    np.testing.assert_allclose(start, env.initial_state_distrib, rtol=0, atol=1e-15)


def test_blackjack_card_is_a_ten_in_4_of_13(draws):
    env = gym.make("Blackjack-v1").unwrapped
    env.reset(seed=0)

    def hit():
        env.player, env.dealer = [10, 1], [5, 5]
        return env.step(1)[0][0]

    found = outcomes_of(env, draws, hit)
    assert found[21] == pytest.approx(4 / 13, abs=1e-15)


SPACES = [(spaces.Discrete(3, start=2), 3), (spaces.MultiDiscrete([2, 3]), 6), (spaces.MultiBinary(3), 8)]


@pytest.mark.parametrize(("space", "elements"), SPACES, ids=str)
def test_sample_of_a_space_has_every_element_once(draws, space, elements):
    space._np_random = draws.twin(np.random.default_rng())
    found = list(draws.outcomes(lambda: str(space.sample())))
    assert len(found) == len({result for _, _, result in found}) == elements
