"""An observation that hides part of the state is found out, with the pair of visits that proves it."""

import ast
import re

import numpy as np
import pytest
from enumeration_envs import Corridor
from gymnasium import spaces
from windy_env import Calm, Windy

from irl_gym.environments.reveal import Reveal
from irl_gym.errors import HiddenState
from irl_gym.tables.enumeration.explorer import Explorer
from irl_gym.tables.enumeration.table import Enumeration

pytestmark = pytest.mark.usefixtures("unchecked")


class Counts(Corridor):
    """Pays 1 for a step only in the first five steps."""

    steps = 0

    def reset(self, *, seed=None, options=None):
        self.steps = 0
        return super().reset(seed=seed)

    def step(self, action):
        self.steps = min(self.steps + 1, 9)
        observation, _, done, truncated, info = self.moved(int(action))
        return observation, float(self.steps <= 5), done, truncated, info


class Flag(Corridor):
    """Whoever was in cell 0 is paid at the end: seven steps later."""

    flag = False

    def reset(self, *, seed=None, options=None):
        self.flag = False
        return super().reset(seed=seed)

    def step(self, action):
        observation, reward, done, truncated, info = self.moved(int(action))
        self.flag = self.flag or self.cell == 0
        return observation, reward * self.flag, done, truncated, info


class Coin(Corridor):
    """Tosses a coin at reset: which action leads where."""

    coin = 0

    def reset(self, *, seed=None, options=None):
        result = super().reset(seed=seed)
        self.coin = int(self.np_random.integers(2))
        return result

    def step(self, action):
        return self.moved(int(action) ^ self.coin)


class LateCoin(Coin):
    """The coin matters in the last cells only."""

    def step(self, action):
        return self.moved(int(action) ^ (self.coin if self.cell == self.n - 2 else 0))


class Harmless(Corridor):
    """Remembers much that never matters."""

    def __init__(self):
        super().__init__()
        self.steps, self.lastaction, self.seen, self.picture = 0, None, {}, np.zeros((40, 40))

    def step(self, action):
        self.steps += 1
        self.lastaction = action
        self.seen[self.cell] = self.seen.get(self.cell, 0) + 1
        self.picture[self.cell] += 1  # for a rendering
        observation, reward, done, _, info = self.moved(int(action))
        return observation, reward, done, self.steps >= 100, info


def table_of(env, **limits):
    return Enumeration(**limits).table(env, 0.9)


def told(env):
    with pytest.raises(HiddenState) as caught:
        table_of(env)
    return str(caught.value)


HIDDEN = {"a counter": (Counts, "steps", 10), "a flag": (Flag, "flag", 2), "a coin": (Coin, "coin", 2),
          "a late coin": (LateCoin, "coin", 2)}  # fmt: skip


@pytest.mark.parametrize("name", HIDDEN)
def test_hidden_state_is_found_and_the_attribute_named(name):
    kind, attribute, _ = HIDDEN[name]
    assert re.search(rf"Inside, the environment differs in .*\b{attribute}: \w+ against \w+", told(kind()))


def actions_of(words):
    return [] if words == "reset" else ast.literal_eval(words.removeprefix("actions "))


@pytest.mark.parametrize("kind", [Counts, Flag])
def test_the_pair_that_proves_it_does_what_is_told(kind):
    message = told(kind())
    shown = int(re.search(r"observation (\d+) hides", message)[1])
    ways = re.search(
        r"After (reset|actions \[.*?\]), action (\d) leads to (\d+)(, the end)? \(probability 1, reward (\S+)\); "
        r"after (reset|actions \[.*?\]), to (\d+)(, the end)? \(probability 1, reward (\S+)\)",
        message,
    )
    first, action, to, end, reward, second, other_to, other_end, other_reward = ways.groups()
    results = [(to, end, reward), (other_to, other_end, other_reward)]
    assert results[0] != results[1]
    for words, (successor, ended, paid) in zip((first, second), results, strict=True):
        env = kind()
        observation, _ = env.reset()
        for one in actions_of(words):
            observation, _, done, _, _ = env.step(one)
            assert not done
        assert observation == shown
        observation, got, done, _, _ = env.step(int(action))
        assert (observation, got, done) == (int(successor), float(paid), ended is not None)


@pytest.mark.parametrize("name", ["a counter", "a flag", "a coin", "a late coin"])
def test_the_mend_that_is_told_works(name):
    kind, attribute, values = HIDDEN[name]
    assert "Reveal(env, {" in told(kind())
    table = table_of(Reveal(kind(), {attribute: values}))
    assert table.evidence.exact and table.mdp.n_states > kind().n


def test_what_never_matters_is_no_hidden_state():
    table = table_of(Harmless())
    assert table.evidence.exact and table.mdp.n_states == 7 and not table.evidence.method.startswith("0 states")


@pytest.fixture
def compared(monkeypatch):
    """The states that are tried in another inner state."""
    numbers, tell_apart = [], Explorer.tell_apart

    def counting(self, number, *args):
        numbers.append(number)
        return tell_apart(self, number, *args)

    monkeypatch.setattr(Explorer, "tell_apart", counting)
    return numbers


def test_each_state_is_compared_in_another_inner_state(compared):
    table_of(Harmless())
    assert set(compared) >= set(range(6))  # each cell but the last


def test_nothing_is_compared_when_the_observation_is_trusted(compared):
    method = table_of(Flag(), revisits=0).evidence.method
    assert not compared and method.endswith("Hidden state was not looked for.")


def test_the_evidence_does_not_tell_of_not_looking_when_hidden_state_was_looked_for():
    assert "not looked for" not in table_of(Harmless()).evidence.method


class Rows(Corridor):
    """Its observation is a pair in a dict; a flag hides."""

    flag = False

    def __init__(self):
        super().__init__()
        self.observation_space = spaces.Dict({"cell": spaces.Discrete(7), "light": spaces.MultiBinary(1)})

    def reset(self, *, seed=None, options=None):
        self.flag = False
        super().reset(seed=seed)
        return self._seen(), {}

    def step(self, action):
        _, reward, done, _, _ = self.moved(int(action))
        self.flag = self.flag or self.cell == 0
        return self._seen(), reward + self.flag, done, False, {}

    def _seen(self):
        return {"cell": self.cell, "light": np.array([self.cell % 2], dtype=np.int8)}


def test_an_observation_of_parts_is_told_without_numpys_words():
    assert re.match(r"observation \{'cell': \d, 'light': \[\d\]\} hides part of the state", told(Rows()))


def test_a_long_way_is_told_by_its_end():
    class Long(Flag):
        def __init__(self):
            super().__init__(61)

    assert "actions that end with [1" in told(Long())


@pytest.mark.parametrize("seed", range(12))
def test_a_number_that_is_drawn_at_reset_and_read_later_is_found(seed):
    with pytest.raises(HiddenState, match=r"observation 3 hides part of .*wind: .*SeededStarts"):
        table_of(Windy(), start_runs=300, seed=seed)


class Rare(Windy):
    """Reset draws a number that decides nothing."""

    def step(self, action):
        self.wind = min(self.wind, 0.0)
        return super().step(action)


def test_how_rare_a_number_drawn_at_reset_can_be_is_told_where_none_is_found():
    method = table_of(Rare(), start_runs=300).evidence.method
    assert "Of 100 further resets none led a random walk to a step that the table does not have: fewer than 3.0% do" in method


def test_a_number_that_is_drawn_anew_at_every_step_is_no_hidden_state():
    assert table_of(Calm(), runs=100, start_runs=100).mdp.n_states == 8
