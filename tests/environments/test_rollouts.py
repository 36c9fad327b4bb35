"""Episodes made many at a time are those made one at a time, in distribution."""

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces
from scipy.stats import ks_2samp
from tiny_env import Room, TableEnv

from irl_gym.agents.simulator import RandomPolicy
from irl_gym.environments.rollouts import APART, TOGETHER, maker_of, moments_of, run_episodes
from irl_gym.errors import InvalidParameter
from irl_gym.mdp.episodes import collect

SQUARE = "irl_gym_envs:irl_gym/ContinuousGridWorld-v0"
CAR = "irl_gym_envs:irl_gym/MountainCar-v0"


class Acts:
    """A policy that is a function of a batch of observations."""

    def __init__(self, function):
        self.function = function

    def predict(self, observation, state=None, episode_start=None, deterministic=False):
        return self.function(observation), state


class Single:
    """The same random policy for one observation at a time, whatever it is made of."""

    def __init__(self, n_actions, rng):
        self.n_actions, self.rng = n_actions, rng

    def predict(self, observation, state=None, episode_start=None, deterministic=False):
        return self.rng.integers(self.n_actions), state


def both(env_id, n, most):
    """Random episodes made many at a time, and made one at a time."""
    env = gym.make(env_id)
    A = int(env.action_space.n)
    many = run_episodes(env, RandomPolicy(A, np.random.default_rng(1)), n, seed=1, most=most)
    one = collect(gym.make(env_id), Single(A, np.random.default_rng(2)), n, seed=100_000, max_episode_steps=most)
    return many, list(one)


@pytest.fixture(scope="module")
def pairs():
    cases = {"CartPole-v1": (300, None), "Taxi-v4": (60, 60), "Blackjack-v1": (1500, 20), SQUARE: (200, None), CAR: (10, 40)}
    return {env_id: both(env_id, *case) for env_id, case in cases.items()}


EVERY = ("CartPole-v1", "Taxi-v4", "Blackjack-v1", SQUARE, CAR)
VARYING = ("CartPole-v1", "Taxi-v4", "Blackjack-v1", SQUARE)
"""Environments whose random returns vary."""


@pytest.mark.parametrize("env_id", VARYING)
def test_run_episodes_gives_the_returns_of_collect(pairs, env_id):
    many, one = ([episode.total_reward for episode in some] for some in pairs[env_id])
    assert ks_2samp(many, one).pvalue > 0.01


@pytest.mark.parametrize("env_id", ["CartPole-v1", "Blackjack-v1"])
def test_run_episodes_gives_the_lengths_of_collect(pairs, env_id):
    many, one = ([len(episode) for episode in some] for some in pairs[env_id])
    assert ks_2samp(many, one).pvalue > 0.01


@pytest.mark.parametrize("env_id", EVERY)
def test_run_episodes_gives_the_ends_of_collect(pairs, env_id):
    many, one = (np.mean([[episode.terminated, episode.truncated] for episode in some], axis=0) for some in pairs[env_id])
    np.testing.assert_allclose(many, one, atol=0.1)


@pytest.mark.parametrize("env_id", EVERY)
def test_run_episodes_ends_each_episode_in_one_way(pairs, env_id):
    assert all(episode.terminated != episode.truncated for episode in pairs[env_id][0])


@pytest.mark.parametrize("env_id", EVERY)
def test_run_episodes_gives_observations_of_the_space(pairs, env_id):
    space = gym.make(env_id).observation_space
    for episode in pairs[env_id][0][:20]:
        parts = episode.observations
        one = [tuple(part[t] for part in parts) if isinstance(parts, tuple) else parts[t] for t in range(len(episode) + 1)]
        assert all(observation in space for observation in one)


def test_run_episodes_keeps_the_start_and_the_end_of_an_episode():
    end = [(1.0, 2, 7.0, True)]
    env = TableEnv([[[(1.0, 1, 3.0, False)]], [end], [end]], [1.0, 0, 0])
    (episode,) = run_episodes(env, RandomPolicy(1, np.random.default_rng(0)), 1, most=9)
    assert episode.observations.tolist() == [0, 1, 2] and episode.rewards.tolist() == [3.0, 7.0] and episode.terminated


def test_run_episodes_makes_episodes_of_one_step():
    end = [(1.0, 1, 1.0, True)]
    found = run_episodes(TableEnv([[end], [end]], [1.0, 0]), RandomPolicy(1, np.random.default_rng(0)), 40, most=5)
    assert [len(episode) for episode in found] == [1] * 40


def test_run_episodes_begins_each_batch_anew():
    found = run_episodes(gym.make("FrozenLake-v1"), RandomPolicy(4, np.random.default_rng(0)), 2 * APART + 3)
    assert len(found) == 2 * APART + 3 and all(episode.observations[0] == 0 for episode in found)


def test_moments_of_asks_the_policy_for_a_whole_batch():
    sizes = []
    policy = Acts(lambda seen: sizes.append(len(seen)) or np.zeros(len(seen), dtype=int))
    for _ in moments_of(gym.make(CAR), policy, TOGETHER + 5, most=2):
        pass
    assert max(sizes) == TOGETHER


def test_moments_of_shows_what_the_episodes_see_at_each_time():
    moments = list(moments_of(gym.make(SQUARE), RandomPolicy(4, np.random.default_rng(0)), 7, most=3))
    assert [moment.time for moment in moments] == [0, 1, 2, 3] and moments[0].actions.size == 0
    assert all(len(moment.observations) == moment.who.size == 7 for moment in moments)


