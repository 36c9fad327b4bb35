"""FiniteLP's program as a function of lambda, the price of ||R||_1: one linear program whose objective changes.

    maximise    sum_s t(s) - lambda ||R||_1    subject to what `PricedRewards` says, with 0 <= t (<= cap)
Solved warm by `WarmLP`, in a hundredth of R_max or of the cap, the smaller. What is handed out is recomputed from R alone: the
margins by `row_margins`, and Lagrange's bound above the optimum from the program's duals.
Axes: S states, A actions, n rows of (4), q rewards (S or S*A).
"""

from typing import Any

import numpy as np

from irl_gym._typing import ActionSets
from irl_gym.errors import SolverFailed, SolverTimeout
from irl_gym.judging.ambiguity.envelope import Line
from irl_gym.judging.ambiguity.priced_rewards import PricedRewards
from irl_gym.learners.linear_programs.proofs.dual_bound import DualBound
from irl_gym.mdp.margins import least_per_state, row_margins
from irl_gym.mdp.optimality_rows import compare
from irl_gym.mdp.planning.discounted import Discounted
from irl_gym.mdp.rewards import TabularReward
from irl_gym.mdp.tabular_mdp import TabularMDP
from irl_gym.programs.deadline import NEVER, Deadline
from irl_gym.programs.warm_lp import Vertex, WarmLP

LARGE = 100.0
"""The smaller of R_max and the cap in the program's unit: the simplex method's tolerance, 1e-9, is absolute."""
PRICED = 1000.0
"""What the objective is multiplied by, for the same reason."""
ACCURATE = 1e-9
"""An answer further from the optimum than this, relative to the largest total margin or the unit, is sought once more."""
SNAPPED = 1e-8
"""A reward this near 0 or its bound, in the program's unit, is that."""


