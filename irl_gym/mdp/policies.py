"""Policies: what acts.

Three ways to write a tabular policy, and everything that takes one takes all three:
    (S,)   int      the action of each state
    (S, A) float    a distribution over actions in each state
    (S, A) bool     a set of actions that are equally good in each state
Axes: S states, A actions.
"""

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol, runtime_checkable

import numpy as np

from irl_gym._typing import ActionSets, Matrix
from irl_gym.checks import any_array, checked_number, of_single_precision, shown_sum
from irl_gym.errors import DamagedFile, InvalidParameter, InvalidPolicy, a_type
from irl_gym.files.archives import read_arrays
from irl_gym.records import Record
from irl_gym.spaces.states import States

ACTIONS = 1
"""The stream of a seed that actions are drawn from."""
NOISE = 2
"""The one that decides where an expert errs, since whoever errs may draw actions of the same seed."""

ROUNDING = 1e-12
"""A row of probabilities whose sum is farther from 1 than this is divided by it."""


@runtime_checkable
class Policy(Protocol):
    """Whatever has Stable-Baselines3's `predict`."""

    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None, deterministic: bool = False
    ) -> tuple[Any, Any]:
        """Map an observation (or a batch) to an action (or a batch) and the next hidden state."""
        ...


def as_distribution(policy: Any, n_states: int, n_actions: int) -> Matrix:
    """Write any tabular policy as a distribution: (S, A), rows that sum to 1.

    A set of actions becomes the uniform distribution over it.

    Raises:
        InvalidPolicy: wrong shape, action out of range, empty set, probabilities negative, NaN or not summing to 1.
    """
    array = policy_array(policy)
    if array.shape == (n_states,) and array.dtype.kind in "iu":
        return _one_hot(array, n_actions)
    if array.shape != (n_states, n_actions):
        raise InvalidPolicy(
            f"policy has shape {array.shape} and dtype {array.dtype}: expected ({n_states},) integer actions, or "
            f"({n_states}, {n_actions}) probabilities or booleans. Give one entry for each state."
        )
    if array.dtype == bool:
        empty = np.flatnonzero(~array.any(axis=1))
        if empty.size:
            raise InvalidPolicy(f"policy[s={empty[0]}] is an empty set: expected at least one action in each state.")
        return array / array.sum(axis=1, keepdims=True)
    if array.dtype.kind != "f":
        raise InvalidPolicy(
            f"policy has dtype {array.dtype} and shape {array.shape}: an (S, A) policy is float (probabilities) or "
            "bool (a set). Convert it, for example with `policy.astype(bool)`."
        )
    return _checked_probabilities(array)


def completed(expert: Any, n_states: int) -> tuple[Any, np.ndarray]:
    """A policy with random actions where nothing is known of it, rows of NaN, and (S,) where something is.

    Raises:
        InvalidPolicy: rows of several lengths, or nothing is known in any state.
    """
    array = policy_array(expert)
    if array.dtype.kind != "f" or array.ndim != 2 or len(array) != n_states:
        return array, np.ones(n_states, dtype=bool)
    unknown = np.asarray(np.isnan(array).all(axis=1))
    if unknown.all():
        raise InvalidPolicy("nothing is known of the expert in any state: expected probabilities in at least one.")
    return np.where(unknown[:, None], 1 / array.shape[1], array), np.logical_not(unknown)


def policy_array(policy: Any) -> np.ndarray:
    """A policy as an array: that of a TabularPolicy, or of what holds one, such as a Solution; or what was given.

    Raises:
        InvalidPolicy: rows of several lengths, or what is no table: episodes, or what acts on observations.
    """
    if isinstance(policy, TabularPolicy):
        return policy.probabilities
    held = getattr(policy, "policy", None)
    if isinstance(held, np.ndarray | TabularPolicy):
        return policy_array(held)
    first = policy[0] if isinstance(policy, Sequence) and len(policy) else None
    episodes = hasattr(first, "observations")
    array = None if episodes else any_array("policy", policy, "one entry for each state", InvalidPolicy)
    if array is None or array.dtype == object:
        raise InvalidPolicy(
            f"policy is {a_type(policy)}{' of episodes' * episodes}: expected a table, (S,) actions or (S, A) "
            f"probabilities. {_table_of(policy, first)}"
        )
    return array


def _table_of(policy: Any, first: Any) -> str:
    """How to make a table of what is none."""
    states = "table.states, table.mdp.n_actions"
    most = "irl_gym.demonstrations.demonstrated.most_frequent"
    if hasattr(policy, "predict"):
        return "Ask it in each state, with `irl_gym.agents.planners.tabular_actions(policy, table.states)`."
    if hasattr(policy, "counts"):
        return f"Take what it does most, with `{most}(policy)`."
    if hasattr(first, "observations") or isinstance(policy, Iterator):
        return f"Count what episodes show, with `{most}(irl_gym.empirical_policy(episodes, {states}))`."
    if hasattr(policy, "P"):
        return "The mdp comes first, then the expert."
    return "Give one entry for each state."


def _one_hot(actions: np.ndarray, n_actions: int) -> np.ndarray:
    wrong = np.flatnonzero((actions < 0) | (actions >= n_actions))
    if wrong.size:
        s = wrong[0]
        raise InvalidPolicy(f"policy[s={s}] is action {actions[s]}: expected an action from 0 to {n_actions - 1}.")
    distribution = np.zeros((actions.size, n_actions))
    distribution[np.arange(actions.size), actions] = 1.0
    return distribution


