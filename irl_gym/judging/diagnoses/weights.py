"""Weights of a linear reward that say nothing of the features: all the same."""

import numpy as np

from irl_gym.judging.diagnoses.case import Case
from irl_gym.judging.diagnoses.findings import Finding
from irl_gym.judging.diagnoses.nothing import constant_reward

SAME = 1e-9
"""Weights or rewards that differ by less, relative to the largest, are the same."""
BOUND = 1.0
"""|alpha_i| at most, in the programs of Ng & Russell (2000), sections 4 and 5."""


def flat_weights(case: Case) -> Finding | None:
    """Equal weights tell no feature from another: all at one bound, or with the same reward in every reachable state."""
    alpha = np.zeros(0) if case.weights is None else case.weights
    largest = float(np.abs(alpha).max(initial=0.0))
    if alpha.size < 2 or largest == 0 or float(np.ptp(alpha)) > SAME * largest or constant_reward(case):
        return None
    constant, bound = _constant(case), abs(largest - BOUND) <= SAME
    if not (constant or bound):
        return None
    longer = "longer" if alpha[0] > 0 else "shorter"
    told = f"All {alpha.size:,} weights are {alpha[0]:.4g}{', the same bound' if bound else ''}"
    if constant and case.reward is not None:
        paid = float(case.reward.values[case.states][0])
        what = (
            f"the reward is {paid:.4g} in every reachable state, so it prefers {'longer' if paid > 0 else 'shorter'} episodes"
        )
        sentence = f"{told}, and {what}, and nothing else."
    else:
        sentence = (
            f"{told}: the reward is {alpha[0]:.4g} times the sum of the features and tells none from another. Where that sum "
            f"is the same everywhere, it prefers {longer} episodes, and nothing else."
        )
    return Finding(
        "flat-weights",
        sentence,
        "A price l1 above 0, raised slowly, takes the weight off features that are worth less than the price; other features "
        "where all are worth the same; nothing where the length of episodes is all that is meant.",
        flags=("--l1",),
    )


def _constant(case: Case) -> bool:
    """Is R known to be the same, and not 0, in every reachable state?"""
    if case.reward is None or not case.on_states or not case.states.size or case.scale == 0:
        return False
    return float(np.ptp(case.reward.values[case.states])) <= SAME * case.scale
