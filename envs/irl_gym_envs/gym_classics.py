"""The environments of the package gym-classics by name: importing this module registers them with Gymnasium.

`gym.make("irl_gym_envs.gym_classics:ClassicGridworld-v0")` does both; gym-classics itself asks for a call of its own.
"""

import gymnasium as gym

from irl_gym.errors import NotInstalled

try:
    import gym_classics
except ImportError as error:
    raise NotInstalled("gym-classics is not installed: expected it, for its environments. pip install gym-classics.") from error

if "ClassicGridworld-v0" not in gym.registry:
    gym_classics.register("gymnasium")
