"""What FiniteLP proves of its program where the expert is known in some states only, or errs: from P, the expert and R alone.

V is the value of acting best under R, everywhere in the reachable part (policy iteration, to rounding), so the margin of a row
of (4) is what the expert's action is worth more than another in truth, whatever is done where the expert is not known:
    margin(s, a) = Q(s, pi) - Q(s, a), of (P_pi(s) - P_a(s)) V for rewards on states
The dual bound is weak duality's (`linear_program`), valid for any multipliers.
Axes: S states, A actions, n rows of (4).
"""

from dataclasses import dataclass

import numpy as np

from irl_gym._typing import Indices, Vector
from irl_gym.learners.linear_programs.proofs.finite_proof import FiniteProof
from irl_gym.learners.linear_programs.soft import PartlyKnown
from irl_gym.mdp.margins import best_margins, least_per_state
from irl_gym.mdp.optimality_rows import as_compared
from irl_gym.mdp.planning.dynamic_programming import optimum
from irl_gym.mdp.planning.howard import Optimum
from irl_gym.mdp.rewards import TabularReward


@dataclass(frozen=True, eq=False)
class Terms:
    """The program whose objective is recomputed."""

    r_max: float
    l1: float
    cap: float | None
    slack: float | None
    counted: np.ndarray
    """(n,) rows that count towards margins."""
    unbreakable: np.ndarray
    """(n,) rows that no reward makes strict."""


def objective(partly: PartlyKnown, R: TabularReward, terms: Terms) -> float:
    """sum_s w_s (min(margin+, cap) - C margin- - C the worst violation of other rows) - l1 N, at a reward on the part.

    A margin is the least over the rows that count; the other rows are those of actions that the expert takes too, first of all.
    """
    c, others = partly.comparisons, partly.active & ~terms.counted
    found = optimum(as_compared(partly.mdp, c, R.on_states), R)
    margins = best_margins(found, c).values
    margin, other = (
        np.nan_to_num(least_per_state(margins[rows], c.states[rows], partly.mdp.n_states)) for rows in (terms.counted, others)
    )
    gains = np.clip(margin, 0.0, np.inf if terms.cap is None else terms.cap)
    short = (np.maximum(-margin, 0.0) + np.maximum(-other, 0.0)) * (terms.slack or 0.0)
    return float(partly.weights @ (gains - short)) - terms.l1 * _price(partly, R, found, terms.r_max)


def _price(partly: PartlyKnown, R: TabularReward, found: Optimum, r_max: float) -> float:
    """N, what l1 prices."""
    mdp = partly.mdp
    gap = np.maximum(-found.advantages.values.astype(np.float64), 0.0)
    loss = np.where(mdp.terminal, 0.0, (partly.comparisons.distribution * gap).sum(axis=1))
    count = 1 if R.on_states else mdp.n_actions
    here = R.values if R.on_states else np.where(partly.unknown, R.values[:, 0], 0.0)
    above = here + (mdp.gamma * loss if R.on_states else _spread(partly, found))  # r_pi
    parts = np.maximum(above, 0.0) + np.maximum(-here, 0.0)
    price = count * float(np.where(partly.avoided, above + r_max, parts).sum())
    return price if R.on_states else price + float(np.abs(R.values[partly.known]).sum())


def _spread(partly: PartlyKnown, found: Optimum) -> Vector:
    """(S,) how much r_pi is above R in unknown states, for a reward on steps: what random actions lose there."""
    mdp = partly.mdp
    following = (mdp.P @ found.W.values).reshape(mdp.n_states, mdp.n_actions)
    return np.where(partly.unknown, mdp.gamma * (following.max(axis=1) - following.mean(axis=1)), 0.0)


def prove_partly(
    partly: PartlyKnown, rows: Indices, reward: TabularReward, terms: Terms, *, bound: float, lambda_0: float | None
) -> FiniteProof:
    """Recompute the program's objective at a reward.

    Args:
        partly: the reachable part of the MDP, and what is known.
        rows: (r,) the states of the whole that are in the part.
        reward: (S,) or (S, A), of the whole.
        terms: of the objective.
        bound: no reward has a larger objective.
        lambda_0: reported as given.
    """
    R = reward.of_rows(rows)
    return FiniteProof(
        objective=objective(partly, R, terms),
        dual_bound=bound,
        l1=float(terms.l1),
        lambda_0=None if lambda_0 is None else float(lambda_0),
        margin_cap=None if terms.cap is None else float(terms.cap),
        slack=None if terms.slack is None else float(terms.slack),
        l1_norm=float(np.abs(R.values).sum()),
        least_l1_norm=float("nan"),
        zero=not R.values.any(),
        unbreakable_rows=partly.comparisons.pairs(rows, np.flatnonzero(terms.unbreakable)),
    )
