"""What is wrong under the true reward, where it is known: with the expert, and with what the learned reward allows."""

import numpy as np

from irl_gym._typing import Indices
from irl_gym.judging.diagnoses.case import Case
from irl_gym.judging.diagnoses.findings import WHERE, Finding, counted
from irl_gym.judging.diagnoses.mends import Mend, breaking, on_steps
from irl_gym.judging.diagnoses.unseen import entered
from irl_gym.judging.metrics import policy_value, random_value
from irl_gym.judging.scores import CLONE, EXPERT, FEWEST, RANDOM, RETRAINED, Scale
from irl_gym.mdp.planning.dynamic_programming import backup, occupancy, policy_evaluation

BLIND = 0.2
"""Share of what an expert had over random actions when it was trained; who lacks more may not see what it saw."""
MUCH = 0.05
"""Share of what can be had over random actions; a loss above it is worth a sentence."""


def _strays(case: Case) -> bool:
    """Does the expert enter states in which nothing is known of it?"""
    assert case.mdp is not None
    visited = entered(case.mdp, (case.distribution > 0) & case.known[:, None])
    return bool((visited & case.acting & ~case.known).any())


def _whose(case: Case) -> str:
    """Whose value that of `Case.continued` is."""
    if not case.has_expert:
        return "what is possible"
    if _strays(case):
        return "the expert as it was seen, and at best elsewhere,"
    return "the expert as it was seen" if _by_episodes(case) else "the expert"


def _by_episodes(case: Case) -> bool:
    """Is the expert known by its episodes only?"""
    return not case.fully_known or bool(case.judged.get("demonstrations", {}).get("episodes_only"))


def poor_expert(case: Case) -> Finding | None:
    """IRL explains what the expert does, not what it should: its own value bounds what a faithful agent earns."""
    shown = case.continued
    if shown is None or not case.has_expert or case.mdp is None or case.true is None or case.true_optimum is None:
        return None
    value = policy_value(case.mdp, case.true, shown)
    best, random = float(case.mdp.d0 @ case.true_optimum.V), random_value(case.mdp, case.true)
    rounding, (mend, flags) = case.true_tie, _better(case)
    earns = f"Under the true reward {_whose(case)} earns {value:.4g}"
    if value < random - rounding or (value <= random + rounding and best > random + rounding):
        told = f"{earns}, no more than random actions, {random:.4g}, where {best:.4g} is possible."
        return Finding("expert-worse-than-random", told, mend, flags=flags)
    if best - value <= max(MUCH * (best - random), rounding):
        return None
    Q = case.true_optimum.Q
    loss = np.where(case.mdp.terminal | ~case.known, 0.0, Q.max(axis=1) - (shown * Q).sum(axis=1))
    states = _heaviest(occupancy(case.mdp, shown).sum(axis=1) * loss)
    told = f"{earns} where {best:.4g} is possible and random actions earn {random:.4g}; it loses most in {WHERE}."
    return Finding("expert-suboptimal", told, mend, states, flags=flags)


def _better(case: Case) -> Mend:
    """How to have a better expert: itself, or what its episodes show of it."""
    if not _by_episodes(case):
        told = "A better expert: plan for the true reward, train longer, or drop its bad episodes."
        return told, ("--expert value-iteration",)
    told = "More episodes, in which its own actions are the most frequent; less noise (epsilon); or leave out its bad episodes."
    return told, ("--episodes", "--epsilon")


