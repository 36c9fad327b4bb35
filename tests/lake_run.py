"""The runs that tests of what a run leaves share: a lake without slipping, and an agent trained for a moment."""

from own_learners import Both, Copycat, Pusher

from irl_gym.agents.planners import SB3, ValueIteration
from irl_gym.runs.experiment import Experiment

COMMAND = ("irl-gym", "run", "--env-kwargs", 'desc=["SG"]', "--out", "a folder")
LAKE = {"env_kwargs": {"is_slippery": False}, "episodes": 10, "eval_episodes": 10, "num_envs": 16}


def asked(**changes):
    return Experiment("FrozenLake-v1", 0.99, **{"retrain": SB3(total_timesteps=8_192), **LAKE, **changes})


def of_policies(name, seed=0):
    """A learner of a policy, of a policy and a reward, or of a policy without a table."""
    few = {
        "env_kwargs": {"max_episode_steps": 50},
        "expert": SB3(total_timesteps=256, hyperparameters={"n_steps": 64, "batch_size": 64}),
        "num_envs": 2,
    }
    return {
        "policy": lambda: asked(learner=Copycat(), seed=seed),
        "both": lambda: asked(learner=Both(), retrain=ValueIteration(), seed=seed),
        "stepped": lambda: Experiment("CartPole-v1", 0.99, episodes=10, eval_episodes=20, learner=Pusher(), seed=seed, **few),
    }[name]()
