"""irl_gym/ContinuousGridWorld-v0: the unit square of Ng & Russell's experiment 3."""

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.utils.env_checker import check_env
from stable_baselines3.common.env_checker import check_env as sb3_check_env

from irl_gym.errors import InvalidInput, InvalidParameter

ID = "irl_gym_envs:irl_gym/ContinuousGridWorld-v0"
EVERYTHING = {"step_size": 0.1, "noise": 0.05, "goal": [[0.0, 0.5], [0.2, 1.0]], "terminal_goal": True, "start": [0.9, 0.1]}


def make(**kwargs):
    return gym.make(ID, **kwargs).unwrapped


def walk(env, state, action):
    env.reset(options={"state": state})
    return env.step(action)


def test_continuous_grid_world_passes_both_checkers():
    check_env(make(), skip_render_check=True)
    sb3_check_env(make())


@pytest.mark.parametrize(("action", "place"), [(0, [0.5, 0.7]), (1, [0.7, 0.5]), (2, [0.5, 0.3]), (3, [0.3, 0.5])])
def test_continuous_grid_world_moves_up_right_down_left(action, place):
    env = make(noise=0.0)
    walk(env, [0.5, 0.5], action)
    np.testing.assert_allclose(env.state, place, atol=1e-15)


def test_continuous_grid_world_noise_is_uniform_on_each_coordinate():
    physics, rng = make().physics, np.random.default_rng(0)
    states = np.full((40_000, 2), 0.5)
    noise = physics.transition(states, np.zeros(40_000, dtype=int), rng).states - [0.5, 0.7]
    assert np.abs(noise).max() <= 0.1
    np.testing.assert_allclose(np.quantile(noise, [0.25, 0.5, 0.75], axis=0), [[-0.05] * 2, [0] * 2, [0.05] * 2], atol=0.002)
    assert abs(np.corrcoef(noise.T)[0, 1]) < 0.02


def test_continuous_grid_world_stays_in_the_square():
    env = make()
    env.reset(seed=0, options={"state": [0.0, 0.0]})
    places = [env.step(3)[0] for _ in range(50)]
    assert np.min(places) == 0.0


@pytest.mark.parametrize(("place", "paid"), [([0.9, 0.7], 1.0), ([0.7, 0.7], 0.0), ([0.9, 0.5], 0.0)])
def test_continuous_grid_world_pays_on_arrival_in_the_goal(place, paid):
    _, reward, terminated, _, _ = walk(make(noise=0.0), place, 0)
    assert (reward, terminated) == (paid, False)


def test_continuous_grid_world_ends_in_the_goal_when_it_is_terminal():
    assert walk(make(terminal_goal=True, noise=0.0), [0.9, 0.7], 0)[1:3] == (1.0, True)


def test_continuous_grid_world_begins_anywhere():
    starts = make().physics.start(20_000, np.random.default_rng(0))
    np.testing.assert_allclose(np.quantile(starts, [0.1, 0.9], axis=0), [[0.1] * 2, [0.9] * 2], atol=0.01)


def test_continuous_grid_world_begins_in_the_start_given():
    np.testing.assert_allclose(make(start=[0.2, 0.3]).reset(seed=0)[0], [0.2, 0.3], rtol=1e-6)


def test_continuous_grid_world_walks_the_same_way_when_seeded_the_same():
    walks = []
    for _ in range(2):
        env = make()
        env.reset(seed=5)
        walks.append([env.step(a % 4)[0] for a in range(20)])
    np.testing.assert_array_equal(*walks)


def test_continuous_grid_world_is_truncated_after_50_steps():
    assert gym.make(ID).spec.max_episode_steps == 50


def test_continuous_grid_world_is_made_again_from_its_json():
    spec = EnvSpec.from_json(gym.make(ID, **EVERYTHING).spec.to_json())
    physics = gym.make(spec).unwrapped.physics
    assert (physics.step_size, physics.noise, physics.terminal_goal) == (0.1, 0.05, True)
    assert (np.ravel(physics.goal).tolist(), list(physics.first)) == ([0.0, 0.5, 0.2, 1.0], [0.9, 0.1])


def test_continuous_grid_world_draws_the_agent_over_the_goal():
    env = make(render_mode="rgb_array", noise=0.0)
    env.reset(options={"state": [0.9, 0.5]})
    before = env.render()
    env.step(0)
    after = env.render()
    assert before.shape == (416, 416, 3) and before.dtype == np.uint8
    assert before[8 + 120, 8 + 360].tolist() == [248, 247, 243]  # (0.9, 0.7) was floor
    assert after[8 + 120, 8 + 360].tolist() == [0, 114, 178]


@pytest.mark.parametrize(
    "kwargs",
    [
        {"step_size": 0.0},
        {"noise": -0.1},
        {"goal": [0.8, 1.0]},
        {"goal": [[0.8, 0.8], [1.0, 1.5]]},
        {"goal": [[0.9, 0.8], [0.8, 1.0]]},
        {"start": "corner"},
        {"start": [0.5]},
        {"render_mode": "ansi"},
    ],
)
def test_continuous_grid_world_refuses_bad_arguments(kwargs):
    from irl_gym_envs.continuous_grid_world import ContinuousGridWorldEnv

    with pytest.raises(InvalidParameter, match=next(iter(kwargs))):
        ContinuousGridWorldEnv(**kwargs)


def test_continuous_grid_world_refuses_states_outside_the_square():
    with pytest.raises(InvalidInput, match="unit square"):
        make().reset(options={"state": [0.5, 1.5]})


def test_continuous_grid_world_refuses_unknown_actions_and_steps_before_reset():
    env = make()
    with pytest.raises(InvalidInput, match="reset first"):
        env.step(0)
    with pytest.raises(InvalidInput, match="action is 4"):
        env.step(4)
