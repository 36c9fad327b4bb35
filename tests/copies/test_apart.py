"""What deepcopy leaves as it is leads a copy of an environment back to it: made anew, or refused."""

import types
import weakref

import gymnasium as gym
import pytest
from gymnasium import spaces

from irl_gym.copies.stripped import without_watchers
from irl_gym.enumeration.table import Enumeration
from irl_gym.errors import NotCopied

N = 5


class Line(gym.Env):
    """A line of five cells, whose author gives it the functions that move."""

    observation_space, action_space = spaces.Discrete(N), spaces.Discrete(2)

    def __init__(self, give):
        self.at = 0
        self.box = [0]
        give(self)

    def put(self, place):
        self.at = place

    def see(self):
        return self.at

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.put(0)
        return self.see(), {}

    def step(self, action):
        self.put(min(max(self.see() + (1 if action else -1), 0), N - 1))
        return self.see(), 0.0, self.see() == N - 1, False, {}


def closes_over_self(env):
    env.put = lambda place: setattr(env, "at", place)


def default(env):
    def put(place, env=env, *, again=env):
        env.at = again.at = place

    env.put = put


def functions_of_functions(env):
    env.moves = {"put": lambda place: inner(place)}
    inner = lambda place: setattr(env, "at", place)  # noqa: E731
    env.put = lambda place: env.moves["put"](place)


def a_method_behind_a_function(env):
    method = Line.put.__get__(env)
    env.put = types.MethodType(lambda self, place: method(place), env)


def closes_over_a_list(env):
    box = env.box
    env.put, env.see = lambda place: box.__setitem__(0, place), types.MethodType(lambda self: self.box[0], env)


class One:
    at = 0


def weak(env):
    env.one = One()
    env.weak = weakref.ref(env.one)
    env.put, env.see = (
        types.MethodType(lambda self, place: setattr(self.weak(), "at", place), env),
        types.MethodType(lambda self: self.one.at, env),
    )


@pytest.mark.parametrize("give", [closes_over_self, default, functions_of_functions, a_method_behind_a_function])
def test_a_function_that_holds_the_environment_holds_its_copy_in_a_copy(give):
    env = Line(give)
    table = Enumeration().table(env, 0.9)
    P = table.mdp.P.toarray().reshape(N, 2, N)[: N - 1].argmax(-1)
    assert (P.tolist(), table.evidence.exact) == ([[max(s - 1, 0), s + 1] for s in range(N - 1)], True)
    assert env.at == 0  # its own was not moved


@pytest.mark.parametrize(("give", "what"), [(closes_over_a_list, "Line.put leads to a list"), (weak, "leads to a One")])
def test_what_leads_a_copy_back_is_refused(give, what):
    with pytest.raises(NotCopied, match=what):
        without_watchers(Line(give))


def test_functions_that_share_a_variable_share_it_in_a_copy():
    def give(env):
        count = 0

        def put(place):
            nonlocal count
            count += 1
            env.at = place

        env.put, env.counted = put, lambda: (env, count)

    env = Line(give)
    made = without_watchers(env)
    made.put(3)
    assert (made.counted()[1], env.counted()[1], made.at, env.at) == (1, 0, 3, 0)
