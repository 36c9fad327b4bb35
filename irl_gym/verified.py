"""What a run claims, computed again from its table, its policies and its reward as they lie in the folder.

A certificate and metrics.json are files like the others, and their digests can be made anew. Both the loss that a run records
and the one computed here are bounds of the same number, so that those of a run whose files are its own have numbers in common.
Numbers that follow from other files are compared with what these give (`claims`). What depends on which actions count as tied,
and so on rounding, is not compared but told as computed now (`again`).
Axes: S states, A actions.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from irl_gym.comparisons import as_compared, compare
from irl_gym.curves import Curve
from irl_gym.diagnoses.unfinished import seen_with_noise
from irl_gym.dynamic_programming import optimum
from irl_gym.errors import InvalidDiscount, InvalidReward, IrlGymError
from irl_gym.evaluation import (
    good_actions,
    judged_reward,
    learned_told,
    reward_told,
    rounding_of,
    settled,
    shown_told,
    table_told,
)
from irl_gym.learners.feature_rows import completed
from irl_gym.mdp import TabularMDP
from irl_gym.metrics import agreement, policy_value
from irl_gym.optimality import Loss, loss_on
from irl_gym.policies import as_distribution
from irl_gym.rewards import TabularReward
from irl_gym.scores import Scale
from irl_gym.tabulation import Tabulation

JUDGED_BY_LOSS = ("FiniteLP", "FeatureLP")
"""Learners whose certificate on a table says what the best policy earns more than the expert."""
ROUNDING = 1e-9
"""Share of what is at stake by which two computations of one loss may differ: features are not alike on all machines."""
WITHIN = 1e-6
"""Share of the largest value by which two computations of one value may differ."""
MOST_STEPS = 100_000
"""Of a horizon that values are computed again for."""
EVIDENCE = ("method", "counted", "error", "reward_error", "value_error", "errors", "hidden_state", "checked")
"""Of a table, what is told as table.npz has it now: another version may word or bound it otherwise."""


@dataclass(frozen=True)
class Claim:
    """A part of metrics.json that follows from another file."""

    file: str
    """Which."""
    expected: Mapping[str, Any]
    """What it gives; a key that metrics.json lacks, as one of an earlier version may, is not claimed."""
    within: float = 0.0
    """By how much a number may differ."""

    def fault(self, metrics: Mapping[str, Any]) -> str | None:
        """Which entry is another, in words, with a mend; None where there is none."""
        found = self._other(metrics, self.expected, "")
        if found is None:
            return None
        made = self.file.endswith(".npz") or self.file == "certificate.json"
        again = f"{self.file} and metrics.json, and what they hold is" if made else "metrics.json, and it is"
        return f"metrics.json has {found}, as {self.file} gives it; delete {again} made again"

    def _other(self, told: Mapping[str, Any], expected: Mapping[str, Any], where: str) -> str | None:
        """The first entry that is another than expected."""
        for key, value in expected.items():
            found = told.get(key, value)
            if isinstance(value, Mapping):
                if (inner := self._other(found, value, f"{where}{key}.")) is not None:
                    return inner
            elif isinstance(found, bool) is not isinstance(value, bool) or not self._alike(found, value):
                return f"{where}{key} {found!r:.60}: expected {value!r:.60}"
        return None

    def _alike(self, found: Any, value: Any) -> bool:
        return found == value or (self.within > 0 and isinstance(found, int | float) and abs(found - value) <= self.within)


def loss_under(mdp: TabularMDP, expert: Any, reward: TabularReward) -> Loss:
    """What the best policy earns more than an expert under a reward, as certificates have it.

    Args:
        mdp: the whole table.
        expert: (S,) actions or (S, A) probabilities; NaN where nothing is known of it, and it may do anything.
        reward: of the table.

    Raises:
        InvalidPolicy: an expert of the wrong shape or content.
        InvalidReward: a reward of the wrong shape.
    """
    reward.expected(mdp)  # checks the shape
    policy, known = completed(expert, mdp.n_states)
    rows = np.flatnonzero(mdp.reachable)
    part, distribution = mdp.restrict(rows), as_distribution(policy, mdp.n_states, mdp.n_actions)[rows]
    seen = known[rows] | part.terminal
    R = reward.of_rows(rows)
    found = optimum(as_compared(part, compare(part, distribution, np.flatnonzero(seen)), R.on_states), R)
    return loss_on(part, found, distribution, ~seen)


def claims(
    config: Mapping[str, Any], stages: Mapping[str, Mapping[str, Any]], certificate: Mapping[str, Any],
    metrics: Mapping[str, Any], table: Tabulation | None,
) -> Iterator[Claim]:  # fmt: skip
    """What metrics.json has to say because of other files, but for values.

    Args:
        config: the run's.
        stages: the record of each stage.
        certificate: the content of certificate.json.
        metrics: the content of metrics.json.
        table: the run's; None where it has none.
    """
    given = config.get("dataset") is not None
    known = {"given": given, "episodes_only": given or bool(config.get("epsilon"))}
    learner = {"learner": config["learner"]["type"]} if (config.get("learner") or {}).get("type") else {}
    yield Claim("config.json", {"reward": learner, "demonstrations": known})
    yield Claim(".stages/reward.json", {"reward": learned_told(stages["reward"])})
    yield Claim(".stages/demonstrations.json", {"demonstrations": shown_told(stages["demonstrations"])})
    taken = {key: one for key, one in stages["agent"].items() if key == "environment_steps"}
    yield Claim(".stages/agent.json", {"training": taken})
    yield Claim("certificate.json", {"reward": reward_told(certificate)})
    if table is not None:
        told = table_told(table, metrics["table"].get("horizon") if given else None)
        yield Claim("table.npz", {"table": {key: one for key, one in told.items() if key not in EVIDENCE}})


def recomputed(
    path: Path, config: Mapping[str, Any], record: Mapping[str, Any], table: Tabulation, expert: Any, reward: TabularReward
) -> dict[str, Any] | None:
    """The record of a reward's loss as computed now; None where the demonstrations are gone.

    Of a learner that judges by episodes its record stands, and beside it, as `on_table`, what the table says.

    Args:
        path: the run's folder, where the demonstrations of an expert with noise are.
        config: the run's.
        record: `reward` of metrics.json.
        table: the run's.
        expert: (S,) actions or (S, A) probabilities; NaN where nothing is known of it.
        reward: the learned one, in the table.

    Raises:
        InvalidReward: the bounds that are recorded cannot be of this table, expert and reward.
        InvalidDiscount: nor can the discount.
        InvalidPolicy: an expert of the wrong shape or content.
    """
    if config.get("gamma") != table.mdp.gamma:
        raise InvalidDiscount(f"the table has gamma {table.mdp.gamma}: expected {config.get('gamma')}, as config.json has")
    try:
        known = seen_with_noise(path, table) if config.get("epsilon") else expert
    except (IrlGymError, OSError):
        return None
    now, low, high = loss_under(table.mdp, known, reward), record.get("loss_low"), record.get("loss_bound")
    if record.get("learner") not in JUDGED_BY_LOSS:
        return {"on_table": str(now)}
    rounding = ROUNDING * now.scale_high
    above, below = math.inf if high is None else high, -math.inf if low is None else low
    if now.low > above + rounding or now.high < below - rounding:
        raise InvalidReward(
            f"under the reward the best policy earns {now.low:.3g} to {now.high:.3g} more than the expert: "
            f"expected {below:.3g} to {above:.3g}, as recorded"
        )
    share = now.share if math.isfinite(now.share) else None
    return {"expert_optimal": now.optimal, "loss_low": now.low, "loss_bound": now.high, "loss_share": share}


def again(
    config: Mapping[str, Any], metrics: Mapping[str, Any], table: Tabulation, expert: Any, agent: Any, reward: TabularReward,
    curve: Curve,
) -> tuple[list[Claim], dict[str, Any]] | None:  # fmt: skip
    """The values of a run's policies as claims, and what of metrics.json is told as computed now; None at a horizon too long.

    Args:
        config: the run's.
        metrics: the content of metrics.json.
        table: the run's.
        expert: (S,) actions or (S, A) probabilities. Of one that is known by its episodes the value is theirs, as recorded.
        agent: the same of the retrained agent.
        reward: the learned one, in the table.
        curve: what the agent earned as it trained.

    Raises:
        InvalidPolicy: an expert or agent of the wrong shape or content.
    """
    mdp, told, horizon = table.mdp, metrics["policies"], metrics["table"].get("horizon")
    if horizon is not None and not 0 <= horizon <= MOST_STEPS:
        return None
    given, known = config.get("dataset") is not None, metrics.get("expert_value") or {}
    uniform = np.full((mdp.n_states, mdp.n_actions), 1 / mdp.n_actions)
    policies = {"expert": ("expert.npz", expert), "random": ("table.npz", uniform), "retrained": ("agent_policy.npz", agent)}
    values = {
        name: told[name]["value"] if given and name == "expert" else policy_value(mdp, table.reward, policy, horizon)
        for name, (_, policy) in policies.items()
    }
    within = WITHIN * max(map(abs, values.values()))
    claimed = [Claim(file, {"policies": {name: {"value": values[name]}}}, within) for name, (file, _) in policies.items()]
    low, high = known.get("low"), known.get("high")
    half = 0.0 if not given else math.inf if low is None or high is None else (high - low) / 2
    rounding = rounding_of(mdp.gamma, values["random"], values["expert"])
    scale = Scale(values["random"], values["expert"], rounding, half, known.get("episodes") if given else None, mdp.gamma)
    good = good_actions(mdp, None if given or config.get("epsilon") else expert, optimum(mdp, table.reward))
    now = {
        "policies": {
            name: {
                "value": values[name],
                "score": scale.score(values[name]),
                "agreement": None if given and name == "expert" else agreement(mdp, policy, good),
            }
            for name, (_, policy) in policies.items()
        },
        "score_reason": scale.reason,
        "expert_value": {} if given else {"episodes": None, "low": values["expert"], "high": values["expert"]},
        "reward": judged_reward(table, reward, scale, horizon),
        "training": settled(curve, scale),
        "table": {key: one for key, one in table_told(table, horizon).items() if key in EVIDENCE},
    }
    return claimed, now


def with_again(told: Mapping[str, Any], now: Mapping[str, Any]) -> dict[str, Any]:
    """Content of json with what was computed now in the place of what was recorded, entry by entry."""
    return {
        key: with_again(one, now[key]) if isinstance(one, Mapping) and isinstance(now.get(key), Mapping) else now.get(key, one)
        for key, one in told.items()
    }
