"""Wrappers that read a time limit inside them: it is in the table where the time is shown."""

import gymnasium as gym
import numpy as np
import pytest
from enumeration_envs import Corridor
from gymnasium import spaces
from gymnasium.wrappers import RepeatAction, StickyAction, TimeAwareObservation, TimeLimit, TransformReward

from irl_gym.environments.seeded_starts import SeededStarts
from irl_gym.errors import InvalidDiscount, NotTabular, UnknownObservation
from irl_gym.mdp.planning.dynamic_programming import policy_iteration, value_iteration
from irl_gym.mdp.planning.finite_horizon import backward_induction
from irl_gym.tables.copies.time_limits import reader_of
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
    """Where the time is not shown, as here: what comes then depends on it."""
    env = TransformReward(wrapper(limited()), lambda reward: 2 * reward)
    named = rf"[Tt]he wrapper {wrapper.__name__} does something else .* TimeLimit .* after 10 steps"
    with pytest.raises(NotTabular, match=named):
        by.table(env, 0.9)


def test_an_observation_that_comes_at_two_times_is_named():
    with pytest.raises(NotTabular, match="observation 3 is seen after 0 of them and after 2: expected the time to be shown"):
        Enumeration(revisits=0).table(Ends(limited()), 0.9)


def test_a_wrapper_that_shows_the_time_is_refused_by_its_name_and_the_limit_where_steps_are_counted():
    with pytest.raises(NotTabular, match="the wrapper TimeAwareObservation shows how many of the 10 steps"):
        Interaction(100).table(TimeAwareObservation(limited(), flatten=False), 0.9)


def test_time_that_is_shown_as_a_share_is_refused():
    with pytest.raises(NotTabular, match="shows the time as a share of 10 steps, a float: expected whole numbers"):
        tabulate(TimeAwareObservation(limited(), normalize_time=True), gamma=0.9)


LAYERS = {
    "shown": lambda env: TimeAwareObservation(env, flatten=False),
    "shown, flat": TimeAwareObservation,
    "an end that is shown": lambda env: TimeAwareObservation(Ends(env), flatten=False),
    "an end of what is shown": lambda env: Ends(TimeAwareObservation(env, flatten=False)),
}


def lake(limit, slippery=False):
    return gym.make("FrozenLake-v1", is_slippery=slippery, max_episode_steps=limit)


@pytest.mark.parametrize("layers", LAYERS.values(), ids=LAYERS)
@pytest.mark.parametrize(("limit", "worth"), [(5, 0.0), (6, 1.0), (8, 1.0)])
def test_the_goal_is_worth_what_it_is_within_the_limit(layers, limit, worth):
    """It is six steps away. The table has a state for each time at which a cell can be reached, and ends at the limit."""
    found = tabulate(layers(lake(limit)), gamma=1.0, check_steps=300)
    best = value_iteration(found.mdp, found.reward)
    assert found.mdp.d0 @ best.V == worth and found.mdp.horizon == limit
    assert found.evidence.exact and f"The limit of {limit} steps is part of it" in found.evidence.method


@pytest.mark.parametrize("limit", [5, 6, 8])
def test_values_at_each_time_are_those_of_backward_induction(limit):
    plain = tabulate(lake(limit, slippery=True), gamma=0.9, check_steps=0)
    V = backward_induction(plain.mdp, plain.reward, horizon=limit).V
    found = tabulate(LAYERS["shown"](lake(limit, slippery=True)), gamma=1.0, check_steps=1000)
    best = policy_iteration(found.mdp, found.reward)
    at = [found.states.decode(row) for row in range(found.mdp.n_states)]
    expected = np.array([V[int(one["time"][0]), int(one["obs"])] for one in at])
    assert np.abs(best.V - expected).max() < 1e-10 and best.error < 1e-10


def test_who_is_cut_pays_where_the_time_is_shown():
    """The corridor's end is three steps away; staying away for all two steps costs 5 at the last one."""
    found = tabulate(TimeAwareObservation(Pays(limited(2)), flatten=False), gamma=1.0, check_steps=100)
    assert found.mdp.d0 @ value_iteration(found.mdp, found.reward).V == -5.0


def test_one_is_no_discount_where_no_wrapper_reads_a_limit():
    with pytest.raises(InvalidDiscount, match=r"gamma is 1\.0"):
        tabulate(lake(6), gamma=1.0)


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
    assert reader_of(around(limited())) is None
