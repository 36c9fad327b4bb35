"""All copies at once: the same as single environments, and as SB3 expects."""

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces
from models import episodic_model
from scipy.stats import chi2_contingency
from stable_baselines3 import PPO
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv

from irl_gym.environments.tabular_env import TabularEnv
from irl_gym.environments.tabular_vec_env import TabularVecEnv, shows_rows
from irl_gym.errors import InvalidInput, InvalidParameter
from irl_gym.mdp.rewards import TabularReward
from irl_gym.mdp.tabular_mdp import TransitionTable
from irl_gym.spaces.states import StateIndex
from irl_gym.tables.discretize import discretize

LIMIT = 5


@pytest.fixture
def model():
    return episodic_model(3, S=6, A=2)


@pytest.fixture
def vec(model):
    return TabularVecEnv(model.mdp, TabularReward(model.R), num_envs=32, max_episode_steps=LIMIT, seed=0)


def corridor(n):
    """n states in a row, one action, the last terminal: every episode is the same."""
    P = np.eye(n, k=1)
    d0 = np.eye(n)[0]
    return TransitionTable(P, d0), TabularReward(np.arange(n, dtype=float))


def episodes(env, n_steps, seed):
    """(observation, action, successor, reward, done, truncated) rows of a vector environment under random actions."""
    rng = np.random.default_rng(seed)
    env.seed(seed)
    here, rows = env.reset(), []
    for _ in range(n_steps):
        actions = rng.integers(2, size=env.num_envs)
        following, rewards, dones, infos = env.step(actions)
        for i in range(env.num_envs):
            last = infos[i]["terminal_observation"] if dones[i] else following[i]
            cut = infos[i].get("TimeLimit.truncated", False)
            rows.append((here[i], actions[i], last, rewards[i], dones[i], cut))
        here = following
    return np.array(rows, dtype=np.float64)


@pytest.fixture
def pair(model, vec):
    """Rows of the vectorised environment and of SB3's DummyVecEnv over single ones."""

    def single():
        return Monitor(gym.wrappers.TimeLimit(TabularEnv(model.mdp, TabularReward(model.R)), LIMIT))

    return episodes(vec, 400, 1), episodes(DummyVecEnv([single] * 8), 1000, 2)


def same_distribution(first, second):
    """p-value of a chi-square test that two lists of symbols have one distribution."""
    values = np.unique(np.concatenate([first, second]))
    table = np.array([[(part == value).sum() for value in values] for part in (first, second)])
    return chi2_contingency(table[:, table.min(axis=0) >= 5]).pvalue


def test_transitions_have_the_distribution_of_single_environments(pair):
    symbols = [rows[:, 0] * 100 + rows[:, 1] * 10 + rows[:, 2] for rows in pair]
    assert same_distribution(*symbols) > 1e-3


def test_ends_have_the_distribution_of_single_environments(pair):
    symbols = [rows[:, 4] * 2 + rows[:, 5] for rows in pair]
    assert same_distribution(*symbols) > 1e-3


def test_rewards_are_those_of_the_arrivals(model, pair):
    assert np.allclose(pair[0][:, 3], model.R[pair[0][:, 2].astype(int)], atol=1e-6)


def test_truncation_is_reported_as_sb3_expects():
    table, reward = corridor(6)
    env = TabularVecEnv(table, reward, num_envs=1, max_episode_steps=2)
    env.reset()
    env.step(np.array([0]))
    observations, _, dones, infos = env.step(np.array([0]))
    assert (dones[0], infos[0]["TimeLimit.truncated"], infos[0]["terminal_observation"], observations[0]) == (1, 1, 2, 0)


def test_termination_at_the_time_limit_is_not_truncation():
    table, reward = corridor(3)
    env = TabularVecEnv(table, reward, num_envs=1, max_episode_steps=2)
    env.reset()
    env.step(np.array([0]))
    assert env.step(np.array([0]))[3][0]["TimeLimit.truncated"] is False


def test_episode_infos_are_monitors():
    table, reward = corridor(4)
    env = TabularVecEnv(table, reward, num_envs=2)
    env.reset()
    infos = [env.step(np.zeros(2, dtype=int))[3] for _ in range(3)][-1]
    assert {**infos[1]["episode"], "t": 0} == {"r": 6.0, "l": 3, "t": 0}


