"""The certificate of an expert that is known in some states only, or that errs: recomputed from P, the expert and R alone.

V is the value of acting best under R, everywhere in the reachable part (policy iteration, to rounding), so the margin of a row
of (4) is what the expert's action is worth more than another in truth, whatever is done where the expert is not known:
    margin(s, a) = Q(s, pi) - Q(s, a), of (P_pi(s) - P_a(s)) V for rewards on states
`loss_bound` is over all that the expert may do in unknown states that it may reach. The dual bound is weak duality's
(`linear_program`), valid for any multipliers.
Axes: S states, A actions, n rows of (4).
"""

from dataclasses import dataclass

import numpy as np

from irl_gym._typing import Vector
from irl_gym.certificate import Certificate, judged
from irl_gym.comparisons import as_compared
from irl_gym.dynamic_programming import optimum
from irl_gym.howard import Optimum
from irl_gym.learners.soft import PartlyKnown
from irl_gym.margins import Margins, best_margins, comparable, least_per_state
from irl_gym.mdp import TabularMDP
from irl_gym.rewards import TabularReward


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


@dataclass(frozen=True, eq=False)
class Judged:
    """What a reward does to each row, under the best continuation."""

    found: Optimum
    """The best continuation."""
    margins: Margins
    """Of each row."""
    price: float
    """N, what l1 prices."""


def judge(partly: PartlyKnown, R: TabularReward, r_max: float) -> Judged:
    """The rows of (4) under a reward on the reachable part."""
    mdp, c = partly.mdp, partly.comparisons
    found = optimum(as_compared(mdp, c, R.on_states), R)
    gap = np.maximum(-found.advantages.values.astype(np.float64), 0.0)
    loss = np.where(mdp.terminal, 0.0, (c.distribution * gap).sum(axis=1))
    count = 1 if R.on_states else mdp.n_actions
    here = R.values if R.on_states else np.where(partly.unknown, R.values[:, 0], 0.0)
    above = here + (mdp.gamma * loss if R.on_states else _spread(partly, found))  # r_pi
    parts = np.maximum(above, 0.0) + np.maximum(-here, 0.0)
    price = count * float(np.where(partly.avoided, above + r_max, parts).sum())
    if not R.on_states:
        price += float(np.abs(R.values[partly.known]).sum())
    return Judged(found, best_margins(found, c), price)


def _spread(partly: PartlyKnown, found: Optimum) -> Vector:
    """(S,) how much r_pi is above R in unknown states, for a reward on steps: what random actions lose there."""
    mdp = partly.mdp
    following = (mdp.P @ found.W.values).reshape(mdp.n_states, mdp.n_actions)
    return np.where(partly.unknown, mdp.gamma * (following.max(axis=1) - following.mean(axis=1)), 0.0)


def objective(partly: PartlyKnown, found: Judged, terms: Terms) -> float:
    """sum_s w_s (min(margin+, cap) - C margin- - C the worst violation of other rows) - l1 N, at the reward.

    A margin is the least over the rows that count; the other rows are those of actions that the expert takes too, first of all.
    """
    c, others = partly.comparisons, partly.active & ~terms.counted
    margin, other = (
        np.nan_to_num(least_per_state(found.margins.values[rows], c.states[rows], partly.mdp.n_states))
        for rows in (terms.counted, others)
    )
    gains = np.clip(margin, 0.0, np.inf if terms.cap is None else terms.cap)
    short = (np.maximum(-margin, 0.0) + np.maximum(-other, 0.0)) * (terms.slack or 0.0)
    return float(partly.weights @ (gains - short)) - terms.l1 * found.price


def certify_partly(
    mdp: TabularMDP,
    partly: PartlyKnown,
    rows: np.ndarray,
    reward: TabularReward,
    terms: Terms,
    *,
    bound: float,
    lambda_0: float | None,
    visits: np.ndarray | None,
) -> Certificate:
    """Recompute what a reward proves about an expert that is known in part.

    Args:
        mdp: the whole MDP.
        partly: its reachable part, and what is known.
        rows: (r,) the states of the whole that are in the part.
        reward: (S,) or (S, A), of the whole.
        terms: of the objective.
        bound: no reward has a larger objective.
        lambda_0: reported as given.
        visits: (S,) how often each state was visited; None when that is not known.
    """
    c = partly.comparisons
    R = reward.of_rows(rows)
    found = judge(partly, R, terms.r_max)
    usable = comparable(c, R)
    return Certificate(
        objective=objective(partly, found, terms),
        dual_bound=bound,
        l1=float(terms.l1),
        lambda_0=None if lambda_0 is None else float(lambda_0),
        margin_cap=None if terms.cap is None else float(terms.cap),
        least_l1_norm=float("nan"),
        unconstrained=rows[np.setdiff1d(np.flatnonzero(partly.known), c.states[usable])],
        slack=None if terms.slack is None else float(terms.slack),
        unknown=rows[partly.unknown],
        **judged(
            mdp, rows, found.found, c, R, found.margins, terms.r_max, terms.unbreakable, partly.active, partly.unknown, visits
        ),
    )
