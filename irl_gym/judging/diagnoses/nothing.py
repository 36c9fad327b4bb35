"""A reward that says nothing: zero, flat, or none at all. Each check says why."""

import numpy as np

from irl_gym.errors import DegenerateExpert, IrlGymError
from irl_gym.judging.diagnoses.case import Case
from irl_gym.judging.diagnoses.findings import WHERE, Finding, counted
from irl_gym.judging.diagnoses.mends import DEFAULTS, capped, on_steps
from irl_gym.learners.base import Outcome


def lambda_above_lambda_0(case: Case) -> Finding | None:
    """R = 0 is optimal above lambda_0 (Ng & Russell 2000, section 3.2). lambda_0 is computed where the certificate lacks it."""
    l1 = case.claims.get("l1") or 0.0
    if not (case.claims.get("zero") and l1 > 0 and case.judges_states) or case.linear:
        return None
    lambda_0 = case.claims.get("lambda_0")
    if lambda_0 is None and case.small and case.has_expert and case.mdp is not None:
        terms = {"margin_cap": case.claims.get("margin_cap"), "slack": case.claims.get("slack"), "unvisited": "free"}
        try:
            lambda_0 = case.learner(**terms).critical_l1(case.mdp, case.expert)
        except IrlGymError:  # nothing to compare: another finding
            return None
    if lambda_0 is not None and l1 < lambda_0:
        return None
    known = "" if lambda_0 is None else f" lambda_0 is {lambda_0:.6g}."
    number = "" if lambda_0 is None else f" or a number below {lambda_0:.4g}"
    program, flags = capped(case) or ("l1=0.0", ("--l1 0",))
    solved = ": solved here, it gives the expert margins" if isinstance(case.best, Outcome) else ""
    return Finding(
        "lambda-above-lambda-0",
        f"The reward is zero because it is too dear: l1 is {l1:.6g}, and above lambda_0 no reward is worth its price.{known}",
        f'{program}{solved}. Or l1="auto", just below lambda_0,{number} for simpler rewards, which leave ties.',
        flags=flags,
    )


def zero_weights(case: Case) -> Finding | None:
    """All weights 0 are optimal: what features can say is not worth its price, or nothing (Ng & Russell 2000, section 4)."""
    if not (case.linear and case.claims.get("zero")):
        return None
    l1, rank, K = case.claims.get("l1") or 0.0, case.claims["rank"], case.claims["n_features"]
    if l1 > 0:
        why = f"its price l1 is {l1:.6g}, above what any reward is worth"
        mend, flags = "l1=0.0 first; then raise it slowly.", ("--l1 0",)
    else:
        flags = ("--features",)
        why = f"no reward in the span of the {counted(K, 'feature')} is worth more than none; their rows have rank {rank}"
        mend = "Give features that differ between what follows the expert's actions and what follows others."
    return Finding("zero-weights", f"The reward is zero: {why}.", mend, flags=flags)


def nothing_to_compare(case: Case) -> Finding | None:
    """(4) compares the expert with actions that it leaves out and that lead elsewhere; where there is none it says nothing."""
    rows = case.rows
    if rows is None or case.mdp is None or rows.usable.any() or not case.judges_states:
        return None
    count, flags = counted(int((case.known & case.acting).sum())), ()
    if case.mdp.n_actions == 1:
        sentence, mend = "There is only one action: every reward makes the expert optimal.", "A world in which to choose."
    elif rows.equal.all():
        sentence = (
            f"The expert takes every action in all {count} where it is known, as random actions do: nothing is preferred."
        )
        mend = (
            "Give the actions that it prefers: `most_frequent(empirical_policy(...))` for an expert that errs, or the (S, A) "
            "set of optimal actions."
        )
    else:
        sentence = f"In all {count} where the expert is known, every action that it leaves out has the successors of its own."
        mend = 'reward_on="state-action": a reward on states is paid for where an action leads.'
        flags = on_steps(case)
    return Finding("nothing-to-compare", sentence, mend, flags=flags)


def unexplained_expert(case: Case) -> Finding | None:
    """(4) may hold only with every margin 0, as for R = 0 (Ng & Russell 2000, section 3.1). By one linear program."""
    asked = case.reward is None or not case.speaks or not case.margins.size or _violated(case)
    if not (asked and case.judges_states and case.rows is not None and case.rows.usable.any()):
        return None
    if not isinstance(case.best, DegenerateExpert):
        return None
    count, kind = counted(int((case.known & case.acting).sum())), "state reward" if case.on_states else "reward"
    mend, flags = "Leave out the actions that it takes by mistake.", ()
    if case.on_states:
        mend, flags = 'reward_on="state-action" explains every expert', on_steps(case)
        errs = "" if case.claims.get("slack") else "; or slack=10.0, which finds the states in which it contradicts itself"
        mend = f"{mend}{errs}."
    return Finding(
        "unexplained-expert",
        f"No {kind} explains this expert: over the {count} where it is known, (4) holds only with every margin 0, so it is "
        "optimal for a reward only if that ties it with everything. Is it optimal for any reward at all, at this gamma?",
        mend,
        flags=flags,
    )


def _violated(case: Case) -> bool:
    return case.rows is not None and bool(case.rows.violated.any())


def no_reward(case: Case) -> Finding | None:
    """No reward came out, though the expert can be explained."""
    if case.claims or case.reward is not None or not case.has_expert or case.can_have_margin is None:
        return None
    return Finding(
        "no-reward",
        "No reward came out, though there is one: FiniteLP() gives the expert a margin in "
        f"{counted(int(case.can_have_margin.any(axis=1).sum()))}.",
        "Run the learner; if it stopped, read its error: a time_limit, or rows that contradict each other.",
    )


def zero_reward(case: Case) -> Finding | None:
    """R = 0 where no price explains it: it ties everything."""
    if case.reward is None or case.linear or case.scale > 0 or lambda_above_lambda_0(case) or not case.judges_states:
        return None
    found = case.best
    if isinstance(found, DegenerateExpert) or nothing_to_compare(case):
        return None
    mend = "FiniteLP() with its defaults finds a reward that prefers the expert's actions." if found else "Learn it again."
    told = "The reward is zero in every reachable state, and no price of ||R||_1 explains it."
    return Finding("zero-reward", told, mend, flags=DEFAULTS if found else ())


def constant_reward(case: Case) -> Finding | None:
    """A constant is no reward where nothing ends. Where episodes end it is one: it tells long ways from short ones."""
    if case.reward is None or case.mdp is None or case.scale == 0 or case.speaks or case.optimum is None:
        return None
    paid = case.reward.values[case.states]
    if not case.on_states:
        paid = paid[case.acting[case.states]]
    same = float(np.ptp(paid)) <= 1e-9 * case.scale
    if case.margins.size or (not same and case.prefers):
        return None
    if not same and not case.optimum.tied()[case.acting].all():
        more = "rounding, the solver or the counts leave more open than actions differ by"
        told = f"No action is certainly better than another under the reward: over all later steps {more}."
        return Finding("flat-reward", told, "A smaller gamma, or larger margins.", flags=("--gamma",))
    what = f"is {paid.flat[0]:.4g} in every reachable state" if same else "pays every action alike in every reachable state"
    ends = case.states[case.mdp.terminal[case.states]]
    where = f"episodes end only where every action leads ({WHERE})" if ends.size else "no state ends an episode"
    return Finding(
        "flat-reward",
        f"The reward {what}, and {where}: every policy collects the same, so nothing is preferred.",
        "FiniteLP() with its defaults, whose margins are above 0 wherever a reward can have any.",
        ends,
        flags=DEFAULTS,
    )
