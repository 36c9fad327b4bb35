"""The doctor: why a reward came out zero, flat, or useless for retraining, in sentences, each with a mend.

    print(doctor(FiniteLP(l1=5.0).fit(mdp, expert), mdp, expert))

Each sentence is one function in `irl_gym.judging.diagnoses`. It recomputes what it claims from P, the expert and R, and asks
the proof only for what that alone knows; a mend is tried where it is a program that is quick to solve.
"""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from irl_gym.errors import InvalidParameter, a_type
from irl_gym.features.linear_reward import LinearReward
from irl_gym.judging.diagnoses import nothing, sampled, solving, ties, truth, unseen, values, weights
from irl_gym.judging.diagnoses.case import Case
from irl_gym.judging.diagnoses.evidence import EvidenceName, missed, too_little
from irl_gym.judging.diagnoses.findings import NO_REWARD, counted
from irl_gym.judging.diagnoses.findings import Diagnosis as Diagnosis
from irl_gym.judging.diagnoses.findings import Finding as Finding
from irl_gym.learners.base import Outcome
from irl_gym.mdp.rewards import TabularReward, as_reward, in_table
from irl_gym.mdp.tabular_mdp import TabularMDP, checked_mdp
from irl_gym.spaces.states import States

CHECKS: Mapping[Callable[[Case], Finding | None], tuple[EvidenceName, ...]] = {
    nothing.lambda_above_lambda_0: ("certificate",),
    nothing.zero_weights: ("certificate",),
    nothing.nothing_to_compare: ("expert",),
    nothing.unexplained_expert: ("expert", "programs"),
    nothing.no_reward: ("expert", "programs"),
    nothing.zero_reward: ("reward",),
    nothing.constant_reward: ("reward",),
    weights.flat_weights: (),
    sampled.inexpressible: ("certificate",),
    truth.blind_expert: ("metrics",),
    truth.poor_expert: ("expert", "true"),
    truth.few_episodes: ("metrics",),
    truth.unconfirmed: ("metrics",),
    ties.violated: ("expert", "reward"),
    truth.lossy_ties: ("reward", "true"),
    ties.same_successors: ("expert",),
    ties.avoidable_ties: ("expert", "reward"),
    ties.unbreakable_ties: ("expert", "reward"),
    ties.unsettled: ("expert", "reward"),
    sampled.fell_short: ("certificate",),
    sampled.beaten: ("certificate",),
    sampled.drowned: ("certificate",),
    sampled.cut_short: ("certificate",),
    sampled.noisy_rows: ("certificate",),
    unseen.strays: ("expert", "reward"),
    unseen.dropped_actions: ("metrics",),
    unseen.unseen_ends: ("metrics",),
    unseen.unvisited: ("expert",),
    values.small_gamma: ("reward", "programs"),
    values.gamma_near_one: ("expert", "reward"),
    values.never_ends: ("expert", "reward"),
    values.faint_margins: ("expert", "reward"),
    solving.inaccurate: ("certificate",),
    solving.far_from_optimal: ("certificate",),
    solving.retried: ("certificate",),
}
"""Every sentence, the most important first, and the evidence without which it cannot be asked for."""


def doctor(
    result: Outcome | TabularReward | LinearReward | np.ndarray | None,
    mdp: TabularMDP | None,
    expert: Any,
    *,
    true: TabularReward | np.ndarray | None = None,
    states: States | None = None,
    shaped: bool = False,
) -> Diagnosis:
    """Say why a reward came out zero, flat, or useless for retraining.

    Args:
        result: of FiniteLP, FeatureLP or TrajectoryLP; a reward from elsewhere, (S,) paid on arrival or (S, A), of which only
            the values are known; None where the learner raised an error and no reward came out.
        mdp: the table that the reward is of; None where the environment can only be stepped.
        expert: (S,) actions, (S, A) probabilities, NaN where nothing is known, or (S, A) set; None where it is not known.
        true: (S,) or (S, A) the true reward, where it is known: then it also says what the expert and the worst tie earn.
        states: turns rows of the table into the observations that a reward's features are of; None where they are of rows.
        shaped: an agent is retrained on the expected advantage, so that small margins do no harm.

    Raises:
        InvalidMDP: something else than a table.
        InvalidParameter: neither a result nor a table, or a reward from elsewhere without a table.
        InvalidReward: a reward of another table.
        InvalidPolicy: an expert of the wrong shape or content.
        InvalidFeatures: features of other observations than the states given.
    """
    mdp = None if mdp is None else checked_mdp(mdp)
    learned = result if isinstance(result, Outcome) else None
    if learned is not None and learned.reward is None:
        return NO_REWARD
    if learned is None and mdp is None:
        what = f"{a_type(result)}{', a reward without a proof,' * (result is not None)}"
        raise InvalidParameter(f"result is {what} and mdp is None: expected a result, a table, or both.")
    reward = result if learned is None else learned.reward
    case = Case(
        mdp,
        None if mdp is None else expert,
        None if reward is None or mdp is None else as_tabular(reward, mdp, states),
        {} if learned is None else learned.proved()["terms"],
        None if learned is None else learned.status,
        {} if learned is None else learned.stats,
        None if true is None or mdp is None else as_reward(true),
        shaped,
        weights=getattr(reward, "alpha", None),
    )
    return diagnose(case)


def as_tabular(reward: Any, mdp: TabularMDP, states: States | None) -> TabularReward:
    """A reward as one of the table's states or steps."""
    tabular = in_table(reward, mdp.n_states if states is None else states)
    tabular.expected(mdp)  # checks the shape
    return tabular


def diagnose(case: Case) -> Diagnosis:
    """Ask every check."""
    if case.mdp is not None and case.expert is not None:
        case.mdp.mixing(case.distribution)  # checks shape and content
    if case.mdp is not None and case.true is not None:
        case.true.expected(case.mdp)
    found = [check(case) for check in CHECKS]
    return Diagnosis(
        tuple(one for one in found if one is not None), f"{_examined(case)} {missed(case, CHECKS)}".strip(), too_little(case)
    )


def _examined(case: Case) -> str:
    """What was looked at."""
    if case.mdp is None:
        return f"Examined: what the learner proved{', and what episodes showed' if case.judged else ''}."
    where = f"{counted(int(case.acting.sum()))} of {counted(case.mdp.n_actions, 'action')} each, gamma {case.mdp.gamma}"
    where += ", on a counted table" if case.counted else ""
    beyond, told = case.beyond.copy(), case.optimality
    if told is None or not beyond.any():
        return f"Examined: {where}."
    beyond[told.unsettled] = False
    margins, judged = told.margin[beyond], int(np.isfinite(told.margin).sum())
    if not margins.size:
        return f"Examined: {where}. No margin of {counted(judged)} is beyond its sampling error."
    return (
        f"Examined: {where}. The reward prefers the expert's action in {margins.size:,} of {judged:,} that it can judge, by "
        f"{margins.min():.3g} to {margins.max():.3g}."
    )
