"""FiniteLP for sums of H steps, undiscounted (lecture notes, section 1.1; Ng & Russell 2000, section 3.2).

The program is that of the table with the time in its states (`irl_gym.mdp.time_expanded`), in which every episode ends and
gamma is 1: (4) has rows for each state at each time at which it can be reached, and V = (I - P_pi)^-1 R (5) is a finite sum.
    R_h(s)    each row has a reward of its own
    R(s)      the rows of a state have one and the same: R_h(s) = R(s), h = 1 .. H, so that ||R||_1 counts each number once
A reward of either kind is paid on arrival (said there). Axes: S states, A actions, H steps.
"""

from dataclasses import replace
from typing import Any

import numpy as np

from irl_gym.errors import InvalidParameter
from irl_gym.learners.base import Outcome
from irl_gym.learners.linear_programs.programs import RewardOn
from irl_gym.learners.linear_programs.proofs.finite_proof import FiniteProof
from irl_gym.mdp.optimality import certify
from irl_gym.mdp.policies import policy_array
from irl_gym.mdp.rewards import TabularReward
from irl_gym.mdp.tabular_mdp import TransitionTable
from irl_gym.mdp.time_expanded import (
    Repeated,
    checked_table,
    expanded_policy,
    expanded_reward,
    one_for_all_times,
    time_expanded,
)


class Within:
    """The problem of H steps, on the table with the time in its states.

    Args:
        table: of S states and A actions.
        expert: the same at all times, or one that depends on the time; rows of NaN where nothing is known of it.
        visits: (S,) how often it was seen in each state, or None.
        horizon: H.

    Raises:
        InvalidMDP, InvalidPolicy: no table, or a policy of another.
    """

    def __init__(self, table: TransitionTable, expert: Any, visits: Any, horizon: int):
        self.table, self.horizon = checked_table(table), horizon
        self.mdp = time_expanded(table, horizon)
        array = policy_array(expert)
        unknown = np.asarray(np.isnan(array).all(axis=-1) if array.dtype.kind == "f" else np.zeros(array.shape[:1], dtype=bool))
        known = np.where(unknown[..., None], 1 / array.shape[-1], array) if unknown.any() else array
        self.expert = expanded_policy(known, table, horizon)
        if unknown.any():
            times = unknown if unknown.ndim == 2 else np.tile(unknown, (horizon, 1))
            self.expert[: times.size][times.ravel()] = np.nan
        self.visits = None if visits is None else np.tile(np.asarray(visits), horizon + 1)

    def tie(self, reward_on: RewardOn) -> Repeated:
        """One reward for all times."""
        return one_for_all_times(self.mdp, self.table.n_states, on_states=reward_on == "state")

    def told(self, outcome: Outcome[TabularReward, FiniteProof]) -> Outcome[TabularReward, FiniteProof]:
        """An outcome whose proof says whether the expert is optimal at each time."""
        found = certify(self.mdp, self.expert, expanded_reward(outcome.reward, self.table, self.horizon))
        proof = replace(outcome.proof, horizon=self.horizon, optimal_within=found.expert_optimal, loss_within=found.loss_bound)
        return replace(outcome, proof=proof)


def not_known() -> InvalidParameter:
    """The error where a reward that is the same at all times is asked of an expert that is not known, or errs."""
    return InvalidParameter(
        "stationary is True, and the expert is not known in some state that can be reached, or may err (slack): expected its "
        "whole policy, without slack. Use stationary=False; or leave out the horizon."
    )
