"""LearnedReward pays the learned reward and changes nothing else."""

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces
from gymnasium.envs.registration import EnvSpec
from tiny_env import TableEnv, both_ways

from irl_gym.errors import InvalidReward, NotDiscrete, UnknownObservation
from irl_gym.rewards import TabularReward
from irl_gym.states import StateIndex
from irl_gym.tabulate import tabulate
from irl_gym.wrappers import LearnedReward

REWARD = TabularReward(np.arange(16, dtype=float))


def walk(env, n=60):
    """Observations, ends and rewards of a seeded walk."""
    rows = [env.reset(seed=3)[0]]
    env.action_space.seed(0)
    for _ in range(n):
        *row, info = env.step(env.action_space.sample())
        rows.append((*row, info.get("true_reward")))
        if row[2] or row[3]:
            rows.append(env.reset()[0])
    return rows


@pytest.fixture
def pair():
    return walk(gym.make("FrozenLake-v1")), walk(LearnedReward(gym.make("FrozenLake-v1"), REWARD))


def steps(rows):
    return [row for row in rows if isinstance(row, tuple)]


def test_everything_but_the_reward_is_unchanged(pair):
    plain, learned = map(steps, pair)
    assert [(o, te, tr) for o, _, te, tr, _ in plain] == [(o, te, tr) for o, _, te, tr, _ in learned]


def test_the_true_reward_is_in_info(pair):
    plain, learned = map(steps, pair)
    assert [row[1] for row in plain] == [row[4] for row in learned]


def test_a_state_reward_is_paid_on_arrival(pair):
    assert all(row[1] == row[0] for row in steps(pair[1]))


def test_a_step_reward_is_paid_for_state_and_action():
    values = np.random.default_rng(0).normal(size=(16, 4))
    env = LearnedReward(gym.make("FrozenLake-v1"), TabularReward(values))
    s, _ = env.reset(seed=0)
    assert env.step(2)[1] == values[s, 2]


def test_a_terminal_copy_gets_its_own_reward():
    env = TableEnv(both_ways(), [1, 0, 0])
    found = tabulate(env, gamma=0.9, check_steps=0)
    wrapped = LearnedReward(env, TabularReward(np.array([0.0, 1.0, 2.0, 7.0])), found.states)
    wrapped.reset(seed=0)
    assert wrapped.step(1)[1] == 7.0


def test_the_spec_of_a_wrapped_environment_makes_it_again(tmp_path):
    REWARD.save(tmp_path / "reward.npz")
    env = LearnedReward(gym.make("FrozenLake-v1"), str(tmp_path / "reward.npz"))
    again = gym.make(EnvSpec.from_json(env.spec.to_json()))
    assert walk(again) == walk(env)


def test_the_spec_of_a_wrapped_environment_makes_it_again_with_a_reward_in_memory():
    env = LearnedReward(gym.make("FrozenLake-v1"), REWARD)
    assert walk(gym.make(env.spec)) == walk(env)


def test_an_array_is_a_reward():
    env = LearnedReward(gym.make("FrozenLake-v1"), REWARD.values)
    assert walk(env) == walk(LearnedReward(gym.make("FrozenLake-v1"), REWARD))


def test_a_reward_for_another_number_of_actions_is_refused():
    with pytest.raises(InvalidReward, match="2 actions"):
        LearnedReward(gym.make("FrozenLake-v1"), np.zeros((16, 2)))


def test_an_observation_outside_the_index_is_refused():
    states = StateIndex(spaces.Discrete(16), codes=np.array([0, 1, 5]))
    env = LearnedReward(gym.make("FrozenLake-v1", is_slippery=False), TabularReward(np.zeros(3)), states)
    env.reset(seed=0)
    with pytest.raises(UnknownObservation, match="4"):
        env.step(1)


def test_a_reward_for_another_number_of_states_is_refused():
    with pytest.raises(InvalidReward, match="5 states"):
        LearnedReward(gym.make("FrozenLake-v1"), TabularReward(np.zeros(5)))


def test_a_continuous_environment_is_refused():
    with pytest.raises(NotDiscrete, match="floats"):
        LearnedReward(gym.make("CartPole-v1"), REWARD)
