"""What an episode returns in expectation, undiscounted and cut where the environment cuts it: what mean returns estimate."""

from collections.abc import Mapping
from typing import Any

from irl_gym.facts import counted
from irl_gym.mdp.planning.finite_horizon import value_within
from irl_gym.tables.tabulation import Tabulation


def expected_return(table: Tabulation, policy: Any, limit: int) -> float | None:
    """The expected return of an episode from the start, under the true reward; None of a policy known by its episodes alone.

    Args:
        table: an exact one.
        policy: (S,) actions, (S, A) probabilities or set; None where it is not at hand.
        limit: steps after which an episode is cut.
    """
    return None if policy is None else value_within(table.mdp, table.reward, policy, horizon=limit)


def expected_told(metrics: Mapping[str, Any]) -> str:
    """What the expected return counts, in words that follow a colon."""
    limit = (metrics["table"] or {}).get("limit") or 0
    return f"exact, undiscounted, within the {counted(limit, 'step')} after which episodes are cut; mean return estimates it"
