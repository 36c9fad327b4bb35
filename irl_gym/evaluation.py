"""How good everything in a run is under the true reward: the content of metrics.json.

No wall time is in it, so that the same seed gives the same bytes; seconds are in the stages' records.
"""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from irl_gym import metrics
from irl_gym._typing import ActionSets
from irl_gym.certificates import claims_in
from irl_gym.confirmation import loss_by_episodes, value_by_episodes
from irl_gym.curves import Curve, read_curve, two_returns
from irl_gym.demonstrations import Episode
from irl_gym.discounted import EPSILON
from irl_gym.distances import epic, starc
from irl_gym.dynamic_programming import optimum
from irl_gym.endings import LOST
from irl_gym.errors import NotTabular, UndefinedDistance
from irl_gym.estimated import evidence_told
from irl_gym.howard import Optimum
from irl_gym.intervals import mean_interval
from irl_gym.loss import loss_of
from irl_gym.mdp import TabularMDP
from irl_gym.policies import as_distribution, support
from irl_gym.rewards import TabularReward
from irl_gym.scores import Scale, half_width
from irl_gym.shares import GOOD, returns_of, share_of_return
from irl_gym.tabulation import Tabulation
from irl_gym.worlds import TableWorld

if TYPE_CHECKING:
    from irl_gym.loop import Loop

JUDGING = 1_000_003
"""Added to the seed of the episodes that judge, the same for all: policies that do the same then earn the same."""
NEARLY_ALL = 0.99
"""A score that the learning curve is reported to reach for good, beside `shares.GOOD`."""


def evaluate(loop: "Loop") -> dict[str, Any]:
    """Judge the expert, a random policy, the retrained agent and the recovered reward."""
    experiment, world = loop.experiment, loop.world
    earned = _earned(loop) if from_data(loop) else np.zeros((0, 2))
    scale = _scale(loop, earned[:, 0])
    agreed = optimal_set(loop) if isinstance(world, TableWorld) else None
    rows = {}
    for name, policy in {"expert": loop.expert, "random": world.random, "retrained": loop.agent}.items():
        told = name == "expert" and from_data(loop)
        episodes = [] if told else world.episodes(policy, experiment.eval_episodes, experiment.seed + JUDGING)
        returns = earned[:, 1] if told else np.array([episode.total_reward for episode in episodes])
        possible = two_returns(world.table) if isinstance(world, TableWorld) and not told else None
        mean = mean_interval(returns, possible=possible)
        low, high = mean.ends
        value = {"expert": scale.expert, "random": scale.random}.get(name)
        value = world.value(policy) if value is None else value
        rows[name] = {
            "value": value,
            "score": scale.score(value),
            "mean_return": mean.estimate,
            "return_low": low,
            "return_high": high,
            "agreement": metrics.agreement(world.table.mdp, policy, agreed)
            if isinstance(world, TableWorld) and agreed is not None and not told
            else None,
            **_confirmed(world, episodes, lost=name == "retrained"),
        }
    expert, random = (returns_of(rows[name]) for name in ("expert", "random"))
    for row in rows.values():
        row["return_share"] = share_of_return(returns_of(row), expert, random)
    training = {"environment_steps": loop.stage("agent")["environment_steps"], **settled(learning_curve(loop), scale)}
    low, high = scale.interval
    return {
        "policies": rows,
        "score_reason": scale.reason,
        "expert_value": {"episodes": scale.episodes, "low": low, "high": high},
        "reward": _reward(loop, scale),
        "training": training,
        "table": table_told(world.table, world.horizon) if isinstance(world, TableWorld) else None,
        "demonstrations": {**shown_told(loop.stage("demonstrations")), **_known_by(loop), **_trained(loop)},
    }


def _confirmed(world: Any, episodes: list[Episode], *, lost: bool) -> dict[str, float | None]:
    """What fresh episodes say of a value that a counted table gives, and of what is lost against the best; else nothing."""
    if not isinstance(world, TableWorld) or world.table.mdp.visits is None or not episodes:
        return {}
    value = value_by_episodes(world.table, episodes, world.horizon)
    low, high = value.ends
    told = {"sampled_value": value.estimate, "sampled_low": low, "sampled_high": high}
    if lost and world.horizon is None:
        told["loses_at_most"] = loss_by_episodes(world.table, episodes).ends[1]
    return told