def _checked_probabilities(array: np.ndarray) -> np.ndarray:
    wrong = np.argwhere(~(array >= 0))  # catches NaN too
    if wrong.size:
        s, a = wrong[0]
        raise InvalidPolicy(f"policy[s={s}, a={a}] is {array[s, a]}: a probability is at least 0.")
    array = array.astype(np.float64)
    sums = array.sum(axis=1)
    if (np.abs(sums - 1) > 1e-8).any():  # an agent's, perhaps: float32
        rows = np.repeat(np.arange(len(array)), array.shape[1])
        array = of_single_precision(array.ravel(), rows, len(array))[0].reshape(array.shape)
        sums = array.sum(axis=1)
    wrong = np.flatnonzero(np.abs(sums - 1) > 1e-8)
    if wrong.size:
        raise InvalidPolicy(f"policy[s={wrong[0]}] sums to {shown_sum(sums[wrong[0]])}: each row must sum to 1. Normalise it.")
    off = np.abs(sums - 1) > ROUNDING
    return np.where(off[:, None], array / sums[:, None], array).astype(np.float64)


def load_actions(path: str | os.PathLike) -> np.ndarray:
    """A policy that a run, or anybody, kept in an npz: `actions`, or else `probabilities`. Rows of NaN, of which nothing was
    known, stay.

    Raises:
        FileNotFoundError: no such file.
        InvalidParameter: a file that cannot be read, or holds neither, or both.
        InvalidPolicy: a table that is no policy.
    """
    try:
        found = read_arrays(path)
    except FileNotFoundError:
        raise
    except (DamagedFile, OSError) as error:
        raise InvalidParameter(f"{path} cannot be read as a table ({error}): expected an npz of numbers.") from error
    names = [name for name in ("actions", "probabilities") if name in found]
    if len(names) != 1:
        raise InvalidParameter(f"{path} holds {sorted(found)[:9]}: expected `actions`, or else `probabilities`.")
    table = found[names[0]]
    if table.ndim not in (1, 2) or table.size == 0:
        raise InvalidPolicy(f"{path} has a table of shape {table.shape}: expected (S,) actions or (S, A) probabilities.")
    width = table.shape[1] if table.ndim == 2 else 0
    known = ~np.isnan(table).all(axis=1) if table.ndim == 2 and table.dtype.kind == "f" else np.ones(len(table), dtype=bool)
    if table.ndim == 1 and table.dtype.kind in "iu":  # how many actions there are, the file does not say
        if table.min() < 0:
            s = int(np.argmax(table < 0))
            raise InvalidPolicy(f"policy[s={s}] is action {table[s]}, in {path}: expected an action of at least 0.")
    else:
        as_distribution(table[known], int(known.sum()), width)  # refuses what is no policy
    return table


def support(policy: Any, n_states: int, n_actions: int) -> ActionSets:
    """The actions that a policy takes with positive probability: (S, A) booleans.

    Raises:
        InvalidPolicy: wrong shape or content.
    """
    return as_distribution(policy, n_states, n_actions) > 0


def generator(seed: int, stream: int = ACTIONS) -> np.random.Generator:
    """The generator of a policy's own draws.

    An environment that is reset with the same seed draws from `default_rng(seed)`: a policy that did so too would foresee what
    happens to it.

    Raises:
        InvalidParameter: a seed that is not a whole number of at least 0.
    """
    whole = int(checked_number("seed", seed, "a whole number of at least 0", least=0, whole=True))
    return np.random.default_rng([whole, stream])


@dataclass(frozen=True, eq=False)
class TabularPolicy(Record):
    """A table of action probabilities that acts on observations, with Stable-Baselines3's `predict`."""

    probabilities: Matrix
    """(S, A), rows sum to 1."""
    states: States
    """Turns observations into rows."""
    seed: int = 0
    """Of the generator that `predict(deterministic=False)` draws from."""
    _rng: np.random.Generator = field(init=False, repr=False)

    def __post_init__(self) -> None:
        if np.ndim(self.probabilities) != 2:
            raise InvalidPolicy(
                f"probabilities have shape {np.shape(self.probabilities)}: expected (S, A). Turn (S,) actions into them with "
                "`irl_gym.mdp.policies.as_distribution(actions, S, A)`."
            )
        checked = as_distribution(self.probabilities, self.states.n_states, np.shape(self.probabilities)[1])
        checked.setflags(write=False)
        object.__setattr__(self, "probabilities", checked)
        object.__setattr__(self, "_rng", generator(self.seed))

    def __reduce__(self) -> tuple:
        return type(self), (self.probabilities, self.states, self.seed)

    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None, deterministic: bool = False
    ) -> tuple[Any, Any]:
        """The action for one observation, or an array of actions for a batch; the hidden state is passed through.

        Raises:
            UnknownObservation: an observation outside the state index.
        """
        batched = self.states.is_batch(observation)
        rows = self.states.encode_batch(observation) if batched else np.array([self.states.encode(observation)])
        p = self.probabilities[rows]
        if deterministic:
            actions = p.argmax(axis=1)
        else:
            draws = self._rng.random((rows.size, 1))
            actions = np.minimum((draws >= p.cumsum(axis=1)).sum(axis=1), p.shape[1] - 1)
        return (actions if batched else np.int64(actions[0])), state
