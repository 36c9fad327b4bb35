"""Canonical forms of a reward: one for each set of rewards that no policy can tell apart.

    AsGiven                  R
    FreshDraws               R + gamma W(s') - W(s), W the value of drawing s, a and s' afresh at each step (EPIC)
    ModelDraws               R less what one more step from s, and from s', pays in expectation (DARD)
    ValueAdjustedLevelling   the advantage of (s, a) under a policy (STARC's VAL)
    MinimalNorm              R + gamma Phi(s') - Phi(s) with the Phi that makes it smallest (STARC's minimal canonicalisation)
Each gives the values of the canonical reward on the transitions of a coverage distribution.

Terminal states. The value of a terminal state is 0, so a potential keeps the optimal policies only where it is 0 there (Ng,
Harada & Russell 1999); the potentials above are, and the forms are unchanged by all others that are. What a reward says of
steps out of a terminal state is read by ModelDraws only. Axes: S states, A actions, n transitions.
"""

from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from irl_gym._typing import Numbers, Sparse, Vector
from irl_gym.errors import InvalidParameter
from irl_gym.judging.distances.coverage import Coverage, coverage_of, probabilities
from irl_gym.judging.distances.payments import StepPayments
from irl_gym.mdp.planning.dynamic_programming import policy_evaluation
from irl_gym.mdp.tabular_mdp import TabularMDP

REFINEMENTS = 3


@runtime_checkable
class Canonical(Protocol):
    """A choice of one reward for each set of equivalent ones."""

    def values(self, mdp: TabularMDP, reward: StepPayments, coverage: Coverage) -> Numbers:
        """(n,) the canonical reward on the transitions of a coverage distribution."""
        ...

    def rounding(self, mdp: TabularMDP, reward: StepPayments, coverage: Coverage) -> float:
        """How far rounding can put a value off: a share of the largest reward that is read."""
        ...


@dataclass(frozen=True)
class AsGiven:
    """The reward as it is."""

    def values(self, mdp: TabularMDP, reward: StepPayments, coverage: Coverage) -> Numbers:
        """(n,) R(s, a, s')."""
        return reward.at(coverage.states, coverage.actions, coverage.next_states)

    def rounding(self, mdp: TabularMDP, reward: StepPayments, coverage: Coverage) -> float:
        """0: nothing is computed."""
        return 0.0


@dataclass(frozen=True, eq=False)
class FreshDraws:
    """EPIC's canonically shaped reward (Gleave et al. 2021, definition 4.1).

        C(R)(s, a, s') = R(s, a, s') + E[gamma R(s', A, S') - R(s, A, S') - gamma R(S, A, S')]
    with S, S' drawn from D_S and A from D_A, independently: every triple counts, possible or not. With m(s) = E[R(s, A, S')]
    and W(s) = m(s) + gamma E[W(S')] this is R + gamma W(s') - W(s).

    Departs: in a table with terminal states W is 0 there. The paper has no terminal states; in its formula a terminal s'
    would be paid m(s') once more, and shaping with a potential that is 0 at terminal states would change C(R).

    Raises:
        InvalidParameter: wrong shape, or not a distribution (when used); or nothing ends, where gamma is 1.
    """

    states: Vector | None = None
    """(S,) D_S; None for uniform."""
    actions: np.ndarray | None = None
    """(A,) D_A; None for uniform."""

    def values(self, mdp: TabularMDP, reward: StepPayments, coverage: Coverage) -> Numbers:
        """(n,) C(R)(s, a, s')."""
        D_S = probabilities("states", self.states, (mdp.n_states,))
        D_A = probabilities("actions", self.actions, (mdp.n_actions,))
        acting = ~mdp.terminal
        mean = np.where(acting, reward.mean_over(D_A, D_S), 0.0)
        if mdp.gamma == 1 and not D_S[mdp.terminal].any():
            raise InvalidParameter(
                "states gives no weight to any state that ends an episode, and gamma is 1: expected some, since E[W(S')] is "
                "infinite otherwise. Pass states=None for uniform over all."
            )
        future = D_S @ mean / (1 - mdp.gamma * D_S[acting].sum())  # E[W(S')]
        W = np.where(acting, mean + mdp.gamma * future, 0.0)
        return AsGiven().values(mdp, reward.shaped(W, mdp.gamma), coverage)

    def rounding(self, mdp: TabularMDP, reward: StepPayments, coverage: Coverage) -> float:
        """Every triple out of a state that acts is read."""
        return reward.precision * reward.largest(~mdp.terminal) * mdp.effective_horizon


