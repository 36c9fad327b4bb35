"""Howard's policy iteration to the last bit, and rigorous bounds of what is left (Howard 1960; Puterman 1994, section 6.4).

Float64 improves first, as long as an advantage is above the rounding of its own terms; then values in extended precision
(`precise`) improve what is left. With the advantages A over the last values W and their rounding r,
    W - V_pi = -(I - gamma P_pi)^-1 A_pi        for every policy (the performance difference lemma, Kakade & Langford 2002)
so V* - W and W - V_pi are sums of what single steps gain or lose (`envelopes`): nothing is lost by subtracting values.
Tolerances are local to a state: a huge reward in a state that nobody visits widens nothing elsewhere.
Axes: S states, A actions.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from irl_gym._typing import Actions, ActionSets, Matrix, Sparse, StateMask, Vector
from irl_gym.errors import InvalidParameter, InvalidReward
from irl_gym.mdp.planning.discounted import EPSILON, Discounted
from irl_gym.mdp.planning.envelopes import least, most
from irl_gym.mdp.planning.precise import EPSILON_LONG, LONG, Advantages, PreciseTable, Split
from irl_gym.mdp.rewards import TabularReward
from irl_gym.mdp.tabular_mdp import TabularMDP

TIED = 4 * EPSILON
"""What rounding makes of a sum, as a share of its terms: 1/3 + 1/3 + 1/3 need not be 1 in a table of float64."""
CAREFUL = 1e-10
"""Share of the terms, by the steps that pay for it, up to which a policy takes an action for tied."""
WORTHWHILE = 1e-15
"""Share of the same terms below which nothing is improved."""
LAST_IMPROVEMENTS = 30
LARGEST = float(np.finfo(np.float64).max) / 64
"""Values up to this add up without overflow."""
OUTWARDS = 1e-9
"""Relative width given to bounds for the last operations, on top."""


@dataclass(frozen=True, eq=False)
class Optimum:
    """The best values that were found, what each action gains over them, and bounds of the best there are."""

    table: PreciseTable
    """P, gamma and the reward."""
    W: Split
    """Values of `policy`, the last one evaluated."""
    advantages: Advantages
    """(S, A) over W."""
    policy: Actions
    """(S,) at most `above` from optimal."""
    blocked: np.ndarray
    """(S, A) actions that are not allowed."""
    iterations: int
    """Improvement steps made."""

    @cached_property
    def V(self) -> Vector:
        """(S,) W in float64."""
        return self.W.values

    @cached_property
    def Q(self) -> Matrix:
        """(S, A) W plus the advantages; -infinity where an action is not allowed."""
        return np.where(self.blocked, -np.inf, self.V[:, None] + self.advantages.values.astype(np.float64))

    @cached_property
    def above(self) -> Vector:
        """(S,) e with V* <= W + e."""
        mdp, gains = self.table.mdp, np.where(self.blocked, -np.inf, self.advantages.high)
        return most(mdp.P, mdp.gamma, gains, self.table.horizon, self.policy)

    def behind(self, distribution: Matrix) -> tuple[Vector, Vector]:
        """(S,) W - V_pi for a policy (S, A), taken in proportion, and (S,) how far that can be off."""
        mdp, found = self.table.mdp, self.advantages
        weights = distribution / distribution.sum(axis=1, keepdims=True)
        lost = -(weights * found.values).sum(axis=1)
        unsure = (weights * (found.rounding + (mdp.n_actions + 8) * EPSILON * np.abs(found.values))).sum(axis=1)
        P_pi, sums = mdp.P_pi(weights), 2 * mdp.n_actions * int((weights > 0).sum() > weights.shape[0])
        discounted = Discounted(P_pi, mdp.gamma, sums=sums)
        behind = discounted.solve(lost.astype(np.float64))
        long = behind.astype(LONG)
        off = np.abs(lost + LONG(mdp.gamma) * (P_pi.astype(LONG) @ long) - long).astype(np.float64)
        onwards = mdp.gamma * (P_pi @ np.abs(behind))
        rounding = self.table.terms * EPSILON_LONG * (onwards + np.abs(behind)) + sums * EPSILON * onwards
        return behind, discounted.above((off + rounding + unsure.astype(np.float64)) * (1 + OUTWARDS))

    def shortfall(self, distribution: Matrix, free: StateMask) -> tuple[Vector, Vector]:
        """(S,) and (S,): W - V_pi lies between them for each policy that does what is told, but anything where it is free.

        Args:
            distribution: (S, A) what is told, taken in proportion.
            free: (S,) where nothing is.
        """
        if not free.any():
            behind, unsure = self.behind(distribution)
            return behind - unsure, behind + unsure
        mdp, found = self.table.mdp, self.advantages
        weights = distribution / distribution.sum(axis=1, keepdims=True)

        def mixed(each: np.ndarray) -> np.ndarray:
            return np.where(free[:, None], each, (weights * each).sum(axis=1, keepdims=True)).astype(np.float64)

        lost = mixed(-found.values)
        unsure = mixed(found.rounding) * (1 + OUTWARDS) + (mdp.n_actions + 8) * EPSILON * mixed(np.abs(found.values))
        P = as_told(mdp, weights, free)
        low = least(P, mdp.gamma, lost - unsure, sums=2 * mdp.n_actions)
        return low, most(P, mdp.gamma, lost + unsure, self.table.horizon, sums=2 * mdp.n_actions)

    @cached_property
    def error(self) -> Vector:
        """(S,) |W - V*| is at most this."""
        behind, unsure = self.behind(self.best)
        return np.maximum(self.above, np.maximum(behind + unsure, 0.0))

    @cached_property
    def gaps(self) -> tuple[Matrix, Matrix]:
        """(S, A) what an action is worth less than the best, V*(s) - Q*(s, a), and (S, A) how far that can be off."""
        return self.less_than(np.zeros(self.policy.size), self.error)

    def less_than(self, behind: Vector, unsure: Vector) -> tuple[Matrix, Matrix]:
        """(S, A) V(s) - Q(s, a), where V is `behind` W (S,), and (S, A) how far that can be off, if V is by `unsure` (S,)."""
        mdp, shape = self.table.mdp, self.blocked.shape
        onwards = mdp.gamma * (mdp.P @ np.stack([behind, unsure, np.abs(behind)], axis=1)).T.reshape(3, *shape)
        gap = (onwards[0] - behind[:, None]) - self.advantages.values.astype(np.float64)
        rounding = self.table.terms * EPSILON * (onwards[2] + np.abs(behind)[:, None] + np.abs(gap))
        return gap, (self.advantages.rounding + unsure[:, None] + onwards[1]) * (1 + OUTWARDS) + rounding

    @cached_property
    def level(self) -> Matrix:
        """(S, A) what the rounding of the table's own numbers can make of a difference of action values, to first order.

        Of the terms of the step itself, and of those of all later ones.
        """
        return self.level_against(self.best, self.best)

    def level_against(self, distribution: Matrix, onwards: Matrix) -> Matrix:
        """(S, A) the same of what a policy (S, A) does first, less an action, where another (S, A) goes on after either."""
        each = self._own + self.table.mdp.gamma * (self.table.mdp.P @ self.drift(onwards)).reshape(self.blocked.shape)
        return each + (distribution * each).sum(axis=1, keepdims=True)

    def drift(self, distribution: Matrix) -> Vector:
        """(S,) what that rounding can make of the value of a policy (S, A), to first order."""
        discounted = Discounted(self.table.mdp.P_pi(distribution), self.table.mdp.gamma)
        return np.maximum(discounted.solve((distribution * self._own).sum(axis=1)), 0.0)

    @property
    def best(self) -> Matrix:
        """(S, A) `policy`."""
        return np.eye(self.blocked.shape[1])[self.policy]

    @property
    def _own(self) -> Matrix:
        """(S, A) the rounding of the table's numbers in a single step: of its terms, and of rows that do not sum to 1."""
        return TIED * self.advantages.size + self.advantages.defects

    def tied(self) -> ActionSets:
        """(S, A) the actions that a policy may take for the best: tied, and the closer the more steps pay for it."""
        gains = np.where(self.blocked, -np.inf, self.advantages.values)
        best = gains.max(axis=1, keepdims=True)
        near = gains >= best - CAREFUL / self.table.mdp.effective_horizon * self.advantages.size
        if not (near.sum(axis=1) > 1)[~self.table.mdp.terminal].any():  # no need of a factorisation
            return near
        return near & (gains >= best - self.level)

    def bound(self, policy: Actions) -> float:
        """|W - V*| and V* - V_policy are at most this in every state: cheaper than `error`, and wider where R has outliers."""
        rows, lost = np.arange(policy.size), self.advantages.rounding - self.advantages.values.astype(np.float64)
        gained = max(float(self.advantages.high[~self.blocked].max(initial=0.0)), 0.0)
        most = max(float(np.maximum(lost[rows, policy], lost[rows, self.policy]).max(initial=0.0)), 0.0)
        return (gained + most) * self.table.horizon * (1 + OUTWARDS)


