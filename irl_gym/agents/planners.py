"""Planners: environments to policies. Experts and retrained agents alike.

`ValueIteration` plans on the table; `SB3` learns from steps with Stable-Baselines3. Both are frozen records, both give a
policy with SB3's `predict`.
"""

import contextlib
import copy
import io
import os
import re
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, Protocol, runtime_checkable

import gymnasium as gym
import numpy as np
import torch
from gymnasium import spaces
from stable_baselines3 import A2C, DQN, PPO
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.logger import HumanOutputFormat, Logger, configure
from stable_baselines3.common.vec_env import VecEnv

from irl_gym._typing import Actions
from irl_gym.agents.checkpoints import Checkpoint, Watching
from irl_gym.agents.shown_observations import Normaliser, read_shown, write_shown
from irl_gym.checks import checked_number
from irl_gym.environments.tabular_vec_env import TabularVecEnv
from irl_gym.errors import InvalidParameter, InvalidPolicy
from irl_gym.files.own_files import write_bytes
from irl_gym.mdp.planning.dynamic_programming import value_iteration
from irl_gym.mdp.policies import Policy, TabularPolicy, as_distribution
from irl_gym.mdp.tabular_mdp import TabularMDP, check_discount
from irl_gym.records import Record
from irl_gym.spaces.states import StateIndex, States
from irl_gym.tables.tabulate import tabulate

Algorithm = Literal["PPO", "DQN", "A2C"]
Progress = Callable[[int, Policy], None]
"""Called with the environment steps made so far and the policy as it is."""
FirstWeights = Callable[[Any], object]
"""Gives weights to a model of SB3 that was not trained yet."""

_ALGORITHMS: dict[str, type[BaseAlgorithm]] = {"PPO": PPO, "DQN": DQN, "A2C": A2C}

# One-hot input and no hidden layer: logits and values are tables, one entry a state, and Adam's large steps are safe.
# scripts/measure_retraining.py prints what these settings reach on each environment.
_LINEAR: dict[str, Any] = {"net_arch": []}
DEFAULTS: dict[str, dict[str, Any]] = {
    "PPO": {"n_epochs": 4, "learning_rate": 0.03, "gae_lambda": 0.6, "ent_coef": 0.03, "policy_kwargs": _LINEAR},
    "A2C": {"n_steps": 8, "learning_rate": 0.03, "gae_lambda": 0.9, "ent_coef": 0.01, "policy_kwargs": _LINEAR},
    "DQN": {
        "learning_rate": 0.01, "learning_starts": 1_000, "batch_size": 512, "train_freq": 4, "gradient_steps": 4,
        "target_update_interval": 500, "exploration_fraction": 0.5, "buffer_size": 100_000, "policy_kwargs": _LINEAR,
    },
}  # fmt: skip
"""Hyper-parameters for discrete observations; other observation spaces get SB3's own."""

FOR_ADVANTAGES: dict[str, Any] = {"normalize_advantage": False, "ent_coef": 0.1}
"""PPO on a reward between -1 and 0, as `ExpectedAdvantage(clip)` gives: its scale is known, and normalising each batch would
let the frequent states drown what is left to learn in rare ones. FrozenLake 8x8: score 0.99 instead of 0.98."""


@runtime_checkable
class Planner(Protocol):
    """Turns an environment into a policy for it."""

    def plan(self, env: gym.Env | VecEnv, *, gamma: float, seed: int = 0, progress: Progress | None = None) -> Policy:
        """Find a good policy for the reward that `env` pays."""
        ...


@dataclass(frozen=True)
class ValueIteration(Record):
    """Exact planning on the table of the environment."""

    tolerance: float | None = None
    """Bound on the error of the values, in units of value; None for 1e-10 of max |R| / (1 - gamma)."""
    sweeps: int = 50
    """Evaluation sweeps after each improvement; 0 for plain value iteration."""
    preference: Sequence[int] | None = None
    """Order in which ties between actions are broken; the default is 0, 1, ..."""
    how = "planned by value iteration"

    def plan(self, env: gym.Env | VecEnv, *, gamma: float, seed: int = 0, progress: Progress | None = None) -> TabularPolicy:
        """The optimal policy of the environment's table.

        Raises:
            NotTabular, NotDiscrete: no table can be made.
        """
        if isinstance(env, TabularVecEnv):
            table, R = env.table, env.reward
            states = env.states or StateIndex(spaces.Discrete(table.n_states))
            mdp = TabularMDP(table.P, gamma, table.d0)
        elif isinstance(env, VecEnv):
            raise InvalidParameter(f"{type(env).__name__} has no table: expected a Gymnasium environment or TabularVecEnv.")
        else:
            found = tabulate(env, gamma=gamma, check_steps=0)
            mdp, R, states = found.mdp, found.reward, found.states
        solution = value_iteration(mdp, R, tolerance=self.tolerance, sweeps=self.sweeps, preference=self.preference)
        return TabularPolicy(as_distribution(solution.policy, mdp.n_states, mdp.n_actions), states, seed)


