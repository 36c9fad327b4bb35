"""What a run claims of its reward, computed again from its table, its expert and its reward as they lie in the folder.

A certificate is a file like the others: one of them may have been swapped. Both the loss that it records and the one computed
here are bounds of the same number, so that those of a run whose files are its own have numbers in common.
Axes: S states, A actions.
"""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from irl_gym.comparisons import as_compared, compare
from irl_gym.diagnoses.unfinished import seen_with_noise
from irl_gym.dynamic_programming import optimum
from irl_gym.errors import InvalidDiscount, InvalidReward, IrlGymError
from irl_gym.learners.feature_rows import completed
from irl_gym.mdp import TabularMDP
from irl_gym.optimality import Loss, loss_on
from irl_gym.policies import as_distribution
from irl_gym.rewards import TabularReward
from irl_gym.run_folder import SURPRISES
from irl_gym.tabulation import Tabulation

JUDGED_BY_LOSS = ("FiniteLP", "FeatureLP")
"""Learners whose certificate on a table says what the best policy earns more than the expert."""
ROUNDING = 1e-9
"""Share of what is at stake by which two computations of one loss may differ: features are not alike on all machines."""


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


def recomputed(
    path: Path, config: Mapping[str, Any], record: Mapping[str, Any], table: Tabulation, expert: Any, reward: TabularReward
) -> dict[str, Any] | None:
    """The record of a reward's loss as computed now; None where its learner records none, or the demonstrations are gone.

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
    if record.get("learner") not in JUDGED_BY_LOSS:
        return None
    try:
        known = seen_with_noise(path, table) if config.get("epsilon") else expert
    except (IrlGymError, OSError, *SURPRISES):
        return None
    now, low, high = loss_under(table.mdp, known, reward), record.get("loss_low"), record.get("loss_bound")
    rounding = ROUNDING * now.scale_high
    above, below = math.inf if high is None else high, -math.inf if low is None else low
    if now.low > above + rounding or now.high < below - rounding:
        raise InvalidReward(
            f"under the reward the best policy earns {now.low:.3g} to {now.high:.3g} more than the expert: "
            f"expected {below:.3g} to {above:.3g}, as recorded"
        )
    share = now.share if math.isfinite(now.share) else None
    return {"expert_optimal": now.optimal, "loss_low": now.low, "loss_bound": now.high, "loss_share": share}