@dataclass(frozen=True, eq=False)
class ModelDraws:
    """DARD's dynamics-aware transformed reward (Wulfe et al. 2022, definition 1).

        C(R)(s, a, s') = R(s, a, s') + E[gamma R(s', A, S'') - R(s, A, S') - gamma R(S', A, S'')]
    with A from D_A, S' from P(. | s, A) and S'' from P(. | s', A): only R(S', A, S'') may be an impossible transition.

    Departs: a terminal state is followed by itself, and R is read there as it is given. So a constant that is added everywhere
    is not seen, though where episodes end it changes which policies are best. Shaping leaves C(R) as it is where
    R(s, a, s') + gamma Phi(s') - Phi(s) is added for the triples out of terminal states too.

    Raises:
        InvalidParameter: wrong shape, or not a distribution (when used).
    """

    actions: np.ndarray | None = None
    """(A,) D_A; None for uniform."""

    def values(self, mdp: TabularMDP, reward: StepPayments, coverage: Coverage) -> Numbers:
        """(n,) C(R)(s, a, s')."""
        D_A = probabilities("actions", self.actions, (mdp.n_actions,))
        s, a, following = coverage.states, coverage.actions, coverage.next_states
        one_step = np.zeros(mdp.n_states)  # E[R(s, A, S')]
        beyond_s = np.zeros(mdp.n_states)  # the parts of E[R(S', A, S'')] that depend on s alone, on s' alone, on both
        beyond_next = np.zeros(mdp.n_states)
        both = None if reward.full is None else np.zeros((mdp.n_states, mdp.n_states))
        for action in np.flatnonzero(D_A):
            p, P = D_A[action], _absorbing(mdp, int(action))
            beyond_next += p * (P @ reward.arrival)
            beyond_s += p * (P @ reward.step[:, action])
            one_step += p * (reward.step[:, action] + P @ reward.arrival)
            if reward.full is not None and both is not None:
                paid = reward.full[:, action]
                one_step += p * (P.multiply(paid)).sum(axis=1)
                both += p * (P @ (P @ paid.T).T)
        more = beyond_s[s] + beyond_next[following] + (0 if both is None else both[s, following])
        return reward.at(s, a, following) + mdp.gamma * one_step[following] - one_step[s] - mdp.gamma * more

    def rounding(self, mdp: TabularMDP, reward: StepPayments, coverage: Coverage) -> float:
        """Triples out of terminal states are read too."""
        return reward.precision * reward.largest(np.ones(mdp.n_states, dtype=bool))


@dataclass(frozen=True, eq=False)
class ValueAdjustedLevelling:
    """STARC's VAL (Skalse et al. 2024, section 3).

        C(R)(s, a, s') = E_{S'}[R(s, a, S') + gamma V(S')] - V(s)
    with S' from P(. | s, a) and V the value of a policy under R: the policy's advantage, which is the same for every s'.
    """

    policy: Any = None
    """(S,) actions, (S, A) probabilities or set; None for uniformly random actions."""
    levelled: bool = True
    """Without levelling, C(R)(s, a, s') = R(s, a, s') + gamma V(s') - V(s): S'-redistribution changes it."""

    def values(self, mdp: TabularMDP, reward: StepPayments, coverage: Coverage) -> Numbers:
        """(n,) C(R)(s, a, s')."""
        R = reward.expected(mdp)
        uniform = np.full(R.shape, 1 / mdp.n_actions)
        V = policy_evaluation(mdp, R, uniform if self.policy is None else self.policy)
        return _shaped_values(mdp, reward, R, V, coverage, self.levelled)

    def rounding(self, mdp: TabularMDP, reward: StepPayments, coverage: Coverage) -> float:
        """Possible transitions are read; without levelling covered ones too."""
        return _rounding(mdp, reward, coverage, self.levelled)


