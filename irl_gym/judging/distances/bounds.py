"""What EPIC promises of policies: its distance bounds regret (Gleave et al. 2021, theorem 4.9).

    G_A(pi_A) - G_A(pi_B) <= 16 K ||R_A||_2 D_EPIC(R_A, R_B) / (1 - gamma)
for pi_A and pi_B optimal under R_A and R_B, if K D(s, a, s') is at least the probability of (s, a, s') at every time step under
both. The proof passes through 4 K ||C(R_A) - mean||_2 D_EPIC / (1 - gamma), the *sharper* bound: half the norm is the distance,
two policies are compared, and the canonical reward is at most 4 times the reward in norm. The last step holds for a coverage in
which S, A and S' are independent with the distributions of the canonical form, so D is uniform over all S * A * S triples here.
Adding a constant to a reward must change no policy, so no state may be terminal. Axes: S states, A actions.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from irl_gym.errors import InvalidMDP
from irl_gym.judging.distances.canonical import FreshDraws
from irl_gym.judging.distances.comparing import norm
from irl_gym.judging.distances.coverage import coverage_of
from irl_gym.judging.distances.exact import EPIC
from irl_gym.judging.distances.payments import payments
from irl_gym.judging.metrics import policy_value
from irl_gym.mdp.planning.dynamic_programming import policy_iteration
from irl_gym.mdp.tabular_mdp import TabularMDP, checked_mdp

FORGOTTEN = 1e-9
"""Time steps that are discounted by more than this are not looked at."""


@dataclass(frozen=True)
class RegretBound:
    """The regret of planning with one reward when the other is true, and what EPIC promises of it."""

    regret: float
    """G_A(pi_A) - G_A(pi_B), from d0."""
    bound: float
    """Theorem 4.9."""
    sharper: float
    """The bound before its last step."""
    distance: float
    """EPIC distance, over all triples."""
    K: float
    """How much more often than D some transition is made at some time."""


def epic_bound(mdp: TabularMDP, true: Any, learned: Any) -> RegretBound:
    """Regret under `true` of a policy that is optimal under `learned`, and EPIC's bounds on it. Dense: S * A * S numbers.

    Raises:
        InvalidMDP: no table, or a terminal state.
        InvalidReward: wrong shape or not finite.
        UndefinedDistance: a canonical reward that is constant.
    """
    if checked_mdp(mdp).terminal.any():
        raise InvalidMDP(
            f"state {np.flatnonzero(mdp.terminal)[0]} is terminal: EPIC's bound holds where none is. Let it follow itself."
        )
    S, A = mdp.n_states, mdp.n_actions
    uniform = np.full((S, A, S), 1 / (S * A * S))
    coverage = coverage_of(mdp, uniform)
    given = payments(mdp, true, "the true reward")
    paid = given.at(coverage.states, coverage.actions, coverage.next_states)
    canonical = FreshDraws().values(mdp, given, coverage)
    expected = [given.expected(mdp), payments(mdp, learned, "the learned reward").expected(mdp)]
    policies = [policy_iteration(mdp, R).policy for R in expected]
    gains = [policy_value(mdp, expected[0], policy) for policy in policies]
    K = max(_most_likely(mdp, policy) for policy in policies) * S * A * S
    distance = EPIC(uniform).distance(mdp, true, learned)
    scale = K * distance * mdp.effective_horizon
    deviation = norm(canonical - coverage.weights @ canonical, coverage.weights, 2)
    return RegretBound(gains[0] - gains[1], 16 * norm(paid, coverage.weights, 2) * scale, 4 * deviation * scale, distance, K)


def _most_likely(mdp: TabularMDP, policy: np.ndarray) -> float:
    """The largest probability of any (s, a, s') at any time under a policy."""
    P = mdp.P_pi(policy)
    largest = P.max(axis=1).toarray().ravel()
    at, most = mdp.d0, 0.0
    for _ in range(int(np.ceil(np.log(FORGOTTEN) / np.log(mdp.gamma)))):
        most = max(most, float((at * largest).max()))
        at = at @ P
    return most
