"""Linear-programming IRL for finite state spaces (Ng & Russell 2000, section 3; lecture notes 2.2.3).

Given P, gamma and the expert's policy pi, find R under which pi is optimal, and as far from ties as possible:
    maximise    sum_s min_{a != pi(s)} (P_pi(s) - P_a(s)) V - l1 ||R||_1
    subject to  (4): (P_pi - P_a) V >= 0 for each a;   V = (I - gamma P_pi)^-1 R (5);   |R(s)| <= R_max

Two modes:
`margin_cap=None`  the paper's LP. It trades margins between states: some get none, and in these the expert is tied with
    actions that can be disastrous under the true reward.
`margin_cap=tau`   Departs: each margin counts up to tau only, and rows that no reward makes strict are left out one by one
    (`strict_rows`; they would force the margin of their state to 0). No state's margin is bought at another's expense.
`margin_cap="auto"`  tau = half of eps*, the largest margin that all other rows can have at once. A cap of at most eps* is
    attained in each of them, so no tie is left that a reward on states breaks by more than R_max / 10^6; and half of it
    leaves an interior of rewards that attain it, in which the l1 term finds the simplest. With l1 = 0 the reward is the limit
    l1 -> 0+ of the capped LP: the least ||R||_1 with all margins at least tau, optimal for every l1 below `stats["l1_limit"]`.
An expert that is known in some states only (rows of NaN), or that errs (`slack`), has the programs of `learners.soft`: (4) has
rows in the states where it is known, and V is what acting best is worth, so that no policy is made up where none was seen and
no unknown state is worth more than it earns.
`unvisited="avoid"`  (default) unknown states have the lowest reward that the margins allow, so an agent that strays into them
    returns to what the expert was seen to do. It is a choice, not knowledge: nothing says that these states are bad.
`slack=C`  a violation of (4) costs C, where a margin is worth 1, both in proportion to `visits`. With C large the rows are hard
    again wherever they can hold. `irl_gym.certify` lists the rows that are violated.
    Actions that the expert takes too, when it takes several, have to be as good: what violates that costs C as well, and adds
    nothing to a margin.
Axes: S states, A actions.
"""

from dataclasses import dataclass, replace
from typing import Any, ClassVar, Literal

import numpy as np

from irl_gym.checks import checked_number, is_word
from irl_gym.errors import DegenerateExpert, InvalidParameter, SolverFailed, SolverInfeasible, a_type
from irl_gym.learners.base import Outcome
from irl_gym.learners.linear_programs import programs
from irl_gym.learners.linear_programs.partial import PartialTask
from irl_gym.learners.linear_programs.programs import (
    JUST_BELOW,
    LARGEST_BOUND,
    NO_MARGIN,
    Program,
    RewardOn,
    Solved,
    checked_visits,
)
from irl_gym.learners.linear_programs.proofs.finite_proof import FiniteProof, prove
from irl_gym.learners.linear_programs.strict_rows import nothing_to_compare, strict_rows
from irl_gym.learners.needs import Needs
from irl_gym.learners.problem import Problem
from irl_gym.mdp.margins import row_margins
from irl_gym.mdp.optimality_rows import Comparisons, compare
from irl_gym.mdp.policies import completed
from irl_gym.mdp.rewards import TabularReward
from irl_gym.mdp.tabular_mdp import TabularMDP, checked_mdp
from irl_gym.programs.killable import within
from irl_gym.programs.solvers import SolverName, Solving, Status, check_solving
from irl_gym.records import Record


