"""Experts from outside: a function, an agent in a zip, a table in a file, and an agent that is less sure of itself.

Everything that acts is a `Policy`: it has Stable-Baselines3's `predict(observation, state, episode_start, deterministic)`, for
one observation and for batches, and its actions count from 0, whatever number the action space starts at.
    Acting       any function obs -> action
    SoftAgent    an SB3 agent at a temperature; `noise` has the errors of tables and the epsilon of any policy
    load_expert  SB3's zip, or the npz of a table that a run left
Axes: S states, A actions, N observations.
"""

import os
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, get_args

import gymnasium as gym
import numpy as np
import torch
from gymnasium import spaces
from stable_baselines3 import DQN
from stable_baselines3.common.distributions import CategoricalDistribution
from stable_baselines3.common.on_policy_algorithm import OnPolicyAlgorithm

from irl_gym._typing import Matrix
from irl_gym.agents.noise import boltzmann, checked_count, checked_temperature
from irl_gym.agents.planners import Agent, Algorithm, load_agent
from irl_gym.agents.shown_observations import Training, read_statistics
from irl_gym.checks import discrete_actions
from irl_gym.errors import DamagedFile, InvalidParameter, InvalidPolicy, NotDiscrete, a_type
from irl_gym.files.archives import read_settings
from irl_gym.mdp.policies import Policy, generator, load_actions
from irl_gym.spaces.batches import batch_size, take
from irl_gym.spaces.states import States


@dataclass(frozen=True, eq=False)
class Acting:
    """Any function from an observation to an action, as a policy.

    The function is given one observation at a time, as the environment shows it, and returns an integer from 0 to A - 1: where
    the action space starts at another number, its first action is still 0. Batches call it once an observation. It is asked
    the same whether `deterministic` or not.

    Raises:
        InvalidParameter: something that cannot be called, or fewer than 1 actions.
    """

    function: Callable[[Any], Any]
    """obs -> action."""
    n_actions: int
    """A."""
    space: spaces.Space
    """Of observations: it tells one from a batch of them."""

    def __post_init__(self) -> None:
        checked_count(self.n_actions)
        if not callable(self.function) or isinstance(self.function, Policy):
            mend = "It is a policy already." if isinstance(self.function, Policy) else "Give a function."
            raise InvalidParameter(f"function is {self.function!r}: expected a callable obs -> action. {mend}")
        if not isinstance(self.space, spaces.Space):
            raise InvalidParameter(f"space is {self.space!r}: expected the environment's observation_space. Use `Acting.of`.")

    @classmethod
    def of(cls, function: Callable[[Any], Any], env: gym.Env) -> "Acting":
        """A function that acts in an environment.

        Raises:
            NotDiscrete: an environment whose actions are not Discrete.
        """
        return cls(function, int(discrete_actions(env.action_space).n), env.observation_space)

    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None, deterministic: bool = False
    ) -> tuple[Any, Any]:
        """The action for one observation, or an array of actions for a batch; the hidden state is passed through.

        Raises:
            InvalidPolicy: the function returned something else than an action; it is named.
        """
        if not _is_batch(self.space, observation):
            return self._action(observation), state
        each = [self._action(take(observation, i)) for i in range(batch_size(observation))]
        return np.array(each, dtype=np.int64), state

    def _action(self, observation: Any) -> np.int64:
        answer = self.function(observation)
        number = np.asarray(answer) if isinstance(answer, int | np.integer | np.ndarray) else np.array(None)
        if number.ndim or number.dtype.kind not in "iu" or not 0 <= number < self.n_actions:
            raise InvalidPolicy(
                f"the function's action for observation {observation!r} is {answer!r}: expected an integer from 0 to "
                f"{self.n_actions - 1}. Actions count from 0, whatever number the action space starts at."
            )
        return np.int64(number)


def _is_batch(space: spaces.Space, observation: Any) -> bool:
    """Is this a stacked batch of observations, not a single one?"""
    if isinstance(space, spaces.Dict):
        key = next(iter(space.spaces))
        return _is_batch(space[key], observation[key])
    if isinstance(space, spaces.Tuple):
        return _is_batch(space[0], observation[0])
    return np.ndim(observation) == len(space.shape or ()) + 1


@dataclass(frozen=True, eq=False)
class SoftAgent:
    """An SB3 agent at a temperature: it draws from the softmax of its own preferences divided by the temperature.

    Preferences are the logits of the policy for PPO and A2C, which at temperature 1 is the agent itself, and the action values
    for DQN. The softness belongs to the expert: actions are drawn also when `deterministic=True`, since the agent itself is
    what is left without. Temperature 0 takes the best action.

    Raises:
        InvalidParameter: no agent of PPO, A2C or DQN, a temperature that is negative or NaN, or a negative seed.
        NotDiscrete: an agent of continuous actions.
    """

    agent: Agent
    """Who is softened; a model of SB3 is wrapped in `planners.Agent`."""
    temperature: float
    """In units of the preferences; 0 is greedy, infinity is uniform."""
    seed: int = 0
    """Of the generator that actions are drawn from."""
    _rng: np.random.Generator = field(init=False, repr=False)

    def __post_init__(self) -> None:
        if not isinstance(self.agent, Agent) or not isinstance(self.agent.model, DQN | OnPolicyAlgorithm):
            held = self.agent.model if isinstance(self.agent, Agent) else self.agent
            raise InvalidParameter(
                f"agent is {a_type(held)}: expected `Agent(model)` of PPO, A2C or DQN. For tables there is `boltzmann`."
            )
        _check_discrete(self.agent)
        checked_temperature(self.temperature)
        object.__setattr__(self, "_rng", generator(self.seed))

    def __reduce__(self) -> tuple:
        return type(self), (self.agent, self.temperature, self.seed)

    def preferences(self, observation: Any) -> Matrix:
        """(N, A) logits or action values for a batch of observations; (1, A) for one."""
        return self._preferences(observation)[0]

    def _preferences(self, observation: Any) -> tuple[np.ndarray, bool]:
        model: Any = self.agent.model
        observation = self.agent.shown(observation)
        model.policy.set_training_mode(False)
        tensor, batched = model.policy.obs_to_tensor(observation)
        with torch.no_grad():
            if isinstance(model, DQN):
                values = model.q_net(tensor)
            else:
                values = _categorical(model.policy.get_distribution(tensor)).distribution.logits
        return values.cpu().numpy().astype(np.float64), batched

    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None, deterministic: bool = False
    ) -> tuple[Any, Any]:
        """The action drawn for one observation, or an array of actions for a batch; the hidden state is passed through."""
        preferences, batched = self._preferences(observation)
        cumulated = boltzmann(preferences, self.temperature).cumsum(axis=1)
        draws = self._rng.random((len(cumulated), 1)) * cumulated[:, -1:]
        actions = np.minimum((draws >= cumulated).sum(axis=1), cumulated.shape[1] - 1)
        return (actions if batched else np.int64(actions[0])), state


