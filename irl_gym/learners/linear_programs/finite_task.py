"""FiniteLP for an expert that is known in every state: its programs, which rows of (4) count in them, and what is proved.

Axes: S states, A actions, n rows of (4).
"""

from typing import Any

import numpy as np

from irl_gym.errors import DegenerateExpert, SolverFailed, SolverInfeasible
from irl_gym.learners.base import Outcome
from irl_gym.learners.linear_programs import programs
from irl_gym.learners.linear_programs.partial import Asked
from irl_gym.learners.linear_programs.programs import LARGEST_BOUND, NO_MARGIN, Program, Solved
from irl_gym.learners.linear_programs.proofs.finite_proof import FiniteProof, prove
from irl_gym.learners.linear_programs.strict_rows import nothing_to_compare, strict_rows
from irl_gym.mdp.margins import row_margins
from irl_gym.mdp.optimality_rows import Comparisons, compare
from irl_gym.mdp.rewards import TabularReward
from irl_gym.mdp.tabular_mdp import TabularMDP
from irl_gym.mdp.time_expanded import Repeated
from irl_gym.programs.solvers import Solving, Status


class FiniteTask:
    """One fit: the reachable part of the MDP, the rows of (4), and the states that count.

    Args:
        learner: the hyper-parameters.
        mdp: the whole MDP.
        expert: its policy, known in every state.
        solving: with which solver, and until when.
        tie: of a reward that is the same in several rows; None where each has its own.

    Raises:
        DegenerateExpert: nothing to compare.
    """

    def __init__(self, learner: Asked, mdp: TabularMDP, expert: Any, solving: Solving, tie: Repeated | None = None):
        self.learner, self.mdp, self.expert, self.solving = learner, mdp, expert, solving
        mdp.mixing(expert)  # checks all states, reachable or not
        self.rows = np.flatnonzero(mdp.reachable)
        self.part = mdp.restrict(self.rows)
        self.comparisons: Comparisons = compare(self.part, np.asarray(expert)[self.rows])
        self.tie = None if tie is None else tie.among(self.rows)
        self.stats: dict[str, Any] = {"programs": {}}
        self.counted = self._candidates()
        self.unbreakable = np.zeros_like(self.counted)
        if not self.counted.any():
            raise nothing_to_compare(self.comparisons, self.part)

    def _candidates(self) -> np.ndarray:
        """(n,) rows that can have a margin: in the paper's LP a trivial row takes it from all rows of its state."""
        c = self.comparisons
        if self.learner.reward_on == "state-action":
            return ~c.equal
        usable = ~c.equal & ~c.trivial
        if self.learner.margin_cap is None:
            usable &= ~np.isin(c.states, c.states[c.trivial & ~c.equal])
        return usable

    def program(self) -> Program:
        """The program, before anything is asked of it."""
        learner = self.learner
        return Program(self.part, self.comparisons, learner.reward_on, self.counted, self.solving, self.tie)

    def record(self, name: str, solved: Solved) -> None:
        """Note what the solver did."""
        self.stats["programs"][name] = solved.answer.to_json()

    def lambda_0(self) -> float:
        """The l1 above which R = 0 is optimal.

        Raises:
            DegenerateExpert: no reward has a positive margin.
        """
        solved = programs.critical_l1(self.program())
        self.record("lambda_0", solved)
        if solved.answer.objective <= NO_MARGIN:
            raise self.degenerate()
        return solved.answer.objective

    def uniform_margin(self) -> float:
        """The largest margin of all rows at once; leaves in `counted` the rows that can have one."""
        bound = self._uniform_bound()
        if bound is None:
            candidates = self.counted
            self.counted = strict_rows(self.comparisons.states, candidates, self._serve)
            self.unbreakable = candidates & ~self.counted
            self.stats["rows_without_margin"] = int(self.unbreakable.sum())
            if not self.counted.any():
                raise self.degenerate()
            rounds = self.part.n_actions  # rewards of that many programs add up, each with margins above 1/2 at the bound
            bound = self._uniform_bound((2 * rounds + 1) * LARGEST_BOUND)
            if bound is None:
                raise SolverFailed("the rows that can have a margin were found, but no uniform margin: report this table.")
        self.stats["uniform_margin"] = self.learner.r_max / bound
        return self.learner.r_max / bound

    def _serve(self, rows: np.ndarray) -> np.ndarray:
        self.counted = rows
        solved = programs.attainable(self.program(), LARGEST_BOUND)
        self.record("attainable", solved)
        R = solved.R if self.tie is None else self.tie.spread(solved.R)
        return row_margins(self.part, self.comparisons, TabularReward(R))

    def _uniform_bound(self, largest: float = LARGEST_BOUND) -> float | None:
        """Least bound on |R| for margins of 1 in all counted rows; None if there is none, or only a larger one."""
        try:
            solved = programs.uniform_margin(self.program())
        except SolverInfeasible:
            return None
        self.record("uniform margin", solved)
        return solved.answer.objective if 0 < solved.answer.objective < largest else None

    def l1_limit(self, y: np.ndarray) -> float:
        """An l1 below which the sparsest reward stays optimal: where no margin's price in ||R||_1, times l1, is above 1."""
        prices = np.bincount(self.comparisons.states[self.counted], np.maximum(y[self.counted], 0))
        return 1 / max(float(prices.max()), 1e-300)

    def degenerate(self) -> DegenerateExpert:
        """Why there is nothing to learn."""
        where = "state reward" if self.learner.reward_on == "state" else "reward"
        mend = ' Use reward_on="state-action".' if self.learner.reward_on == "state" else ""
        mend += "" if self.tie is None else " Use stationary=False."
        return DegenerateExpert(
            f"equation (4) holds for this expert only with every margin 0, as for R = constant: no {where} over the "
            f"{self.rows.size} reachable states prefers its actions. Is the policy optimal for any reward at all?{mend}"
            f"{self.comparisons.caveat if self.learner.reward_on == 'state' else ''}"
        )

    def result(self, solved: Solved, **proof: Any) -> Outcome[TabularReward, FiniteProof]:
        """The reward of the whole MDP, and the proof; `proof` are terms of `prove`."""
        zero = np.abs(solved.R).max() <= NO_MARGIN * self.learner.r_max  # then it is 0 and an interior point's rounding
        R = np.zeros_like(solved.R) if zero else solved.R
        never = self.comparisons.pairs(self.rows, np.flatnonzero(self.unbreakable))
        if self.tie is None:
            values = np.zeros((self.mdp.n_states, *R.shape[1:]))
            values[self.rows] = R
        else:
            values, never = self.tie.whole(R), np.unique(never % [self.tie.shape[0], self.mdp.n_actions], axis=0)
        reward = TabularReward.learned(values, {"learner": "FiniteLP", "reward_on": self.learner.reward_on})
        terms = {"r_max": self.learner.r_max, "unbreakable_rows": never, "tie": self.tie, **proof}
        paid = reward.of_rows(self.rows) if self.tie is None else TabularReward(self.tie.spread(R), {}, reward.tolerance)
        found = prove(self.part, self.comparisons, paid, self.counted, **terms)
        return Outcome(reward, Status.ZERO if found.zero else solved.answer.status, found, self.stats)