@dataclass(frozen=True)
class FiniteLP(Record):
    """Linear-programming IRL for finite state spaces (Ng & Russell 2000, section 3.2).

    Raises:
        InvalidParameter: a field outside its range.
    """

    r_max: float = 1.0
    """R_max > 0, the bound on |R|. Paper, section 3.2."""
    l1: float | Literal["auto"] = 0.0
    """lambda >= 0, the price of ||R||_1; "auto" is just below lambda_0, the price at which R becomes 0."""
    margin_cap: float | Literal["auto"] | None = "auto"
    """tau > 0, the cap on margins; "auto" chooses it; None is the paper's LP."""
    reward_on: RewardOn = "state"
    """"state" for R(s) as in the paper; "state-action" for R(s, a), when no R(s) singles the expert out."""
    report_lambda_0: bool = False
    """Compute lambda_0 for the proof even when l1 is 0: one more LP."""
    solver: SolverName = "auto"
    """"auto" chooses by size; see `irl_gym.programs.solvers`."""
    time_limit: float | None = None
    """Seconds for the whole fit: all its programs, all attempts at them, and the proof, together; None for no limit.
    Kept within a fifth, also where factors fill up: what could be long works in a process that is ended then (`killable`). What
    no clock is looked at for is the making of the matrices, about a second for a million entries."""
    slack: float | None = None
    """C >= 1, the price of violating (4), where a margin is worth 1: for experts that err. None: (4) holds at any cost."""
    unvisited: Literal["avoid", "free"] = "avoid"
    """Reward of states where nothing is known of the expert: as low as the margins allow, or whatever they make of it."""
    needs: ClassVar[Needs] = Needs(("dynamics", "expert or demonstrations"), actions="inferred")
    """The parts of a problem that `learn` reads."""
    of_feasible_set: ClassVar[bool] = True
    """Is the reward one of those that `irl_gym.judging.ambiguity` describes, by how far they reach and how they depend on
    lambda?"""

    def __post_init__(self) -> None:
        checked_number("r_max", self.r_max, "a bound above 0, such as 1.0", above=0)
        if not is_word(self.l1, "auto"):
            checked_number("l1", self.l1, "a number of at least 0, or 'auto'", least=0)
        if self.margin_cap is not None and not is_word(self.margin_cap, "auto"):
            checked_number("margin_cap", self.margin_cap, "a number above 0, 'auto' or None", above=0)
        check_solving(self.solver, self.time_limit)
        if not is_word(self.reward_on, "state", "state-action"):
            raise InvalidParameter(f"reward_on is {self.reward_on!r}: expected 'state' or 'state-action'.")
        if not is_word(self.unvisited, "avoid", "free"):
            raise InvalidParameter(f"unvisited is {self.unvisited!r}: expected 'avoid' or 'free'.")
        if self.slack is not None:
            checked_number("slack", self.slack, "a price of at least 1, or None for hard rows", least=1)
            if self.reward_on == "state-action":
                raise InvalidParameter(
                    f"slack is {self.slack!r}: expected None with reward_on='state-action', where every expert is optimal for "
                    "some reward and no row needs slack."
                )

    def learn(self, problem: Problem, rng: np.random.Generator | None = None) -> Outcome[TabularReward, FiniteProof]:
        """`fit`, of a problem: its table, and the expert's policy or what its episodes show most often. Nothing is drawn.

        Raises:
            MissingPart: one of these is not there. And whatever `fit` raises.
            InvalidDemonstrations: a reward on steps, and actions that states do not tell apart.
        """
        known = self.needs.of(problem, self)
        if self.reward_on == "state-action" and known.inferred is not None:
            known.inferred.check_apart()
        return replace(self.fit(checked_mdp(known.dynamics), known.policy, visits=known.visits), inferred=known.inferred)

    def fit(self, mdp: TabularMDP, expert: Any, *, visits: np.ndarray | None = None) -> Outcome[TabularReward, FiniteProof]:
        """Learn a reward under which the expert is optimal.

        Args:
            mdp: only states reachable from d0 get a reward; the others get 0 and are not judged.
            expert: (S,) actions, (S, A) probabilities, or (S, A) set of optimal actions. Rows of NaN say that nothing is known
                of the expert in a state, as in the tables of `irl_gym.demonstrations.demonstrated`: such a state has no row of
                (4).
            visits: (S,) how often the expert was seen in each state: what its margin and its violation count for. Where the
                expert is known everywhere and slack is None they change nothing. No state with visits is avoided.

        Raises:
            InvalidPolicy: an expert of the wrong shape or content.
            InvalidParameter: visits of the wrong shape, or 0 where the expert is known.
            DegenerateExpert: (4) leaves no reward with a positive margin anywhere.
            SolverTimeout, SolverFailed: no answer.
        """
        solving = Solving.begun(self.solver, self.time_limit)
        with within(solving.deadline):
            return self._fit(checked_mdp(mdp), expert, visits, solving)

    def _fit(
        self, mdp: TabularMDP, expert: Any, visits: np.ndarray | None, solving: Solving
    ) -> Outcome[TabularReward, FiniteProof]:
        known_expert, known = completed(expert, mdp.n_states)
        acting = mdp.reachable & ~mdp.terminal
        visits = checked_visits(visits, known & acting)
        if self.slack is not None or (acting & ~known).any():
            return PartialTask(self, mdp, known_expert, known, visits, solving).fit()
        task, y_l1 = _Task(self, mdp, known_expert, solving), None
        largest = None if self.margin_cap is None else task.uniform_margin()
        lambda_0 = task.lambda_0() if self.l1 == "auto" or self.l1 > 0 or self.report_lambda_0 else None
        l1 = JUST_BELOW * lambda_0 if self.l1 == "auto" and lambda_0 is not None else float(self.l1)
        if largest is None:
            solved, cap = programs.ng_russell(task.program(), self.r_max, l1, None), None
            y = solved.y
        else:
            cap = largest / 2 if self.margin_cap == "auto" or self.margin_cap is None else float(self.margin_cap)
            if self.margin_cap == "auto" and l1 == 0:
                solved = programs.sparsest(task.program(), self.r_max, cap)
                task.stats["l1_limit"] = task.l1_limit(solved.y)
                y, y_l1 = np.zeros_like(solved.y), solved.y
            else:
                solved, y = (result := programs.ng_russell(task.program(), self.r_max, l1, cap)), result.y
        task.record("reward", solved)
        result = task.result(solved, l1=l1, lambda_0=lambda_0, margin_cap=cap, y=y, y_l1=y_l1)
        if l1 == 0 and result.proof.objective <= NO_MARGIN * min(self.r_max, cap or np.inf):
            raise task.degenerate()
        return result

    def critical_l1(self, mdp: TabularMDP, expert: Any) -> float:
        """lambda_0: above it R = 0 is optimal (section 3.2). By one linear program, not by the paper's search.

        Raises:
            InvalidPolicy: an expert of the wrong shape or content.
            DegenerateExpert: no reward has a positive margin, so lambda_0 would be 0.
        """
        solving = Solving.begun(self.solver, self.time_limit)
        with within(solving.deadline):
            expert, known = completed(expert, mdp.n_states)
            if self.slack is not None or (mdp.reachable & ~mdp.terminal & ~known).any():
                partial = PartialTask(self, mdp, expert, known, None, solving)
                partial.settle()
                return partial.lambda_0()
            task = _Task(self, mdp, expert, solving)
            if self.margin_cap is not None:
                task.uniform_margin()
            return task.lambda_0()