def test_infos_are_not_shared_between_copies(vec):
    vec.reset()
    infos = vec.step(np.zeros(32, dtype=int))[3]
    assert len({id(info) for info in infos}) == 32


def test_seed_makes_runs_equal(vec):
    assert np.array_equal(episodes(vec, 20, 7), episodes(vec, 20, 7))


def test_states_decode_the_observations(model):
    states = StateIndex(spaces.MultiDiscrete([2, 3]))
    env = TabularVecEnv(model.mdp, TabularReward(model.R), num_envs=4, states=states, seed=0)
    assert env.observation_space.contains(env.reset()[0])


def test_states_decode_dictionaries(model):
    states = StateIndex(spaces.Dict(a=spaces.Discrete(2), b=spaces.Discrete(3)))
    env = TabularVecEnv(model.mdp, TabularReward(model.R), num_envs=4, states=states, max_episode_steps=1, seed=0)
    env.reset()
    assert set(env.step(np.zeros(4, dtype=int))[3][0]["terminal_observation"]) == {"a", "b"}


@pytest.mark.parametrize(
    "space",
    [
        spaces.Tuple([spaces.Discrete(2), spaces.Discrete(3)]),
        spaces.Dict(a=spaces.Tuple([spaces.Discrete(2)]), b=spaces.Discrete(3)),
        spaces.Dict(a=spaces.Dict(c=spaces.Discrete(2)), b=spaces.Discrete(3)),
        spaces.Dict(a=spaces.Discrete(2), b=spaces.Discrete(3)),
        spaces.Box(np.array([0, 1]), np.array([1, 3]), dtype=np.int64),
        spaces.MultiDiscrete([2, 3]),
        spaces.Discrete(6, start=2),
    ],
)
def test_rows_are_shown_for_observations_that_sb3_cannot_encode(model, space):
    states = StateIndex(space)
    env = TabularVecEnv(
        model.mdp, TabularReward(model.R), num_envs=4, states=states, show_rows=shows_rows(states), max_episode_steps=1, seed=0
    )
    last = env.reset()
    assert env.observation_space == spaces.Discrete(6) and last.shape == (4,)
    final = env.step(np.zeros(4, dtype=int))[3][0]["terminal_observation"]
    assert env.states is states and np.isscalar(final) and 0 <= final < 6


def test_observations_are_shown_when_sb3_encodes_them():
    cells = discretize(gym.make("MountainCar-v0"), gamma=0.9, bins=3).states
    assert not shows_rows(StateIndex(spaces.Discrete(6))) and not shows_rows(cells)


@pytest.mark.parametrize(
    "space",
    [
        spaces.Tuple([spaces.Discrete(2), spaces.Discrete(3)]),
        spaces.Dict(a=spaces.Tuple([spaces.Discrete(2)]), b=spaces.Discrete(3)),
        spaces.Dict(a=spaces.Dict(c=spaces.Discrete(2)), b=spaces.Discrete(3)),
    ],
)
def test_constructor_refuses_to_show_what_sb3_does_not_take(model, space):
    with pytest.raises(InvalidParameter, match=r"no Tuple.*Use show_rows=True"):
        TabularVecEnv(model.mdp, TabularReward(model.R), states=StateIndex(space))


def test_ppo_learns_on_it_and_sees_episodes(vec):
    model = PPO("MlpPolicy", vec, n_steps=8, batch_size=64, device="cpu").learn(512)
    assert len(model.ep_info_buffer) > 0


@pytest.mark.parametrize("actions", [np.full(32, 2), np.zeros(31, dtype=int), np.zeros(32)])
def test_step_refuses_wrong_actions(vec, actions):
    vec.reset()
    with pytest.raises(InvalidInput, match="actions"):
        vec.step(actions)


@pytest.mark.parametrize("wrong", [{"num_envs": 0}, {"max_episode_steps": 0}, {"states": StateIndex(spaces.Discrete(5))}])
def test_constructor_refuses(model, wrong):
    with pytest.raises(InvalidParameter, match="expected"):
        TabularVecEnv(model.mdp, TabularReward(model.R), **wrong)


def test_set_attr_is_refused(vec):
    with pytest.raises(InvalidInput, match="table"):
        vec.set_attr("reward", None)
