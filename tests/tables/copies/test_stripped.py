import collections
import random
import threading

import gymnasium as gym
import numpy as np
import pytest
from walk_env import Bag, StandIn, Walk, frames, snapshots_of

from irl_gym.environments.learned_reward import LearnedReward
from irl_gym.errors import NotTabular
from irl_gym.tables.copies.stripped import without_watchers


def test_without_watchers_leaves_out_limits_and_learned_rewards():
    env = gym.make("FrozenLake-v1", render_mode="rgb_array")
    own = without_watchers(LearnedReward(env, np.arange(16.0)))
    assert (type(own), own.render_mode) == (type(env.unwrapped), None)
    assert own is not env.unwrapped
    assert own.P is not env.unwrapped.P


def test_without_watchers_keeps_wrappers_that_change_something():
    own = without_watchers(frames())
    assert [type(own).__name__, type(own.env).__name__, own.env.env is own.unwrapped] == [
        "FrameStackObservation",
        "TimeAwareObservation",
        True,
    ]


def test_without_watchers_names_what_cannot_be_copied():
    env = Walk(parts={"guard": Bag([threading.Lock()])})
    with pytest.raises(NotTabular, match=r"Walk.parts\['guard'\].items\[0\] is a lock.*get_state"):
        without_watchers(env)


def test_without_watchers_drops_what_draws():
    pygame = pytest.importorskip("pygame")
    assert without_watchers(Walk(clock=pygame.time.Clock())).clock is None


def test_snapshots_replace_generators_wherever_they_are_each_once():
    rng, other = np.random.default_rng(0), random.Random(0)
    env = Walk(rng=rng, bag=Bag([rng, (1, {"deep": other})]), draw=rng.random, queue=collections.deque([rng]))
    made = StandIn.made
    own, snapshots = snapshots_of(env)
    snapshots.restore(snapshots.take())
    assert StandIn.made == made + 3  # rng, other, and Gymnasium's own; the spaces here are of the class
    assert own.rng is own.bag.items[0] is own.queue[0] is own.draw.__self__
    assert [type(one) for one in (own.rng, own.bag.items[1][1]["deep"], own.np_random)] == [StandIn] * 3
    assert env.rng is rng


def test_snapshots_replace_the_generator_of_a_space():
    env = Walk(noise=gym.spaces.Dict({"a": gym.spaces.Discrete(3)}))
    env.action_space = gym.spaces.Discrete(2)
    own, _ = snapshots_of(env)
    assert type(own.action_space.np_random) is StandIn
    assert type(own.noise["a"].np_random) is StandIn


class Renewing(Walk):
    def reset(self, *, seed=None, options=None):
        self.rng = np.random.default_rng(seed)
        return super().reset(seed=seed)

    def step(self, action):
        return *super().step(action)[:2], True, False, {}


def test_snapshots_refuse_an_environment_that_makes_new_generators():
    with pytest.raises(NotTabular, match="made a new Generator while it ran"):
        snapshots_of(Renewing())


def test_take_refuses_a_generator_that_is_nobodys_stand_in():
    env, snapshots = snapshots_of(Walk())
    env.parts = [np.random.default_rng(0)]
    with pytest.raises(NotTabular, match="made a new Generator"):
        snapshots.take()


class Uncopied:
    """Raises what it is given when it is copied."""

    def __init__(self, error):
        self.error = error

    def __deepcopy__(self, memo):
        raise self.error


def test_without_watchers_names_what_a_copy_raised():
    error = KeyError("part")
    with pytest.raises(NotTabular, match=r"Walk.inner is an Uncopied, which cannot be copied \(KeyError: 'part'\)") as told:
        without_watchers(Walk(inner=Uncopied(error)))
    assert told.value.__cause__ is error


@pytest.mark.parametrize("error", [MemoryError(), KeyboardInterrupt()])
def test_without_watchers_lets_pass_what_says_nothing_about_the_environment(error):
    with pytest.raises(type(error)) as passed:
        without_watchers(Walk(inner=Uncopied(error)))
    assert passed.value is error


@pytest.mark.parametrize("error", [MemoryError(), KeyboardInterrupt()])
def test_a_lack_of_memory_in_a_copy_of_the_whole_passes(error):
    class Whole(Walk):
        def __deepcopy__(self, memo):
            raise error

    with pytest.raises(type(error)) as passed:
        without_watchers(Whole())
    assert passed.value is error
