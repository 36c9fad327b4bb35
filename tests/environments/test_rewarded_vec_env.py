"""A learned reward in a vector environment: paid on arrival, also at the end, and divided by its return's deviation."""

import gymnasium as gym
import numpy as np
import pytest
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.vec_env import VecNormalize
from tiny_env import Room, TableEnv

from irl_gym.environments.rewarded_vec_env import RewardedVecEnv, rewarded
from irl_gym.errors import InvalidFeatures
from irl_gym.features.bases import RadialBasis
from irl_gym.features.feature_maps import Functions, OneHot
from irl_gym.features.linear_reward import LinearReward

ALPHA = np.random.default_rng(0).normal(size=16)
LAKE = LinearReward(ALPHA, OneHot(16))


def lakes(n=4, **kwargs):
    return make_vec_env("FrozenLake-v1", n, seed=3, env_kwargs=kwargs)


def walk(venv, n=100):
    """Observations, rewards, ends and infos of n seeded steps; the first entry is the reset's."""
    rng = np.random.default_rng(1)
    rows = [(venv.reset(), None, None, None)]
    for _ in range(n):
        rows.append(venv.step(rng.integers(2, size=venv.num_envs)))
    return rows


@pytest.fixture(scope="module")
def pair():
    return walk(lakes()), walk(RewardedVecEnv(lakes(), LAKE))


def test_rewarded_vec_env_changes_nothing_but_the_reward(pair):
    for (observations, _, dones, _), (same, _, ends, _) in zip(*pair, strict=True):
        assert np.array_equal(observations, same) and np.array_equal(dones, ends)


def test_rewarded_vec_env_pays_the_reward_of_the_state_arrived_in(pair):
    for observations, rewards, dones, infos in pair[1][1:]:
        reached = [
            info["terminal_observation"] if done else o for o, done, info in zip(observations, dones, infos, strict=True)
        ]
        np.testing.assert_allclose(rewards, ALPHA[reached], rtol=1e-6)


def test_rewarded_vec_env_pays_where_the_episode_ended_not_where_the_next_begins(pair):
    ends = [(r[i], infos[i]["terminal_observation"]) for _, r, d, infos in pair[1][1:] for i in np.flatnonzero(d)]
    assert len(ends) > 20 and all(where != 0 and paid == np.float32(ALPHA[where]) for paid, where in ends)


def test_rewarded_vec_env_pays_where_a_time_limit_cut():
    def make():
        return gym.make("FrozenLake-v1", max_episode_steps=1, is_slippery=False)

    venv = RewardedVecEnv(make_vec_env(make, 2), LAKE)
    venv.reset()
    _, rewards, dones, infos = venv.step(np.array([2, 1]))
    assert dones.all() and infos[0]["TimeLimit.truncated"]
    np.testing.assert_allclose(rewards, ALPHA[[1, 4]], rtol=1e-6)


def test_rewarded_vec_env_pays_rewards_of_coordinates():
    phi = RadialBasis.grid([-1, -1, -1, -1], [1, 1, 1, 1], 2)
    reward = LinearReward(np.arange(16.0), phi)
    venv = RewardedVecEnv(make_vec_env("CartPole-v1", 3, seed=0), reward)
    venv.reset()
    observations, rewards, _, _ = venv.step(np.zeros(3, dtype=int))
    np.testing.assert_allclose(rewards, reward.of(observations), rtol=1e-6)


def test_rewarded_vec_env_pays_rewards_of_dictionaries():
    reward = LinearReward(np.array([1.0]), Functions(lambda seen: seen["b"][:, :1], 1))
    venv = RewardedVecEnv(make_vec_env(lambda: Room(2), 2), reward)
    venv.reset()
    paid = [venv.step(np.zeros(2, dtype=int))[1].tolist() for _ in range(4)]
    assert paid == [[1.0, 1.0], [2.0, 2.0], [1.0, 1.0], [2.0, 2.0]]


def test_rewarded_vec_env_refuses_features_of_other_observations():
    venv = RewardedVecEnv(make_vec_env("CartPole-v1", 2), LAKE)
    venv.reset()
    with pytest.raises(InvalidFeatures, match="integers"):
        venv.step(np.zeros(2, dtype=int))


# --- divided by the deviation of the return ---


def test_rewarded_keeps_the_reward_as_it_is_beside_the_divided_one():
    venv = rewarded(lakes(), LAKE, 0.9)
    venv.reset()
    observations, _, dones, _ = venv.step(np.ones(4, dtype=int))
    assert isinstance(venv, VecNormalize) and not dones.any()
    np.testing.assert_allclose(venv.get_original_reward(), ALPHA[observations], rtol=1e-6)


def test_rewarded_divides_by_a_positive_number():
    venv = rewarded(lakes(), LAKE, 0.9)
    venv.reset()
    for _ in range(50):
        _, rewards, _, _ = venv.step(np.random.default_rng(0).integers(4, size=4))
        assert np.array_equal(np.sign(rewards), np.sign(venv.get_original_reward()))


def test_rewarded_leaves_observations_as_they_are():
    plain, learned = make_vec_env("CartPole-v1", 2, seed=0), make_vec_env("CartPole-v1", 2, seed=0)
    reward = LinearReward(np.array([1.0]), Functions(lambda seen: seen[:, :1], 1))
    for (observations, *_), (same, *_) in zip(walk(plain, 30), walk(rewarded(learned, reward, 0.9), 30), strict=True):
        np.testing.assert_array_equal(observations, same)


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_rewarded_pays_about_one_deviation_whatever_the_scale(scale):
    venv = rewarded(lakes(8), LinearReward(scale * ALPHA, OneHot(16)), 0.9)
    paid = np.concatenate([row[1] for row in walk(venv, 400)[200:]])
    assert 0.05 < np.abs(paid).mean() < 5


def test_rewarded_does_not_clip():
    venv = rewarded(lakes(), LinearReward(np.full(16, 1e6), OneHot(16)), 0.9)
    venv.reset()
    assert (venv.step(np.zeros(4, dtype=int))[1] > 100).all()  # before anything is known of the deviation


def test_rewarded_never_pays_the_true_reward():
    env = TableEnv([[[(1.0, 0, 77.0, False)]]], [1.0])
    venv = rewarded(make_vec_env(lambda: env, 1), LinearReward(np.zeros(1), OneHot(1)), 0.9)
    assert all(row[1].tolist() == [0.0] for row in walk_of_one(venv))


def walk_of_one(venv):
    venv.reset()
    return [venv.step(np.zeros(1, dtype=int)) for _ in range(5)]
