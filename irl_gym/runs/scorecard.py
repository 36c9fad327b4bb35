"""The content of metrics.json: how good everything in a run is, and what its stages recorded of it.

Computed from what is judged and from the records of the stages; `verified` does it again when a run is read. No wall time is in
it, so that the same seed gives the same bytes; seconds are in the stages' records.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from irl_gym.demonstrations.endings import LOST
from irl_gym.facts import in_lines
from irl_gym.files.metrics_schema import Metrics
from irl_gym.files.run_folder import read_json
from irl_gym.judging import measures
from irl_gym.judging.curves import Curve
from irl_gym.judging.estimated import evidence_told
from irl_gym.judging.measures import JudgedReward, measured
from irl_gym.judging.scores import CLONE, EXPERT, LEARNED, RANDOM, RETRAINED, Scale, in_order
from irl_gym.judging.shares import GOOD
from irl_gym.mdp.rewards import TabularReward
from irl_gym.runs.certificates import claims_in
from irl_gym.tables.tabulation import Tabulation

TOLD_STAGES = ("expert", "demonstrations", "reward", "agent", "clone")
"""The stages whose records are told."""
NEARLY_ALL = 0.99
"""A score that the learning curve is reported to reach for good, beside `shares.GOOD`."""
NOT_RECORDED = "not recorded in this version"
"""How a policy came about of which an earlier version did not note it."""
BEST = ("best_round", "best_by")
"""What the algorithm for trajectories tells of its rounds."""
TRAINED = ("trained_return", "vecnormalize")
"""What `FromFile.trained` says of an expert's training."""
STATE_LISTS = ("inseparable", "marginless", "unbreakable", "unconstrained", "undecided", "unknown", "unsettled", "violated")
"""Lists of states in certificates; the metrics count them."""


def scorecard(
    config: Mapping[str, Any], records: Mapping[str, Mapping[str, Any]], certificate: Mapping[str, Any],
    policies: Mapping[str, Mapping[str, Any]], scale: Scale, curve: Curve,
    table: Tabulation | None, horizon: int | None, learned: TabularReward | None, limit: int,
) -> dict[str, Any]:  # fmt: skip
    """The content of metrics.json.

    Args:
        config: the run's.
        records: of the stages in `TOLD_STAGES`.
        certificate: the content of certificate.json.
        policies: their rows, by `evaluation.evaluate`.
        scale: of scores, by the same.
        curve: what the agent earned as it trained.
        table: None where the environment can only be stepped, as the next two.
        horizon: steps that values count; None for all.
        learned: the recovered reward on the rows of the table.
        limit: steps after which episodes are cut.
    """
    on_table = {} if table is None or learned is None else judge_reward(learned, table, scale, horizon)
    return {
        "policies": policies,
        **scale_told(scale),
        "reward": reward_told(certificate) | learned_told(records["reward"]) | on_table,
        "training": {**training_told(records["agent"]), **settled(curve, scale)},
        "table": None if table is None else table_told(table, horizon, limit),
        "demonstrations": shown_told(records["demonstrations"]) | known_by(config) | trained_told(records["expert"])
        | cloned_told(records["clone"]),
    }  # fmt: skip


def read_metrics(path: Path) -> dict[str, Any]:
    """The content of metrics.json, its policies in order; what a terminal would obey in its names and texts is spelled out.

    Raises:
        OSError: it cannot be read now.
        DamagedFile: it is something else.
    """
    told = in_lines(read_json(path, Metrics))
    return {**told, "policies": in_order(told["policies"])}


def scale_told(scale: Scale) -> dict[str, Any]:
    """Why there is no score, and how surely the expert's value is known."""
    low, high = scale.interval
    return {"score_reason": scale.reason, "expert_value": {"episodes": scale.episodes, "low": low, "high": high}}


def known_by(config: Mapping[str, Any]) -> dict[str, bool]:
    """Were the episodes given, and are they all that a learner of tables knows of the expert?"""
    given = config.get("dataset") is not None
    return {"given": given, "episodes_only": given or bool(config.get("epsilon"))}


def shown_told(record: Mapping[str, Any]) -> dict[str, Any]:
    """What is told of the demonstrations, from their stage's record."""
    more = {key: record[key] for key in LOST if key in record}
    named = {"dataset": "dataset_id", "episodes": "episodes"}
    return {told: record[key] for told, key in named.items() if key in record} | more


def trained_told(record: Mapping[str, Any]) -> dict[str, Any]:
    """What is told of an expert's training, from its stage's record."""
    return {key: value for key, value in record.items() if key in TRAINED}


def cloned_told(record: Mapping[str, Any]) -> dict[str, Any]:
    """Why the demonstrations could not be copied, from that stage's record."""
    return {"no_clone": record["no_clone"]} if "no_clone" in record else {}


def training_told(record: Mapping[str, Any]) -> dict[str, Any]:
    """What is told of the agent's training, from its stage's record: its steps, and where it did not go on as in one go."""
    resumed = {"resumed_at": record["resumed_at"]} if "resumed_at" in record else {}
    return {"environment_steps": record.get("environment_steps", 0), **resumed}


def resumed_told(record: Mapping[str, Any]) -> str:
    """That a training was resumed where it cannot be set to the state it was in, as the end of a sentence; empty where not."""
    steps = " and ".join(f"{one:,}" for one in record.get("resumed_at", ()))
    return f"resumed at step {steps}: its result may be another than that of training in one go" if steps else ""


def how_of(planner: Any) -> str:
    """How a planner's policy comes about, by its `how`; of a planner of somebody's own that has none, by its class's name."""
    return getattr(planner, "how", f"planned by {type(planner).__name__}")


def outcome_of(learner: Any) -> str:
    """How a learner's policy comes about, by its `how`; of one that has none, by its class's name."""
    return getattr(learner, "how", f"learned by {type(learner).__name__}")


def came_about(config: Mapping[str, Any], stages: Mapping[str, Mapping[str, Any]]) -> dict[str, str]:
    """How each of the loop's policies came about, by its configuration and the records of its stages."""
    names = ("expert", "clone", "reward", "agent")
    made, cloned, learned, trained = (stages.get(name, {}).get("how", NOT_RECORDED) for name in names)
    n = stages["demonstrations"].get("episodes")
    noise = f", with a random action at probability {config['epsilon']:g}" if config.get("epsilon") else ""
    given = config.get("dataset") is not None
    alone = ", of states alone" if stages["demonstrations"].get("states_only") else ""
    return {
        EXPERT: f"known by {n:,} episode{'s' * (n != 1)} of the dataset{alone}" if given else f"{made}{noise}",
        RANDOM: "uniformly random actions",
        CLONE: cloned,
        LEARNED: learned,
        RETRAINED: trained,
    }


def judge_reward(learned: TabularReward, table: Tabulation, scale: Scale, horizon: int | None) -> dict[str, Any]:
    """Every measure of a learned reward."""
    return measured(measures.REWARDS, JudgedReward(learned, table, scale, horizon))


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


def table_told(table: Tabulation, horizon: int | None, limit: int | None) -> dict[str, Any]:
    """How big a table is, where it is from, and how far off it can be; the steps that values count, and that episodes have."""
    mdp, evidence = table.mdp, table.evidence
    return {
        "horizon": horizon,
        **({} if limit is None else {"limit": limit}),
        "states": mdp.n_states, "reachable": int(mdp.reachable.sum()), "actions": mdp.n_actions,
        "transitions": mdp.P.nnz, "split": evidence.split, "exact": evidence.exact, "method": evidence.method,
        "counted": mdp.visits is not None,
        **evidence_told(evidence),
    }  # fmt: skip


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
