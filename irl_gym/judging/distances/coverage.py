"""Which transitions a distance looks at, and how much each counts: the coverage distribution D(s, a, s').

    None          uniform over the pairs (s, a) of states that act, s' from P(. | s, a)
    (S, A)        of pairs; s' from P(. | s, a). `occupancy(mdp, policy)`, divided by its sum, is what a policy visits
    (S, A, S)     of triples, also of impossible ones
A terminal state takes no step, so it can be an s' but never an s. Axes: S states, A actions, n transitions.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from irl_gym._typing import Indices, Numbers
from irl_gym.checks import float_array, shown_sum
from irl_gym.errors import InvalidParameter, UndefinedDistance
from irl_gym.mdp.tabular_mdp import TabularMDP, checked_mdp, entry_rows

SUM_TOLERANCE = 1e-8


@dataclass(frozen=True, eq=False)
class Coverage:
    """Transitions with weights; those of weight 0 are left out."""

    states: Indices
    """(n,) s."""
    actions: Indices
    """(n,) a."""
    next_states: Indices
    """(n,) s'."""
    weights: Numbers
    """(n,) positive, summing to 1."""


def probabilities(name: str, value: Any, shape: tuple[int, ...]) -> np.ndarray:
    """Return a distribution as floats; None is the uniform one.

    Raises:
        InvalidParameter: wrong shape, a negative number or NaN, or a sum that is not 1.
    """
    if value is None:
        return np.full(shape, 1 / np.prod(shape))
    array = float_array(name, value, f"{shape} probabilities", InvalidParameter)
    if array.shape != shape:
        raise InvalidParameter(f"{name} has shape {array.shape}: expected {shape}.")
    _check_probabilities(name, array)
    return array


def coverage_of(mdp: TabularMDP, coverage: Any) -> Coverage:
    """The transitions that a coverage distribution gives weight to.

    Raises:
        InvalidParameter: wrong shape, not a distribution, a step out of a terminal state, or no possible transition at all.
        UndefinedDistance: every state is terminal, so there are no transitions.
    """
    if checked_mdp(mdp).terminal.all():
        raise UndefinedDistance("every state is terminal: no transition is left to compare rewards on.")
    S, A = mdp.n_states, mdp.n_actions
    if coverage is None:
        acting = ~mdp.terminal
        return _along_P(mdp, np.repeat(acting / (acting.sum() * A), A))
    array = float_array("coverage", coverage, "(S, A) or (S, A, S) probabilities", InvalidParameter)
    if array.shape not in ((S, A), (S, A, S)):
        raise InvalidParameter(f"coverage has shape {array.shape}: expected ({S}, {A}) or ({S}, {A}, {S}), or None.")
    possible = array if array.ndim == 2 else array.reshape(-1, S)[entry_rows(mdp.P), mdp.P.indices]
    if not (possible * (_acting(mdp, 2) if array.ndim == 2 else 1)).any():
        raise InvalidParameter(
            "coverage misses all transitions: it has no weight on any that the table can make. Give weight to states that act, "
            "or pass None for all of them."
        )
    _check_probabilities("coverage", array)
    wrong = np.argwhere((array > 0) & ~_acting(mdp, array.ndim))
    if wrong.size:
        raise InvalidParameter(
            f"coverage{wrong[0].tolist()} is {array[tuple(wrong[0])]:.3g}, but state {wrong[0][0]} is terminal: expected 0, "
            "since it takes no step. Pass None for uniform over the others."
        )
    if array.ndim == 2:
        return _along_P(mdp, array.ravel())
    states, actions, next_states = np.nonzero(array)
    return Coverage(states, actions, next_states, array[states, actions, next_states])


def _acting(mdp: TabularMDP, axes: int) -> np.ndarray:
    return ~mdp.terminal.reshape(-1, *[1] * (axes - 1))


def _along_P(mdp: TabularMDP, pairs: np.ndarray) -> Coverage:
    """Weights of pairs (S*A,), spread over their successors."""
    rows = entry_rows(mdp.P).astype(np.int64)
    weights = pairs[rows] * mdp.P.data
    kept = weights > 0
    rows = rows[kept]
    return Coverage(rows // mdp.n_actions, rows % mdp.n_actions, mdp.P.indices[kept].astype(np.int64), weights[kept])


def _check_probabilities(name: str, array: np.ndarray) -> None:
    wrong = np.argwhere(~(array >= 0))
    if wrong.size:
        raise InvalidParameter(f"{name}{wrong[0].tolist()} is {array[tuple(wrong[0])]}: a probability is at least 0.")
    if not abs(array.sum() - 1) <= SUM_TOLERANCE:
        raise InvalidParameter(
            f"{name} sums to {shown_sum(array.sum())}: expected a distribution, which sums to 1. Divide by the sum."
        )
