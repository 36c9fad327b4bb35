"""What the discount, and a world without an end, make of a reward."""

import numpy as np
import scipy.sparse as sp

from irl_gym.judging.diagnoses.case import Case
from irl_gym.judging.diagnoses.findings import WHERE, Finding, counted
from irl_gym.mdp.margins import least_per_state
from irl_gym.mdp.planning.dynamic_programming import policy_iteration
from irl_gym.mdp.rewards import TabularReward
from irl_gym.mdp.tabular_mdp import TabularMDP

VANISHED = 1e-6
"""A margin below this, in units of the largest |R|, is none to a solver, a planner or an agent."""
MANY = 0.1
"""Share of the states."""
FAR = 1e-3
"""gamma^d from which a distance of d steps explains that a margin vanishes; it is d steps at least, and more by chance."""
LARGER = (0.5, 0.9, 0.95, 0.99, 0.995, 0.999)
"""Discounts that are tried."""
FAINT = 1e-3
"""A typical margin below this, in units of the range of V, is lost in the noise of an agent's own estimates."""


def small_gamma(case: Case) -> Finding | None:
    """gamma^d is what is left of a reward d steps away. Claimed only where a larger gamma, tried here, mends it."""
    if case.mdp is None or not case.small:
        return None
    for under, paid, vanish in (
        ("the reward the expert's margin", case.reward, _margins_vanish),
        ("the true reward what a choice is worth", case.true, _choices_vanish),
    ):
        if paid is None or (now := vanish(case, None)) is None:
            continue
        now &= (case.mdp.gamma ** _steps_to_pay(case.mdp, paid) <= FAR)[case.acting]
        if now.mean() < MANY:
            continue
        for larger in (one for one in LARGER if one > case.mdp.gamma):
            then = vanish(case, larger)
            if then is not None and (then & now).sum() < now.sum() / 10:
                return _small(case, under, now, larger)
    return None


def _small(case: Case, under: str, vanished: np.ndarray, larger: float) -> Finding:
    assert case.mdp is not None
    states = np.flatnonzero(case.acting)[vanished]
    return Finding(
        "small-gamma",
        f"At gamma = {case.mdp.gamma} values vanish on the way: under {under} is below {VANISHED:g} of the largest |R| in "
        f"{counted(states.size)}, {vanished.mean():.0%}: {WHERE}.",
        f"A larger gamma: at {larger:g}, with the same reward, it no longer is.",
        states,
        flags=(f"--gamma {larger:g}",),
    )


