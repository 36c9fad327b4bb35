"""Repeated visits within an episode tell whether observations hide state that lasts."""

import gymnasium as gym
import numpy as np
import pytest
from counted import counted, episode
from gymnasium import spaces
from windy_env import Calm, PaidByMood, Windy

from irl_gym.tables.counted.counting import Counting, Interaction, interact
from irl_gym.tables.repeats import FOUND, Repeats
from irl_gym.tables.table_files import load_table, save_table

pytestmark = pytest.mark.usefixtures("unchecked")


def repeats(env, steps, seed=0):
    return Counting().table(interact(env, steps, seed=seed), env.observation_space, int(env.action_space.n), gamma=0.9)


def found(env, steps, seed=0):
    return repeats(env, steps, seed).evidence.repeats


@pytest.mark.parametrize("seed", range(12))
def test_a_number_drawn_at_reset_that_decides_what_follows_is_found(seed):
    evidence = repeats(Windy(), 20_000, seed).evidence
    assert evidence.repeats.hidden and evidence.repeats.of == "successors"
    assert (evidence.error, evidence.reward_error, evidence.value_error) == (None, None, None)
    assert "hidden state             found" in str(evidence) and "not bounded" in str(evidence) and "Reveal" in str(evidence)


@pytest.mark.parametrize("seed", range(12))
def test_a_number_drawn_at_reset_that_decides_what_is_paid_is_found(seed):
    told = found(PaidByMood(), 20_000, seed)
    assert told.hidden and told.of == "rewards" and "rewards are alike" in str(told)


def test_the_pair_that_tells_most_is_named():
    table = repeats(Windy(), 20_000)
    assert table.states.decode(table.evidence.repeats.row // 2) == 3


class Wanders(gym.Env):
    """Any Markov environment of this make: branches, ends, traps, and rewards of a kind."""

    action_space = spaces.Discrete(3)

    def __init__(self, seed, pays):
        rng = np.random.default_rng(seed)
        self.n, self.pays, self.ends = int(rng.integers(2, 40)), pays, rng.choice([0.01, 0.1, 0.4])
        self.observation_space = spaces.Discrete(self.n)
        self.P = rng.dirichlet(np.full(self.n, rng.choice([0.02, 0.1, 1.0])), (self.n, 3))

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.s = int(self.np_random.integers(self.n))
        return self.s, {}

    def step(self, action):
        self.s = int(self.np_random.choice(self.n, p=self.P[self.s, action]))
        return self.s, float(self.pays(self.np_random)), bool(self.np_random.random() < self.ends), False, {}


PAYS = {
    "a coin": lambda rng: rng.random() < 0.5,
    "rarely": lambda rng: rng.random() < 0.01,
    "normal, far from 0": lambda rng: 1e3 + rng.normal(),
    "heavy": lambda rng: rng.standard_exponential() ** 4,
}


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("pays", PAYS)
def test_no_alarm_where_nothing_is_hidden(pays, seed):
    told = found(Wanders(seed, PAYS[pays]), 1_500, seed)
    assert told.p_value > 100 * FOUND


def test_no_alarm_where_the_wind_is_drawn_at_every_step():
    assert min(found(Calm(), 3_000, seed).p_value for seed in range(5)) > 0.05


def test_what_few_visits_repeat_is_not_called_hidden():
    """One episode of one kind, one of the other: two coins that fell alike."""
    told = counted([episode([0, 1, 0, 1, 0], [0] * 4, terminated=False), episode([0, 2, 0, 2, 0], [0] * 4, terminated=False)])
    assert not told.table.evidence.repeats.hidden


def test_repeats_are_counted_where_both_halves_of_the_episodes_know_the_pair():
    walks = [episode([0, 0, 0, 1], [0] * 3), episode([0, 0, 0, 0, 1], [0] * 4), episode([0, 2, 2, 1], [0] * 3)]
    told = counted(walks).table.evidence.repeats
    assert (told.compared, told.alike) == (2 + 3, 1 + 2)  # of state 0; state 2 only the third episode saw


def test_an_episode_that_never_comes_back_shows_nothing_and_it_is_told():
    told = counted([episode([0, 1, 2], [0, 0]), episode([0, 1, 2], [0, 0])]).table.evidence
    assert "not looked for: too few visits that an episode made twice" in str(told)


def test_repeats_are_kept_with_a_table(tmp_path):
    table = repeats(Windy(), 2_000)
    save_table(table, tmp_path / "table.npz")
    kept = load_table(tmp_path / "table.npz", Windy.observation_space).evidence
    assert kept == table.evidence and isinstance(kept.repeats, Repeats)


def test_interaction_draws_the_same_from_the_generators_that_all_share():
    class Shared(Windy):
        def step(self, action):
            self.cell = int(np.random.randint(8))  # noqa: NPY002
            return self.cell, 0.0, False, False, {}

    first, second = (Interaction(500).table(Shared(), 0.9).mdp.P for _ in range(2))
    assert (first != second).nnz == 0