@dataclass(frozen=True, eq=False)
class Agent(Record):
    """A trained Stable-Baselines3 model, as a policy."""

    model: BaseAlgorithm
    """The model; everything SB3 offers is there."""
    states: States | None = None
    """Turns observations into the rows that the model was trained on; None where it was trained on observations."""
    normaliser: Normaliser | None = None
    """Does to observations what VecNormalize did while the model was trained; None for nothing."""

    @property
    def observation_space(self) -> spaces.Space:
        """Of the environment that it acts in."""
        return self.model.observation_space if self.states is None else self.states.space

    def shown(self, observation: Any) -> Any:
        """An observation, or a batch, as the model was shown it.

        Raises:
            UnknownObservation: an observation that `states` does not hold.
            InvalidParameter: statistics of observations of another shape.
        """
        if self.states is not None:
            batched = self.states.is_batch(observation)
            return self.states.encode_batch(observation) if batched else self.states.encode(observation)
        return observation if self.normaliser is None else self.normaliser(observation)

    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None, deterministic: bool = False
    ) -> tuple[Any, Any]:
        """SB3's `predict`, on one thread: networks this small are slower on more.

        Raises:
            UnknownObservation, InvalidParameter: as `shown`.
        """
        observation = self.shown(observation)
        with torch_threads(1):
            return self.model.predict(observation, state, episode_start, deterministic)

    def save(self, path: str | os.PathLike) -> None:
        """Write SB3's zip, and beside it what the model is shown, if not observations. Beside first, then renamed."""
        write_shown(Path(path), self.states, self.normaliser)
        content = io.BytesIO()  # torch would raise errors of its own where the disk is full
        self.model.save(content)
        write_bytes(path, content.getvalue())


def load_agent(path: str | os.PathLike, algorithm: Algorithm, states: States | None = None) -> Agent:
    """Load an agent from SB3's zip. Such a file can run code when loaded: load only files you trust.

    Args:
        path: the zip.
        algorithm: "PPO", "DQN" or "A2C".
        states: of the table, for an agent that was trained on its rows; None for what the file beside the zip says
            (`irl_gym.agents.shown_observations`).

    Raises:
        FileNotFoundError: no such file.
        InvalidParameter: an unknown algorithm, or a file that holds none of its agents.
    """
    path = Path(path)
    if not path.exists():
        raise FileNotFoundError(f"{path} does not exist: expected an agent's zip, as SB3 writes it.")
    numbered, normaliser = read_shown(path)
    try:
        return Agent(_algorithm(algorithm).load(path, device="cpu"), states or numbered, normaliser)
    except Exception as error:  # what is unpickled may raise anything
        raise InvalidParameter(f"{path} holds no {algorithm} agent ({error}): expected SB3's zip of one.") from error


def _algorithm(name: str) -> type[BaseAlgorithm]:
    if name not in _ALGORITHMS:
        raise InvalidParameter(f"algorithm is {name!r}: expected one of {sorted(_ALGORITHMS)}.")
    return _ALGORITHMS[name]


