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
`horizon=H`  sums of H steps, undiscounted, for an expert that is known at each time (`finite_within`): one reward R(s) for all
    times, or R_h(s).
`slack=C`  a violation of (4) costs C, where a margin is worth 1, both in proportion to `visits`. With C large the rows are hard
    again wherever they can hold. `irl_gym.certify` lists the rows that are violated.
    Actions that the expert takes too, when it takes several, have to be as good: what violates that costs C as well, and adds
    nothing to a margin.
Axes: S states, A actions.
"""

from dataclasses import dataclass, replace
from typing import Any, ClassVar, Literal

import numpy as np

from irl_gym.checks import checked_flag, checked_number, is_word
from irl_gym.errors import InvalidParameter, a_type
from irl_gym.learners.base import Outcome
from irl_gym.learners.linear_programs import programs
from irl_gym.learners.linear_programs.finite_task import FiniteTask
from irl_gym.learners.linear_programs.finite_within import Within, not_known
from irl_gym.learners.linear_programs.partial import PartialTask
from irl_gym.learners.linear_programs.programs import (
    JUST_BELOW,
    NO_MARGIN,
    RewardOn,
    checked_visits,
)
from irl_gym.learners.linear_programs.proofs.finite_proof import FiniteProof
from irl_gym.learners.needs import Needs
from irl_gym.learners.problem import Problem
from irl_gym.mdp.policies import completed
from irl_gym.mdp.rewards import TabularReward
from irl_gym.mdp.tabular_mdp import TabularMDP, TransitionTable, checked_horizon, checked_mdp
from irl_gym.mdp.time_expanded import Repeated
from irl_gym.programs.killable import within
from irl_gym.programs.solvers import SolverName, Solving, check_solving
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
    horizon: int | None = None
    """H, steps of an episode, whose sums are undiscounted whatever gamma is (lecture notes, section 1.1); None for discounted
    sums without end."""
    stationary: bool = True
    """With a horizon: one reward for all times. False: R_h(s), on the rows of `irl_gym.mdp.time_expanded`."""
    needs: ClassVar[Needs] = Needs(("dynamics", "expert or demonstrations"), actions="inferred")
    """The parts of a problem that `learn` reads."""

    @property
    def of_feasible_set(self) -> bool:
        """Is the reward one of those that `irl_gym.judging.ambiguity` describes, by how far they reach and how they depend on
        lambda? These are of discounted sums.
        """
        return self.horizon is None

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
        checked_flag("stationary", self.stationary)
        if self.horizon is not None:
            checked_horizon(self.horizon)
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
        if self.horizon is not None and not self.stationary:
            raise InvalidParameter(
                "stationary is False, and the reward would have another number of states than the problem: expected True. Call "
                "`FiniteLP.fit`; or have the time shown, with `gymnasium.wrappers.TimeAwareObservation(env)` and horizon=None."
            )
        if self.reward_on == "state-action" and known.inferred is not None:
            known.inferred.check_apart()
        return replace(self.fit(checked_mdp(known.dynamics), known.policy, visits=known.visits), inferred=known.inferred)

    def fit(
        self, mdp: TabularMDP | TransitionTable, expert: Any, *, visits: np.ndarray | None = None
    ) -> Outcome[TabularReward, FiniteProof]:
        """Learn a reward under which the expert is optimal.

        Args:
            mdp: only states reachable from d0 get a reward; the others get 0 and are not judged. With a horizon any
                TransitionTable, whose discount is not taken.
            expert: (S,) actions, (S, A) probabilities, or (S, A) set of optimal actions; with a horizon also (H, S) or
                (H, S, A), which depend on the time. Rows of NaN say that nothing is known of the expert in a state, as in the
                tables of `irl_gym.demonstrations.demonstrated`: such a state has no row of (4).
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
            if self.horizon is None:
                return self._fit(checked_mdp(mdp), expert, visits, solving)
            posed = Within(mdp, expert, visits, self.horizon)
            if not self.stationary:
                return self._fit(posed.mdp, posed.expert, posed.visits, solving)
            return posed.told(self._fit(posed.mdp, posed.expert, posed.visits, solving, posed.tie(self.reward_on)))

    def _fit(
        self, mdp: TabularMDP, expert: Any, visits: np.ndarray | None, solving: Solving, tie: Repeated | None = None
    ) -> Outcome[TabularReward, FiniteProof]:
        known_expert, known = completed(expert, mdp.n_states)
        acting = mdp.reachable & ~mdp.terminal
        visits = checked_visits(visits, known & acting)
        if self.slack is not None or (acting & ~known).any():
            if tie is not None:
                raise not_known()
            return PartialTask(self, mdp, known_expert, known, visits, solving).fit()
        task, y_l1 = FiniteTask(self, mdp, known_expert, solving, tie), None
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
            tie = None
            if self.horizon is not None:
                posed = Within(mdp, expert, None, self.horizon)
                mdp, expert, tie = posed.mdp, posed.expert, posed.tie(self.reward_on) if self.stationary else None
            expert, known = completed(expert, mdp.n_states)
            if self.slack is not None or (mdp.reachable & ~mdp.terminal & ~known).any():
                if tie is not None:
                    raise not_known()
                partial = PartialTask(self, mdp, expert, known, None, solving)
                partial.settle()
                return partial.lambda_0()
            task = FiniteTask(self, mdp, expert, solving, tie)
            if self.margin_cap is not None:
                task.uniform_margin()
            return task.lambda_0()


def checked_finite(learner: Any) -> FiniteLP:
    """A FiniteLP as it is, for who works on its program of discounted sums.

    Raises:
        InvalidParameter: another learner, or one with a horizon.
    """
    if not isinstance(learner, FiniteLP):
        raise InvalidParameter(f"learner is {a_type(learner)}: expected a FiniteLP, whose program it is.")
    if learner.horizon is not None:
        raise InvalidParameter(f"learner has the horizon {learner.horizon}: expected None, as in the program that is asked of.")
    return learner