def _steps_to_pay(mdp: TabularMDP, reward: TabularReward) -> np.ndarray:
    """(S,) the least number of steps to one that can pay half of the largest |R|; infinite where there is none."""
    paid = np.abs(reward.values)
    far = paid >= 0.5 * paid[mdp.reachable].max()
    rows = ((mdp.P @ far.astype(np.float64)) > 0).reshape(mdp.n_states, mdp.n_actions) if reward.on_states else far
    states, successors = mdp.P.nonzero()
    leads = sp.csr_array((np.ones(states.size), (states // mdp.n_actions, successors)), shape=(mdp.n_states, mdp.n_states))
    seen = new = rows.any(axis=1) & ~mdp.terminal
    steps, count = np.where(seen, 0.0, np.inf), 0
    while new.any():
        count += 1
        new = (leads @ new.astype(np.float64) > 0) & ~seen
        seen = seen | new
        steps[new] = count
    return steps


def _margins_vanish(case: Case, gamma: float | None) -> np.ndarray | None:
    """Acting states in which the margin of R is below VANISHED; those violated do not count, those without a row neither."""
    if case.reward is None or case.scale == 0 or not case.fully_known or not case.judges_states or case.mdp is None:
        return None
    rows = case.rows_at(gamma)
    least = least_per_state(rows.margins[rows.usable], rows.states[rows.usable], case.mdp.n_states)[case.acting]
    return np.abs(np.where(np.isnan(least), np.inf, least)) <= VANISHED * case.scale


def _choices_vanish(case: Case, gamma: float | None) -> np.ndarray | None:
    """Acting states in which the best and the worst action differ by less under the true reward."""
    if case.true is None or case.mdp is None:
        return None
    mdp = case.mdp if gamma is None else TabularMDP(case.mdp.P, gamma, case.mdp.d0, case.mdp.visits, case.mdp.horizon)
    Q = policy_iteration(mdp, case.true).Q[case.acting]
    return np.asarray(Q.max(axis=1) - Q.min(axis=1) <= VANISHED * case.true.largest(mdp))


def gamma_near_one(case: Case) -> Finding | None:
    """I - gamma P_pi has a condition number of about 1 / (1 - gamma), by which rounding and solvers' residuals grow in V."""
    if case.mdp is None or case.mdp.horizon is not None or case.scale == 0 or not case.speaks:
        return None
    if (told := case.optimality) is None:
        return None
    margins, left_open = told.margin[told.margin > 0], _left_open(case.scale, case.mdp.gamma)
    if not margins.size or left_open <= max(VANISHED * case.scale, 0.1 * (typical := float(np.median(margins)))):
        return None
    tried = (g for g in (0.9, 0.99, 0.999, 0.9999, 0.99999, 0.999999) if g < case.mdp.gamma)
    fine = [g for g in tried if _left_open(case.scale, g) <= 0.01 * typical]
    mend = f"A smaller gamma: {fine[-1]:g} is safe for margins of this size." if fine else "A smaller gamma, or larger margins."
    return Finding(
        "gamma-near-one",
        f"gamma is so near 1 that margins drown: 1 / (1 - gamma) is {1 / (1 - case.mdp.gamma):.3g}, so a solver's residuals "
        f"leave {left_open:.2g} of a margin open, and the typical one is {typical:.2g}.",
        mend,
        flags=(f"--gamma {fine[-1]:g}",) if fine else ("--gamma",),
    )


def _left_open(largest: float, gamma: float) -> float:
    """What solvers' feasibility, 1e-8 of the largest |R|, leaves of a margin: a tenth of the condition number of it."""
    return 1e-8 * largest * (1 + 0.1 / (1 - gamma))


def never_ends(case: Case) -> Finding | None:
    """Where nothing ends or absorbs, a constant added to R changes nothing: only differences count, and here they are small."""
    if case.mdp is None or case.optimum is None or not case.has_expert or case.scale == 0:
        return None
    if case.mdp.terminal[case.states].any() or _absorbing(case.mdp)[case.states].any():
        return None
    level = float(np.abs(case.optimum.V[case.states]).max())
    margins = case.margins
    if margins.size and np.median(margins) > FAINT * level:
        return None
    told = f"margins are typically {np.median(margins):.2g}" if margins.size else "there is no margin at all"
    again = "retrain " if case.shaped else "retrain with shaping, which leaves only differences, and "
    return Finding(
        "never-ends",
        f"No reachable state is terminal or absorbing, so a constant in R adds the same to every policy: values are up to "
        f"{level:.3g}, and {told}.",
        f"If the task ends, let the environment say `terminated` there. If it goes on, {again}with a time limit.",
        flags=() if case.shaped else ("--shaping",),
    )


def _absorbing(mdp: TabularMDP) -> np.ndarray:
    """(S,) states that every action keeps."""
    pairs = np.arange(mdp.n_states * mdp.n_actions)
    kept = np.asarray(mdp.P[pairs, pairs // mdp.n_actions]).reshape(mdp.n_states, mdp.n_actions)
    return kept.min(axis=1) > 1 - 1e-12


def faint_margins(case: Case) -> Finding | None:
    """An agent that learns from samples sees the range of V first and the margins last. Shaping (Ng, Harada & Russell 1999)."""
    if case.shaped or case.optimum is None or not case.speaks or not case.judges_states:
        return None
    margins = case.margins
    span = float(np.ptp(case.optimum.V[case.states]))
    if not margins.size or (typical := float(np.median(margins))) >= FAINT * span:
        return None
    return Finding(
        "faint-margins",
        f"An agent will hardly see the margins: typically {typical:.2g}, where values range over {span:.3g}.",
        f"Retrain on ExpectedAdvantage(clip={typical:.2g}).apply(reward, mdp), as the loop does with shaping=True.",
        flags=("--shaping",),
    )
