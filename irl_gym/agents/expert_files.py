"""An expert that is given as a file: SB3's zip of an agent, or an npz of a table's actions, as runs leave them."""

import hashlib
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from stable_baselines3.common.vec_env import VecEnv

from irl_gym.agents.experts import load_expert, training_of
from irl_gym.agents.planners import Agent, Progress
from irl_gym.agents.shown_observations import beside
from irl_gym.environments.tabular_vec_env import TabularVecEnv
from irl_gym.errors import DatasetMismatch, InvalidParameter, NotTabular
from irl_gym.files.own_files import digest
from irl_gym.mdp.policies import Policy, TabularPolicy, as_distribution


@dataclass(frozen=True)
class FromFile:
    """A planner that plans nothing: its policy is in a file. An agent's zip can run code when loaded: trust it first.

    Raises:
        InvalidParameter: no such file, or another than the digest says.
    """

    path: str
    """SB3's zip, or an npz with `actions` or `probabilities`."""
    sha256: str | None = None
    """Of the files, so that a run knows them again; `FromFile.at` fills it in."""
    normalize: str | None = None
    """Statistics of an agent's observations, where it was trained under VecNormalize: the file of its `save`, or an npz."""
    how = "read from a file"

    def __post_init__(self) -> None:
        if not is_file(self.path):
            raise InvalidParameter(f"expert is {self.path!r}, which is no file: expected SB3's zip, or an npz of actions.")
        if self.normalize is not None and not is_file(self.normalize):
            raise InvalidParameter(
                f"normalize is {self.normalize!r}, which is no file: expected what VecNormalize's `save` wrote, or an npz."
            )
        if self.sha256 is not None and self.sha256 != fingerprint(self.path, self.normalize):
            raise InvalidParameter(f"{self.path} is not the file that it was (sha256 {self.sha256[:8]}...): expected the same.")

    @classmethod
    def at(cls, path: str, normalize: str | None = None) -> "FromFile":
        """The expert in a file, with the digest of all its files."""
        there = is_file(path) and (normalize is None or is_file(normalize))
        return cls(path, fingerprint(path, normalize) if there else None, normalize)

    def trained(self) -> dict[str, Any]:
        """What its zip says of its training: the mean return of its last episodes, and statistics that may be missing here."""
        training = training_of(self.path)
        told: dict[str, Any] = {"trained_return": float(np.mean(training.returns))} if training.returns else {}
        missing = training.normalised and self.normalize is None and not beside(self.path).exists()
        return told | ({"vecnormalize": True} if missing else {})

    def plan(self, env: gym.Env | VecEnv, *, gamma: float, seed: int = 0, progress: Progress | None = None) -> Policy:
        """The policy in the file.

        Raises:
            DatasetMismatch: an agent of another environment.
            InvalidPolicy: a table of another size.
            NotTabular: a table of actions, where there is no table.
        """
        found = load_expert(self.path, normalize=self.normalize)
        if isinstance(found, Agent):
            return _fitting(found, env)
        if not isinstance(env, TabularVecEnv) or env.states is None:
            raise NotTabular(f"{self.path} holds a table of actions: expected an agent's zip, since there is no table here.")
        unknown = (
            np.isnan(found).any(axis=1) if found.ndim == 2 and found.dtype.kind == "f" else np.zeros(len(found), dtype=bool)
        )
        if unknown.any():
            raise InvalidParameter(
                f"{self.path} says nothing of {int(unknown.sum())} states, such as {int(np.argmax(unknown))}: expected actions "
                "in all. An expert read from a dataset cannot act; give the dataset."
            )
        return TabularPolicy(as_distribution(found, env.table.n_states, env.table.n_actions), env.states, seed)


def is_file(path: Any) -> bool:
    """Is this the path of a file that is there?"""
    return isinstance(path, str | os.PathLike) and Path(path).is_file()


def fingerprint(path: str, normalize: str | None = None) -> str:
    """The sha256 of a file; where others say what an agent in it is shown, of the digests of all."""
    found = [digest(one) for one in (path, beside(path), normalize) if one is not None and is_file(one)]
    return found[0] if len(found) == 1 else hashlib.sha256("".join(found).encode()).hexdigest()


def _fitting(agent: Agent, env: gym.Env | VecEnv) -> Agent:
    """The agent, which sees rows if it was trained on them."""
    if isinstance(env, TabularVecEnv) and env.states is not None:
        if agent.states is None and env.shows_rows and agent.model.observation_space == env.observation_space:
            return Agent(agent.model, env.states)
        check_agent(agent, env.states.space, env.action_space)
    else:
        check_agent(agent, env.observation_space, env.action_space)
    return agent


def check_agent(agent: Agent, observations: Any, actions: spaces.Space) -> None:
    """Check that an agent can act in an environment of these spaces.

    Raises:
        DatasetMismatch: it was trained on other observations or actions.
    """
    found, taken = agent.observation_space, agent.model.action_space
    fits = taken == actions and (found == observations or not isinstance(observations, spaces.Discrete))
    cause = None
    try:
        if fits and found != observations:  # SB3 turns pictures, so spaces that differ may fit
            agent.predict(observations.sample(), deterministic=True)
    except (ValueError, TypeError, KeyError, AttributeError, RuntimeError) as error:
        fits, cause = False, error
    if not fits:
        raise DatasetMismatch(
            f"the expert is an agent for observations {found} and actions {taken}: expected {observations} and {actions}, the "
            "environment's. Name the environment that it was trained in, or train it in this one."
        ) from cause
