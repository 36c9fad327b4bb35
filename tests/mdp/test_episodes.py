"""Episodes: collected by stepping and from a table, and what they say about the policy."""

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces
from scipy.stats import ks_2samp

from irl_gym.errors import InvalidDemonstrations, InvalidParameter
from irl_gym.judging.metrics import policy_value
from irl_gym.mdp.episodes import Episode, collect, collect_from_table, empirical_policy
from irl_gym.mdp.planning.dynamic_programming import policy_iteration
from irl_gym.mdp.policies import TabularPolicy, as_distribution
from irl_gym.spaces.states import StateIndex

STATES = StateIndex(spaces.Discrete(4))


def episode(observations, actions, **kwargs):
    settings = {"rewards": np.zeros(len(actions)), "terminated": True, "truncated": False, **kwargs}
    return Episode(np.array(observations), np.array(actions), **settings)


@pytest.fixture(scope="module")
def lake(toy_text):
    return toy_text("FrozenLake 4x4 slippery")


@pytest.fixture(scope="module")
def expert(lake):
    return policy_iteration(lake.mdp, lake.reward.values).policy


def drawn(lake, policy, n, **kwargs):
    settings = {"seed": 0, "max_episode_steps": 100, **kwargs}
    return list(collect_from_table(lake.mdp, lake.payments.entries, lake.states, policy, n, **settings))


def stepped(lake, policy, n, **kwargs):
    actor = TabularPolicy(as_distribution(policy, 16, 4), lake.states)
    return list(collect(gym.make("FrozenLake-v1"), actor, n, **kwargs))


def test_collect_gives_as_many_episodes_as_asked(lake, expert):
    assert len(stepped(lake, expert, 7)) == 7


def test_collect_records_the_seed_of_each_episode(lake, expert):
    assert [one.seed for one in stepped(lake, expert, 3, seed=10)] == [10, 11, 12]


def test_an_episode_can_be_made_again_from_its_seed(lake, expert):
    third = stepped(lake, expert, 3, seed=10)[2]
    again = stepped(lake, expert, 1, seed=12)[0]
    assert np.array_equal(third.observations, again.observations)


def test_collect_truncates_where_the_environment_has_no_limit(toy_text):
    actor = TabularPolicy(np.full((48, 4), 0.25), toy_text("CliffWalking").states)
    (one,) = collect(gym.make("CliffWalking-v1"), actor, 1, max_episode_steps=30)
    assert (len(one), one.truncated, one.terminated) == (30, True, False)


def test_episodes_of_a_table_have_the_lengths_of_stepped_ones(lake, expert):
    lengths = [[len(one) for one in made] for made in (drawn(lake, expert, 800), stepped(lake, expert, 800))]
    assert ks_2samp(*lengths).pvalue > 1e-3


def test_episodes_of_a_table_have_the_exact_value_on_average(lake, expert):
    returns = [0.99 ** np.arange(len(one)) @ one.rewards for one in drawn(lake, expert, 5000, max_episode_steps=2000)]
    exact = policy_value(lake.mdp, lake.reward, expert)
    assert np.mean(returns) == pytest.approx(exact, abs=4 * np.std(returns) / np.sqrt(5000))


def test_episodes_of_a_table_pay_the_reward_of_the_arrival(lake, expert):
    for one in drawn(lake, expert, 50):
        assert np.array_equal(one.rewards, (one.observations[1:] == 15).astype(float))


def test_episodes_of_a_table_end_as_the_table_says(lake, expert):
    for one in drawn(lake, expert, 50, max_episode_steps=20):
        assert one.terminated == lake.mdp.terminal[one.observations[-1]]
        assert one.truncated == (not one.terminated)


@pytest.mark.parametrize("wrong", [{"n_episodes": 0}, {"max_episode_steps": 0}])
def test_collect_from_table_refuses_nothing_to_do(lake, expert, wrong):
    settings = {"n_episodes": 1, "max_episode_steps": 1, **wrong}
    with pytest.raises(InvalidParameter, match="is 0"):
        list(collect_from_table(lake.mdp, lake.payments.entries, lake.states, expert, **settings))


@pytest.mark.parametrize(
    ("observations", "actions", "rewards"), [([0], [], []), ([0, 1], [0, 0], [0.0, 0.0]), ([0, 1], [0], [0.0, 0.0])]
)
def test_an_episode_refuses_lengths_that_do_not_fit(observations, actions, rewards):
    with pytest.raises(InvalidDemonstrations, match="expected"):
        episode(observations, np.array(actions, dtype=int), rewards=np.array(rewards))


def test_empirical_policy_counts_each_action():
    found = empirical_policy([episode([0, 1, 0, 0, 2], [1, 0, 1, 0])], STATES, 2)
    assert np.array_equal(found.counts, [[1, 2], [1, 0], [0, 0], [0, 0]])


def test_empirical_policy_says_nothing_about_states_not_visited():
    found = empirical_policy([episode([0, 1], [1])], STATES, 2)
    assert np.array_equal(found.visited, [True, False, False, False])
    assert not found.counts[1:].any()


def test_empirical_policy_names_the_action_out_of_range():
    with pytest.raises(InvalidDemonstrations, match="episode 1, step 2 takes action 5"):
        empirical_policy([episode([0, 1], [1]), episode([0, 1, 2, 3], [0, 1, 5])], STATES, 2)


def test_no_episodes_are_refused():
    with pytest.raises(InvalidDemonstrations, match="no episodes"):
        empirical_policy([], STATES, 2)


@pytest.mark.parametrize("actions", [np.array([0.5]), np.array([[0]])])
def test_an_episode_refuses_actions_that_are_not_integers(actions):
    with pytest.raises(InvalidDemonstrations, match="integers"):
        Episode(np.array([0, 1]), actions, np.zeros(1), True, False)