def blind_expert(case: Case) -> Finding | None:
    """An agent that was trained on normalised observations is lost on others: it returns less than its zip says it did then."""
    told, rows = case.judged.get("demonstrations", {}), case.judged.get("policies") or {}
    trained, expert, random = told.get("trained_return"), rows.get("expert"), rows.get("random")
    if trained is None or expert is None or random is None or told.get("episodes_only"):
        return None
    high, chance = expert["return_high"], random["mean_return"]
    if high is None or high >= trained - BLIND * (trained - chance) or trained <= chance:
        return None
    under = ", under a VecNormalize whose statistics are not given here" if told.get("vecnormalize") else ""
    return Finding(
        "blind-expert",
        f"The expert returns {expert['mean_return']:.4g} here, but returned {trained:.4g} in the last episodes of its "
        f"training, by its zip{under}: it may see other observations here, such as ones that were not normalised, or was paid "
        "another reward then.",
        "Give the statistics of its observations, the file that VecNormalize's `save` wrote; or an expert of this environment.",
        flags=("--expert-normalize",),
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


def unconfirmed(case: Case) -> Finding | None:
    """A counted table is an estimate: what it says a policy earns is confirmed by episodes that were not counted, or not."""
    rows = case.judged.get("policies") or {}
    for name, row in rows.items():
        low, high = row.get("sampled_low"), row.get("sampled_high")
        if low is None or high is None or name == CLONE:  # it acts at random where the table is counted least
            continue
        value, much = row["value"], MUCH * abs(rows["expert"]["value"] - rows["random"]["value"])
        if max(value - high, low - value) > much:
            whose = {RETRAINED: "the retrained agent", RANDOM: "a random policy", EXPERT: "the expert"}.get(name, name)
            return Finding(
                "table-not-confirmed",
                f"By the counted table {whose} earns {value:.4g}, by episodes that were not counted {row['sampled_value']:.4g} "
                f"({low:.4g} to {high:.4g}): what is judged on this table is off by more than the noise of these episodes.",
                "More steps to count. If it stays, the observation hides part of the state.",
                flags=("--table sample", "--steps"),
            )
    return None


def lossy_ties(case: Case) -> Finding | None:
    """The worst policy among those greedy under R, under the true reward (`metrics.worst_tie`): what an agent may find.

    What it loses against the expert is shared out among its actions, by their value in the expert's hands; the expert's own
    actions are no ties that a reward could break.
    """
    if case.continued is None or case.worst is None or not case.speaks or case.mdp is None or case.true is None:
        return None
    V, worst = policy_evaluation(case.mdp, case.true, case.continued), case.worst
    fair, random = float(case.mdp.d0 @ V), random_value(case.mdp, case.true)
    much = max(MUCH * abs(fair - random), case.true_tie)
    if fair - worst.value <= much:
        return None
    here = np.arange(case.mdp.n_states)
    loss = V - backup(case.mdp, case.true.expected(case.mdp), V)[here, worst.policy]
    lost = np.where(case.mdp.terminal, 0.0, occupancy(case.mdp, worst.policy).sum(axis=1) * np.maximum(loss, 0.0))
    own = case.known & (case.distribution[here, worst.policy] > 0) if case.has_expert else np.zeros_like(case.acting)
    told = f"{worst.value + 0.0:.4g}, {_whose(case)} {fair:.4g} and random actions {random:.4g}"
    blamed = np.where(own, 0.0, lost)
    if blamed.sum() <= much:
        return None if poor_expert(case) else _mixed(lost, worst.policy, told)
    states = _heaviest(blamed)
    actions = worst.policy[states]
    mend, flags = _break(case, states, actions)
    return Finding(
        "worst-tie",
        f"The reward allows too much: the worst policy that is greedy under it earns {told}. It loses most in "
        f"{counted(states.size)}: {WHERE}.",
        mend,
        states,
        tuple(actions.tolist()),
        flags,
    )


def _mixed(lost: np.ndarray, policy: np.ndarray, told: str) -> Finding:
    """The expert takes several actions in a state, of which not all are as good; a learner takes them to be."""
    states = _heaviest(lost)
    actions = policy[states]
    return Finding(
        "expert-suboptimal",
        f"The actions that the expert mixes are not all as good: under the true reward the worst policy that is greedy under "
        f"the learned one, and takes them, earns {told}. It loses most in {WHERE}.",
        "Give the actions that it prefers: `most_frequent(empirical_policy(...))` for an expert that errs.",
        states,
        tuple(actions.tolist()),
    )


def _heaviest(weight: np.ndarray) -> np.ndarray:
    """States that carry more than a hundredth of a loss, the heaviest first."""
    order = np.argsort(-weight, kind="stable")
    return order[weight[order] > 0.01 * weight.sum()].astype(np.int64)


def _break(case: Case, states: Indices, actions: np.ndarray) -> Mend:
    """How these ties are broken."""
    if case.has_expert and not case.known[states].all():
        return "More episodes: in some of these states nothing is known of the expert.", ("--episodes",)
    if case.rows is not None and case.on_states:
        trivial = case.rows.trivial & ~case.rows.equal
        same = set(zip(case.rows.states[trivial].tolist(), case.rows.actions[trivial].tolist(), strict=True))
        if same & set(zip(states.tolist(), actions.tolist(), strict=True)):
            told = 'reward_on="state-action": some of these actions have the successors of the expert\'s own.'
            return told, on_steps(case)
    if not case.judges_states:
        return "More rounds or features, so that these actions lead to other features than the expert's.", ("--rounds",)
    return breaking(case, states, actions)
