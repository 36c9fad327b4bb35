"""What demonstrations say of a policy: tables of it, and how sure they are.

`empirical_policy` counts how often each action was taken in each state. From the counts n(s, a) come tables (S, A):
    maximum_likelihood   n(s, a) / n(s)
    smoothed             (n(s, a) + c) / (n(s) + A c), the mean of the posterior under a Dirichlet(c) prior
    most_frequent        1 for the action taken most often
    supported            equal shares for all actions that cannot be told from the most frequent one
A state never visited is NaN in each of them: nothing is known there, and nothing is filled in. `FiniteLP` and `FeatureLP` take
such tables. An expert that errs now and then is read by `most_frequent`: a table with every action it ever took would ask for
a reward under which its errors are as good as the rest.
`confidence` and `intervals` are posterior statements under a Dirichlet prior, whose marginals are beta distributions.
Axes: S states, A actions.
"""

from typing import Any

import numpy as np
from scipy.special import betainc, betaincinv

from irl_gym._typing import ActionSets, Matrix, Vector
from irl_gym.checks import any_array, checked_number
from irl_gym.errors import InvalidDemonstrations, InvalidParameter
from irl_gym.mdp.episodes import EmpiricalPolicy


def checked_counts(seen: EmpiricalPolicy) -> np.ndarray:
    """(S, A) the counts.

    Raises:
        InvalidDemonstrations: counts that are negative, not whole numbers, not a table, all 0, or too large to add up.
    """
    counts = np.asarray(seen.counts)
    if counts.ndim != 2 or counts.dtype.kind not in "iu":
        raise InvalidDemonstrations(
            f"the counts have shape {counts.shape} and dtype {counts.dtype}: expected (S, A) integers, as `empirical_policy` "
            "makes them."
        )
    wrong = np.argwhere(counts < 0)
    if wrong.size:
        s, a = wrong[0]
        raise InvalidDemonstrations(f"counts[s={s}, a={a}] is {counts[s, a]}: expected how often the action was taken.")
    if not counts.any():
        raise InvalidDemonstrations("no action was seen in any state: expected at least one step.")
    total = counts.sum(axis=1, dtype=np.float64).max()
    if total >= 2**63:
        raise InvalidDemonstrations(f"the counts of a state add up to {total:.3g}: expected less than 2^63 steps.")
    return counts.astype(np.int64)


def counted_pairs(states: np.ndarray, actions: np.ndarray, n_states: int, n_actions: int) -> EmpiricalPolicy:
    """The counts of steps in flat arrays, millions of them in a fraction of a second.

    Args:
        states: (n,) rows of the table that the steps were taken in.
        actions: (n,) what was done there, from 0.
        n_states: S.
        n_actions: A.

    Raises:
        InvalidDemonstrations: arrays that are not whole numbers of one length, no step, or a number outside its range.
    """
    pair = {"states": (any_array("states", states, "(n,) integers", InvalidDemonstrations), n_states),
            "actions": (any_array("actions", actions, "(n,) integers", InvalidDemonstrations), n_actions)}  # fmt: skip
    shape = pair["states"][0].shape
    for name, (array, n) in pair.items():
        if array.ndim != 1 or array.dtype.kind not in "iu" or array.shape != shape or not array.size:
            raise InvalidDemonstrations(
                f"{name} have shape {array.shape} and dtype {array.dtype}: expected (n,) integers, as many states as actions "
                "and at least one."
            )
        if array.min() < 0 or array.max() >= n:
            first = int(np.argmax((array < 0) | (array >= n)))
            raise InvalidDemonstrations(f"{name}[{first}] is {array[first]}: expected 0 to {n - 1}.")
    rows = pair["states"][0].astype(np.int64) * n_actions + pair["actions"][0].astype(np.int64)
    return EmpiricalPolicy(np.bincount(rows, minlength=n_states * n_actions).reshape(n_states, n_actions))


