"""How good policies are under the true reward: a function of tables, policies and returns.

What is judged is a mapping of names to policies, each with how it came about. Two of them, expert and random actions, are what
the others are measured by; by what measures says `measures`.
Axes: S states, A actions, N episodes.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np

from irl_gym._typing import ActionSets, Vector
from irl_gym.demonstrations.shown import shown
from irl_gym.intervals import Interval, mean_interval
from irl_gym.judging import measures
from irl_gym.judging.curves import two_returns
from irl_gym.judging.measures import JudgedPolicy, Yardstick, measured
from irl_gym.judging.metrics import ties_of
from irl_gym.judging.scores import EXPERT, RANDOM, REFERENCES, Scale, half_width
from irl_gym.mdp.episodes import Episode
from irl_gym.mdp.loss import loss_of
from irl_gym.mdp.planning.discounted import EPSILON
from irl_gym.mdp.planning.dynamic_programming import optimum
from irl_gym.mdp.planning.howard import Optimum
from irl_gym.mdp.policies import as_distribution, support
from irl_gym.mdp.tabular_mdp import TabularMDP
from irl_gym.tables.tabulation import Tabulation

JUDGING = 1_000_003
"""Added to the seed of the episodes that judge, the same for all: policies that do the same then earn the same."""


@runtime_checkable
class JudgingWorld(Protocol):
    """Where policies are judged."""

    @property
    def gamma(self) -> float:
        """Discount."""
        ...

    @property
    def limit(self) -> int:
        """Steps after which episodes are cut."""
        ...

    def value(self, policy: Any) -> float:
        """Discounted, from the start, under the true reward."""
        ...

    def episodes(self, policy: Any, n: int, seed: int) -> list[Episode]:
        """Episodes of the environment itself."""
        ...


@dataclass(frozen=True, eq=False)
class Candidate:
    """A policy to be judged, and what is known of it."""

    policy: Any
    """(S,) actions or (S, A) probabilities of a table, elsewhere what has `predict`; None where only its episodes are known."""
    how: str
    """How it came about."""
    value: float
    """Discounted, from the start, under the true reward."""
    returns: Interval | None
    """Its mean undiscounted return; None where it is not known."""
    episodes: Sequence[Episode] = ()
    """Fresh ones of the environment; none of a policy that is known by episodes that were given, or of a run that is read."""


def played(policy: Any, how: str, world: JudgingWorld, table: Tabulation | None, *, episodes: int, seed: int) -> Candidate:
    """A policy that can act.

    Args:
        policy: as the world has it.
        how: how it came about.
        world: where it acts.
        table: the world's; None without one.
        episodes: N for its mean return.
        seed: of the run.
    """
    drawn = world.episodes(policy, episodes, seed + JUDGING)
    possible = None if table is None else two_returns(table)
    returns = mean_interval(np.array([episode.total_reward for episode in drawn]), possible=possible)
    return Candidate(policy, how, world.value(policy), returns, drawn)


def seen(episodes: Sequence[Episode], how: str, table: Tabulation | None, gamma: float) -> tuple[Candidate, Vector]:
    """A policy that is known by episodes that were given, and (N,) their discounted returns.

    They are paid by the table's reward where there is one: a log that was imported may have no rewards. Episodes of states
    alone are paid what the most likely mixture of actions earns in each.
    """
    paid = [episode.rewards for episode in episodes]
    if table is not None and episodes[0].actions is None:
        of_state = (shown(episodes, table.states, table.mdp.n_actions, table.mdp).shares * table.reward.values).sum(axis=1)
        paid = [of_state[episode.rows(table.states)[:-1]] for episode in episodes]
    elif table is not None:
        taken = [episode.taken(f"episode {number}") for number, episode in enumerate(episodes)]
        paid = [table.reward.values[one.rows(table.states)[:-1], a] for one, a in zip(episodes, taken, strict=True)]
    earned = np.array([[gamma ** np.arange(len(one)) @ one, one.sum()] for one in paid])
    return Candidate(None, how, float(earned[:, 0].mean()), mean_interval(earned[:, 1])), earned[:, 0]


def evaluate(
    policies: Mapping[str, tuple[Any, str]], world: JudgingWorld, table: Tabulation | None, horizon: int | None, *,
    given: Sequence[Episode] | None, episodes_only: bool, episodes: int, seed: int,
) -> tuple[dict[str, dict[str, Any]], Scale]:  # fmt: skip
    """Judge policies: their rows of metrics.json, and the scale of their scores.

    Args:
        policies: by name, each with how it came about; among them `scores.REFERENCES`.
        world: where they act.
        table: the world's; None where it can only be stepped.
        horizon: steps that values count; None for all.
        given: the expert's episodes, where it is known by them alone.
        episodes_only: did the learner see no more of the expert than episodes? Then optimal actions are what agrees.
        episodes: N of each for mean returns.
        seed: of the run.
    """
    candidates, half, known = {}, 0.0, None
    for name, (policy, how) in policies.items():
        if given is not None and name == EXPERT:
            candidates[name], earned = seen(given, how, table, world.gamma)
            half, known = half_width(earned, without_chance(given, table)), earned.size
        else:
            candidates[name] = played(policy, how, world, table, episodes=episodes, seed=seed)
    scale = scale_of(candidates, world.gamma, table, half, known)
    good = None
    if table is not None:
        good = good_actions(table.mdp, None if episodes_only else policies[EXPERT][0], optimum(table.mdp, table.reward))
    return judge(candidates, scale, table, horizon, good, world.limit), scale


def scale_of(
    candidates: Mapping[str, Candidate], gamma: float, table: Tabulation | None, half: float, episodes: int | None
) -> Scale:
    """What scores are measured by.

    Args:
        candidates: those that are judged.
        gamma: discount.
        table: None without one.
        half: half the width of the interval of the expert's value.
        episodes: N that the expert is known by; None where it is at hand.
    """
    random, expert = candidates[RANDOM].value, candidates[EXPERT].value
    # what a factorisation of I - gamma P leaves of values, its condition number being about the effective horizon
    rounding = 0.0 if table is None else 64 * EPSILON * table.mdp.effective_horizon * max(abs(random), abs(expert))
    return Scale(random, expert, rounding, half, episodes, gamma)


def judge(
    candidates: Mapping[str, Candidate], scale: Scale, table: Tabulation | None, horizon: int | None, good: ActionSets | None,
    limit: int | None, *, sampled: bool = True,
) -> dict[str, dict[str, Any]]:  # fmt: skip
    """The rows of metrics.json: every measure of each policy.

    Args:
        candidates: by their names.
        scale: of scores.
        table: None without one.
        horizon: steps that values count; None for all.
        good: (S, A) actions that agree with the expert; None without a table.
        limit: steps after which episodes are cut; None where that was not recorded.
        sampled: measures that rest on episodes, too.
    """
    limit = limit if table is not None and table.evidence.exact else None
    by = Yardstick(scale, candidates[EXPERT].returns, candidates[RANDOM].returns, table, horizon, good, limit)
    return {
        name: {"how": one.how}
        | measured(
            measures.POLICIES,
            JudgedPolicy(one.policy, one.value, one.returns, one.episodes, name in REFERENCES, by),
            sampled=sampled,
        )
        for name, one in candidates.items()
    }


def without_chance(episodes: Sequence[Episode], table: Tabulation | None) -> bool:
    """Are all episodes given the same, in a table in which start and steps could not have gone otherwise?"""
    if table is None or not table.evidence.exact:
        return False
    mdp, first = table.mdp, episodes[0]
    rows, actions = first.rows(table.states), first.actions
    if any(not np.array_equal(one.rows(table.states), rows) for one in episodes):
        return False
    if actions is not None and any(not np.array_equal(one.taken("one that was given"), actions) for one in episodes):
        return False
    pairs = rows[:-1, None] * mdp.n_actions + np.arange(mdp.n_actions)
    if actions is None:  # then every action that can have made a step counts
        acted = np.asarray(mdp.P[pairs.ravel(), np.repeat(rows[1:], mdp.n_actions)]).reshape(pairs.shape) > 0
    else:
        acted = np.eye(mdp.n_actions, dtype=bool)[actions]
    taken = mdp.P[pairs[acted]]
    return np.count_nonzero(mdp.d0) == 1 and int((taken > 0).sum(axis=1).max(initial=0)) <= 1


def good_actions(mdp: TabularMDP, expert: np.ndarray | None, best: Optimum) -> ActionSets:
    """(S, A) the actions that agree with an expert: every optimal one if it is optimal, else those it takes.

    Args:
        mdp: P, gamma and d0.
        expert: (S,) actions or (S, A) probabilities; None where it errs or is known by data, and optimal actions count.
        best: what is optimal under the true reward.
    """
    if expert is None or loss_of(best, as_distribution(expert, mdp.n_states, mdp.n_actions)).optimal:
        return ties_of(best, 0.0).possible
    return support(expert, mdp.n_states, mdp.n_actions)
