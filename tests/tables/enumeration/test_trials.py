"""Steps whose draws cannot be enumerated are counted: how well, how often, and always the same."""

import random

import gymnasium as gym
import numpy as np
import pytest
from enumeration_envs import RAND, Corridor, Slippery, same_table
from gymnasium import spaces

from irl_gym.errors import NotTabular
from irl_gym.tables.copies.snapshots import ConstantChanged
from irl_gym.tables.enumeration.limits import Limits
from irl_gym.tables.enumeration.outside import shared_mark
from irl_gym.tables.enumeration.table import Enumeration
from irl_gym.tables.enumeration.trials import Trials

pytestmark = pytest.mark.usefixtures("unchecked")

COUNTED = ("imported from np.random", "imported from random", "normal", "many outcomes", "mixed")
EXACT = ("generator", "random state", "random.Random", "module np.random", "module random")


def table_of(env, **limits):
    return Enumeration(**{"runs": 200, "start_runs": 200} | limits).table(env, 0.9)


def furthest(table):
    """The largest error of a probability of a slippery corridor."""
    truth = np.zeros((7, 2, 7))
    for cell in range(6):
        for action in (0, 1):
            for slips, p in ((0, 0.8), (1, 0.2)):
                truth[cell, action, max(0, cell + 2 * (action ^ slips) - 1)] += p
    return np.abs(table.mdp.P.toarray().reshape(7, 2, 7) - truth).max()


@pytest.mark.parametrize("kind", EXACT)
def test_a_generator_of_the_environments_own_is_enumerated(kind):
    table = table_of(Slippery(kind))
    assert table.evidence.exact and table.evidence.error == 0 and furthest(table) < 1e-15


@pytest.mark.parametrize("kind", COUNTED)
def test_what_cannot_be_enumerated_is_counted_within_the_error_that_is_told(kind):
    table = table_of(Slippery(kind))
    assert not table.evidence.exact and 0 < furthest(table) <= table.evidence.error < 0.2


@pytest.mark.parametrize("kind", COUNTED)
def test_counts_are_the_same_again(kind):
    assert same_table(table_of(Slippery(kind)), table_of(Slippery(kind)))


def test_counts_differ_with_another_seed():
    assert not same_table(table_of(Slippery("normal")), table_of(Slippery("normal"), seed=1))


def test_more_runs_are_nearer_the_truth():
    few, many = table_of(Slippery("normal"), runs=50), table_of(Slippery("normal"), runs=2000)
    assert many.evidence.error < few.evidence.error and furthest(many) < few.evidence.error / 3


def test_the_error_is_that_of_what_was_run_least():
    """300 runs of a step tell less than 10,000 of a reset, and 10 of a reset less than 300 of a step."""

    class Start(Slippery):
        def reset(self, *, seed=None, options=None):
            super().reset(seed=seed)
            self.cell = 1 + int(self.np_random.normal() > 0)
            return self.cell, {}

    errors = [table_of(Start("normal"), runs=300, start_runs=starts).evidence.error for starts in (10, 300, 10_000)]
    assert errors[0] > 5 * errors[1] and errors[1] == pytest.approx(errors[2], rel=0.05)


def test_counting_leaves_the_generators_that_all_share_as_they_were():
    np.random.seed(3)  # noqa: NPY002
    before = np.random.get_state()[1].tolist(), random.getstate()  # noqa: NPY002
    table_of(Slippery("imported from random"))
    assert (np.random.get_state()[1].tolist(), random.getstate()) == before  # noqa: NPY002


class RarelySlips(Corridor):
    """Draws outside its own generator, and once in fifty steps it matters."""

    def step(self, action):
        return self.moved(1 - int(action) if RAND() < 0.02 else int(action))


def test_a_draw_from_outside_that_rarely_matters_is_noticed():
    np.random.seed(0)  # noqa: NPY002
    assert not table_of(RarelySlips()).evidence.exact


def test_many_outcomes_are_enumerated_when_that_is_allowed():
    table = table_of(Slippery("many outcomes", n=3), most_outcomes=25_000, revisits=0)
    assert table.evidence.exact and table.mdp.P[[2]].toarray()[0] == pytest.approx([0.8, 0, 0.2], abs=1e-12)


class NoisyPay(Corridor):
    """Where a step leads is certain, what it pays is not; and it counts its steps, harmlessly."""

    steps = 0

    def step(self, action):
        self.steps += 1
        observation, _, done, truncated, info = self.moved(int(action))
        return observation, float(self.np_random.normal(2.0)), done, truncated, info


def test_a_reward_that_is_counted_is_no_hidden_state_and_not_exact():
    table = table_of(NoisyPay(), runs=400)
    assert not table.evidence.exact and abs(table.reward.values[:-1] - 2).max() < 5 / np.sqrt(400)


class Rational(Corridor):
    """Jumps to a cell that a permutation draws, and pays by a choice."""

    def step(self, action):
        self.cell = int(self.np_random.permutation(3)[0])
        return self.cell, float(self.np_random.choice([0, 1, 5], p=[0.5, 0.25, 0.25])), False, False, {}