def _categorical(distribution: Any) -> CategoricalDistribution:
    if not isinstance(distribution, CategoricalDistribution):
        raise NotDiscrete(f"the agent draws from {a_type(distribution)}: expected a categorical distribution.")
    return distribution


def load_expert(
    path: str | os.PathLike,
    algorithm: Algorithm | None = None,
    states: States | None = None,
    normalize: str | os.PathLike | None = None,
) -> Agent | np.ndarray:
    """Load an expert: an `Agent` from SB3's zip, or the table that a run left as npz.

    An agent's zip can run code when loaded: load only files you trust. Which algorithm made it is read without loading it. An
    npz cannot; it holds `actions` (or `probabilities`): (S,) actions, (S, A) probabilities or sets. Rows of NaN, where a run
    knew nothing, stay. Make a policy of a table with `TabularPolicy(as_distribution(table, S, A), states)`.

    Args:
        path: the file, of either kind.
        algorithm: who made the zip, "PPO", "DQN" or "A2C"; None to find out. Needed where the settings in it do not tell.
        states: of the table, for an agent that was trained on its rows; None for what the file beside its zip says.
        normalize: statistics of its observations, for an agent that was trained under VecNormalize: the file that its `save`
            wrote, or an npz; see `irl_gym.agents.shown_observations.read_statistics`.

    Raises:
        FileNotFoundError: no such file.
        InvalidParameter: a file that holds neither, or the agent of another algorithm; statistics that are none of its own.
        InvalidPolicy: a table that is none.
        NotDiscrete: an agent of continuous actions.
    """
    path = Path(path)
    if not path.exists():
        raise FileNotFoundError(f"{path} does not exist: expected an agent's zip, as SB3 writes it, or a table's npz.")
    try:
        names, settings = read_settings(path, "data")
    except (DamagedFile, OSError) as error:
        raise InvalidParameter(f"{path} holds no expert ({error}): expected SB3's zip of an agent, or an npz.") from error
    if any(name.endswith(".npy") for name in names):
        if normalize is not None:
            raise InvalidParameter(
                f"{path} holds a table of actions: expected an agent's zip beside statistics. Leave them out."
            )
        return load_actions(path)
    if not isinstance(settings, dict):
        raise InvalidParameter(
            f"{path} holds {names[:3]}: expected SB3's zip of an agent, or an npz with `actions`. Save it with `model.save`."
        )
    maker = _maker(settings)
    algorithm = algorithm or maker
    if algorithm is None:
        raise InvalidParameter(
            f"{path} holds no agent of {', '.join(get_args(Algorithm))}: expected one of these. An agent of another "
            "library is a policy as it is, since it has `predict`: give its episodes (`collect`, `write_minari`). If it is one "
            "of these after all, name its algorithm."
        )
    if maker not in (None, algorithm):
        raise InvalidParameter(f"{path} holds no {algorithm} agent: expected {maker}, which its settings tell. Name that.")
    agent = load_agent(path, algorithm, states)
    _check_discrete(agent)
    if normalize is None:
        return agent
    normaliser = read_statistics(normalize)
    normaliser.check(agent.model.observation_space)
    return replace(agent, normaliser=normaliser)


def training_of(path: str | os.PathLike) -> Training:
    """What an agent's zip says of its training; nothing where it is no such zip."""
    try:
        _, settings = read_settings(path, "data")
    except (DamagedFile, OSError):
        return Training()
    return Training.of(settings) if isinstance(settings, dict) else Training()


def _maker(settings: dict[str, Any]) -> Algorithm | None:
    """The algorithm that wrote SB3's `data`, told by the hyper-parameters that only it has; None for any other."""
    described = settings.get("policy_class")
    if isinstance(described, dict) and str(described.get("__module__", "")).startswith("sb3_contrib"):
        return None  # which has relatives of PPO and DQN
    own: dict[Algorithm, set[str]] = {
        "PPO": {"clip_range", "n_epochs"},
        "DQN": {"exploration_fraction", "target_update_interval"},
        "A2C": {"gae_lambda", "normalize_advantage"},  # PPO's too, which has been ruled out by then
    }
    return next((name for name, keys in own.items() if keys <= settings.keys()), None)


def _check_discrete(agent: Agent) -> None:
    discrete_actions(agent.model.action_space, "the agent's action space")
