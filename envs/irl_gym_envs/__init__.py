"""Environments with exact tables, or whose state can be set: importing this package registers them under irl_gym/.

    gym.make("irl_gym_envs:irl_gym/GridWorld-v0")     imports the package and makes the environment in one call

irl_gym never imports this package: to the library these are environments like any other.
"""

import gymnasium as gym

GRID_WORLD = "irl_gym/GridWorld-v0"
FOUR_ROOMS = "irl_gym/FourRooms-v0"
MOUNTAIN_CAR = "irl_gym/MountainCar-v0"
CONTINUOUS_GRID_WORLD = "irl_gym/ContinuousGridWorld-v0"
MINI_GRID = "irl_gym/MiniGrid-v0"

gym.register(GRID_WORLD, entry_point="irl_gym_envs.grid_world:GridWorldEnv", max_episode_steps=100)
gym.register(FOUR_ROOMS, entry_point="irl_gym_envs.four_rooms:FourRoomsEnv", max_episode_steps=500)
gym.register(
    MOUNTAIN_CAR,
    entry_point="irl_gym_envs.mountain_car:MountainCarEnv",
    vector_entry_point="irl_gym_envs.mountain_car:MountainCarVectorEnv",
)
gym.register(
    CONTINUOUS_GRID_WORLD,
    entry_point="irl_gym_envs.continuous_grid_world:ContinuousGridWorldEnv",
    vector_entry_point="irl_gym_envs.continuous_grid_world:ContinuousGridWorldVectorEnv",
    max_episode_steps=50,
)
gym.register(MINI_GRID, entry_point="irl_gym_envs.mini_grid:MiniGridEnv", max_episode_steps=500)

__all__ = ["CONTINUOUS_GRID_WORLD", "FOUR_ROOMS", "GRID_WORLD", "MINI_GRID", "MOUNTAIN_CAR"]
