"""Environments with exact tables. Importing this package registers them in Gymnasium under the namespace irl_gym.

    gym.make("irl_gym_envs:irl_gym/GridWorld-v0")     imports the package and makes the environment in one call

irl_gym never imports this package: to the library these are environments like any other.
"""

import gymnasium as gym

GRID_WORLD = "irl_gym/GridWorld-v0"
FOUR_ROOMS = "irl_gym/FourRooms-v0"

gym.register(GRID_WORLD, entry_point="irl_gym_envs.grid_world:GridWorldEnv", max_episode_steps=100)
gym.register(FOUR_ROOMS, entry_point="irl_gym_envs.four_rooms:FourRoomsEnv", max_episode_steps=500)

__all__ = ["FOUR_ROOMS", "GRID_WORLD"]
