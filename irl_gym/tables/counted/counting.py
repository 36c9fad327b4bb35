"""Tables from samples: what an environment did, counted, from interaction or from a dataset.

The states are the observations that occur in the episodes, and a few more where one is entered both with and without
`terminated`: then it gets a terminal copy. Truncation ends an episode, never a state: a state seen only at the end of a cut
episode is an ordinary one in which nothing was tried. With n(s, a, s') steps seen,
    P(s' | s, a) = (n(s, a, s') + prior) / (n(s, a) + K prior)        K successors in the support of the prior
    d0(s)        = share of the episodes that begin in s
The prior is on the successors seen from s under *any* action. Actions of one state mostly lead to the same few neighbours (a
slippery floor), so that is where an unseen step may well lead; a prior on all states would make every state the neighbour of
every other, and P dense.
Axes: S states, A actions, N episodes.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any, Literal, get_args

import gymnasium as gym
import numpy as np
from gymnasium import spaces

from irl_gym.checks import checked_number, discrete_actions
from irl_gym.errors import InvalidDemonstrations, InvalidParameter
from irl_gym.mdp.episodes import Episode, stacked
from irl_gym.mdp.policies import Policy, generator
from irl_gym.mdp.rewards import TabularReward
from irl_gym.mdp.tabular_mdp import TabularMDP, check_discount, entry_rows
from irl_gym.spaces.listed_states import ListedStates
from irl_gym.tables.copies.calls import called, seeded_globals, stepped
from irl_gym.tables.copies.stripped import without_watchers
from irl_gym.tables.copies.time_limits import check_unread
from irl_gym.tables.counted.counted_rows import Counts, Entries, seen_entries, supported
from irl_gym.tables.counted.step_counts import tally
from irl_gym.tables.tabulation import Evidence, Samples, Tabulation
from irl_gym.tables.value_error import with_errors

Unvisited = Literal["self-loop", "uniform", "refuse"]

EPISODE_STEPS = 500
"""Steps after which `interact` cuts an episode, where the environment has no time limit."""
MOST_ENTRIES = 1 << 26
"""Entries of P at most that uniform rows may make: 800 MB."""
ACTIONS = 4096
"""Random actions drawn at a time."""


@dataclass(frozen=True, eq=False)
class CountedTable:
    """A table from samples, and the counts behind it."""

    table: Tabulation
    """P, R, d0 and the states."""
    counts: Counts
    """Visits, and what they settle."""


@dataclass(frozen=True)
class Counting:
    """How episodes become a table.

    Raises:
        InvalidParameter: a negative prior, or an unknown rule.
    """

    prior: float = 0.0
    """Dirichlet's concentration, at least 0, of each successor seen from a state under any action; 0 for maximum likelihood.
    It counts in visited pairs only: unvisited ones follow the rule below. A step that only the prior allows pays what the same
    states were paid under other actions."""
    unvisited: Unvisited = "self-loop"
    """What follows a pair (s, a) that no episode has: s itself; any state that is not terminal, uniformly; or an error. Such
    steps pay the least reward of all episodes, so that nobody gains by going where nothing is known."""

    def __post_init__(self) -> None:
        checked_number("prior", self.prior, "a concentration of at least 0, such as 0.5", least=0)
        if self.unvisited not in get_args(Unvisited):
            raise InvalidParameter(f"unvisited is {self.unvisited!r}: expected one of {', '.join(get_args(Unvisited))}.")

    def table(self, episodes: Iterable[Episode], space: spaces.Space, n_actions: int, *, gamma: float) -> Tabulation:
        """The table of episodes; arguments and errors as `count`."""
        return self.count(episodes, space, n_actions, gamma=gamma).table

    def count(self, episodes: Iterable[Episode], space: spaces.Space, n_actions: int, *, gamma: float) -> CountedTable:
        """The table of episodes, and the counts behind it.

        Args:
            episodes: at least one; they may come from a generator, and are read once.
            space: of the observations, made of integers.
            n_actions: A; actions count from 0.
            gamma: discount in (0, 1).

        Raises:
            InvalidDiscount: gamma outside (0, 1).
            InvalidParameter: fewer than 1 actions, or uniform rows that would not fit into memory.
            NotDiscrete: observations that are not integers.
            InvalidDemonstrations: no episode, an action out of range, a reward that is not finite; a pair never visited, where
                those are refused.
            UnknownObservation: an observation outside the space.
        """
        check_discount(gamma)
        checked_number("n_actions", n_actions, "a whole number of at least 1", least=1, whole=True)
        seen = tally(episodes, space, int(n_actions))
        n = len(seen.numbers)
        both = np.flatnonzero(seen.ordinary & seen.ended)
        copies = {int(s): n + i for i, s in enumerate(both)}
        states = ListedStates(space, seen.numbers, copies)
        acting = np.append(seen.ordinary, np.zeros(both.size, dtype=bool))
        entries, visits = seen_entries(seen, states, int(n_actions))
        if self.prior:
            entries = supported(entries, visits, self.prior)
        missing = np.flatnonzero(np.repeat(acting, n_actions) & (visits.ravel() == 0))
        if missing.size:
            entries = self._completed(entries, missing, acting, states, float(seen.paid[:, 2].min()))
        P, successors = entries.matrices(visits)
        counts = Counts(visits, successors, float(self.prior))
        d0 = np.append(seen.started, np.zeros(both.size)) / seen.n_episodes
        total = int(acting.sum()) * int(n_actions)
        payments = entries.payments(P.data, visits.shape)
        method = (
            f"Counts of {int(visits.sum())} steps in {seen.n_episodes} episodes, which visit {total - missing.size} of {total} "
            f"pairs (s, a) of states that are not terminal; prior {self.prior:g}, unvisited pairs: {self.unvisited}."
        )
        # Hoeffding's inequality for all first states at once, those that no episode began in too.
        start_error = min(1.0, float(np.sqrt(np.log(2 * n / 0.05) / (2 * seen.n_episodes))))
        evidence = Evidence(
            method, exact=False, merged=0, split=len(copies), check=None, error=max(counts.largest_error(), start_error),
            repeats=seen.repeats,
        )  # fmt: skip
        reward = TabularReward(payments.mean, {"source": "samples"})
        found = np.where(visits.ravel() > 0, visits.ravel(), 1)[entry_rows(P)]
        frequencies = np.where(visits.ravel()[entry_rows(P)] > 0, successors.data / found, P.data)
        paid = float(seen.paid[:, 2].min()), float(seen.paid[:, 3].max())
        samples = Samples(frequencies, float(seen.n_episodes), paid)
        table = Tabulation(TabularMDP(P, gamma, d0, visits), reward, payments, states, evidence, samples)
        return CountedTable(with_errors(table), counts)

    def _completed(
        self, entries: Entries, missing: np.ndarray, acting: np.ndarray, states: ListedStates, least: float
    ) -> Entries:
        """The entries with rows for pairs that were never visited."""
        n_actions = entries.n_actions
        if self.unvisited == "refuse":
            s, a = divmod(int(missing[0]), n_actions)
            shown = states.numbers[s].tolist()
            raise InvalidDemonstrations(
                f"{missing.size} of {int(acting.sum()) * n_actions} pairs (s, a) were never visited, the first (s={s}, a={a}) "
                f"with observation {shown[0] if len(shown) == 1 else shown}: expected every action in every state. Give more "
                "episodes, or choose what follows such a pair: unvisited='self-loop' or 'uniform'."
            )
        everywhere = np.flatnonzero(acting)
        if self.unvisited == "self-loop":
            rows, following = missing, missing // n_actions
        elif missing.size * everywhere.size > MOST_ENTRIES:
            raise InvalidParameter(
                f"unvisited is 'uniform', which makes {missing.size} rows of {everywhere.size} entries: expected no more than "
                f"{MOST_ENTRIES} entries. Choose 'self-loop'."
            )
        else:
            rows, following = np.repeat(missing, everywhere.size), np.tile(everywhere, missing.size)
        share = np.full(rows.size, 1 / everywhere.size if self.unvisited == "uniform" else 1.0)
        pays = np.full(rows.size, least)
        return entries.joined(rows, following, share, pays, pays**2)


@dataclass(frozen=True)
class Interaction:
    """A table from random steps of a copy of the environment: for `tabulate(env, gamma=..., by=Interaction())`.

    Raises:
        InvalidParameter: fewer than 1 steps, or a negative seed.
    """

    steps: int = 100_000
    """Steps in all."""
    counting: Counting = field(default_factory=Counting)
    """What counts become."""
    seed: int = 0
    """Of resets and actions."""

    def __post_init__(self) -> None:
        checked_number("steps", self.steps, "a number of steps of at least 1", least=1, whole=True)
        checked_number("seed", self.seed, "a whole number of at least 0", least=0, whole=True)

    def table(self, env: gym.Env, gamma: float, progress: Callable[[int, int], None] | None = None, /) -> Tabulation:
        """The table that the steps gave.

        Raises:
            NotDiscrete: observations or actions that are not made of integers.
            NotTabular: the environment cannot be copied, or raises an error.
        """
        space: Any = env.action_space
        check_unread(env)
        episodes = interact(without_watchers(env), self.steps, seed=self.seed)
        with seeded_globals([self.seed]):
            return self.counting.table(_told(episodes, self.steps, progress), env.observation_space, int(space.n), gamma=gamma)


def _told(episodes: Iterable[Episode], steps: int, progress: Callable[[int, int], None] | None) -> Iterator[Episode]:
    """The same episodes; `progress` is told the steps they take."""
    taken = 0
    for episode in episodes:
        taken += len(episode)
        if progress is not None:
            progress(taken, steps)
        yield episode


def interact(env: gym.Env, steps: int, *, seed: int, policy: Policy | None = None) -> Iterator[Episode]:
    """Run an environment for some steps, an episode at a time, from its own resets.

    The first reset is seeded, and the others go on from there. Episodes are cut at the environment's time limit, or after
    EPISODE_STEPS where it has none; the last one where the steps are up.

    Args:
        env: any Gymnasium environment with integer actions; itself stepped.
        steps: in all; at least 1.
        seed: of the first reset and of random actions.
        policy: with SB3's `predict`, not deterministic, actions counted from 0; None for uniformly random actions.

    Raises:
        NotDiscrete: other actions.
        NotTabular: the environment raised an error, or a step did not return five values.
        InvalidParameter: fewer than 1 steps, or a negative seed.
    """
    n_actions = int(discrete_actions(env.action_space).n)
    checked_number("steps", steps, "a number of steps of at least 1", least=1, whole=True)
    checked_number("seed", seed, "a whole number of at least 0", least=0, whole=True)
    choose = _random_actions(n_actions, generator(seed)) if policy is None else _actions_of(policy)
    return _episodes(env, int(steps), int(seed), choose)


def _random_actions(n_actions: int, rng: np.random.Generator) -> Callable[[Any], int]:
    def stream() -> Iterator[int]:
        while True:
            yield from rng.integers(n_actions, size=ACTIONS).tolist()

    actions = stream()
    return lambda observation: next(actions)


def _actions_of(policy: Policy) -> Callable[[Any], int]:
    return lambda observation: int(policy.predict(observation, deterministic=False)[0])


def _episodes(env: gym.Env, steps: int, seed: int, choose: Callable[[Any], int]) -> Iterator[Episode]:
    limit = (env.spec.max_episode_steps if env.spec is not None else None) or EPISODE_STEPS
    first = int(getattr(env.action_space, "start", 0))
    left, begin = steps, seed
    while left:
        observation = called(lambda begin=begin: env.reset(seed=begin)[0])
        observations, actions, rewards = [observation], [], []
        terminated = truncated = False
        while not (terminated or truncated):
            action = choose(observation)
            observation, reward, terminated, truncated = stepped(env, action + first)
            observations.append(observation)
            actions.append(action)
            rewards.append(reward)
            truncated = truncated or (not terminated and len(actions) in (limit, left))
        left -= len(actions)
        yield Episode(stacked(observations), np.array(actions), np.array(rewards), terminated, truncated, begin)
        begin = None
