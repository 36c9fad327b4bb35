"""FiniteLP's program with a price on ||R||_1, as a polytope: what its constraints are, and what its objective costs.

    maximise    sum_s t(s) - l1 sum(R+ + R-)
    subject to  (I - gamma P_pi) V = R+ - R-   (5),  or V = R_pi + gamma P_pi V for R(s, a);   0 <= R+, R- <= R_max
                margins >= t(s) in the rows that count, >= 0 in the others, = 0 where the expert takes the action too  (4)
                t in a range: from 0 to the cap, or fixed at it where it is only the norm that is made small
A row of equal successors says 0 >= 0 and is left out; under the paper's own objective its state does not count.
The unknowns by block: V (S), t (m), R+ (q), R- (q).
Axes: S states, A actions, n rows of (4), m states with a margin, q rewards (S or S*A).
"""

from functools import cached_property

import numpy as np
import scipy.sparse as sp

from irl_gym._typing import Indices, Sparse
from irl_gym.judging.ambiguity.extremes import Polytope
from irl_gym.learners.linear_programs.programs import picking
from irl_gym.mdp.optimality_rows import Comparisons
from irl_gym.mdp.tabular_mdp import TabularMDP


class PricedRewards:
    """The rewards of one kind, each with what it costs, over the rows of (4) of one expert.

    Args:
        part: the reachable part of an MDP.
        comparisons: the expert's rows of (4) there, known in every state.
        on_states: R(s), or R(s, a).
        counted: (n,) the rows that count towards the margin of their state.
    """

    def __init__(self, part: TabularMDP, comparisons: Comparisons, *, on_states: bool, counted: np.ndarray):
        self.part, self.comparisons, self.on_states = part, comparisons, on_states
        self.kept: Indices = np.flatnonzero(~comparisons.trivial) if on_states else np.arange(comparisons.states.size)
        self.states: Indices = np.unique(comparisons.states[counted])
        self.counted = counted[self.kept]
        self.size = part.n_states * (1 if on_states else part.n_actions)

    @cached_property
    def A(self) -> Sparse:
        """(S + kept, S + m + 2 q) the rows (5), then those of (4) that are kept."""
        part, c, kept = self.part, self.comparisons, self.kept
        S, A, m, q = part.n_states, part.n_actions, self.states.size, self.size
        closing = sp.eye_array(S) - part.gamma * part.P_pi(c.distribution)
        pays = sp.eye_array(S) if self.on_states else part.mixing(c.distribution)  # (S, q) R of the expert's step
        states = c.states[kept]
        at = np.searchsorted(self.states, states[self.counted])
        t = sp.csr_array((np.ones(at.size), (np.flatnonzero(self.counted), at)), shape=(kept.size, m))
        if self.on_states:
            gain, step = c.rows[kept], sp.csr_array((kept.size, q))
        else:
            stacked = states * A + c.actions[kept]
            gain = picking(states, S) - part.gamma * part.P[stacked]
            step = picking(stacked, q)
        return sp.csr_array(sp.block_array([[closing, sp.csr_array((S, m)), -pays, pays], [gain, -t, -step, step]]))

    def polytope(self, r_max: float, least: float, most: float) -> Polytope:
        """All rewards with |R| <= r_max and margins that leave room for t from `least` to `most`."""
        S, m, q, k = self.part.n_states, self.states.size, self.size, self.kept.size
        bound = np.full(q, float(r_max))
        if not self.on_states:
            bound[np.repeat(self.part.terminal, self.part.n_actions)] = 0.0
        return Polytope(
            self.A,
            np.zeros(S + k),
            np.concatenate([np.zeros(S), np.where(self.comparisons.equal[self.kept], 0.0, np.inf)]),
            np.concatenate([np.full(S, -np.inf), np.full(m, least), np.zeros(2 * q)]),
            np.concatenate([np.full(S, np.inf), np.full(m, most), bound, bound]),
        )

    def cost(self, gain: float, l1: float) -> np.ndarray:
        """(S + m + 2 q,) what is minimised: l1 ||R||_1 less `gain` times the sum of the margins."""
        return np.concatenate([np.zeros(self.part.n_states), np.full(self.states.size, -gain), np.full(2 * self.size, l1)])

    def rewards(self, x: np.ndarray) -> np.ndarray:
        """(q,) R = R+ - R-."""
        first = self.part.n_states + self.states.size
        return x[first : first + self.size] - x[first + self.size :]

    @cached_property
    def picked(self) -> Sparse:
        """(q, S + m + 2 q) R as functions of the unknowns."""
        none, eye = sp.csr_array((self.size, self.part.n_states + self.states.size)), sp.eye_array(self.size)
        return sp.csr_array(sp.hstack([none, eye, -eye]))
