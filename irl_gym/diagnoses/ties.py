"""Actions that the reward leaves as good as the expert's, or better. Each sentence names the states and the actions."""

import numpy as np

from irl_gym.diagnoses.case import Case, Rows
from irl_gym.diagnoses.findings import Finding, counted, named
from irl_gym.errors import DegenerateExpert
from irl_gym.metrics import TIE_TOLERANCE


def violated(case: Case) -> Finding | None:
    """(4), Ng & Russell 2000, section 3.1: an action that is worth more than the expert's under R."""
    rows = case.rows
    if rows is None or case.reward is None or not (case.judges_states and case.speaks):
        return None
    which = np.flatnonzero(rows.violations > case.tolerance)
    if not which.size:
        return None
    which = which[np.argsort(-rows.violations[which], kind="stable")]
    states, actions = rows.states[which], rows.actions[which]
    count, worst = np.unique(states).size, float(rows.violations[which[0]])
    where = f"in {counted(count)} another action is worth more, by at most {worst:.3g}: {named(states, actions)}"
    return Finding(
        "expert-not-optimal",
        f"The expert is not optimal under this reward: {where}.",
        _obey(case),
        states,
        tuple(actions.tolist()),
    )


def _obey(case: Case) -> str:
    """What to do about violations, by what the learner could have done."""
    slack = case.claims.get("slack")
    if slack is not None:
        return (
            f"Nothing, if these are the expert's errors: slack={slack:g} gives them up. If they are not, raise slack, or show "
            "more episodes there."
        )
    if case.linear:
        return "More or other features; a larger S_0; or FiniteLP, where the table is small enough."
    found = case.best
    if found is None or isinstance(found, DegenerateExpert):
        return 'reward_on="state-action"; or slack=10.0, if the expert errs.'
    return "FiniteLP() with its defaults: it finds a reward on this table under which the expert is optimal."


def same_successors(case: Case) -> Finding | None:
    """A row of (4) whose actions have the same successors is 0 >= 0 for every R(s) (Ng & Russell 2000, section 3.2).

    Where the true reward is known, only those are named that it tells apart.
    """
    rows = case.rows
    if rows is None or not (case.judges_states and case.on_states):
        return None
    tied = rows.trivial & ~rows.equal
    if case.true_optimum is not None and case.true is not None:
        Q, scale = case.true_optimum.Q, float(np.abs(case.true.values).max())
        theirs = (case.distribution * Q).sum(axis=1)
        tied &= theirs[rows.states] - Q[rows.states, rows.actions] > TIE_TOLERANCE * scale
    which = np.flatnonzero(tied)
    if not which.size:
        return None
    states, actions = rows.states[which], rows.actions[which]
    harm = "but not the same true reward" if case.true is not None else "which does no harm only if they also cost the same"
    return Finding(
        "same-successors",
        f"In {counted(np.unique(states).size)} an action leads where the expert's own leads, {harm}: {named(states, actions)}. "
        "No reward on states tells them apart.",
        'reward_on="state-action".',
        states,
        tuple(actions.tolist()),
    )


def _marginless(case: Case, rows: Rows) -> np.ndarray:
    """(k,) rows that a reward of this kind can move and that have no margin, without being violated."""
    small = (rows.margins <= case.tolerance) & (rows.margins >= -case.tolerance)
    return np.flatnonzero(rows.usable & small)


def avoidable_ties(case: Case) -> Finding | None:
    """Ties that another reward breaks, by solving for it: the paper's sum of margins leaves some of them, prices others."""
    split = _split(case)
    if split is None or not split[0].size:
        return None
    rows, which = case.rows, split[0]
    assert rows is not None
    states, actions = rows.states[which], rows.actions[which]
    if case.linear:
        mend = 'margin_cap="auto"; if it stays, more or other features, or FiniteLP.'
    else:
        mend = 'margin_cap="auto" with l1=0.0: solved here, it gives the expert a margin in each of these states.'
        if split[2]:
            mend = 'margin_cap="auto" with l1=0.0; if it stays, reward_on="state-action".'
    return Finding(
        "avoidable-ties",
        f"In {counted(np.unique(states).size)} the reward ties the expert with another action"
        f"{'' if split[2] else ', though some reward prefers it'}: {named(states, actions)}. An agent may take either.",
        mend,
        states,
        tuple(actions.tolist()),
    )


def unbreakable_ties(case: Case) -> Finding | None:
    """Ties that every reward of this kind leaves, where the expert is optimal: rewards that satisfy (4) form a cone."""
    split = _split(case)
    if split is None or not split[1].size:
        return None
    rows, which = case.rows, split[1]
    assert rows is not None
    states, actions = rows.states[which], rows.actions[which]
    kind = "reward on states" if case.on_states else "reward"
    mend = 'reward_on="state-action"; or give the expert as the (S, A) set of its optimal actions, if both are as good.'
    return Finding(
        "unbreakable-ties",
        f"In {counted(np.unique(states).size)} no {kind} under which the expert is optimal everywhere prefers its action to "
        f"another: {named(states, actions)}.",
        mend if case.on_states else "Give the expert as the (S, A) set of its optimal actions.",
        states,
        tuple(actions.tolist()),
    )


def _split(case: Case) -> tuple[np.ndarray, np.ndarray, bool] | None:
    """Rows without a margin: those that another reward breaks, those that none does; and whether that is not known."""
    rows = case.rows
    if rows is None or not (case.speaks and case.judges_states):
        return None
    which = _marginless(case, rows)
    if not which.size:
        return which, which, False
    if case.can_have_margin is None:
        return which, which[:0], True
    broken = case.can_have_margin[rows.states[which]]
    return which[broken], which[~broken], False
