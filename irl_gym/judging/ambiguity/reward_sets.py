"""The feasible rewards with margins of at least tau and |R| <= 1, as a polytope of values V.

    unknowns     V (S,)
    states       u (k,) too: the reward of each of the k states where nothing is known of the expert
                 -1 <= (I - gamma P_pi) V <= 1              where it is known: this is R, equation (5)
                 (P_pi(s) - P_a(s)) V >= tau, 0, or = 0     (4): where a margin is asked, not asked, or the expert takes a too
                 V(s) - gamma P_a(s) V >= u(s) for each a,  -1 <= u <= 1      where it is not known
    steps        -1 <= V(s) - gamma P_sa V <= 1             for actions that the expert takes: this is R(s, a)
                 V(s) - gamma P_sa V >= tau - 1             for others: some R(s, a) >= -1 is worse by tau
V is 0 in terminal states where rewards are on steps. A pin takes the place of both bounds. Axes: S states, A actions.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any

import numpy as np
import scipy.sparse as sp

from irl_gym._typing import Sparse
from irl_gym.judging.ambiguity.extremes import Polytope, extremes
from irl_gym.judging.ambiguity.feasible import Posed
from irl_gym.learners.linear_programs.programs import picking
from irl_gym.programs.deadline import Deadline
from irl_gym.programs.warm_lp import WarmLP

Ends = tuple[np.ndarray, np.ndarray, int]


class RewardSet(ABC):
    """The rewards of one kind that are feasible, in units of R_max.

    Args:
        posed: the reachable part of the MDP and its rows of (4).
        served: (S, A) actions over which a margin is asked.
        pins: known rewards, by state or by (state, action).
    """

    counted: np.ndarray
    """(m,) rows of the polytope that a margin is asked of."""

    @abstractmethod
    def __init__(self, posed: Posed, served: np.ndarray, pins: Mapping[Any, float]): ...

    @abstractmethod
    def polytope(self, tau: float) -> Polytope:
        """The set."""

    @abstractmethod
    def bounds(self, tau: float, workers: int, deadline: Deadline) -> Ends:
        """Least and largest reward, (S,) or (S, A), and how many linear programs it took."""

    def largest_margin(self, deadline: Deadline) -> float:
        """The largest tau at which the set is not empty.

        Raises:
            SolverInfeasible: it is empty even at 0.
        """
        bare = self.polytope(0.0)
        column = sp.csr_array(-self.counted[:, None].astype(np.float64))
        A = sp.csr_array(sp.hstack([bare.A, column]))
        least, most = np.append(bare.least, 0.0), np.append(bare.most, np.inf)
        program = WarmLP(A, bare.low, bare.high, least, most, deadline=deadline)
        return float(program.minimise(np.append(np.zeros(bare.least.size), -1.0)).x[-1])


class StateRewards(RewardSet):
    """Rewards on states."""

    def __init__(self, posed: Posed, served: np.ndarray, pins: Mapping[Any, float]):
        part, c = posed.part, posed.comparisons
        S, A = part.n_states, part.n_actions
        self.n_states, self.n_actions, self.pins = S, A, pins
        self.largest_value = part.effective_horizon
        self.closed, self.opened = np.flatnonzero(posed.known), np.flatnonzero(~posed.known)
        self.here: Sparse = sp.csr_array(sp.eye_array(S) - part.gamma * part.P_pi(c.distribution))[self.closed]  # R, (5)
        states = self.opened.repeat(A)
        following = part.P[states * A + np.tile(np.arange(A), self.opened.size)]
        self.each: Sparse = sp.csr_array(picking(states, S) - part.gamma * following)  # (I - gamma P_a) V for each a
        moved = np.flatnonzero(~c.trivial)
        self.equal = c.equal[moved]
        self.asked = posed.movable(True)[moved] & served[c.states[moved], c.actions[moved]]
        none, k = np.zeros(self.closed.size, dtype=bool), self.opened.size
        self.counted = np.concatenate([none, self.asked, np.zeros(k * A, dtype=bool)])
        under = -picking(np.arange(k).repeat(A), k)
        beside = [sp.csr_array((none.size, k)), sp.csr_array((moved.size, k)), under]
        left = sp.vstack([self.here, c.rows[moved], self.each])
        self.A: Sparse = sp.csr_array(sp.hstack([left, sp.vstack(beside)]))

    def polytope(self, tau: float) -> Polytope:
        """All (V, u)."""
        within = [[np.array([self.pins.get(int(s), end) for s in which]) for which in (self.closed, self.opened)]
                  for end in (-1.0, 1.0)]  # fmt: skip
        (least, least_u), (most, most_u) = within
        k, value = self.each.shape[0], np.full(self.n_states, self.largest_value)
        return Polytope(
            self.A,
            np.concatenate([least, np.where(self.asked, tau, 0.0), np.zeros(k)]),
            np.concatenate([most, np.where(self.equal, 0.0, np.inf), np.full(k, np.inf)]),
            np.concatenate([-value, least_u]),
            np.concatenate([value, most_u]),
        )

    def bounds(self, tau: float, workers: int, deadline: Deadline) -> Ends:
        """Where the expert is not known the largest u, and the least of V(s) - gamma P_a(s) V over V and a."""
        k, n = self.opened.size, self.closed.size
        on_V = sp.vstack([self.here, sp.csr_array((k, self.n_states)), -self.each])
        on_u = sp.vstack([sp.csr_array((n, k)), sp.eye_array(k), sp.csr_array((self.each.shape[0], k))])
        functions: Sparse = sp.csr_array(sp.hstack([on_V, on_u]))
        both = np.arange(functions.shape[0]) < n
        least, most = extremes(self.polytope(tau), functions, lowest=both, workers=workers, deadline=deadline)
        low, high = np.zeros(self.n_states), np.zeros(self.n_states)
        low[self.closed], high[self.closed], high[self.opened] = least[:n], most[:n], most[n : n + k]
        low[self.opened] = (-most[n + k :]).reshape(k, self.n_actions).min(axis=1)
        for s, value in self.pins.items():
            low[s] = high[s] = value
        return *_ordered(low, high), int(both.sum() + both.size)


class StepRewards(RewardSet):
    """Rewards on steps."""

    def __init__(self, posed: Posed, served: np.ndarray, pins: Mapping[Any, float]):
        part = posed.part
        S, A = part.n_states, part.n_actions
        self.shape, self.terminal, self.pins = (S, A), part.terminal, pins
        self.largest_value = part.effective_horizon
        acting = np.flatnonzero(~part.terminal)
        self.pairs = (acting[:, None] * A + np.arange(A)).ravel()
        self.taken = posed.taken.ravel()[self.pairs]
        asked = posed.known[:, None] & served & ~posed.taken
        self.counted = asked.ravel()[self.pairs]
        self.A: Sparse = sp.csr_array(picking(self.pairs // A, S) - part.gamma * part.P[self.pairs])

    def _pinned(self, otherwise: float) -> np.ndarray:
        """(p,) the pin of each pair, or another number."""
        A = self.shape[1]
        return np.array([self.pins.get((int(pair // A), int(pair % A)), otherwise) for pair in self.pairs])

    def polytope(self, tau: float) -> Polytope:
        """All V."""
        value = np.where(self.terminal, 0.0, self.largest_value)
        low = self._pinned(-1.0) + np.where(self.counted, tau, 0.0)
        return Polytope(self.A, low, np.where(self.taken, self._pinned(1.0), np.inf), -value, value)

    def bounds(self, tau: float, workers: int, deadline: Deadline) -> Ends:
        """An action that the expert does not take can have any reward from -1 to what keeps it worse by tau."""
        least, most = extremes(self.polytope(tau), self.A, lowest=self.taken, workers=workers, deadline=deadline)
        low = np.where(self.taken, least, self._pinned(-1.0))
        high = np.where(self.taken, most, np.minimum(most - np.where(self.counted, tau, 0.0), self._pinned(1.0)))
        found = np.full((2, self.shape[0] * self.shape[1]), np.nan)
        found[:, self.pairs] = _ordered(low, high)
        low, high = found.reshape(2, *self.shape)
        return low, high, int(self.taken.sum() + self.taken.size)


def _ordered(low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Within +-1 and low <= high, but for the solver's rounding."""
    low, high = np.clip(low, -1.0, 1.0), np.clip(high, -1.0, 1.0)
    return np.minimum(low, high), np.maximum(low, high)