@dataclass(frozen=True)
class SB3(Record):
    """Reinforcement learning with Stable-Baselines3.

    Raises:
        InvalidParameter: an unknown algorithm, or fewer than 1 steps.
    """

    algorithm: Algorithm = "PPO"
    """"PPO", "DQN" or "A2C"."""
    total_timesteps: int = 400_000
    """Environment steps, all copies together."""
    hyperparameters: Mapping[str, Any] = field(default_factory=dict, hash=False)
    """Of SB3's constructor; they override `DEFAULTS`."""
    threads: int = 1
    """Torch threads while training. Networks this small are slower on more."""

    how = property(lambda self: f"trained by {self.algorithm}")

    def __post_init__(self) -> None:
        _algorithm(self.algorithm)
        for name in ("total_timesteps", "threads"):
            checked_number(name, getattr(self, name), "a whole number of at least 1", least=1, whole=True)

    def plan(
        self, env: gym.Env | VecEnv, *, gamma: float, seed: int = 0, progress: Progress | None = None, interval: int = 0,
        log: Path | None = None, checkpoint: Checkpoint | None = None, start: FirstWeights | None = None,
    ) -> Agent:  # fmt: skip
        """Train a new agent.

        Args:
            env: what to train on; a TabularVecEnv is by far the fastest.
            gamma: discount.
            seed: of the agent and, through it, of the environment.
            progress: called about every `interval` environment steps, and at the end.
            interval: environment steps between calls; 0 for a hundredth of the total.
            log: folder for SB3's own scalars, as TensorBoard reads them; None for no log.
            checkpoint: where the training is kept while it is under way, and gone on with; None for nowhere.
            start: called with the new model before it is trained, to give it other weights; None for SB3's random ones.
        """
        settings = self._settings(env)
        with torch_threads(self.threads):
            model = self._model(env, gamma=check_discount(gamma), seed=int(seed), device="cpu", **settings)
            agent = Agent(model, env.states if isinstance(env, TabularVecEnv) and env.shows_rows else None)
            watching = Watching(agent, self.total_timesteps, progress, interval or self.total_timesteps // 100, checkpoint)
            if log is not None:
                model.set_logger(configure(str(log), ["tensorboard"]))
            elif model.tensorboard_log is None:  # SB3's own logger leaves a folder in the temporary one
                model.set_logger(Logger(None, [HumanOutputFormat(sys.stdout)] if model.verbose else []))
            going_on = watching.resume()
            if start is not None and not going_on:
                start(model)
            left = self.total_timesteps - model.num_timesteps  # none where it was killed after the last step
            model.learn(left, callback=watching, reset_num_timesteps=not going_on)
            model.logger.close()
        if progress:
            progress(model.num_timesteps, agent)
        return agent

    def _model(self, env: gym.Env | VecEnv, **settings: Any) -> BaseAlgorithm:
        try:
            return _algorithm(self.algorithm)("MlpPolicy", env, **settings)
        except TypeError as error:
            unexpected = re.search(r"unexpected keyword argument '(\w+)'", str(error))
            if unexpected is None:
                raise
            raise InvalidParameter(
                f"{self.algorithm} takes no hyper-parameter {unexpected[1]!r}: expected those of SB3's constructor."
            ) from error

    def _settings(self, env: gym.Env | VecEnv) -> dict[str, Any]:
        """What SB3's constructor is given; a copy, since SB3 writes into `policy_kwargs`."""
        discrete = isinstance(env.observation_space, spaces.Discrete)
        settings = copy.deepcopy({**(DEFAULTS[self.algorithm] if discrete else {}), **self.hyperparameters})
        many = discrete or isinstance(env, TabularVecEnv)
        if many and self.algorithm == "PPO":  # rollouts of 2048 steps, whatever the number of copies
            copies = getattr(env, "num_envs", 1)
            settings.setdefault("n_steps", max(8, 2048 // copies))
            settings.setdefault("batch_size", _batch_size(settings["n_steps"] * copies))
        return settings


FOR_CONTROL = SB3(
    total_timesteps=60_000,
    hyperparameters={"n_steps": 32, "batch_size": 256, "n_epochs": 20, "gae_lambda": 0.8, "learning_rate": 1e-3},
)
"""PPO for classic control, on 8 copies, after rl-baselines3-zoo's settings for CartPole: returns of 500 after 60,000 steps."""


def _batch_size(rollout: int) -> int:
    """Half a rollout or less, about 1024, without a rest; all of it where it has no such divisor."""
    return max((d for d in range(256, min(rollout, 1024) + 1) if rollout % d == 0), default=rollout)


@contextlib.contextmanager
def torch_threads(threads: int) -> Iterator[None]:
    """So many threads of torch, in a block."""
    before = torch.get_num_threads()
    torch.set_num_threads(threads)
    try:
        yield
    finally:
        torch.set_num_threads(before)


def tabular_actions(policy: Policy, states: States) -> Actions:
    """(S,) the action that a policy takes, deterministically, in each state.

    Raises:
        InvalidPolicy: what it predicts are no whole numbers.
    """
    found = np.asarray(policy.predict(states.decode_batch(np.arange(states.n_states)), deterministic=True)[0])
    if found.dtype.kind not in "iu":
        raise InvalidPolicy(f"{type(policy).__name__} predicts {found.dtype}: expected whole numbers, an action a state.")
    return found.astype(np.int64)