class PricedProgram:
    """The program of one expert.

    Args:
        mdp: only states reachable from d0 get a reward.
        expert: (S,) actions, (S, A) probabilities or (S, A) set, known in all of these states.
        r_max: bound on |R|.
        cap: the cap on margins; None is the paper's program, in which a row of equal successors takes its state's margin.
        on_states: R(s), or R(s, a).
        deadline: of all solves together.
        served: (S, A) actions whose rows can be strict; the other rows count towards no margin. None for all.
    """

    def __init__(
        self,
        mdp: TabularMDP,
        expert: Any,
        *,
        r_max: float,
        cap: float | None,
        on_states: bool,
        deadline: Deadline = NEVER,
        served: ActionSets | None = None,
    ):
        self.whole, self.r_max, self.cap, self.on_states = mdp, r_max, cap, on_states
        self.deadline = deadline
        self.rows = np.flatnonzero(mdp.reachable)
        self.part = part = mdp.restrict(self.rows)
        self.comparisons = c = compare(part, np.asarray(expert)[self.rows])
        trivial = c.trivial & ~c.equal if on_states else np.zeros(c.states.size, dtype=bool)
        self.usable = ~c.equal & ~trivial & (served is None or served[self.rows[c.states], c.actions])
        self.counted = self.usable & ~np.isin(c.states, c.states[trivial]) if cap is None else self.usable
        self.discounted = Discounted(part.P_pi(c.distribution), part.gamma)
        self.unit = (r_max if cap is None else min(r_max, cap)) / LARGE
        self.program = PricedRewards(part, c, on_states=on_states, counted=self.counted)
        self.states = self.program.states
        self.largest = 0.0
        """The largest total margin seen."""
        self.lp = self._program()

    def _program(self, *, perturbed: bool = False) -> WarmLP:
        """The constraints, in the program's unit."""
        most = np.inf if self.cap is None else self.cap / self.unit
        return self.program.polytope(self.r_max / self.unit, 0.0, most).program(self.deadline, perturbed=perturbed)

    def at(self, price: float) -> tuple[Line, float]:
        """An optimal reward at a price, and Lagrange's bound above the optimum.

        Raises:
            SolverTimeout: the time limit was reached.
            SolverFailed: no answer.
        """
        if not self.deadline.left:
            raise self._late()
        cost = PRICED * self.program.cost(1.0, price)
        line, bound, off = self._answer(self._solved(cost), price)
        if off > ACCURATE:  # once more, from nothing: the simplex method says "optimal" of a basis that has become inexact
            again = self._answer(self._afresh(cost), price)
            line, bound, off = min((line, bound, off), again, key=lambda one: one[2])
        self.largest = max(self.largest, line.total)
        return line, bound

    def _answer(self, vertex: Vertex, price: float) -> tuple[Line, float, float]:
        """The reward of a vertex, the bound of its duals, and how far from an optimum of the program these are."""
        line = self.line(self.program.rewards(vertex.x))
        y = np.zeros(self.comparisons.states.size)
        y[self.program.kept] = vertex.row_duals[self.part.n_states :] / PRICED
        bound = self.bound(y, price)
        missing = (bound - line.at(price)) / max(self.largest, line.total, 1e-300)
        return line, bound, max(missing, line.violation)

    def _solved(self, cost: np.ndarray) -> Vertex:
        """The optimum, from where the last solve ended; from scratch where that leads nowhere."""
        try:
            return self.lp.minimise(cost)
        except SolverTimeout:
            raise self._late() from None
        except SolverFailed:
            return self._afresh(cost)

    def _afresh(self, cost: np.ndarray) -> Vertex:
        """The optimum from scratch: with perturbations, which get anywhere, and then from their basis without."""
        rough, exact = self._program(perturbed=True), self._program()
        self.lp = exact
        try:
            vertex = rough.minimise(cost)
            exact.start_from(rough)
            try:
                return exact.minimise(cost)
            except SolverFailed:
                self.lp = rough
                return vertex
        except SolverTimeout:
            raise self._late() from None

    def _late(self) -> SolverTimeout:
        return SolverTimeout(f"the path was not finished in {self.deadline.seconds} s: raise time_limit, or give most_pieces.")

    def line(self, R: np.ndarray) -> Line:
        """What a reward (q,), in the program's unit, is worth, and its largest violation of (4): from P and the expert."""
        bound, part, c = self.r_max / self.unit, self.part, self.comparisons
        R = np.clip(R, -bound, bound)
        R = np.where(np.abs(R) <= SNAPPED, 0.0, R)
        R = np.where(np.abs(R) >= bound - SNAPPED, np.sign(R) * self.r_max, R * self.unit)
        R = R if self.on_states else R.reshape(part.n_states, part.n_actions)
        values = row_margins(part, c, TabularReward(R), self.discounted)
        least = least_per_state(values[self.usable], c.states[self.usable], part.n_states)
        total = float(np.minimum(least[self.states], np.inf if self.cap is None else self.cap).sum())
        S = self.whole.n_states
        whole, margins = np.zeros((S, *R.shape[1:])), np.full(S, np.nan)
        whole[self.rows], margins[self.rows] = R, least
        violation = float(np.where(c.equal, np.abs(values), -values).max(initial=0.0))
        return Line(total, float(np.abs(R).sum()), whole, margins, violation / (self.unit * LARGE))

    def bound(self, y: np.ndarray, price: float) -> float:
        """No reward is worth more at this price; valid for any duals y (n,) of the rows of (4)."""
        dual = DualBound(
            self.part, self.comparisons, self.discounted, self.on_states, self.counted, self.r_max, float(price), self.cap
        )
        y = np.where(self.comparisons.equal, y, np.maximum(y, 0.0))
        sums = np.bincount(self.comparisons.states[self.counted], y[self.counted], self.part.n_states)
        short = (sums > 1 - 1e-6) & (sums < 1)  # a margin is bounded by 2 R_max / (1 - gamma), which makes much of rounding
        return dual.bound(
            np.where(self.counted & short[self.comparisons.states], y / np.where(short, sums, 1.0)[self.comparisons.states], y)
        )
