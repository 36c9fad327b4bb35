"""Wrappers that read a time limit inside them, which no table has."""

import gymnasium as gym
import numpy as np
import pytest
from enumeration_envs import Corridor
from gymnasium import spaces
from gymnasium.wrappers import RepeatAction, StickyAction, TimeAwareObservation, TimeLimit, TransformReward

from irl_gym.environments.seeded_starts import SeededStarts
from irl_gym.errors import NotTabular, UnknownObservation
from irl_gym.tables.copies.time_limits import check_limits
from irl_gym.tables.counted.counting import Interaction
from irl_gym.tables.enumeration.table import Enumeration
from irl_gym.tables.tabulate import tabulate

pytestmark = pytest.mark.usefixtures("unchecked")


def limited(n=10):
    return TimeLimit(Corridor(), n)


class Ends(gym.Wrapper):
    """Turns the limit into an end."""

    def step(self, action):
        observation, reward, terminated, truncated, info = self.env.step(action)
        return observation, reward, terminated or truncated, False, info


class Pays(gym.Wrapper):
    """Makes who is cut pay."""

    def step(self, action):
        observation, reward, terminated, truncated, info = self.env.step(action)
        return observation, reward - 5 * truncated, terminated, truncated, info


class Reads(gym.Wrapper):
    """Reads the steps that the limit has counted."""

    def step(self, action):
        observation, reward, *rest = self.env.step(action)
        return observation, reward - self.get_wrapper_attr("_elapsed_steps") * 0.5, *rest


@pytest.mark.parametrize("wrapper", [Ends, Pays, Reads])
@pytest.mark.parametrize("by", [Enumeration(), Interaction(100)], ids=["enumerated", "counted"])
def test_a_wrapper_that_does_something_where_an_episode_is_cut_is_refused_by_its_name_and_the_limit(wrapper, by):
    env = TransformReward(wrapper(limited()), lambda reward: 2 * reward)
    with pytest.raises(NotTabular, match=rf"the wrapper {wrapper.__name__} does something else .* TimeLimit .* after 10 steps"):
        by.table(env, 0.9)


@pytest.mark.parametrize("options", [{"flatten": False}, {"flatten": True, "normalize_time": False}])
def test_a_wrapper_that_shows_the_time_is_refused_by_its_name_and_the_limit(options):
    env = gym.make("FrozenLake-v1")
    with pytest.raises(NotTabular, match="the wrapper TimeAwareObservation shows how many of the 100 steps"):
        tabulate(TimeAwareObservation(env, **options), gamma=0.9)


@pytest.mark.parametrize("wrapper", [Ends, Pays, Reads])
def test_without_the_wrapper_there_is_a_table(wrapper):
    assert tabulate(wrapper(limited()).env, gamma=0.9).mdp.n_states == 7


@pytest.mark.parametrize(
    "around", [lambda env: SeededStarts(env, (0,)), lambda env: TransformReward(env, lambda reward: -reward)]
)
def test_wrappers_that_do_not_read_the_limit_are_taken(around):
    assert tabulate(around(limited()), gamma=0.9, check_steps=0).mdp.n_states == 7


def test_a_limit_around_the_wrapper_is_none_that_it_reads():
    assert tabulate(TimeLimit(Ends(Corridor()), 10), gamma=0.9, check_steps=0).mdp.n_states == 7


class Noisy(gym.Wrapper):
    """Pays what a clock says, and so something else each time."""

    def step(self, action):
        observation, _, *rest = self.env.step(action)
        return observation, float(np.random.default_rng().random()), *rest


def test_a_wrapper_that_is_random_by_itself_is_not_blamed_for_the_limit():
    assert not Enumeration(runs=20, start_runs=20, revisits=0).table(Noisy(limited()), 0.9).evidence.exact


class Counts(gym.ObservationWrapper):
    """Shows the steps taken, up to a limit that it knows of."""

    def __init__(self, env):
        super().__init__(env)
        self.steps = 0
        self.observation_space = spaces.MultiDiscrete([7, 11])

    def reset(self, **options):
        self.steps = -1
        return super().reset(**options)

    def observation(self, observation):
        self.steps += 1
        return np.array([observation, self.steps])


def test_an_observation_out_of_its_space_names_the_limit_that_was_left_out():
    with pytest.raises(UnknownObservation, match=r"Around a TimeLimit of 10 steps.*Counts"):
        Enumeration().table(Counts(limited()), 0.9)


@pytest.mark.parametrize("around", [lambda env: StickyAction(env, 0.25), lambda env: RepeatAction(env, 3)])
def test_wrappers_that_repeat_actions_do_not_read_the_limit(around):
    check_limits(around(limited()))