def _scale(loop: "Loop", earned: np.ndarray) -> Scale:
    """What a score is measured by; earned are the discounted returns (N,) of episodes that were given."""
    world, told = loop.world, from_data(loop)
    random = world.value(world.random)
    expert = float(earned.mean()) if told else world.value(loop.expert)
    rounding = rounding_of(world.gamma, random, expert) if isinstance(world, TableWorld) else 0.0
    if not told:
        return Scale(random, expert, rounding, gamma=world.gamma)
    return Scale(random, expert, rounding, half_width(earned, _without_chance(loop)), earned.size, world.gamma)


def rounding_of(gamma: float, *values: float) -> float:
    """What a factorisation of I - gamma P leaves of values, its condition number being about 1 / (1 - gamma)."""
    return 64 * EPSILON / (1 - gamma) * max(map(abs, values))


def _without_chance(loop: "Loop") -> bool:
    """Are all episodes given the same, in a table in which start and steps could not have gone otherwise?"""
    world = loop.world
    if not isinstance(world, TableWorld) or not world.table.evidence.exact:
        return False
    mdp, first = world.table.mdp, loop.demonstrations[0]
    rows = first.rows(world.table.states)
    if any(
        not (np.array_equal(one.rows(world.table.states), rows) and np.array_equal(one.actions, first.actions))
        for one in loop.demonstrations
    ):
        return False
    taken = mdp.P[rows[:-1] * mdp.n_actions + first.actions]
    return np.count_nonzero(mdp.d0) == 1 and int((taken > 0).sum(axis=1).max(initial=0)) <= 1


def _earned(loop: "Loop") -> np.ndarray:
    """(N, 2) discounted and undiscounted return of the episodes that were given, by the table's reward where there is one.

    A dataset need not hold rewards: a log that was imported may have none.
    """
    world = loop.world
    paid = [
        world.table.reward.values[episode.rows(world.table.states)[:-1], episode.actions]
        if isinstance(world, TableWorld)
        else episode.rewards
        for episode in loop.demonstrations
    ]
    return np.array([[world.gamma ** np.arange(len(one)) @ one, one.sum()] for one in paid])


def from_data(loop: "Loop") -> bool:
    """Is the expert known by episodes that were given only?"""
    return loop.experiment.dataset is not None


def shown_told(record: Mapping[str, Any]) -> dict[str, Any]:
    """What is told of the demonstrations, from their stage's record."""
    more = {key: record[key] for key in LOST if key in record}
    named = {"dataset": "dataset_id", "episodes": "episodes"}
    return {told: record[key] for told, key in named.items() if key in record} | more


def _trained(loop: "Loop") -> dict[str, Any]:
    return {key: value for key, value in loop.stage("expert").items() if key in TRAINED}


def _known_by(loop: "Loop") -> dict[str, bool]:
    """Were the episodes given, and are they all that a learner of tables knows of the expert?"""
    return {"given": from_data(loop), "episodes_only": loop.experiment.from_episodes}


def optimal_set(loop: "Loop") -> ActionSets:
    """(S, A) the expert's optimal set: all optimal actions if it is optimal, errs or is known by data, else those it takes."""
    world = loop.world
    if not isinstance(world, TableWorld):
        raise NotTabular("the environment is only stepped: expected a table, which tells optimal actions.")
    mdp, true = world.table.mdp, world.table.reward
    return good_actions(mdp, None if loop.experiment.from_episodes else loop.expert, optimum(mdp, true))


def good_actions(mdp: TabularMDP, expert: np.ndarray | None, best: Optimum) -> ActionSets:
    """(S, A) the actions that agree with an expert: every optimal one if it is optimal, else those it takes.

    Args:
        mdp: P, gamma and d0.
        expert: (S,) actions or (S, A) probabilities; None where it errs or is known by data, and optimal actions count.
        best: what is optimal under the true reward.
    """
    if expert is None or loss_of(best, as_distribution(expert, mdp.n_states, mdp.n_actions)).optimal:
        return metrics.ties_of(best, 0.0).possible
    return support(expert, mdp.n_states, mdp.n_actions)


