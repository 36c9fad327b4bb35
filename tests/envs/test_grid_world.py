"""irl_gym/GridWorld-v0: its table, its arguments, and what Gymnasium, SB3 and Minari expect of it."""

import time

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.utils.env_checker import check_env
from models import paper_grid
from stable_baselines3.common.env_checker import check_env as sb3_check_env
from yardstick import yard

from irl_gym.errors import InvalidInput, InvalidParameter
from irl_gym.learners.linear_programs.finite import FiniteLP
from irl_gym.mdp.planning.dynamic_programming import value_iteration
from irl_gym.tables.tabulate import tabulate

ID = "irl_gym_envs:irl_gym/GridWorld-v0"
EVERYTHING = {
    "size": [3, 4],
    "slip": 0.2,
    "goals": [[0, 3], [2, 3]],
    "pits": [1, 3],
    "walls": [[1, 1]],
    "goal_reward": 2.0,
    "pit_reward": -3.0,
    "step_reward": -0.1,
    "start": [[2, 0], [0, 0]],
    "start_probabilities": [0.25, 0.75],
    "terminal_goal": False,
}


def make(**kwargs):
    return gym.make(ID, **kwargs).unwrapped


def probability(env, s, a, following):
    return env.table.P[[s * 4 + a]].toarray()[0, following]


def test_grid_world_is_the_papers_grid_by_default():
    paper = paper_grid(0.9)
    difference = abs(make().mdp(0.9).P - paper.mdp.P).max()
    assert difference < 1e-15


def test_grid_world_pays_the_papers_reward_by_default():
    np.testing.assert_array_equal(make().reward.values, paper_grid().R)


def test_grid_world_has_the_papers_lambda_0():
    mdp, env = make().mdp(0.9), make()
    expert = value_iteration(mdp, env.reward.expected(mdp), preference=(0, 1, 2, 3)).policy
    assert FiniteLP(margin_cap=None).critical_l1(mdp, expert) == pytest.approx(1.0550, abs=2e-4)


@pytest.mark.parametrize("kwargs", [{}, EVERYTHING], ids=["defaults", "everything"])
def test_grid_world_tabulates_to_its_own_table(kwargs):
    env = gym.make(ID, **kwargs)
    found, own = tabulate(env, gamma=0.9), env.unwrapped.mdp(0.9)
    assert (found.mdp.P != own.P).nnz == 0
    np.testing.assert_array_equal(found.mdp.d0, own.d0)


@pytest.mark.parametrize("kwargs", [{}, EVERYTHING], ids=["defaults", "everything"])
def test_grid_world_tabulates_to_its_own_reward(kwargs):
    env = gym.make(ID, **kwargs)
    found = tabulate(env, gamma=0.9, check_steps=0)
    np.testing.assert_allclose(found.reward.values, env.unwrapped.reward.expected(env.unwrapped.table), atol=1e-12)


@pytest.mark.parametrize("render_mode", [None, "ansi", "rgb_array"])
@pytest.mark.parametrize("kwargs", [{}, EVERYTHING], ids=["defaults", "everything"])
def test_grid_world_passes_gymnasiums_checker(kwargs, render_mode):
    check_env(make(**kwargs, render_mode=render_mode))


@pytest.mark.parametrize("kwargs", [{}, EVERYTHING], ids=["defaults", "everything"])
def test_grid_world_passes_sb3s_checker(kwargs):
    sb3_check_env(make(**kwargs, render_mode="rgb_array"), skip_render_check=False)


def test_grid_world_spec_survives_json():
    spec = gym.make(ID, **EVERYTHING).spec
    assert EnvSpec.from_json(spec.to_json()) == spec


def test_grid_world_made_from_json_has_the_same_table():
    env = gym.make(ID, **EVERYTHING)
    again = gym.make(EnvSpec.from_json(env.spec.to_json())).unwrapped
    assert (again.table.P != env.unwrapped.table.P).nnz == 0


def test_grid_world_slips_to_a_uniform_one_of_all_four_moves():
    env = make(size=3, slip=0.4, goals=[])
    np.testing.assert_allclose([probability(env, 4, 0, s) for s in (1, 5, 7, 3)], [0.7, 0.1, 0.1, 0.1])


@pytest.mark.parametrize(("action", "following"), [(0, 1), (1, 5), (2, 7), (3, 3)])
def test_grid_world_actions_are_up_right_down_left(action, following):
    assert probability(make(size=3, slip=0.0, goals=[]), 4, action, following) == 1


def test_grid_world_stays_when_a_move_leaves_the_grid():
    assert probability(make(size=3, slip=0.0, goals=[]), 0, 0, 0) == 1