@pytest.mark.parametrize("env_id", ["CartPole-v1", "FrozenLake-v1"])
def test_run_episodes_gives_every_episode_its_own_actions(env_id):
    taken = []

    def draw(seen):
        taken.append(np.random.default_rng(len(taken)).integers(2, size=len(seen)))
        return taken[-1]

    found = run_episodes(gym.make(env_id), Acts(draw), 5)
    for i, episode in enumerate(found):
        assert episode.actions.tolist() == [step[i] for step in taken[: len(episode)]]


def test_run_episodes_counts_actions_from_0_when_the_space_does_not():
    class FromFive(TableEnv):
        def __init__(self):
            end = [(1.0, 1, 0.0, True)]
            super().__init__([[[(1.0, 0, 0.0, False)], end], [end, end]], [1.0, 0])
            self.action_space = spaces.Discrete(2, start=5)

        def step(self, action):
            assert action in self.action_space
            return super().step(action - 5)

    (episode,) = run_episodes(FromFive(), Acts(lambda seen: np.ones(len(seen), dtype=int)), 1, most=3)
    assert episode.actions.tolist() == [1] and episode.terminated


def test_run_episodes_stacks_dictionaries():
    for episode in run_episodes(Room(3), RandomPolicy(2, np.random.default_rng(0)), 2, most=9):
        assert episode.observations["a"].tolist() == [0, 1, 2, 3] and episode.observations["b"].shape == (4, 2)


# --- cuts ---


@pytest.mark.parametrize("env_id", ["CartPole-v1", "Taxi-v4", SQUARE])
def test_most_cuts_episodes(env_id):
    A = int(gym.make(env_id).action_space.n)
    found = run_episodes(gym.make(env_id), RandomPolicy(A, np.random.default_rng(0)), 40, most=6)
    assert all(len(episode) <= 6 and episode.truncated == (not episode.terminated) for episode in found)


@pytest.mark.parametrize("env_id", ["CartPole-v1", "MountainCar-v0", SQUARE])
def test_an_environments_own_time_limit_cuts_episodes(env_id):
    env = gym.make(env_id, max_episode_steps=5)
    found = run_episodes(env, RandomPolicy(int(env.action_space.n), np.random.default_rng(0)), 10)
    assert {(len(episode), episode.truncated) for episode in found} == {(5, True)}


def test_an_episode_that_ends_at_the_cut_is_not_truncated():
    end = [(1.0, 1, 1.0, True)]
    (episode,) = run_episodes(TableEnv([[end], [end]], [1.0, 0]), RandomPolicy(1, np.random.default_rng(0)), 1, most=1)
    assert (episode.terminated, episode.truncated) == (True, False)


@pytest.mark.parametrize("env", [gym.make("CliffWalking-v1"), TableEnv([[[(1.0, 0, 0.0, False)]]], [1.0])])
def test_no_cut_is_refused_when_there_is_no_time_limit(env):
    with pytest.raises(InvalidParameter, match=r"most is None.* no time limit"):
        run_episodes(env, RandomPolicy(1, np.random.default_rng(0)), 1)


@pytest.mark.parametrize("wrong", [{"n": 0}, {"n": -3}, {"n": 1.5}, {"n": "3"}, {"most": 0}, {"most": 2.5}, {"seed": -1}])
def test_numbers_out_of_range_are_refused(wrong, unchecked):
    asked = {"n": 1, "most": 5, "seed": 0} | wrong
    with pytest.raises(InvalidParameter, match=f"{next(iter(wrong))} is"):
        run_episodes(gym.make("Taxi-v4"), RandomPolicy(6, np.random.default_rng(0)), **asked)


# --- seeds and copies ---


@pytest.mark.parametrize("env_id", ["CartPole-v1", "Blackjack-v1", "FrozenLake-v1"])
def test_the_same_seed_gives_the_same_episodes(env_id):
    A = int(gym.make(env_id).action_space.n)
    first, second = (
        run_episodes(gym.make(env_id), RandomPolicy(A, np.random.default_rng(3)), 50, seed=8, most=20) for _ in "12"
    )
    for one, again in zip(first, second, strict=True):
        np.testing.assert_equal(one.observations, again.observations)
        assert one.rewards.tolist() == again.rewards.tolist()


@pytest.mark.parametrize("env_id", ["CartPole-v1", "Taxi-v4"])
def test_numpys_integers_seed_the_same_episodes(env_id, unchecked):
    first, second = (
        run_episodes(gym.make(env_id), RandomPolicy(2, np.random.default_rng(3)), n, seed=seed, most=9)
        for n, seed in ((3, 8), (np.int64(3), np.int64(8)))
    )
    np.testing.assert_equal([one.observations for one in first], [one.observations for one in second])


@pytest.mark.parametrize("env_id", ["CartPole-v1", "FrozenLake-v1"])
def test_the_environment_itself_is_not_touched(env_id):
    env = gym.make(env_id)
    env.reset(seed=0)
    before = env.unwrapped.__dict__.copy()
    run_episodes(env, RandomPolicy(2, np.random.default_rng(0)), 3)
    key = "state" if env_id == "CartPole-v1" else "s"
    assert env.unwrapped.__dict__[key] is before[key]


class Doubled(gym.RewardWrapper):
    """A wrapper that no spec can hold: it does not record its arguments."""

    def reward(self, reward):
        return 2 * reward


@pytest.mark.parametrize("wrap", [Doubled, lambda env: gym.wrappers.TransformReward(env, lambda reward: 2 * reward)])
def test_wrappers_are_run_too(wrap):
    found = run_episodes(wrap(gym.make("CartPole-v1")), RandomPolicy(2, np.random.default_rng(0)), 3)
    assert all(episode.total_reward == 2 * len(episode) for episode in found)


def test_maker_of_turns_rendering_off():
    assert maker_of(gym.make("FrozenLake-v1", render_mode="rgb_array"))().render_mode is None