def test_several_draws_of_one_step_are_enumerated_together():
    table = table_of(Rational())
    row = table.mdp.P[[0]].toarray()[0]
    assert row[:3] == pytest.approx([1 / 3] * 3) and np.allclose(table.reward.values, 1.5)


class Raises(Corridor):
    def step(self, action):
        if self.cell == 1:
            raise RuntimeError("the floor is gone")
        return self.moved(int(action))


def test_an_error_of_the_environment_is_told_as_its_own():
    with pytest.raises(NotTabular, match=r"raised RuntimeError \(the floor is gone\): expected .* to work"):
        table_of(Raises())


class OldStep(Corridor):
    """Returns four values, as before Gymnasium."""

    def step(self, action):
        return self.moved(int(action))[:4]


def test_a_step_of_another_make_is_told():
    with pytest.raises(NotTabular, match=r"raised ValueError .*unpack"):
        table_of(OldStep())


class NewGenerator(Corridor):
    def step(self, action):
        self.np_random = np.random.default_rng(3)
        return self.moved(int(action) ^ int(self.np_random.integers(2)))


def test_a_generator_that_is_made_anew_is_refused():
    with pytest.raises(NotTabular, match="made a new Generator while it ran"):
        table_of(NewGenerator())


def test_the_outcomes_of_a_call_are_the_same_when_they_are_made_again():
    env = Slippery("generator")
    env.reset(seed=0)
    trials = Trials(env, Enumeration(), frozenset(), counting=False)
    call = trials.step(trials.fresh, 1)
    for one in trials.outcomes(call, 0, lambda _: None, runs=1).all:
        assert trials.again(call, 0, one.script) == one.result


class Picture(gym.Env):
    """A picture too large for a short print of it, whose middle changes by chance from outside."""

    observation_space, action_space = spaces.Box(0, 1, (64, 64), np.uint8), spaces.Discrete(1)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        return np.zeros((64, 64), np.uint8), {}

    def step(self, action):
        picture = np.zeros((64, 64), np.uint8)
        picture[32, 32] = RAND() < 0.5
        return picture, 0.0, False, False, {}


def test_a_difference_inside_a_large_observation_is_noticed():
    np.random.seed(0)  # noqa: NPY002
    table = table_of(Picture())
    assert not table.evidence.exact and table.mdp.n_states == 2


class RareLeaf(Corridor):
    """Past thirty cells, one draw comes from outside its own generator."""

    def __init__(self):
        super().__init__(60)

    def step(self, action):
        if self.cell == 3 and action:
            return self.moved(int(RAND() < 0.5))
        return self.moved(int(action))


def test_a_draw_from_outside_in_one_rare_leaf_is_noticed():
    np.random.seed(0)  # noqa: NPY002
    table = table_of(RareLeaf())
    assert not table.evidence.exact and table.mdp.P[[3 * 2 + 1]].toarray()[0, 2] == pytest.approx(0.5, abs=0.15)


class Draws(Corridor):
    """Draws from outside in every step, harmlessly."""

    def step(self, action):
        RAND()
        return self.moved(int(action))


def test_a_table_is_not_exact_where_draws_from_outside_have_not_mattered_yet():
    evidence = table_of(Draws()).evidence
    assert not evidence.exact and evidence.method.startswith("The environment draws from the module numpy.random, which is not")
    assert "every outcome of its draws" not in evidence.method


def test_counted_steps_that_were_not_compared_are_told():
    class Ages(Slippery):
        age = 0

        def step(self, action):
            self.age += 1
            return super().step(action)

    assert "Hidden state was not looked for in counted steps." in table_of(Ages("normal")).evidence.method
    assert "Hidden" not in table_of(Ages("generator")).evidence.method


class Truncates(Corridor):
    def step(self, action):
        *most, _, info = self.moved(int(action))
        return *most, self.cell == 0, info


def test_a_truncation_of_the_environments_own_is_told():
    method = table_of(Truncates()).evidence.method
    assert "The environment truncated steps itself; truncation is not part of a table." in method
    assert "truncat" not in table_of(Corridor()).evidence.method


@pytest.mark.parametrize(
    "draw",
    [random.random, lambda: random.gauss(0, 1), np.random.rand, lambda: np.random.randint(3), lambda: np.random.rand(624)],  # noqa: NPY002
    ids=["random", "gauss", "rand", "randint", "as many as there are words"],
)
def test_a_draw_from_the_shared_generators_is_seen_in_their_mark(draw):
    for _ in range(700):
        before = shared_mark()
        assert shared_mark() == before
        draw()
        assert shared_mark() != before


class Lamp(Corridor):
    """Lights a lamp in a large list, once it is told to."""

    def __init__(self):
        super().__init__(4)
        self.lamps, self.told = [0, *range(600)], False

    def step(self, action):
        self.lamps[0] = int(self.told)
        return self.moved(int(action))


def test_a_step_that_changes_what_was_held_to_be_constant_is_noticed_at_once():
    env = Lamp()
    env.reset(seed=0)
    trials = Trials(env, Limits(), frozenset(), counting=False)
    trials.seeded([0], lambda: trials.move(1))
    env.told = True
    with pytest.raises(ConstantChanged, match="lamps"):
        trials.seeded([0], lambda: trials.move(1))
