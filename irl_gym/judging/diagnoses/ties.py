"""Actions that the reward leaves as good as the expert's, or better. Each sentence names the states and the actions."""

import numpy as np

from irl_gym._typing import Indices
from irl_gym.errors import DegenerateExpert
from irl_gym.judging.diagnoses.case import Case
from irl_gym.judging.diagnoses.findings import WHERE, Finding, counted
from irl_gym.judging.diagnoses.mends import DEFAULTS, Mend, breaking, on_steps
from irl_gym.mdp.margins import JudgedRows
from irl_gym.mdp.optimality import alike_told, unsettled_told, violated_told


def violated(case: Case) -> Finding | None:
    """(4), Ng & Russell 2000, section 3.1: an action that is worth more than the expert's under R."""
    rows = case.rows
    if rows is None or case.reward is None or not (case.judges_states and case.speaks):
        return None
    which = np.flatnonzero(rows.violated)
    if not which.size:
        return None
    which = which[np.argsort(-rows.violations[which], kind="stable")]
    told = violated_told(_count(rows, which), which.size, float(rows.violations[which[0]]))
    told = f"The expert is not optimal under this reward: {told}: {WHERE}."
    return _found("expert-not-optimal", told, _obey(case), rows, which)


def _count(rows: JudgedRows, which: np.ndarray) -> int:
    """In how many states some rows (k,) are."""
    return np.unique(rows.states[which]).size


def _found(name: str, told: str, mend: Mend, rows: JudgedRows, which: np.ndarray) -> Finding:
    """A finding about some rows (k,)."""
    return Finding(name, told, mend[0], rows.states[which], tuple(rows.actions[which].tolist()), mend[1])


def _obey(case: Case) -> Mend:
    """What to do about violations, by what the learner could have done."""
    slack = case.claims.get("slack")
    if slack is not None:
        return (
            f"Nothing, if these are the expert's errors: slack={slack:g} gives them up. If they are not, a larger slack, such "
            f"as {10 * slack:g}, or more episodes there.",
            (f"--slack {10 * slack:g}",),
        )
    if case.linear and case.claims.get("margin_cap") is None:
        return 'margin_cap="auto"; if it stays, more or other features, a larger S_0, or FiniteLP.', ("--margin-cap auto",)
    if case.linear:
        return "More or other features; a larger S_0; or FiniteLP, where the table is small enough.", ("--features",)
    found = case.best
    if found is None or isinstance(found, DegenerateExpert):
        return 'reward_on="state-action"; or slack=10.0, if the expert errs.', on_steps(case)
    return "FiniteLP() with its defaults: it finds a reward on this table under which the expert is optimal.", DEFAULTS


def same_successors(case: Case) -> Finding | None:
    """A row of (4) whose actions have the same successors is 0 >= 0 for every R(s) (Ng & Russell 2000, section 3.2).

    Where the true reward is known, only those are named that it tells apart.
    """
    rows = case.rows
    if rows is None or not (case.judges_states and case.on_states):
        return None
    tied = rows.trivial & ~rows.equal
    if case.true_optimum is not None:
        Q, level = case.true_optimum.Q, case.true_optimum.level
        theirs = (case.distribution * Q).sum(axis=1)
        tied &= (theirs[:, None] - Q > level)[rows.states, rows.actions]
    which = np.flatnonzero(tied)
    if not which.size:
        return None
    paid = "but not, as counted, the same true reward" if case.counted else "but not the same true reward"
    harm = paid if case.true is not None else "which does no harm only if they also cost the same"
    alike = alike_told(_count(rows, which), estimated=case.counted).replace("in", "In", 1)
    told = f"{alike}, {harm}: {WHERE}. No reward on states tells them apart."
    mend = 'reward_on="state-action"; more steps to count, where they do lead elsewhere.' if case.counted else None
    return _found("same-successors", told, (mend or 'reward_on="state-action".', on_steps(case)), rows, which)


def _marginless(rows: JudgedRows) -> np.ndarray:
    """(k,) rows that a reward of this kind can move and that have no margin, without being violated."""
    return np.flatnonzero(rows.usable & rows.tied)


def avoidable_ties(case: Case) -> Finding | None:
    """Ties that another reward breaks, by solving for it: the paper's sum of margins leaves some of them, prices others."""
    rows, which, _, guessed = _split(case)
    if rows is None or not which.size:
        return None
    though = "" if guessed else ", though some reward prefers it"
    states = counted(_count(rows, which))
    told = f"In {states} the reward ties the expert with another action{though}: {WHERE}. An agent may take either."
    return _found("avoidable-ties", told, breaking(case, rows.states[which], rows.actions[which]), rows, which)


def unbreakable_ties(case: Case) -> Finding | None:
    """Ties that every reward of this kind leaves, where the expert is optimal: rewards that satisfy (4) form a cone."""
    rows, _, which, _ = _split(case)
    if rows is None or not which.size:
        return None
    kind, mend = "reward", ("Give the expert as the (S, A) set of its optimal actions.", ())
    if case.on_states:
        kind = "reward on states"
        told = 'reward_on="state-action"; or give the expert as the (S, A) set of its optimal actions, if both are as good.'
        mend = told, on_steps(case)
    states = counted(_count(rows, which))
    told = f"In {states} no {kind} under which the expert is optimal everywhere prefers its action to another: {WHERE}."
    return _found("unbreakable-ties", told, mend, rows, which)


def unsettled(case: Case) -> Finding | None:
    """A margin on a counted table is one only where it exceeds its sampling error (`irl_gym.mdp.sampling_error`)."""
    rows = case.rows
    if rows is None or not (case.judges_states and case.speaks) or not (which := rows.unsettled).size:
        return None
    which = which[np.argsort(rows.margins[which] - rows.errors[which], kind="stable")]
    left = f"{rows.errors[which].min():.2g} to {rows.errors[which].max():.2g}"
    told = f"The table is counted: {unsettled_told(_count(rows, which))}; these errors are {left}: {WHERE}."
    more = "More steps to count (`Interaction(steps=...)`, `Enumeration(runs=...)`, episodes): four times as many halve it."
    mend = more, ("--table sample", "--steps")
    return _found("within-sampling-error", told, mend, rows, which)


def _split(case: Case) -> tuple[JudgedRows | None, Indices, Indices, bool]:
    """The rows of (4); those without a margin that another reward breaks; those that none does; is the split not known?"""
    rows, none = case.rows, np.zeros(0, dtype=np.int64)
    if rows is None or not (case.speaks and case.judges_states):
        return None, none, none, False
    which = _marginless(rows)
    if not which.size:
        return rows, none, none, False
    possible = case.can_have_margin
    if possible is None:
        return rows, which, none, True
    broken = possible[rows.states[which], rows.actions[which]]
    return rows, which[broken], which[~broken], False
