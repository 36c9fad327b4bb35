"""The certificate of an expert that is known in some states only, or that errs: recomputed from P, the expert and R alone.

V is the value of acting best under R, everywhere in the reachable part (policy iteration, to rounding), so the margin of a row
of (4) is what the expert's action is worth more than another in truth, whatever is done where the expert is not known:
    margin(s, a) = Q(s, pi) - Q(s, a), of (P_pi(s) - P_a(s)) V for rewards on states
`expert_optimal` is judged where the expert is known. The bound is weak duality's (`linear_program`), valid for any multipliers.
Axes: S states, A actions, n rows of (4).
"""

from dataclasses import dataclass

import numpy as np

from irl_gym._typing import Vector
from irl_gym.certificate import Certificate, comparable, judged, least_per_state, tied_throughout
from irl_gym.dynamic_programming import backup, policy_iteration
from irl_gym.learners.soft import PartlyKnown
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

    margins: np.ndarray
    """(n,)."""
    price: float
    """N, what l1 prices."""
    V: Vector
    """(S,) what acting best is worth; for rewards on states with what the state itself pays."""


def judge(partly: PartlyKnown, R: TabularReward, r_max: float) -> Judged:
    """The rows of (4) under a reward on the reachable part."""
    mdp, c = partly.mdp, partly.comparisons
    steps = R.expected(mdp)
    Q = policy_iteration(mdp, steps, tolerance=0.0).Q
    best = Q.max(axis=1)
    Q = backup(mdp, steps, best)
    mine = (c.distribution * Q).sum(axis=1)
    margins = mine[c.states] - Q[c.states, c.actions]
    loss = np.where(mdp.terminal, 0.0, Q.max(axis=1) - mine)
    count = 1 if R.on_states else mdp.n_actions
    here = R.values if R.on_states else np.where(partly.unknown, R.values[:, 0], 0.0)
    above = here + (mdp.gamma * loss if R.on_states else _spread(partly, R))  # r_pi
    parts = np.maximum(above, 0.0) + np.maximum(-here, 0.0)
    price = count * float(np.where(partly.avoided, above + r_max, parts).sum())
    if not R.on_states:
        price += float(np.abs(R.values[partly.known]).sum())
    return Judged(margins, price, R.values + mdp.gamma * best if R.on_states else best)


def _spread(partly: PartlyKnown, R: TabularReward) -> Vector:
    """(S,) how much r_pi is above R in unknown states, for a reward on steps: what random actions lose there."""
    mdp = partly.mdp
    V = policy_iteration(mdp, R.expected(mdp), tolerance=0.0).Q.max(axis=1)
    following = (mdp.P @ V).reshape(mdp.n_states, mdp.n_actions)
    return np.where(partly.unknown, mdp.gamma * (following.max(axis=1) - following.mean(axis=1)), 0.0)


def objective(partly: PartlyKnown, found: Judged, terms: Terms) -> float:
    """sum_s w_s (min(margin+, cap) - C margin- - C the worst violation of other rows) - l1 N, at the reward.

    A margin is the least over the rows that count; the other rows are those of actions that the expert takes too, first of all.
    """
    c, others = partly.comparisons, partly.active & ~terms.counted
    margin, other = (
        np.nan_to_num(least_per_state(found.margins[rows], c.states[rows], partly.mdp.n_states))
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
    part, c = partly.mdp, partly.comparisons
    R = TabularReward(reward.values[rows])
    found = judge(partly, R, terms.r_max)
    usable = comparable(c, R)
    short = np.where(partly.active, np.maximum(-found.margins, 0.0), 0.0)
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
        **judged(mdp, part, rows, c, R, found.margins, found.V, short, terms.r_max, terms.unbreakable, visits),
        indifferent=tied_throughout(found.margins[partly.active], R, part),
    )
