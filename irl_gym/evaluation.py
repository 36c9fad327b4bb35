"""How good everything in a run is under the true reward: the content of metrics.json.

No wall time is in it, so that the same seed gives the same bytes; seconds are in the stages' records.
"""

import csv
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from irl_gym import metrics

if TYPE_CHECKING:
    from irl_gym.loop import Loop

GOOD = 0.9
"""Score that the learning curve is reported to reach for good."""


def evaluate(loop: "Loop") -> dict[str, Any]:
    """Judge the expert, a random policy, the retrained agent and the recovered reward."""
    mdp, true = loop.table.mdp, loop.table.reward
    random, expert = metrics.random_value(mdp, true), loop.true_value(loop.expert_actions)
    policies = {"expert": loop.expert_actions, "random": loop.uniform, "retrained": loop.agent_actions}
    rows = {}
    for number, (name, policy) in enumerate(policies.items()):
        value = loop.true_value(policy)
        episodes = loop.episodes(policy, loop.experiment.eval_episodes, loop.experiment.seed + 1_000_003 * (number + 1))
        returns = np.array([episode.total_reward for episode in episodes])
        mean, low, high = metrics.mean_interval(returns, rng=np.random.default_rng(loop.experiment.seed))
        rows[name] = {
            "value": value,
            "score": _plain(metrics.normalised_score(value, random, expert)),
            "mean_return": mean,
            "return_low": low,
            "return_high": high,
            "agreement": metrics.agreement(mdp, policy, loop.optimal_set),
        }
    worst = metrics.worst_tie(mdp, loop.learned, true)
    share = (expert - worst.value) / (expert - random) if expert != random else float("nan")
    keys = ("l1", "lambda_0", "margin_cap", "duality_gap", "l1_norm", "least_l1_norm", "expert_optimal", "degenerate")
    reward = {key: loop.certificate[key] for key in keys}
    reward |= {
        "worst_tie_value": worst.value,
        "worst_tie_regret": expert - worst.value,
        "worst_tie_regret_share": _plain(share),
        "inseparable_states": len(loop.certificate["inseparable"]),
        "marginless_states": len(loop.certificate["marginless"]),
    }
    crossing = settled_at(learning_curve(loop), random, expert)
    check = loop.table.evidence.check
    return {
        "policies": rows,
        "reward": reward,
        "training": {"environment_steps": loop.stage("agent")["environment_steps"], "steps_to_0.9": crossing},
        "table": {
            "states": mdp.n_states, "reachable": int(mdp.reachable.sum()), "actions": mdp.n_actions,
            "transitions": mdp.P.nnz, "split": loop.table.evidence.split,
            "check": None if check is None else dict(vars(check)),
        },
    }  # fmt: skip


def learning_curve(loop: "Loop") -> np.ndarray:
    """(n, 2) environment steps and exact true value, as the agent trained."""
    return loop.folder.load("learning_curve.csv", _read_curve)


def _read_curve(path: Path) -> np.ndarray:
    with path.open(newline="") as file:
        heading, *lines = csv.reader(file)
    if heading != ["environment_steps", "true_value"]:
        raise ValueError(f"its columns are {heading}")
    return np.array(lines, dtype=np.float64).reshape(-1, 2)


def settled_at(curve: np.ndarray, random: float, expert: float) -> int | None:
    """Environment steps after which the score on a learning curve (n, 2) stays at GOOD or above; None if it does not."""
    if expert == random or not len(curve):
        return None
    bad = np.flatnonzero((curve[:, 1] - random) / (expert - random) < GOOD)
    first = bad[-1] + 1 if bad.size else 0
    return int(curve[first, 0]) if first < len(curve) else None


def _plain(value: float) -> float | None:
    """A float as json holds it: NaN becomes None."""
    return None if np.isnan(value) else value