def checked_finite(learner: Any) -> FiniteLP:
    """A FiniteLP as it is, for who works on its program.

    Raises:
        InvalidParameter: another learner.
    """
    if not isinstance(learner, FiniteLP):
        raise InvalidParameter(f"learner is {a_type(learner)}: expected a FiniteLP, whose program it is.")
    return learner


class _Task:
    """One fit: the reachable part of the MDP, the rows of (4), and the states that count."""

    def __init__(self, learner: FiniteLP, mdp: TabularMDP, expert: Any, solving: Solving):
        self.learner, self.mdp, self.expert, self.solving = learner, mdp, expert, solving
        mdp.mixing(expert)  # checks all states, reachable or not
        self.rows = np.flatnonzero(mdp.reachable)
        self.part = mdp.restrict(self.rows)
        self.comparisons: Comparisons = compare(self.part, np.asarray(expert)[self.rows])
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
        learner = self.learner
        return Program(self.part, self.comparisons, learner.reward_on, self.counted, self.solving)

    def record(self, name: str, solved: Solved) -> None:
        self.stats["programs"][name] = solved.answer.to_json()

    def lambda_0(self) -> float:
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
        return row_margins(self.part, self.comparisons, TabularReward(solved.R))

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
        where = "state reward" if self.learner.reward_on == "state" else "reward"
        mend = ' Use reward_on="state-action".' if self.learner.reward_on == "state" else ""
        return DegenerateExpert(
            f"equation (4) holds for this expert only with every margin 0, as for R = constant: no {where} over the "
            f"{self.rows.size} reachable states prefers its actions. Is the policy optimal for any reward at all?{mend}"
            f"{self.comparisons.caveat if self.learner.reward_on == 'state' else ''}"
        )

    def result(self, solved: Solved, **proof: Any) -> Outcome[TabularReward, FiniteProof]:
        values = np.zeros((self.mdp.n_states, *solved.R.shape[1:]))
        if np.abs(solved.R).max() > NO_MARGIN * self.learner.r_max:  # below, it is 0 and an interior point's rounding
            values[self.rows] = solved.R
        reward = TabularReward.learned(values, {"learner": "FiniteLP", "reward_on": self.learner.reward_on})
        never = self.comparisons.pairs(self.rows, np.flatnonzero(self.unbreakable))
        terms = {"r_max": self.learner.r_max, "unbreakable_rows": never, **proof}
        found = prove(self.part, self.comparisons, reward.of_rows(self.rows), self.counted, **terms)
        return Outcome(reward, Status.ZERO if found.zero else solved.answer.status, found, self.stats)
