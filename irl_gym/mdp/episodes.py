"""Demonstrations: episodes of a policy, and what they say about it.

An episode of T steps has T + 1 observations, T actions, T rewards, and ends by `terminated` or `truncated`. Where nobody wrote
down what the last action led to, `ending` says so: the pair counts for the policy, and nothing is made of its successor.
Actions may be missing, all of an episode or none: who cannot do without asks for them by `taken`. None is ever made up.
Axes: S states, A actions, K features, T steps, N episodes.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, get_args

import gymnasium as gym
import numpy as np

from irl_gym._typing import StateMask
from irl_gym.checks import checked_number
from irl_gym.errors import InvalidDemonstrations, InvalidParameter, InvalidPolicy, UnknownObservation, a_type
from irl_gym.mdp.policies import Policy, as_distribution
from irl_gym.mdp.sampling import walks
from irl_gym.mdp.tabular_mdp import TransitionTable
from irl_gym.records import Record
from irl_gym.spaces.batches import batch_sizes, by_part, take
from irl_gym.spaces.states import States

Ending = Literal["seen", "unseen", "followed", "dropped"]
WITHOUT_ACTIONS = (
    "Record the actions too; or learn from states alone, where the table is known with FiniteLP, FeatureLP or Clone, else with "
    "TrajectoryLP."
)


@dataclass(frozen=True, eq=False)
class Episode(Record):
    """One episode.

    Raises:
        InvalidDemonstrations: lengths that do not fit together, no step at all, or flags that are not one boolean each.
    """

    observations: Any
    """T + 1 observations, stacked as vector environments stack them."""
    actions: np.ndarray | None
    """(T,) integers from 0, whatever number the action space starts at; None where only the states are known."""
    rewards: np.ndarray
    """(T,) what the environment paid."""
    terminated: bool
    """Did the last step end the episode?"""
    truncated: bool
    """Did a time limit?"""
    seed: int | None = None
    """Given to `reset`; None when the episode was drawn from a table."""
    ending: Ending = "seen"
    """seen: the last observation is what the last action led to. unseen: that was not recorded, and the observation before
    stands in its place. followed: nor was it, but an exact table has one successor only, which stands there. dropped: one more
    action, taken in the last observation, was recorded and is left out."""

    def __post_init__(self) -> None:
        steps = len(self.rewards) if self.actions is None else self._checked_actions()
        if steps == 0 or len(self.rewards) != steps:
            raise InvalidDemonstrations(
                f"an episode has {steps} actions and {len(self.rewards)} rewards: expected as many rewards as actions, and "
                "at least one."
            )
        for count in batch_sizes(self.observations):
            if count != steps + 1:
                raise InvalidDemonstrations(
                    f"an episode of {steps} actions has {count} observations: expected {steps + 1}, the last one included."
                )
        for name in ("terminated", "truncated"):
            flag = getattr(self, name)
            if not isinstance(flag, bool | np.bool_):
                raise InvalidDemonstrations(
                    f"{name} is {flag!r}: expected True or False, of the last step. Cut the episode where it ended."
                )
            object.__setattr__(self, name, bool(flag))
        if self.ending not in get_args(Ending):
            raise InvalidDemonstrations(f"ending is {self.ending!r}: expected one of {', '.join(get_args(Ending))}.")

    def _checked_actions(self) -> int:
        actions = np.asarray(self.actions)
        if actions.ndim != 1 or (actions.size and actions.dtype.kind not in "iu"):
            raise InvalidDemonstrations(
                f"an episode's actions have shape {actions.shape} and dtype {actions.dtype}: expected (T,) integers."
            )
        object.__setattr__(self, "actions", actions)
        return len(actions)

    def __len__(self) -> int:
        return len(self.rewards)

    def taken(self, who: str) -> np.ndarray:
        """(T,) the actions, for whom an error names with the episode.

        Raises:
            InvalidDemonstrations: it has none.
        """
        if self.actions is None:
            raise InvalidDemonstrations(f"{who} has only states: expected an action a step. {WITHOUT_ACTIONS}")
        return self.actions

    @property
    def total_reward(self) -> float:
        """Undiscounted return."""
        return float(np.sum(self.rewards))

    def infos(self, first_action: int) -> dict[str, np.ndarray]:
        """What is told of each moment besides, (T + 1,) by name, where actions count from `first_action`: here nothing."""
        return {}

    def rows(self, states: States) -> np.ndarray:
        """(T+1,) the states visited; the last but one again where the last was not seen.

        Raises:
            UnknownObservation: an observation that the index does not hold.
        """
        ended = np.zeros(len(self) + 1, dtype=bool)
        ended[-1] = self.terminated and self.ending != "unseen"
        return states.encode_batch(self.observations, terminated=ended)

    def seen_part(self) -> "Episode | None":
        """The steps whose successors are known, which may be all; None where there is none.

        What the last action led to is needed for transitions and for sums along states, not for a policy.
        """
        if self.ending != "unseen":
            return self
        if len(self) == 1:
            return None
        known, actions = take(self.observations, slice(None, -1)), None if self.actions is None else self.actions[:-1]
        return replace(
            self, observations=known, actions=actions, rewards=self.rewards[:-1], terminated=False, truncated=True,
            ending="dropped",
        )  # fmt: skip


def numbered(episodes: Iterable[Episode], states: States) -> Iterator[tuple[Episode, np.ndarray]]:
    """Each episode with the rows (T+1,) that it visits.

    Raises:
        InvalidDemonstrations: something else than an episode.
        UnknownObservation: an observation that the index does not hold, naming the episode.
    """
    for number, episode in enumerate(episodes):
        if not isinstance(episode, Episode):
            raise InvalidDemonstrations(
                f"episode {number} is {a_type(episode)}: expected an Episode. Read Minari datasets with "
                "`read_minari(dataset)`, and other data with `irl_gym.demonstrations.imports`."
            )
        try:
            rows = episode.rows(states)
        except UnknownObservation as error:
            raise UnknownObservation(f"episode {number}: {error}") from error
        yield episode, rows


def seen_parts(episodes: Iterable[Episode]) -> list[Episode]:
    """The parts of episodes whose every successor is known; those of which nothing is left are left out."""
    return [part for one in episodes if (part := one.seen_part()) is not None]


def stacked(observations: Sequence[Any]) -> Any:
    """Observations as a batch, stacked as vector environments stack them."""
    return by_part(lambda *parts: np.asarray(parts), *observations)


def collect(
    env: gym.Env,
    policy: Policy,
    n_episodes: int,
    *,
    seed: int = 0,
    deterministic: bool = False,
    max_episode_steps: int | None = None,
) -> Iterator[Episode]:
    """Run a policy in an environment, an episode at a time; episode i is reset with seed + i.

    Args:
        env: any Gymnasium environment with integer actions.
        policy: with SB3's `predict`; actions count from 0.
        n_episodes: how many; at least 1.
        seed: of the first episode.
        deterministic: passed to `predict`.
        max_episode_steps: truncate longer episodes; needed where the environment has no time limit and the policy may never
            end one.

    Raises:
        InvalidParameter: fewer than 1 episodes or steps, or no environment.
        InvalidPolicy: a policy without `predict`.
    """
    _check_count(n_episodes, max_episode_steps)
    if not hasattr(env, "reset"):
        raise InvalidParameter(f"env is {a_type(env)}: expected an environment. It comes first, then the policy.")
    if not hasattr(policy, "predict"):
        raise InvalidPolicy(
            f"policy is {a_type(policy)}: expected one that acts on observations, with `predict`. Make one of a "
            "table, with `irl_gym.TabularPolicy(irl_gym.mdp.policies.as_distribution(policy, n_states, n_actions), "
            "table.states)`."
        )
    return _stepped(env, policy, n_episodes, seed, deterministic, max_episode_steps)


def _stepped(
    env: gym.Env, policy: Policy, n_episodes: int, seed: int, deterministic: bool, max_episode_steps: int | None
) -> Iterator[Episode]:
    first_action = int(getattr(env.action_space, "start", 0))
    for episode_seed in range(seed, seed + n_episodes):
        observation, _ = env.reset(seed=episode_seed)
        observations, actions, rewards = [observation], [], []
        terminated = truncated = False
        while not (terminated or truncated):
            action, _ = policy.predict(observation, deterministic=deterministic)
            observation, reward, terminated, truncated, _ = env.step(int(action) + first_action)
            observations.append(observation)
            actions.append(int(action))
            rewards.append(float(reward))
            truncated = truncated or (not terminated and len(actions) == max_episode_steps)
        yield Episode(
            stacked(observations), np.array(actions), np.array(rewards), bool(terminated), bool(truncated), episode_seed
        )


def _check_count(n_episodes: int, max_episode_steps: int | None) -> None:
    for name, value in (("n_episodes", n_episodes), ("max_episode_steps", max_episode_steps)):
        if value is not None:
            checked_number(name, value, "a whole number of at least 1", least=1, whole=True)


def collect_from_table(
    table: TransitionTable,
    entry_rewards: np.ndarray,
    states: States,
    policy: Any,
    n_episodes: int,
    *,
    seed: int = 0,
    max_episode_steps: int,
) -> Iterator[Episode]:
    """Draw episodes from a table, all at once: the same distribution as `collect`, many times faster.

    Args:
        table: P and d0.
        entry_rewards: (nnz,) reward of each transition, in the order of `table.P.data`; see `Tabulation.payments`.
        states: turns rows into the environment's observations.
        policy: (S,) actions, (S, A) probabilities or (S, A) set.
        n_episodes: N, at least 1.
        seed: of the generator.
        max_episode_steps: truncate longer episodes.

    Raises:
        InvalidParameter: fewer than 1 episodes or steps.
        InvalidPolicy: wrong shape or content.
    """
    _check_count(n_episodes, max_episode_steps)
    distribution = as_distribution(policy, table.n_states, table.n_actions)
    rows, actions, entries, lengths = walks(table, distribution, n_episodes, max_episode_steps, np.random.default_rng(seed))
    ended = table.terminal[rows[np.arange(n_episodes), lengths]].tolist()
    return (
        Episode(states.decode_batch(rows[i, : n + 1]), actions[i, :n], entry_rewards[entries[i, :n]], ended[i], not ended[i])
        for i, n in enumerate(lengths.tolist())
    )


@dataclass(frozen=True, eq=False)
class EmpiricalPolicy(Record):
    """What episodes say about the policy that made them; `irl_gym.demonstrations.demonstrated` makes tables of it."""

    counts: np.ndarray
    """(S, A) int64, how often each action was taken in each state."""

    @property
    def visited(self) -> StateMask:
        """(S,) states in which at least one action was seen."""
        return self.counts.sum(axis=1) > 0


def empirical_policy(episodes: Iterable[Episode], states: States, n_actions: int) -> EmpiricalPolicy:
    """Count the actions taken in each state.

    Raises:
        InvalidParameter: states or a number of actions that are none.
        InvalidDemonstrations: an action out of range, naming episode and step; an episode without actions; or no episode.
        UnknownObservation: an observation that the index does not hold, naming the episode.
    """
    if not isinstance(states, States):
        raise InvalidParameter(f"states is {a_type(states)}: expected a numbering. Give a table's, `table.states`.")
    checked_number("n_actions", n_actions, "a whole number of at least 1, such as `table.mdp.n_actions`", least=1, whole=True)
    counts = np.zeros((states.n_states, n_actions), dtype=np.int64)
    number = -1
    for number, (episode, rows) in enumerate(numbered(episodes, states)):
        actions = episode.taken(f"episode {number}")
        wrong = np.flatnonzero((actions < 0) | (actions >= n_actions))
        if wrong.size:
            raise InvalidDemonstrations(
                f"episode {number}, step {wrong[0]} takes action {actions[wrong[0]]}: expected 0 to {n_actions - 1}."
            )
        np.add.at(counts, (rows[:-1], actions), 1)
    if number < 0:
        raise InvalidDemonstrations("there are no episodes: expected at least one.")
    return EmpiricalPolicy(counts)