@dataclass(frozen=True)
class MinimalNorm:
    """STARC's minimal canonicalisation for the L2 norm (Skalse et al. 2024, section 3): the smallest equivalent reward.

        C(R) = R + gamma Phi(s') - Phi(s), Phi = argmin of the mean square over pairs (s, a), s' from P(. | s, a)
    after R was replaced by its mean over s' where it is levelled. An orthogonal projection, so it needs no policy.
    """

    levelled: bool = True
    """Without levelling, the mean square is that of R(s, a, s'), and S'-redistribution changes it."""

    def values(self, mdp: TabularMDP, reward: StepPayments, coverage: Coverage) -> Numbers:
        """(n,) C(R)(s, a, s')."""
        R = reward.expected(mdp)
        every = coverage_of(mdp, None)
        arrivals = np.flatnonzero(np.repeat(~mdp.terminal, mdp.n_actions)) if self.levelled else None
        if arrivals is not None:
            leaving = sp.csr_array(sp.kron(sp.eye_array(mdp.n_states), np.ones((mdp.n_actions, 1))))
            system, right, weights = (mdp.gamma * mdp.P - leaving)[arrivals], R.ravel()[arrivals], np.ones(arrivals.size)
        else:
            n = every.states.size
            shape, entry, one = (n, mdp.n_states), np.arange(n), np.ones(n)
            system = mdp.gamma * sp.csr_array((one, (entry, every.next_states)), shape=shape)
            system = system - sp.csr_array((one, (entry, every.states)), shape=shape)
            right, weights = reward.at(every.states, every.actions, every.next_states), every.weights
        Phi = np.zeros(mdp.n_states)
        Phi[~mdp.terminal] = _least_squares(sp.csr_array(system)[:, np.flatnonzero(~mdp.terminal)], right, weights)
        return _shaped_values(mdp, reward, R, Phi, coverage, self.levelled)

    def rounding(self, mdp: TabularMDP, reward: StepPayments, coverage: Coverage) -> float:
        """Possible transitions are read; without levelling covered ones too."""
        return _rounding(mdp, reward, coverage, self.levelled)


def _rounding(mdp: TabularMDP, reward: StepPayments, coverage: Coverage, levelled: bool) -> float:
    """What rounding leaves of values of a policy, and of what is computed from them."""
    read = [coverage_of(mdp, None)] if levelled else [coverage_of(mdp, None), coverage]
    largest = max(float(np.abs(AsGiven().values(mdp, reward, which)).max()) for which in read)
    return reward.precision * largest * mdp.effective_horizon


def _shaped_values(
    mdp: TabularMDP, reward: StepPayments, R: np.ndarray, potential: Vector, coverage: Coverage, levelled: bool
) -> Numbers:
    """The values of R + gamma Phi(s') - Phi(s), or of their mean over s'."""
    if not levelled:
        return AsGiven().values(mdp, reward.shaped(potential, mdp.gamma), coverage)
    mean = R + mdp.gamma * (mdp.P @ potential).reshape(R.shape) - potential[:, None]
    return mean[coverage.states, coverage.actions]


def _least_squares(system: Sparse, right: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """The x that minimises sum_i w_i (right_i + (system x)_i)^2, by the normal equations, refined."""
    weighted = sp.csr_array(system.T.multiply(weights[None, :]))
    factor = splu(sp.csc_matrix(weighted @ system))
    x = np.zeros(system.shape[1])
    for _ in range(REFINEMENTS):
        x -= factor.solve(weighted @ (right + system @ x))
    return x


def _absorbing(mdp: TabularMDP, action: int) -> Sparse:
    """(S, S) transitions under an action, with terminal states followed by themselves."""
    return sp.csr_array(mdp.P_a(action) + sp.diags_array(mdp.terminal.astype(np.float64)))
