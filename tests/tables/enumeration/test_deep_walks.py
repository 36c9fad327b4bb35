"""What happens late is found by long walks, and told with the way to it."""

import re

import gymnasium as gym
import numpy as np
import pytest
from enumeration_envs import RAND, Corridor
from gymnasium import spaces

from irl_gym.errors import HiddenState
from irl_gym.tables.enumeration import deep_walks
from irl_gym.tables.enumeration.table import Enumeration

pytestmark = pytest.mark.usefixtures("unchecked")


class Clock(gym.Env):
    """Shows nothing, and ends after some steps."""

    action_space = spaces.Discrete(2)

    def __init__(self, n, shown=None):
        self.n, self.shown = n, shown
        self.observation_space = spaces.Discrete(1 if shown is None else 40)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.t = 0
        return 0, {}

    def step(self, action):
        self.t += 1
        seen = 0 if self.shown is None else min(self.t // self.shown, 39)
        return seen, 0.0, self.t == self.n, False, {}


class Quits(Clock):
    """Action 1 ends at once."""

    def step(self, action):
        seen, reward, done, *rest = super().step(action)
        return seen, reward, bool(done or action), *rest


class Pays(Clock):
    def step(self, action):
        seen, _, _, *rest = super().step(action)
        return seen, float(self.t == self.n), False, *rest


class Truncated(Clock):
    """Ends, but has truncated itself before: no episode gets there."""

    def step(self, action):
        seen, reward, done, _, info = super().step(action)
        return seen, reward, done, self.t >= self.n // 2, info


def table_of(env, **limits):
    return Enumeration(**limits).table(env, 0.9)


@pytest.mark.parametrize("kind", [Clock, Quits, Pays])
@pytest.mark.parametrize("n", [25, 50, 100, 700])
def test_a_counter_behind_a_constant_observation_is_found(kind, n):
    with pytest.raises(HiddenState, match=rf"observation 0 hides part of .*t: 0 against {n - 1}\b.*Reveal"):
        table_of(kind(n))


def test_a_counter_that_changes_the_observation_each_50_steps_is_found():
    with pytest.raises(HiddenState, match=r"observation 0 hides part of .*t: 0 against 49"):
        table_of(Clock(10**9, shown=50))


def test_the_way_to_a_late_step_leads_to_it():
    class Told(Clock):
        def step(self, action):
            return super().step(action)

    with pytest.raises(HiddenState) as caught:
        table_of(Told(25))
    way = re.search(r"; after actions (\[[0-9, ]+\]), to 0, the end", str(caught.value))[1]
    assert len(way.split(",")) == 24


def test_the_same_walk_is_made_again():
    def told():
        with pytest.raises(HiddenState) as caught:
            table_of(Clock(100))
        return str(caught.value)

    assert told() == told()


def test_no_walk_is_made_where_every_inner_state_was_compared(monkeypatch):
    class Walked(Exception):
        pass

    def steps(*_):
        raise Walked

    monkeypatch.setattr(deep_walks, "_steps", steps)
    assert table_of(Corridor()).evidence.exact
    with pytest.raises(Walked):
        table_of(Clock(100))


def test_no_walk_is_made_where_the_observation_is_trusted():
    assert table_of(Clock(100), revisits=0).evidence.exact


def test_what_comes_after_a_truncation_is_left_alone():
    evidence = table_of(Truncated(200)).evidence
    assert evidence.exact and "truncated steps itself" in evidence.method


class Ages(Corridor):
    """Counts its steps harmlessly, pays by a choice, slips by a comparison; one action draws what cannot be enumerated."""

    age, counts = 0, False

    def step(self, action):
        self.age += 1
        slips = self.np_random.normal() < -2 if self.counts and action else self.np_random.random() < 0.01
        observation, _, done, *rest = self.moved(int(action) ^ int(slips))
        return observation, float(self.np_random.choice([0.1, 0.7])), done, *rest


@pytest.mark.parametrize("counts", [False, True])
def test_walks_agree_with_a_table_that_is_right(counts):
    env = Ages()
    env.counts = counts
    assert table_of(env, runs=50, revisits=1).evidence.exact is not counts


def test_a_late_draw_from_outside_is_no_hidden_state():
    class Late(Clock):
        def step(self, action):
            return super().step(action) if self.t < 60 else (0, float(RAND() < 0.5), False, False, {})

    np.random.seed(0)  # noqa: NPY002
    table = table_of(Late(10**9), runs=10)
    assert not table.evidence.exact


def test_walks_stop_at_their_limits(monkeypatch):
    env = Clock(10**9)
    count = 0

    def counted(*args):
        nonlocal count
        for step in whole(*args):
            count += 1
            yield step

    whole = deep_walks._steps
    monkeypatch.setattr(deep_walks, "_steps", counted)
    assert table_of(env).evidence.exact and count == deep_walks.STEPS
