"""A table and a reward as a gym.Env."""

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from models import episodic_model
from scipy.stats import chisquare

from irl_gym.environments.tabular_env import TabularEnv
from irl_gym.errors import InvalidInput, InvalidReward
from irl_gym.mdp.rewards import TabularReward
from irl_gym.tables.tabulate import tabulate


@pytest.fixture
def model():
    return episodic_model(3, S=6, A=2)


@pytest.fixture
def env(model):
    return TabularEnv(model.mdp, TabularReward(model.R))


def test_tabular_env_passes_gymnasiums_checker(env):
    check_env(env, skip_render_check=True)


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_tabular_env_passes_sb3s_checker(env):
    from stable_baselines3.common.env_checker import check_env as check

    check(env)


def test_tabulate_gives_the_table_back(model, env):
    found = tabulate(env, gamma=0.9)
    assert abs(found.mdp.P - model.mdp.P).max() < 1e-12


def test_tabulate_gives_the_reward_back_on_steps(model, env):
    found = tabulate(env, gamma=0.9)
    assert np.allclose(found.reward.values, TabularReward(model.R).expected(model.mdp))


def test_mdp_has_the_discount_asked_for(env):
    assert env.mdp(0.7).gamma == 0.7


def test_P_of_a_terminal_state_loops_without_reward(model, env):
    s = int(np.flatnonzero(model.mdp.terminal)[0])
    assert env.P[s][0] == [(1.0, s, 0.0, True)]


def test_step_has_the_frequencies_of_the_table(model, env):
    counts = np.zeros(6)
    s = int(np.flatnonzero(~model.mdp.terminal)[0])
    env.reset(seed=0)
    for _ in range(4000):
        env.reset(options={"state": s})
        counts[env.step(1)[0]] += 1
    p = model.P[s, 1]
    assert counts[p == 0].sum() == 0
    assert chisquare(counts[p > 0], 4000 * p[p > 0]).pvalue > 1e-3


def test_step_pays_a_state_reward_on_arrival(model, env):
    env.reset(seed=1)
    following, paid, *_ = env.step(0)
    assert paid == model.R[following]


def test_step_terminates_on_arrival_in_a_terminal_state_only(model, env):
    env.reset(seed=0)
    for _ in range(200):
        following, _, terminated, truncated, _ = env.step(env.action_space.sample())
        assert terminated == model.mdp.terminal[following]
        assert not truncated
        if terminated:
            env.reset()


def test_reset_is_the_same_for_the_same_seed(env):
    assert env.reset(seed=5)[0] == env.reset(seed=5)[0]


@pytest.mark.parametrize("action", [-1, 2, 0.5])
def test_step_refuses_an_action_out_of_range(env, action):
    env.reset(seed=0)
    with pytest.raises(InvalidInput, match=str(action)):
        env.step(action)


def test_step_refuses_to_go_on_before_reset(env):
    with pytest.raises(InvalidInput, match="reset"):
        env.step(0)


def test_reset_refuses_a_terminal_state(model, env):
    s = int(np.flatnonzero(model.mdp.terminal)[0])
    with pytest.raises(InvalidInput, match=str(s)):
        env.reset(options={"state": s})


def test_tabular_env_refuses_a_reward_of_another_table(model):
    with pytest.raises(InvalidReward, match="5"):
        TabularEnv(model.mdp, TabularReward(np.zeros(5)))


def test_tabular_env_works_in_a_time_limit(env):
    limited = gym.wrappers.TimeLimit(env, 3)
    limited.reset(seed=0)
    ends = [limited.step(0) for _ in range(3)]
    assert ends[-1][2] or ends[-1][3]
