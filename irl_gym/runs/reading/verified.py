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

from irl_gym.errors import InvalidDiscount, InvalidReward, IrlGymError
from irl_gym.facts import in_lines
from irl_gym.judging.curves import Curve
from irl_gym.judging.evaluation import Candidate, good_actions, judge, scale_of
from irl_gym.judging.metrics import policy_value
from irl_gym.judging.scores import CLONE, EXPERT, LEARNED, RANDOM, RETRAINED
from irl_gym.judging.shares import returns_of, share_of_return
from irl_gym.mdp.planning.dynamic_programming import optimum
from irl_gym.mdp.rewards import TabularReward
from irl_gym.runs.certificates import certified, optimality_told
from irl_gym.runs.reading.unfinished import seen_with_noise
from irl_gym.runs.scorecard import (
    NOT_RECORDED,
    came_about,
    cloned_told,
    judge_reward,
    known_by,
    learned_told,
    reward_told,
    scale_told,
    settled,
    shown_told,
    table_told,
    training_told,
)
from irl_gym.tables.tabulation import Tabulation

ROUNDING = 1e-9
"""Share of what is at stake by which two computations of one loss may differ: features are not alike on all machines."""
WITHIN = 1e-6
"""Share of the largest value by which two computations of one value may differ."""
MOST_STEPS = 100_000
"""Of a horizon or a limit that values are computed again for."""
FILES = {RETRAINED: "agent_policy.npz", LEARNED: "learned_policy.npz", CLONE: "clone_policy.npz"}
"""Where the policies of a table are that are judged by expert and random actions."""
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
        found = self._other(metrics, in_lines(self.expected), "")
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
    known = known_by(config)
    learner = {"learner": config["learner"]["type"]} if (config.get("learner") or {}).get("type") else {}
    yield Claim("config.json", {"reward": learner, "demonstrations": known})
    shown = ".stages/demonstrations.json" if known["given"] else ".stages/expert.json"
    made = {EXPERT: shown, RANDOM: "config.json", LEARNED: ".stages/reward.json", RETRAINED: ".stages/agent.json"}
    made |= {CLONE: ".stages/clone.json"}
    for name, how in came_about(config, stages).items():
        file = made[name]
        yield Claim(file, {"policies": {name: {"how": how}}})
    yield Claim(".stages/reward.json", {"reward": learned_told(stages["reward"])})
    yield Claim(".stages/demonstrations.json", {"demonstrations": shown_told(stages["demonstrations"])})
    yield Claim(".stages/clone.json", {"demonstrations": cloned_told(stages.get("clone", {}))})
    yield Claim(".stages/agent.json", {"training": training_told(stages["agent"])})
    yield Claim("certificate.json", {"reward": reward_told(certificate)})
    if table is not None:
        recorded = metrics["table"]
        told = table_told(table, recorded.get("horizon") if known["given"] else None, recorded.get("limit"))
        yield Claim("table.npz", {"table": {key: one for key, one in told.items() if key not in EVIDENCE}})


def recomputed(
    path: Path, config: Mapping[str, Any], certificate: Mapping[str, Any], table: Tabulation, expert: Any, reward: TabularReward
) -> dict[str, Any] | None:
    """What a run's reward says of its expert as computed now, as json holds it; None where the demonstrations are gone.

    Args:
        path: the run's folder, where the demonstrations of an expert with noise are.
        config: the run's.
        certificate: the content of certificate.json.
        table: the run's.
        expert: (S,) actions or (S, A) probabilities; NaN where nothing is known of it.
        reward: the learned one, in the table.

    Raises:
        InvalidReward: the bounds that are recorded cannot be of this table, expert and reward.
        InvalidPolicy: an expert of the wrong shape or content.
    """
    try:
        known = seen_with_noise(path, table) if config.get("epsilon") else expert
    except (IrlGymError, OSError):
        return None
    episodes = config.get("dataset") is not None or bool(config.get("epsilon"))
    now, recorded = certified(table, known, reward, episodes=episodes), certificate["optimality"] or {}
    low, high = recorded.get("loss_low"), recorded.get("loss_bound")
    rounding = ROUNDING * now.at_stake
    above, below = math.inf if high is None else high, -math.inf if low is None else low
    if now.loss_low > above + rounding or now.loss_bound < below - rounding:
        raise InvalidReward(
            f"under the reward the best policy earns {now.loss_low:.3g} to {now.loss_bound:.3g} more than the expert: "
            f"expected {below:.3g} to {above:.3g}, as recorded"
        )
    return optimality_told(now, table, inferred=recorded.get("inferred", False))


