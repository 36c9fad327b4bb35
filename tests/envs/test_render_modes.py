"""What all environments say of render modes that they do not have, or were not given."""

import gymnasium as gym
import pytest

import irl_gym_envs  # noqa: F401  (registers its environments)
from irl_gym.errors import InvalidParameter

DRAWN = {"GridWorld": "ansi", "FourRooms": "ansi", "ContinuousGridWorld": "rgb_array", "MiniGrid": "rgb_array"}


@pytest.mark.parametrize("name", [*DRAWN, "MountainCar"])
def test_a_render_mode_that_is_unknown_is_refused(name):
    kind = gym.spec(f"irl_gym/{name}-v0").entry_point
    with pytest.raises(InvalidParameter, match="render_mode is 'film': expected None or one of"):
        gym.envs.registration.load_env_creator(kind)(render_mode="film")


@pytest.mark.parametrize("name", DRAWN)
def test_rendering_without_a_mode_warns_and_offers_one(name):
    env = gym.make(f"irl_gym/{name}-v0", disable_env_checker=True).unwrapped
    with pytest.warns(UserWarning, match=f'irl_gym/{name}-v0", render_mode="{DRAWN[name]}"'):
        assert env.render() is None