def as_told(mdp: TabularMDP, distribution: Matrix, free: StateMask) -> Sparse:
    """(S*A, S) P in which every action does what a policy (S, A) does, but in the states that are free (S,)."""
    n = mdp.n_actions
    blocks = np.where(free[:, None, None], np.eye(n), distribution[:, None, :])
    s, row, column = np.nonzero(blocks)
    mixing = sp.csr_array((blocks[s, row, column], (s * n + row, s * n + column)), shape=(mdp.P.shape[0],) * 2)
    return sp.csr_array(mixing @ mdp.P)


def howard(mdp: TabularMDP, reward: TabularReward, blocked: np.ndarray, max_iterations: int) -> Optimum:
    """The best policy among the actions that are not blocked (S, A).

    Raises:
        InvalidReward: values that overflow.
        InvalidParameter: `max_iterations` spent.
    """
    R, states, seen = reward.expected(mdp), np.arange(mdp.n_states), set()
    paid = np.abs(R)
    if paid.max() > LARGEST / mdp.effective_horizon:
        raise InvalidReward(f"the reward is up to {paid.max():.3g}, too large at gamma {mdp.gamma}: values overflow. Scale it.")
    policy = _warm_start(mdp, R, blocked)
    for iteration in range(1, max_iterations + 1):
        discounted = Discounted(mdp.P[states * mdp.n_actions + policy], mdp.gamma)
        V = np.where(mdp.terminal, 0.0, discounted.solve(R[states, policy]))
        onwards = mdp.gamma * (mdp.P @ np.stack([V, np.abs(V)], axis=1))
        Q = np.where(blocked, -np.inf, R + onwards[:, 0].reshape(R.shape))
        size = paid + onwards[:, 1].reshape(R.shape) + np.abs(V)[:, None]
        gains = Q - Q[states, policy][:, None] - 32 * EPSILON * size
        better = gains.max(axis=1) > 32 * EPSILON * size[states, policy]
        seen.add(hash(policy.tobytes()))
        following = np.where(better, gains.argmax(axis=1), policy)
        if not better.any() or hash(following.tobytes()) in seen:  # float64 sees no better one, or goes round
            return _last_improvements(PreciseTable(mdp, reward), V, policy, discounted, blocked, iteration)
        policy = following
    raise InvalidParameter(f"max_iterations is {max_iterations}: policy iteration did not finish.")