def _reward(loop: "Loop", scale: Scale) -> dict[str, Any]:
    """The certificate's numbers, what its stage recorded, and on tables what the worst tie loses."""
    told, world = reward_told(loop.certificate) | learned_told(loop.stage("reward")), loop.world
    if isinstance(world, TableWorld):
        told |= judged_reward(world.table, world.tabular(loop.learned), scale, world.horizon)
    return told


def reward_told(certificate: Mapping[str, Any]) -> dict[str, Any]:
    """The certificate's numbers, and the sizes of its lists of states."""
    told = claims_in(certificate)
    sizes = {f"{key}_states": len(value) for key, value in told.items() if key in STATE_LISTS}
    return sizes | {key: value for key, value in told.items() if not isinstance(value, list)}


def learned_told(record: Mapping[str, Any]) -> dict[str, Any]:
    """Whose the reward is, and what the program said, from its stage's record."""
    stats = record.get("stats", {})
    rounds = {"rounds": len(stats["rounds"])} if "rounds" in stats else {}
    told = {key: one[key] for one, keys in ((record, ("learner", "status")), (stats, BEST)) for key in keys if key in one}
    return told | rounds


def judged_reward(table: Tabulation, learned: TabularReward, scale: Scale, horizon: int | None) -> dict[str, Any]:
    """What the worst tie under a reward loses, and how far it is from the true one."""
    worst = metrics.worst_tie(table.mdp, learned, table.reward)
    value = worst.value if horizon is None else metrics.policy_value(table.mdp, table.reward, worst.policy, horizon)
    return {
        "reward_on": "state" if learned.on_states else "state-action",
        "worst_tie_value": value,
        "worst_tie_regret": scale.expert - value,
        "worst_tie_regret_share": scale.share(scale.expert - value),
        **_apart(table.mdp, table.reward, learned),
    }


def _apart(mdp: TabularMDP, true: TabularReward, learned: TabularReward) -> dict[str, float | None]:
    """Distances of the learned reward from the true one, where episodes go; None where one is not defined."""
    rows = np.flatnonzero(mdp.reachable)
    part, pair = mdp.restrict(rows), [reward.values[rows] for reward in (true, learned)]
    told: dict[str, float | None] = {}
    for name, distance in (("starc", starc), ("epic", epic)):
        try:
            told[name] = distance(part, *pair)
        except UndefinedDistance:
            told[name] = None
    return told


BEST = ("best_round", "best_by")
"""What the algorithm for trajectories tells of its rounds."""
TRAINED = ("trained_return", "vecnormalize")
"""What `FromFile.trained` says of an expert's training."""
STATE_LISTS = ("inseparable", "marginless", "unbreakable", "unconstrained", "unknown", "unsettled", "violated")
"""Lists of states in certificates; the metrics count them."""


def table_told(table: Tabulation, horizon: int | None) -> dict[str, Any]:
    """How big a table is, where it is from, and how far off it can be; and the steps that values count."""
    mdp, evidence = table.mdp, table.evidence
    return {
        "horizon": horizon,
        "states": mdp.n_states, "reachable": int(mdp.reachable.sum()), "actions": mdp.n_actions,
        "transitions": mdp.P.nnz, "split": evidence.split, "exact": evidence.exact, "method": evidence.method,
        "counted": mdp.visits is not None,
        **evidence_told(evidence),
    }  # fmt: skip


def learning_curve(loop: "Loop") -> Curve:
    """What the agent earned under the true reward as it trained."""
    return loop.folder.load("learning_curve.csv", read_curve)


def settled(curve: Curve, scale: Scale) -> dict[str, int | None]:
    """Environment steps after which the score stays good, and nearly all of it; None where it does not, or there is none."""
    points = np.column_stack([curve.steps, curve.value])
    return {
        f"steps_to_{good:g}": None if scale.reason is not None else settled_at(points, scale.random, scale.expert, good)
        for good in (GOOD, NEARLY_ALL)
    }


def settled_at(curve: np.ndarray, random: float, expert: float, good: float = GOOD) -> int | None:
    """Environment steps after which the score on a learning curve (n, 2) stays at `good` or above; None if it does not."""
    if not expert > random or not len(curve):
        return None
    bad = np.flatnonzero((curve[:, 1] - random) / (expert - random) < good)
    first = bad[-1] + 1 if bad.size else 0
    return int(curve[first, 0]) if first < len(curve) else None
