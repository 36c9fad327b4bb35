"""What demonstrations show of an expert on numbered states, whether their actions were recorded or only the states.

Axes: S states, A actions.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from irl_gym._typing import Matrix, Vector
from irl_gym.demonstrations.demonstrated import most_frequent, visits
from irl_gym.demonstrations.inferred import Inferred, infer
from irl_gym.errors import InvalidDemonstrations
from irl_gym.mdp.episodes import Episode, empirical_policy
from irl_gym.mdp.tabular_mdp import TransitionTable
from irl_gym.records import Record
from irl_gym.spaces.states import States


@dataclass(frozen=True, eq=False)
class ShownPolicy(Record):
    """What demonstrations show of an expert."""

    weights: Matrix
    """(S, A) how often each action was taken, as recorded or as inferred."""
    policy: Matrix
    """(S, A) what it does most; NaN where that is not known."""
    visits: Vector
    """(S,) steps from each state."""
    inferred: Inferred | None = None
    """How its actions were inferred; None where they were recorded."""

    @property
    def shares(self) -> Matrix:
        """(S, A) the share of each action; equal ones where nothing is known."""
        total = self.weights.sum(axis=1, keepdims=True)
        return np.divide(self.weights, total, out=np.full(self.weights.shape, 1 / self.weights.shape[1]), where=total > 0)


def shown(episodes: Sequence[Episode], states: States, n_actions: int, table: TransitionTable | None) -> ShownPolicy:
    """Count the actions of episodes; of episodes that have none infer them from a table.

    Args:
        episodes: at least one, all with actions or none.
        states: their numbering.
        n_actions: A.
        table: P; None where it is not known.

    Raises:
        InvalidDemonstrations: no episode; actions out of range; or missing, in some episodes, or where there is no table.
        UnknownObservation: an observation that the index does not hold, naming the episode.
    """
    every = list(episodes)
    lacking = [number for number, one in enumerate(every) if isinstance(one, Episode) and one.actions is None]
    if lacking and table is not None:
        if len(lacking) < len(every):
            raise InvalidDemonstrations(
                f"episode {lacking[0]} has only states, and {len(every) - len(lacking)} of the {len(every)} episodes have "
                "actions: expected actions in all or in none. Leave the others out, or take the states of all, with "
                "`irl_gym.demonstrations.inferred.without_actions(episodes)`."
            )
        found = infer(every, states, table)
        return ShownPolicy(found.weights, found.policy, found.visits, found)
    seen = empirical_policy(every, states, n_actions)
    return ShownPolicy(seen.counts.astype(np.float64), most_frequent(seen), visits(seen))