def _last_improvements(
    table: PreciseTable, V: Vector, policy: Actions, discounted: Discounted, blocked: np.ndarray, iteration: int
) -> Optimum:
    """Improve by advantages in extended precision; however this ends, the bounds hold."""
    mdp, states = table.mdp, np.arange(policy.size)
    W = table.refined(V, policy, discounted)
    found = table.advantages(W)
    for _ in range(LAST_IMPROVEMENTS):
        gains = np.where(blocked, -np.inf, found.values)
        least = np.maximum(2 * found.rounding, WORTHWHILE * found.size)
        better = (gains - gains[states, policy][:, None] > least + least[states, policy][:, None]) & ~blocked
        if not better.any():
            break
        policy = np.where(better.any(axis=1), np.where(better, gains, -np.inf).argmax(axis=1), policy)
        discounted = Discounted(mdp.P[states * mdp.n_actions + policy], mdp.gamma)
        V = np.where(mdp.terminal, 0.0, discounted.solve(table.steps[states, policy]))
        W = table.refined(V, policy, discounted)
        found, iteration = table.advantages(W), iteration + 1
    return Optimum(table, W, found, policy, blocked, iteration)


def sweeps_of(mdp: TabularMDP, R: np.ndarray, V: np.ndarray, policy: np.ndarray, sweeps: int) -> np.ndarray:
    """Sweeps of V <- R_pi + gamma P_pi V."""
    rows = np.arange(mdp.n_states)
    P_pi, R_pi = mdp.gamma * mdp.P[rows * mdp.n_actions + policy], R[rows, policy]
    for _ in range(sweeps):
        V = P_pi @ V + R_pi
    return V


def _warm_start(mdp: TabularMDP, R: np.ndarray, blocked: np.ndarray) -> np.ndarray:
    """A policy to begin with: greedy for R; on tables where a factorisation costs, after some cheap improvements."""
    policy = np.where(blocked, -np.inf, R).argmax(axis=1)
    V = np.zeros(mdp.n_states)
    for _ in range(20 if mdp.n_states > 500 else 0):
        V = sweeps_of(mdp, R, V, policy, 20)
        Q = R + mdp.gamma * (mdp.P @ V).reshape(R.shape)
        policy = np.where(blocked, -np.inf, Q).argmax(axis=1)
    return policy
