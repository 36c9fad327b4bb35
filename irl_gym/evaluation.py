"""How good everything in a run is under the true reward: the content of metrics.json.

No wall time is in it, so that the same seed gives the same bytes; seconds are in the stages' records.
"""

from typing import TYPE_CHECKING, Any

import numpy as np

from irl_gym import metrics
from irl_gym._typing import ActionSets
from irl_gym.curves import Curve, read_curve
from irl_gym.dynamic_programming import policy_iteration, tied
from irl_gym.errors import NotTabular
from irl_gym.intervals import mean_interval
from irl_gym.policies import support
from irl_gym.worlds import TableWorld

if TYPE_CHECKING:
    from irl_gym.loop import Loop

GOOD = 0.9
"""Score that the learning curve is reported to reach for good."""


def evaluate(loop: "Loop") -> dict[str, Any]:
    """Judge the expert, a random policy, the retrained agent and the recovered reward."""
    experiment, world = loop.experiment, loop.world
    random = world.value(world.random)
    earned = _earned(loop) if from_data(loop) else np.zeros((0, 2))
    expert = float(earned[:, 0].mean()) if from_data(loop) else world.value(loop.expert)
    rows = {}
    for number, (name, policy) in enumerate({"expert": loop.expert, "random": world.random, "retrained": loop.agent}.items()):
        told = name == "expert" and from_data(loop)
        seed = experiment.seed + 1_000_003 * (number + 1)
        episodes = [] if told else world.episodes(policy, experiment.eval_episodes, seed)
        returns = earned[:, 1] if told else np.array([episode.total_reward for episode in episodes])
        mean, low, high = mean_interval(returns, rng=np.random.default_rng(experiment.seed))
        value = {"expert": expert, "random": random}.get(name)
        value = world.value(policy) if value is None else value
        rows[name] = {
            "value": value,
            "score": _score(value, random, expert),
            "mean_return": mean,
            "return_low": low,
            "return_high": high,
            "agreement": metrics.agreement(world.table.mdp, policy, optimal_set(loop))
            if isinstance(world, TableWorld) and not told
            else None,
        }
    curve = learning_curve(loop)
    training = {
        "environment_steps": loop.stage("agent")["environment_steps"],
        "steps_to_0.9": settled_at(np.column_stack([curve.steps, curve.value]), random, expert),
    }
    shown = {"policies": rows, "reward": _reward(loop, random, expert), "training": training}
    return {**shown, "table": _table(world) if isinstance(world, TableWorld) else None, "demonstrations": _recorded(loop)}


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


def _score(value: float, random: float, expert: float) -> float | None:
    """Random = 0, expert = 1; None where the expert earns no more than random actions, and there is no such scale."""
    return _plain(metrics.normalised_score(value, random, expert)) if expert > random else None


def from_data(loop: "Loop") -> bool:
    """Is the expert known by episodes that were given only?"""
    return loop.experiment.dataset is not None


def _recorded(loop: "Loop") -> dict[str, Any]:
    record = loop.stage("demonstrations")
    return {"dataset": record["dataset_id"], "episodes": record["episodes"], **_known_by(loop)}


def _known_by(loop: "Loop") -> dict[str, bool]:
    """Were the episodes given, and are they all that a learner of tables knows of the expert?"""
    return {"given": from_data(loop), "episodes_only": loop.experiment.from_episodes}


def optimal_set(loop: "Loop") -> ActionSets:
    """(S, A) the expert's optimal set: all optimal actions if it is optimal, errs or is known by data, else those it takes."""
    world = loop.world
    if not isinstance(world, TableWorld):
        raise NotTabular("the environment is only stepped: expected a table. Which actions are optimal is not known.")
    mdp, reward = world.table.mdp, world.table.reward
    best = policy_iteration(mdp, reward)
    tolerance = metrics.TIE_TOLERANCE * float(np.abs(reward.values).max())
    if loop.experiment.from_episodes or world.value(loop.expert) >= float(mdp.d0 @ best.V) - tolerance:
        return tied(best.Q, tolerance)
    return support(loop.expert, mdp.n_states, mdp.n_actions)


def _reward(loop: "Loop", random: float, expert: float) -> dict[str, Any]:
    """The certificate's numbers, the sizes of its lists of states, and on tables what the worst tie loses."""
    told: dict[str, Any] = {"learner": loop.stage("reward")["learner"], "status": loop.stage("reward")["status"]}
    for key, value in loop.certificate.items():
        if key in STATE_LISTS:
            told[f"{key}_states"] = len(value)
        elif not isinstance(value, list):
            told[key] = value
    world = loop.world
    if isinstance(world, TableWorld):
        told["reward_on"] = "state" if world.tabular(loop.learned).on_states else "state-action"
        worst = metrics.worst_tie(world.table.mdp, world.tabular(loop.learned), world.table.reward)
        value = worst.value if world.horizon is None else world.value(worst.policy)
        share = (expert - value) / (expert - random) if expert > random else float("nan")
        told |= {
            "worst_tie_value": value,
            "worst_tie_regret": expert - value,
            "worst_tie_regret_share": _plain(share),
        }
    stats = loop.stage("reward")["stats"]
    rounds = {"rounds": len(stats["rounds"])} if "rounds" in stats else {}
    return told | rounds | {key: stats[key] for key in ("best_round", "best_by") if key in stats}


STATE_LISTS = ("inseparable", "marginless", "unconstrained", "unknown", "violated")
"""Lists of states in certificates; the metrics count them."""


def _table(world: TableWorld) -> dict[str, Any]:
    mdp, evidence = world.table.mdp, world.table.evidence
    return {
        "horizon": world.horizon,
        "states": mdp.n_states, "reachable": int(mdp.reachable.sum()), "actions": mdp.n_actions,
        "transitions": mdp.P.nnz, "split": evidence.split, "exact": evidence.exact, "error": evidence.error,
        "method": evidence.method,
        "check": None if evidence.check is None else dict(vars(evidence.check)),
    }  # fmt: skip


def learning_curve(loop: "Loop") -> Curve:
    """What the agent earned under the true reward as it trained."""
    return loop.folder.load("learning_curve.csv", read_curve)


def settled_at(curve: np.ndarray, random: float, expert: float) -> int | None:
    """Environment steps after which the score on a learning curve (n, 2) stays at GOOD or above; None if it does not."""
    if not expert > random or not len(curve):
        return None
    bad = np.flatnonzero((curve[:, 1] - random) / (expert - random) < GOOD)
    first = bad[-1] + 1 if bad.size else 0
    return int(curve[first, 0]) if first < len(curve) else None


def _plain(value: float) -> float | None:
    """A float as json holds it: NaN becomes None."""
    return None if np.isnan(value) else value
