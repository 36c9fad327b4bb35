"""The run that tests of what a run leaves share: a lake without slipping, and an agent trained for a moment."""

from irl_gym.agents.planners import SB3
from irl_gym.runs.experiment import Experiment

COMMAND = ("irl-gym", "run", "--env-kwargs", 'desc=["SG"]', "--out", "a folder")
LAKE = {"env_kwargs": {"is_slippery": False}, "episodes": 10, "eval_episodes": 10, "num_envs": 16}


def asked(**changes):
    return Experiment("FrozenLake-v1", 0.99, **{"retrain": SB3(total_timesteps=8_192), **LAKE, **changes})
