"""The doctor: why a reward came out zero, flat, or useless for retraining, in sentences, each with a mend.

    print(doctor(FiniteLP(l1=5.0).fit(mdp, expert), mdp, expert))

Each sentence is one function in `irl_gym.diagnoses`. It recomputes what it claims from P, the expert and R, and asks the
proof only for what that alone knows; a mend is tried where it is a program that is quick to solve.
"""

import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from irl_gym.certificates import claims_in
from irl_gym.diagnoses import nothing, sampled, solving, ties, truth, unseen, values, weights
from irl_gym.diagnoses.case import Case
from irl_gym.diagnoses.findings import Diagnosis as Diagnosis
from irl_gym.diagnoses.findings import Finding as Finding
from irl_gym.diagnoses.findings import counted
from irl_gym.diagnoses.unfinished import left_behind, seen_with_noise
from irl_gym.errors import InvalidParameter
from irl_gym.learners.base import IRLResult
from irl_gym.linear_reward import LinearReward
from irl_gym.mdp import TabularMDP, checked_mdp
from irl_gym.rewards import TabularReward, as_reward
from irl_gym.states import States

if TYPE_CHECKING:
    from irl_gym.runs import Run

CHECKS: tuple[Callable[[Case], Finding | None], ...] = (
    nothing.lambda_above_lambda_0,
    nothing.zero_weights,
    nothing.nothing_to_compare,
    nothing.unexplained_expert,
    nothing.no_reward,
    nothing.zero_reward,
    nothing.constant_reward,
    weights.flat_weights,
    sampled.inexpressible,
    truth.blind_expert,
    truth.poor_expert,
    truth.few_episodes,
    truth.unconfirmed,
    ties.violated,
    truth.lossy_ties,
    ties.same_successors,
    ties.avoidable_ties,
    ties.unbreakable_ties,
    ties.unsettled,
    sampled.fell_short,
    sampled.beaten,
    sampled.drowned,
    sampled.cut_short,
    sampled.noisy_rows,
    unseen.strays,
    unseen.dropped_actions,
    unseen.unseen_ends,
    unseen.unvisited,
    values.small_gamma,
    values.gamma_near_one,
    values.never_ends,
    values.faint_margins,
    solving.inaccurate,
    solving.far_from_optimal,
    solving.retried,
)
"""Every sentence, the most important first."""


def doctor(
    result: IRLResult | TabularReward | LinearReward | np.ndarray | None,
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
    learned = result if isinstance(result, IRLResult) else None
    if learned is None and mdp is None:
        what = "None" if result is None else f"a {type(result).__name__}, a reward without a proof,"
        raise InvalidParameter(f"result is {what} and mdp is None: expected a result, a table, or both.")
    reward = result if learned is None else learned.reward
    case = Case(
        mdp,
        None if mdp is None else expert,
        None if reward is None or mdp is None else _tabular(reward, mdp, states),
        {} if learned is None else learned.proof.to_json(),
        "" if learned is None else learned.status.value,
        {} if learned is None else learned.stats,
        None if true is None or mdp is None else as_reward(true),
        shaped,
        weights=weights_of(reward),
    )
    return diagnose(case)


def weights_of(reward: Any) -> np.ndarray | None:
    """(K,) alpha of a reward that is linear in features; None of another."""
    return reward.alpha if isinstance(reward, LinearReward) else None


def _tabular(reward: Any, mdp: TabularMDP, states: States | None) -> TabularReward:
    if isinstance(reward, LinearReward):
        reward = reward.tabular(mdp.n_states if states is None else states)
    tabular = as_reward(reward)
    tabular.expected(mdp)  # checks the shape
    return tabular


def diagnose(case: Case) -> Diagnosis:
    """Ask every check."""
    if case.mdp is not None and case.expert is not None:
        case.mdp.mixing(case.distribution)  # checks shape and content
    if case.mdp is not None and case.true is not None:
        case.true.expected(case.mdp)
    found = [check(case) for check in CHECKS]
    return Diagnosis(tuple(one for one in found if one is not None), _examined(case))


def _examined(case: Case) -> str:
    """What was looked at."""
    if case.mdp is None:
        return "There is no table: only what the proof says was examined."
    where = f"{counted(int(case.acting.sum()))} of {counted(case.mdp.n_actions, 'action')} each, gamma {case.mdp.gamma:g}"
    where += ", on a counted table" if case.counted else ""
    beyond = case.beyond.copy()
    if case.rows is None or not beyond.any():
        return f"Examined: {where}."
    beyond[case.rows.states[case.unsettled]] = False
    margins, judged = case.least[beyond], int(np.isfinite(case.least).sum())
    if not margins.size:
        return f"Examined: {where}. No margin of {judged:,} states is beyond its sampling error."
    return (
        f"Examined: {where}. The reward prefers the expert's action in {margins.size:,} of {judged:,} that it can judge, by "
        f"{margins.min():.3g} to {margins.max():.3g}."
    )


def diagnose_run(run: "Run") -> Diagnosis:
    """The same of a run's folder, as `irl_gym.runs.read_run` reads it.

    Raises:
        InvalidReward, InvalidPolicy: files that do not belong together.
        DatasetMissing: the demonstrations of an expert with noise are gone.
    """
    reward: Mapping[str, Any] = run.stages.get("reward", {})
    table, claims = run.table, claims_in(run.certificate)
    if table is None:
        stats = reward.get("stats", {})
        return diagnose(
            Case(
                claims=claims, status=reward.get("status", ""), stats=stats, judged=run.metrics, weights=weights_of(run.learned)
            )
        )
    case = Case(
        table.mdp,
        seen_with_noise(run.path, table) if run.config.get("epsilon") else run.expert,
        _tabular(run.learned, table.mdp, table.states),
        claims,
        reward.get("status", ""),
        reward.get("stats", {}),
        table.reward,
        bool(run.config.get("shaping")),
        run.metrics,
        weights_of(run.learned),
    )
    return diagnose(case)


def diagnose_unfinished(path: str | os.PathLike) -> Diagnosis | None:
    """The same of the folder of a run that did not finish: from its table and expert, and its reward if there is one.

    None where the folder does not hold enough.
    """
    case = left_behind(Path(path))
    return None if case is None else diagnose(case)
