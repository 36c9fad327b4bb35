"""irl_gym/MountainCar-v0: Gymnasium's physics on Ng & Russell's road."""

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.utils.env_checker import check_env

from irl_gym.errors import InvalidInput, InvalidParameter

ID = "irl_gym_envs:irl_gym/MountainCar-v0"


def make(**kwargs):
    return gym.make(ID, **kwargs).unwrapped


def drive(env, state, action):
    env.reset(options={"state": state})
    return env.step(action)


def test_mountain_car_passes_gymnasiums_checker():
    check_env(make(), skip_render_check=True)


def test_mountain_car_steps_as_gymnasiums_left_of_the_goal():
    env, theirs = make(), gym.make("MountainCar-v0").unwrapped
    rng = np.random.default_rng(0)
    theirs.reset(seed=0)
    for position, velocity in rng.uniform([-1.2, -0.07], [0.42, 0.07], size=(500, 2)):
        action = int(rng.integers(3))
        theirs.state = (position, velocity)
        expected = theirs.step(action)
        found = drive(env, [position, velocity], action)
        np.testing.assert_allclose(env.state, theirs.state, rtol=0, atol=1e-15)
        np.testing.assert_array_equal(found[0], expected[0])
        assert found[1:4] == expected[1:4]


def test_mountain_car_begins_as_gymnasiums():
    observation, _ = make().reset(seed=3)
    np.testing.assert_array_equal(observation, gym.make("MountainCar-v0").reset(seed=3)[0])


def test_mountain_car_takes_gymnasiums_reset_options():
    observation, _ = make().reset(seed=0, options={"low": -0.9, "high": -0.9})
    assert observation[0] == pytest.approx(-0.9)


def test_mountain_car_ends_at_the_end_of_the_road():
    env = make()
    observation, reward, terminated, truncated, _ = drive(env, [0.49, 0.05], 2)
    assert (env.state[0], reward, terminated, truncated) == (0.5, -1.0, True, False)
    assert env.observation_space.contains(observation)


def test_mountain_car_stops_at_the_end_of_the_road_and_goes_on_when_the_goal_is_not_terminal():
    env = make(terminal_goal=False)
    _, _, terminated, _, _ = drive(env, [0.49, 0.05], 2)
    assert (env.state.tolist(), terminated) == ([0.5, 0.0], False)
    env.step(0)
    assert env.state[0] < 0.5


def test_mountain_car_stops_at_the_left_wall():
    env = make()
    drive(env, [-1.19, -0.05], 0)
    assert env.state.tolist() == [-1.2, 0.0]


@pytest.mark.parametrize(("position", "paid"), [(-0.73, 0.0), (-0.71, 1.0), (-0.33, 1.0), (-0.31, 0.0)])
def test_mountain_car_pays_in_the_valley_when_the_task_is_to_park(position, paid):
    env = make(task="park")
    assert drive(env, [position, 0.0], 1)[1] == paid


def test_mountain_car_has_no_time_limit():
    assert gym.make(ID).spec.max_episode_steps is None


def test_mountain_car_is_made_again_from_its_json():
    spec = EnvSpec.from_json(gym.make(ID, task="park", terminal_goal=False).spec.to_json())
    assert gym.make(spec).unwrapped.physics == make(task="park", terminal_goal=False).physics


def test_mountain_car_draws_the_road():
    env = make(render_mode="rgb_array")
    env.reset(seed=0)
    assert env.render().shape == (400, 600, 3)
    env.close()


@pytest.mark.parametrize("kwargs", [{"task": "fly"}, {"render_mode": "ansi"}])
def test_mountain_car_refuses_bad_arguments(kwargs):
    from irl_gym_envs.mountain_car import MountainCarEnv

    with pytest.raises(InvalidParameter, match=str(next(iter(kwargs.values())))):
        MountainCarEnv(**kwargs)


@pytest.mark.parametrize("state", [[0.6, 0.0], [0.0], [0.0, float("nan")]])
def test_mountain_car_refuses_states_off_the_road(state):
    with pytest.raises(InvalidInput, match="position, velocity"):
        make().reset(options={"state": state})


def test_mountain_car_refuses_unknown_actions():
    env = make()
    env.reset(seed=0)
    with pytest.raises(InvalidInput, match="action is 3"):
        env.step(3)


def test_mountain_car_refuses_to_step_before_reset():
    with pytest.raises(InvalidInput, match="reset first"):
        make().step(0)