def _masked(table: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """The table, NaN in states never visited."""
    visited = counts.sum(axis=1) > 0
    return np.where(visited.reshape(-1, *[1] * (table.ndim - 1)), table, np.nan)


def maximum_likelihood(seen: EmpiricalPolicy) -> Matrix:
    """(S, A) the share of each action; NaN in states never visited.

    Raises:
        InvalidDemonstrations: counts that no episodes could have given.
    """
    counts = checked_counts(seen)
    return _masked(counts / np.maximum(counts.sum(axis=1, keepdims=True), 1), counts)


def smoothed(seen: EmpiricalPolicy, concentration: float = 1.0) -> Matrix:
    """(S, A) shares with `concentration` more of each action in the states visited; NaN in the others.

    Args:
        seen: the counts.
        concentration: c > 0 of the Dirichlet prior; 1 is Laplace's rule, 0.5 Jeffreys's.

    Raises:
        InvalidDemonstrations: counts that no episodes could have given.
        InvalidParameter: a concentration that is not above 0.
    """
    c = checked_number("concentration", concentration, "a number above 0, such as 1.0", above=0)
    counts = checked_counts(seen)
    more = counts + c
    return _masked(more / more.sum(axis=1, keepdims=True), counts)


def most_frequent(seen: EmpiricalPolicy) -> Matrix:
    """(S, A) 1 for the action taken most often, the lowest of those that tie; NaN in states never visited.

    Raises:
        InvalidDemonstrations: counts that no episodes could have given.
    """
    counts = checked_counts(seen)
    return _masked(np.eye(counts.shape[1])[counts.argmax(axis=1)], counts)


def as_likely(seen: EmpiricalPolicy) -> Matrix:
    """(S, A) posterior probability that an action is more probable than the most frequent one; NaN in states never visited.

    Under a uniform Dirichlet prior the share of action a among the times that it or the most frequent one, m, is taken has the
    posterior Beta(n_a + 1, n_m + 1), so this is P(share > 1/2): exact. It is 1/2 for actions as frequent.

    Raises:
        InvalidDemonstrations: counts that no episodes could have given.
    """
    counts = checked_counts(seen)
    most = counts.max(axis=1, keepdims=True)
    return _masked(betainc(most + 1.0, counts + 1.0, 0.5), counts)


def supported(seen: EmpiricalPolicy, level: float = 0.95) -> Matrix:
    """(S, A) equal shares for every action that the data cannot tell from the most frequent one; NaN where never visited.

    An action is left out when it is less probable than the most frequent one with posterior probability of at least `level`.
    After few visits that leaves out nothing: with 0.95 it takes four of one action alone.

    Args:
        seen: the counts.
        level: between 0.5 and 1.

    Raises:
        InvalidDemonstrations: counts that no episodes could have given.
        InvalidParameter: a level outside its range.
    """
    level = checked_number("level", level, "a probability between 0.5 and 1, such as 0.95", above=0.5, below=1)
    counts = checked_counts(seen)
    kept: ActionSets = np.nan_to_num(as_likely(seen), nan=1.0) > 1 - level
    kept |= counts == counts.max(axis=1, keepdims=True)
    return _masked(kept / kept.sum(axis=1, keepdims=True), counts)


def confidence(seen: EmpiricalPolicy) -> Vector:
    """(S,) at least this posterior probability that the most frequent action is the most probable one; NaN where never visited.

    One minus the sum, over the other actions, of the exact posterior probability that they are more probable. With two actions
    it is exact, with more a lower bound, and 0 where it says nothing.

    Raises:
        InvalidDemonstrations: counts that no episodes could have given.
    """
    counts = checked_counts(seen)
    others = np.nan_to_num(as_likely(seen))
    others[np.arange(len(counts)), counts.argmax(axis=1)] = 0.0
    return _masked(np.maximum(1 - others.sum(axis=1), 0.0), counts)


def intervals(seen: EmpiricalPolicy, level: float = 0.95, concentration: float = 1.0) -> tuple[Matrix, Matrix]:
    """Low and high (S, A): pi(a | s) lies between them with posterior probability `level`; NaN in states never visited.

    The marginals of the posterior, Beta(n_a + c, n - n_a + (A - 1) c), with equal tails: exact, one action at a time.

    Args:
        seen: the counts.
        level: between 0 and 1.
        concentration: c > 0 of the Dirichlet prior.

    Raises:
        InvalidDemonstrations: counts that no episodes could have given.
        InvalidParameter: a level or concentration outside its range.
    """
    level = checked_number("level", level, "a probability between 0 and 1, such as 0.95", above=0, below=1)
    c = checked_number("concentration", concentration, "a number above 0, such as 1.0", above=0)
    counts = checked_counts(seen)
    if counts.shape[1] == 1:
        raise InvalidParameter("there is one action: expected at least two, or its probability is 1.")
    mine = counts + c
    rest = counts.sum(axis=1, keepdims=True) - counts + (counts.shape[1] - 1) * c
    ends: list[Any] = [_masked(betaincinv(mine, rest, tail), counts) for tail in ((1 - level) / 2, (1 + level) / 2)]
    return ends[0], ends[1]


def visits(seen: EmpiricalPolicy) -> Vector:
    """(S,) how often each state was visited, as `FiniteLP.fit` takes it.

    Raises:
        InvalidDemonstrations: counts that no episodes could have given.
    """
    return checked_counts(seen).sum(axis=1).astype(np.float64)
