"""irl_gym/FourRooms-v0: the plan and the noise of Sutton, Precup & Singh (1999)."""

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.utils.env_checker import check_env
from scipy.sparse.csgraph import connected_components
from stable_baselines3.common.env_checker import check_env as sb3_check_env

from irl_gym.errors import InvalidParameter
from irl_gym.tables.tabulate import tabulate

ID = "irl_gym_envs:irl_gym/FourRooms-v0"
HALLWAYS = [(3, 6), (6, 2), (7, 9), (10, 6)]


def make(**kwargs):
    return gym.make(ID, **kwargs).unwrapped


def test_four_rooms_has_104_free_cells_on_13_by_13():
    env = make()
    assert (env.shape, int((~env.walls).sum())) == ((13, 13), 104)


def test_four_rooms_reaches_every_free_cell_and_no_wall():
    env = make(goals=[], start=[1, 1])
    np.testing.assert_array_equal(env.table.reachable.reshape(env.shape), ~env.walls)


def test_four_rooms_falls_into_four_rooms_when_the_hallways_are_closed():
    env = make(goals=[])
    rooms = [r * 13 + c for r, c in np.argwhere(~env.walls).tolist() if (r, c) not in HALLWAYS]
    P = env.table.P_pi(np.full((169, 4), 0.25))[rooms][:, rooms]
    _, labels = connected_components(P)
    assert sorted(np.bincount(labels).tolist()) == [20, 25, 25, 30]


def test_four_rooms_noise_is_the_papers():
    env = make()
    s = 2 * 13 + 2
    row = env.table.P[[s * 4 + 0]].toarray()[0]
    np.testing.assert_allclose(row[[s - 13, s + 1, s + 13, s - 1]], [2 / 3, 1 / 9, 1 / 9, 1 / 9])


def test_four_rooms_pays_the_goal_once_on_arrival():
    env = make(slip=0.0)
    env.reset(seed=0, options={"state": 6 * 13 + 9})
    assert env.step(2)[:3] == (7 * 13 + 9, 1.0, True)


def test_four_rooms_tabulates_to_its_own_table():
    env = gym.make(ID)
    assert (tabulate(env, gamma=0.9).mdp.P != env.unwrapped.mdp(0.9).P).nnz == 0


@pytest.mark.parametrize("render_mode", [None, "ansi", "rgb_array"])
def test_four_rooms_passes_gymnasiums_checker(render_mode):
    check_env(make(render_mode=render_mode))


def test_four_rooms_passes_sb3s_checker():
    sb3_check_env(make())


def test_four_rooms_spec_survives_json():
    spec = gym.make(ID, slip=0.1, goals=[[9, 9]], start="uniform").spec
    assert EnvSpec.from_json(spec.to_json()) == spec


def test_four_rooms_refuses_a_goal_in_a_wall():
    with pytest.raises(InvalidParameter, match=r"goals has the cell \[6, 6\]"):
        make(goals=[6, 6])