def test_grid_world_stays_when_a_wall_is_in_the_way():
    assert probability(make(size=3, slip=0.0, walls=[1, 1]), 3, 1, 3) == 1


def test_grid_world_never_reaches_a_wall():
    env = make(size=3, slip=0.5, walls=[[1, 1]])
    assert not env.table.reachable[4]


def test_grid_world_numbers_cells_row_by_row():
    env = make(size=(2, 5), start=[1, 3])
    assert env.reset(seed=0)[0] == 8


def test_grid_world_goal_is_terminal_by_default():
    np.testing.assert_array_equal(np.flatnonzero(make().table.terminal), [4])


def test_grid_world_continuing_goal_pays_every_arrival():
    env = make(size=(1, 2), slip=0.0, terminal_goal=False)
    env.reset(seed=0)
    paid = [env.step(action)[1:3] for action in (1, 1, 3, 1)]
    assert paid == [(1.0, False), (1.0, False), (0.0, False), (1.0, False)]


def test_grid_world_pit_ends_the_episode_and_pays_on_arrival():
    env = make(size=(1, 3), slip=0.0, start=[0, 1], pits=[0, 0], pit_reward=-7.0)
    env.reset(seed=0)
    assert env.step(3)[:3] == (0, -7.0, True)


def test_grid_world_pays_the_step_reward_when_a_move_bumps():
    env = make(step_reward=-0.5, slip=0.0)
    env.reset(seed=0)
    assert env.step(3)[1] == -0.5


def test_grid_world_starts_anywhere_free_when_uniform():
    env = make(size=2, walls=[0, 0], start="uniform")
    np.testing.assert_allclose(env.table.d0, [0, 0, 0.5, 0.5])


def test_grid_world_starts_by_the_given_distribution():
    np.testing.assert_allclose(make(**EVERYTHING).table.d0[[8, 0]], [0.25, 0.75])


def test_grid_world_is_truncated_by_a_time_limit_only():
    env = gym.make(ID, slip=0.0)
    env.reset(seed=0)
    ends = [env.step(3)[2:4] for _ in range(100)]
    assert ends[-1] == (False, True) and not any(any(end) for end in ends[:-1])


def test_grid_world_repeats_itself_when_seeded():
    def walk():
        env = make()
        return [env.reset(seed=3)[0], *(env.step(a)[0] for a in (0, 1, 0, 1, 2, 3))]

    assert walk() == walk()


@pytest.mark.slow
def test_grid_world_of_a_million_cells_is_made_in_250_yards():
    started = time.process_time()
    make(size=1000)
    assert (time.process_time() - started) / yard() < 250


@pytest.mark.parametrize(
    ("kwargs", "told"),
    [
        ({"size": 0}, "size is 0"),
        ({"size": 1}, "nowhere to go"),
        ({"size": [3]}, r"size is \[3\]"),
        ({"size": 2.5}, "size is 2.5"),
        ({"slip": 1.2}, "slip is 1.2"),
        ({"slip": float("nan")}, "slip is nan"),
        ({"goals": [5, 0]}, r"goals has the cell \[5, 0\], off the map"),
        ({"goals": [0, -1]}, "off the map"),
        ({"goals": [1.5, 2.0]}, "in whole numbers"),
        ({"walls": [[1, 2], [3]]}, "walls is"),
        ({"walls": [0, 4]}, "goals has the cell .* among the walls"),
        ({"pits": [0, 4]}, "pits has the cell .* among the goals"),
        ({"start": [0, 4]}, "start has the cell .* terminal"),
        ({"walls": [4, 0]}, "start has the cell .* among the walls"),
        ({"start": []}, "start is empty"),
        ({"start": "anywhere"}, "start is 'anywhere'"),
        ({"start": "uniform", "start_probabilities": [1.0]}, "start='uniform'"),
        ({"start": [[4, 0], [4, 1]], "start_probabilities": [1.0]}, r"expected \(2,\)"),
        ({"start": [[4, 0], [4, 1]], "start_probabilities": [0.5, 0.6]}, "sum to 1"),
        ({"goal_reward": float("inf")}, "goal_reward is inf"),
    ],
)
def test_grid_world_refuses_arguments_that_cannot_be_right(kwargs, told):
    with pytest.raises(InvalidParameter, match=told):
        make(**kwargs)


def test_grid_world_refuses_an_unknown_render_mode():
    from irl_gym_envs.grid_world import GridWorldEnv

    with pytest.raises(InvalidParameter, match="render_mode is 'video'"):
        GridWorldEnv(render_mode="video")


def test_grid_world_refuses_to_start_in_a_wall():
    with pytest.raises(InvalidInput, match="a wall"):
        make(walls=[[2, 2]]).reset(options={"state": 12})