def again(
    config: Mapping[str, Any], metrics: Mapping[str, Any], table: Tabulation, expert: Any, agents: Mapping[str, Any],
    reward: TabularReward | None, curve: Curve,
) -> tuple[list[Claim], dict[str, Any]] | None:  # fmt: skip
    """The values of a run's policies as claims, and what is told as computed now; None where steps are too many.

    Args:
        config: the run's.
        metrics: the content of metrics.json.
        table: the run's.
        expert: (S,) actions or (S, A) probabilities. Of one that is known by its episodes the value is theirs, as recorded.
        agents: the same of the retrained agent, the learner's policy and the clone, by their names, where there is one.
        reward: the learned one, in the table; None of a learner of policies.
        curve: what the agent earned as it trained.

    Raises:
        InvalidDiscount: the table's is not the one that is configured.
        InvalidPolicy: an expert or agent of the wrong shape or content.
    """
    if config.get("gamma") != table.mdp.gamma:
        raise InvalidDiscount(f"the table has gamma {table.mdp.gamma}: expected {config.get('gamma')}, as config.json has")
    mdp, told, horizon, limit = table.mdp, metrics["policies"], *(metrics["table"].get(name) for name in ("horizon", "limit"))
    if any(steps is not None and not 1 <= steps <= MOST_STEPS for steps in (horizon, limit)):
        return None
    given, known = known_by(config), metrics.get("expert_value") or {}
    uniform = np.full((mdp.n_states, mdp.n_actions), 1 / mdp.n_actions)
    policies = {EXPERT: ("expert.npz", expert), RANDOM: ("table.npz", uniform)}
    policies |= {name: (FILES[name], policy) for name, policy in agents.items()}
    read = {
        name: _read(told[name], None if given["given"] and name == EXPERT else policy, table, horizon)
        for name, (_, policy) in policies.items()
    }
    within = WITHIN * max(abs(one.value) for one in read.values())
    claimed = [Claim(file, {"policies": {name: {"value": read[name].value}}}, within) for name, (file, _) in policies.items()]
    low, high = known.get("low"), known.get("high")
    half = 0.0 if not given["given"] else math.inf if low is None or high is None else (high - low) / 2
    scale = scale_of(read, mdp.gamma, table, half, known.get("episodes") if given["given"] else None)
    good = good_actions(mdp, None if given["episodes_only"] else expert, optimum(mdp, table.reward))
    now = {
        "policies": judge(read, scale, table, horizon, good, limit, sampled=False),
        "score_reason": scale.reason,
        "expert_value": {} if given["given"] else scale_told(scale)["expert_value"],
        "reward": {} if reward is None else judge_reward(reward, table, scale, horizon),
        "training": settled(curve, scale),
        "table": {key: one for key, one in table_told(table, horizon, limit).items() if key in EVIDENCE},
    }
    return claimed, now


def _read(row: Mapping[str, Any], policy: Any, table: Tabulation, horizon: int | None) -> Candidate:
    """A policy with its value computed now, and returns as its row of metrics.json has them; so too the value where None."""
    value = row["value"] if policy is None else policy_value(table.mdp, table.reward, policy, horizon)
    return Candidate(policy, row.get("how", NOT_RECORDED), value, returns_of(row))


def shares(policies: Mapping[str, Mapping[str, Any]]) -> dict[str, dict[str, float | None]]:
    """What the mean returns of a run's rows make of the share of return in each, as recorded as they are."""
    means = {name: returns_of(row) for name, row in policies.items()}
    return {name: {"return_share": share_of_return(one, means[EXPERT], means[RANDOM])} for name, one in means.items()}


def with_again(told: Mapping[str, Any], now: Mapping[str, Any]) -> dict[str, Any]:
    """Content of json with what was computed now in the place of what was recorded, entry by entry."""
    return {
        key: with_again(one, now[key]) if isinstance(one, Mapping) and isinstance(now.get(key), Mapping) else now.get(key, one)
        for key, one in told.items()
    }
