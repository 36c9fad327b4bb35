"""An error of the environment's own is named, and stays the cause; what says nothing about the environment passes."""

import gymnasium as gym
import pytest
from walk_env import Walk

from irl_gym.errors import NotEnumerable, NotTabular
from irl_gym.tables.copies.calls import called, stepped


def raiser(error):
    def run():
        raise error

    return run


class Breaks(Walk):
    def __init__(self, error):
        super().__init__()
        self.error = error

    def step(self, action):
        raise self.error


def test_called_returns_what_the_call_does():
    assert called(lambda: 7) == 7


@pytest.mark.parametrize("error", [KeyError("door"), RuntimeError("no floor"), StopIteration(), AssertionError("not here")])
def test_called_names_an_error_of_the_environments_own_and_keeps_its_traceback(error):
    with pytest.raises(NotTabular, match=rf"the environment raised {type(error).__name__} \(") as told:
        called(raiser(error))
    assert told.value.__cause__ is error and error.__traceback__ is not None


@pytest.mark.parametrize("error", [MemoryError(), KeyboardInterrupt(), SystemExit(), NotEnumerable("a normal number")])
def test_called_lets_pass_what_is_no_fault_of_the_environment(error):
    with pytest.raises(type(error)) as passed:
        called(raiser(error))
    assert passed.value is error


def test_stepped_gives_plain_types():
    env = Walk()
    env.reset(seed=0)
    made = stepped(env, 1)
    assert [type(part) for part in made[1:]] == [float, bool, bool]


def test_stepped_names_what_the_step_raised():
    with pytest.raises(NotTabular, match=r"raised ZeroDivisionError \(by nothing\)"):
        stepped(Breaks(ZeroDivisionError("by nothing")), 0)


def test_stepped_names_a_step_that_returns_four_values():
    class Old(gym.Env):
        def step(self, action):
            return 0, 0.0, False, {}

    with pytest.raises(NotTabular, match=r"raised ValueError .*unpack"):
        stepped(Old(), 0)
