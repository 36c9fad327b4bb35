"""What is read of experts: tables of actions, an agent's zip, what the agent is shown, and statistics of its observations."""

import base64
import contextlib
import json
import pickle
import zipfile
from collections import deque

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from stable_baselines3.common.running_mean_std import RunningMeanStd
from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize

from irl_gym.agents.checkpoints import Checkpoint
from irl_gym.agents.experts import load_expert, training_of
from irl_gym.agents.planners import SB3
from irl_gym.agents.shown_observations import read_shown, read_statistics, write_shown
from irl_gym.environments.tabular_vec_env import TabularVecEnv
from irl_gym.errors import InvalidParameter
from irl_gym.spaces.listed_states import ListedStates
from irl_gym.spaces.states import StateIndex

CELLS = spaces.MultiDiscrete([4, 4])
SETTINGS = {
    "policy_class": {"__module__": "stable_baselines3.a2c"}, "_last_original_obs": {":type:": "ndarray"},
    "observation_space": {":type:": "<class 'gymnasium.spaces.box.Box'>"},
    "ep_info_buffer": {":serialized:": base64.b64encode(pickle.dumps(deque([{"r": 1.5}, {"r": np.float64(2)}]))).decode()},
}  # fmt: skip


def write_experts(folder):
    np.savez(folder / "actions.npz", actions=np.arange(16) % 4)
    np.savez(folder / "known.npz", probabilities=np.vstack([np.full((15, 4), 0.25), np.full((1, 4), np.nan)]))
    with zipfile.ZipFile(folder / "agent.zip", "w") as archive:
        archive.writestr("data", json.dumps(SETTINGS))


def read_experts(folder):
    training = training_of(folder / "agent.zip")
    assert np.isfinite(training.returns).all() and training.normalised in (True, False)
    for path in sorted(folder.glob("*.npz")):
        table = load_expert(path)
        assert table.ndim in (1, 2) and table.size
        if table.ndim == 2 and table.dtype.kind == "f":
            known = table[~np.isnan(table).all(axis=1)]
            assert np.isfinite(known).all() and (known >= 0).all() and (abs(known.sum(axis=1) - 1) < 1e-6).all()
        else:
            assert table.dtype.kind in "iub" and table.min() >= 0
    with contextlib.suppress(InvalidParameter):  # of who stands in for Stable-Baselines3 in these tests
        load_expert(folder / "agent.zip")


def write_statistics(folder):
    venv = VecNormalize(DummyVecEnv([lambda: gym.make("CartPole-v1")]))
    venv.reset()
    for action in (0, 1, 1):
        venv.step([action])
    venv.save(folder / "array.pkl")
    mean, var = venv.obs_rms.mean, venv.obs_rms.var
    np.savez(folder / "array.npz", mean=mean, var=var, clip=10.0, epsilon=1e-8)
    np.savez(folder / "parts.npz", **{"mean.a": mean, "var.a": var, "mean.b": 0.5, "var.b": 1.0}, clip=10.0, epsilon=1e-8)
    venv.obs_rms = {"a": RunningMeanStd(shape=(2,)), "b": RunningMeanStd(shape=())}
    venv.save(folder / "parts.pkl")


def sound_statistics(found):
    observation = {key: np.zeros_like(mean) for key, mean in found.mean.items()}
    shown = {"": found(observation[""])} if "" in observation else found(observation)
    for key, one in shown.items():
        assert one.dtype == np.float32 and one.shape == found.mean[key].shape and not np.isnan(one).any()
        assert abs(one).max(initial=0) <= np.float32(found.clip)


def read_numbers(folder):
    for path in sorted(folder.iterdir()):
        sound_statistics(read_statistics(path))


def write_what_is_shown(folder):
    write_statistics(folder)
    write_shown(folder / "normalised.zip", None, read_statistics(folder / "parts.pkl"))
    write_shown(folder / "index.zip", StateIndex(CELLS, {3: 16}), None)
    write_shown(folder / "listed.zip", ListedStates(CELLS, np.array([[0, 1], [2, 3], [3, 3]]), {1: 3}), None)


def read_what_is_shown(folder):
    for path in sorted(folder.glob("*.shown.npz")):
        states, normaliser = read_shown(path.with_name(path.name.replace(".shown.npz", ".zip")))
        assert (states is None) != (normaliser is None)
        if normaliser is not None:
            sound_statistics(normaliser)
            continue
        assert all(states.space.contains(states.decode(row)) for row in range(min(states.n_states, 20)))


FEW = {
    "PPO": {"n_steps": 8, "batch_size": 16, "n_epochs": 1},
    "DQN": {"learning_starts": 8, "buffer_size": 40, "gradient_steps": 1, "batch_size": 8},
}  # fmt: skip
"""Of trainings of 64 steps, on two copies."""


class _BrokenOff(Exception):
    """Ends a training."""


def trained(mdp, path, algorithm, until=None):
    def look(steps, agent):
        if until is not None and steps >= until:
            raise _BrokenOff

    env = TabularVecEnv(mdp, np.linspace(-1, 1, mdp.n_states), num_envs=2, max_episode_steps=9, seed=3)
    planner = SB3(algorithm, total_timesteps=64, hyperparameters=FEW[algorithm])
    return planner.plan(env, gamma=0.9, seed=3, progress=look, interval=2, checkpoint=Checkpoint(path, "it"))


def write_trainings(mdp):
    def write(folder):
        for algorithm in FEW:
            with contextlib.suppress(_BrokenOff):
                trained(mdp, folder / f"{algorithm}.npz", algorithm, until=48)

    return write


def read_trainings(mdp):
    """What goes on to its end ends in weights that act."""

    def read(folder):
        for algorithm in FEW:
            model = trained(mdp, folder / f"{algorithm}.npz", algorithm).model
            assert model.num_timesteps >= 64 and all(np.isfinite(one.detach()).all() for one in model.policy.parameters())

    return read
