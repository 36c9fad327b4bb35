"""What is wrong under the true reward, where it is known: with the expert, and with what the learned reward allows."""

import numpy as np

from irl_gym.diagnoses.case import Case
from irl_gym.diagnoses.findings import Finding, counted, named
from irl_gym.diagnoses.unseen import entered
from irl_gym.dynamic_programming import occupancy
from irl_gym.metrics import policy_value, random_value, worst_tie
from irl_gym.scores import FEWEST, Scale

MUCH = 0.05
"""Share of what can be had over random actions; a loss above it is worth a sentence."""


def _expert_value(case: Case) -> float | None:
    """The expert's true value from d0; None where it enters states in which nothing is known of it."""
    if case.mdp is None or case.true is None or not case.has_expert:
        return None
    visited = entered(case.mdp, (case.distribution > 0) & case.known[:, None])
    if (visited & case.acting & ~case.known).any():
        return None
    return policy_value(case.mdp, case.true, case.distribution)


def poor_expert(case: Case) -> Finding | None:
    """IRL explains what the expert does, not what it should: its own value bounds what a faithful agent earns."""
    value = _expert_value(case)
    if value is None or case.mdp is None or case.true is None or case.true_optimum is None:
        return None
    best, random = float(case.mdp.d0 @ case.true_optimum.V), random_value(case.mdp, case.true)
    rounding = case.true_tie
    mend = "A better expert: plan for the true reward, train longer, or drop its bad episodes."
    if value <= random - rounding or (value <= random + rounding and best > random + rounding):
        sentence = f"earns {value:.4g}, no more than random actions, {random:.4g}, where {best:.4g} is possible"
        return Finding("expert-worse-than-random", f"Under the true reward the expert {sentence}.", mend)
    if best - value <= max(MUCH * (best - random), rounding):
        return None
    Q = case.true_optimum.Q
    loss = np.where(case.mdp.terminal | ~case.known, 0.0, Q.max(axis=1) - (case.distribution * Q).sum(axis=1))
    weight = occupancy(case.mdp, case.distribution).sum(axis=1) * loss
    states = _heaviest(weight)
    return Finding(
        "expert-suboptimal",
        f"Under the true reward the expert earns {value:.4g} where {best:.4g} is possible and random actions earn "
        f"{random:.4g}; it loses most in {named(states)}.",
        mend,
        states,
    )


def few_episodes(case: Case) -> Finding | None:
    """The value of an expert that is known by episodes only is their mean: too few make no scale for a score."""
    known = case.judged.get("expert_value") or {}
    if known.get("episodes") is None:
        return None
    rows, high = case.judged["policies"], known["high"]
    expert = rows["expert"]["value"]
    half = float("inf") if high is None else high - expert
    scale = Scale(rows["random"]["value"], expert, half=half, episodes=known["episodes"])
    if not scale.few:
        return None
    about = "" if scale.needed is None else f": about {max(scale.needed, FEWEST):,}, if more are like these"
    about = f": {FEWEST} at the least" if half == float("inf") else about
    return Finding(
        "few-episodes",
        f"There is no score: {scale.reason}.",
        f"More episodes of the expert{about}.",
    )


def lossy_ties(case: Case) -> Finding | None:
    """The worst policy among those greedy under R, under the true reward (`metrics.worst_tie`): what an agent may find."""
    if case.mdp is None or case.true is None or case.true_optimum is None or not case.speaks or case.reward is None:
        return None
    worst = worst_tie(case.mdp, case.reward, case.true)
    expert = _expert_value(case)
    fair = float(case.mdp.d0 @ case.true_optimum.V) if expert is None else expert
    random = random_value(case.mdp, case.true)
    rounding = case.true_tie
    if fair - worst.value <= max(MUCH * abs(fair - random), rounding):
        return None
    Q = case.true_optimum.Q
    loss = Q.max(axis=1) - Q[np.arange(case.mdp.n_states), worst.policy]
    states = _heaviest(np.where(case.mdp.terminal, 0.0, occupancy(case.mdp, worst.policy).sum(axis=1) * loss))
    actions = worst.policy[states]
    whose = "what is possible" if expert is None else "the expert"
    return Finding(
        "worst-tie",
        f"The reward allows too much: the worst policy that is greedy under it earns {worst.value + 0.0:.4g}, "
        f"{whose} {fair:.4g} and random actions {random:.4g}. It loses most in {counted(states.size)}: "
        f"{named(states, actions)}.",
        _break(case, states, actions),
        states,
        tuple(actions.tolist()),
    )


def _heaviest(weight: np.ndarray) -> np.ndarray:
    """States that carry more than a hundredth of a loss, the heaviest first."""
    order = np.argsort(-weight, kind="stable")
    return order[weight[order] > 0.01 * weight.sum()].astype(np.int64)


def _break(case: Case, states: np.ndarray, actions: np.ndarray) -> str:
    """How these ties are broken."""
    if case.has_expert and not case.known[states].all():
        return "More episodes: in some of these states nothing is known of the expert."
    if case.rows is not None and case.on_states:
        trivial = case.rows.trivial & ~case.rows.equal
        same = set(zip(case.rows.states[trivial].tolist(), case.rows.actions[trivial].tolist(), strict=True))
        if same & set(zip(states.tolist(), actions.tolist(), strict=True)):
            return 'reward_on="state-action": some of these actions have the successors of the expert\'s own.'
    if not case.judges_states:
        return "More rounds or features, so that these actions lead to other features than the expert's."
    if case.linear:
        return 'margin_cap="auto"; if it stays, more or other features, or FiniteLP.'
    return 'margin_cap="auto" with l1=0.0, and reward_on="state-action" where that leaves them.'
