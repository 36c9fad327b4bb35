"""FiniteLP for an expert that is known in some states only, or that errs: which programs are solved, and in which order.

The programs are those of `soft`. With a cap, rows that no reward makes strict are left out one by one (`strict_rows`): they
count towards no margin, and are priced as other rows are. The cap "auto" is half of the largest margin that the rows which
count can have at once. Where the data contradict themselves no such margin exists, and with slack the states are found first
whose rows it is best to give up: those violated when margins count up to R_max / 1000. What can be strict, and by how much, is
then asked of the others, and the rows given up return to the last program.
With l1 = 0 the reward is the limit l1 -> 0+: the least N with the margins of the best reward. That also sends states to avoid
as low as these margins allow. Axes: S states, A actions, n rows of (4).
"""

from contextlib import suppress
from typing import Any, Literal, Protocol, runtime_checkable

import numpy as np

from irl_gym.errors import DegenerateExpert, InvalidParameter, SolverInfeasible
from irl_gym.learners.base import Outcome
from irl_gym.learners.linear_programs.programs import JUST_BELOW, LARGEST_BOUND, NO_MARGIN, RewardOn
from irl_gym.learners.linear_programs.proofs.finite_proof import FiniteProof
from irl_gym.learners.linear_programs.proofs.soft_proof import Terms, prove_partly
from irl_gym.learners.linear_programs.soft import Found, PartlyKnown, SoftProgram
from irl_gym.learners.linear_programs.strict_rows import strict_rows
from irl_gym.mdp.margins import least_per_state
from irl_gym.mdp.optimality_rows import compare
from irl_gym.mdp.rewards import TabularReward
from irl_gym.mdp.tabular_mdp import TabularMDP
from irl_gym.programs.solvers import Solving, Status

GIVEN_UP_BELOW = 1e3
"""Margins down to R_max over this count when the rows are chosen that are given up."""
GIVEN_UP = 1e-6
"""A violation above this, in units of those margins, gives a state's rows up."""
LEEWAYS = (1e-8, 1e-7, 1e-6)
"""What the simplest reward may leave of the best one's margins, in their unit: without it no interior is left. The next where
the solver finds none. The proof's gap includes it."""


@runtime_checkable
class Asked(Protocol):
    """What is read of a FiniteLP, whose fields these are."""

    @property
    def r_max(self) -> float:
        """R_max, the bound on |R|."""
        ...

    @property
    def l1(self) -> float | Literal["auto"]:
        """lambda, the price of ||R||_1."""
        ...

    @property
    def margin_cap(self) -> float | Literal["auto"] | None:
        """tau, the cap on margins."""
        ...

    @property
    def reward_on(self) -> RewardOn:
        """What R is a function of."""
        ...

    @property
    def report_lambda_0(self) -> bool:
        """Is lambda_0 wanted whatever l1 is?"""
        ...

    @property
    def slack(self) -> float | None:
        """C, the price of a violation."""
        ...

    @property
    def unvisited(self) -> Literal["avoid", "free"]:
        """Which reward unknown states have."""
        ...


class PartialTask:
    """One fit.

    Args:
        learner: the hyper-parameters.
        mdp: the whole MDP.
        distribution: (S, A) the expert, anything where it is not known.
        known: (S,) states where it is known.
        visits: (S,) how often each state was visited, or None.
        solving: with which solver, and until when.

    Raises:
        DegenerateExpert: nothing to compare.
    """

    def __init__(
        self, learner: Asked, mdp: TabularMDP, distribution: Any, known: np.ndarray, visits: np.ndarray | None,
        solving: Solving,
    ):  # fmt: skip
        self.learner, self.mdp, self.solving = learner, mdp, solving
        mdp.mixing(distribution)  # checks all states
        self.rows = np.flatnonzero(mdp.reachable)
        part = mdp.restrict(self.rows)
        known = known[self.rows] & ~part.terminal
        c = compare(part, np.asarray(distribution)[self.rows], np.flatnonzero(known))
        on_states = learner.reward_on == "state"
        active = ~c.trivial if on_states else np.ones(c.states.size, dtype=bool)
        self.counted = active & ~c.equal
        self.unbreakable = np.zeros_like(active)
        if on_states and learner.margin_cap is None:
            self.counted &= ~np.isin(c.states, c.states[c.trivial & ~c.equal])
        avoided = np.zeros(part.n_states, dtype=bool)
        if learner.unvisited == "avoid" and (~known & ~part.terminal).any():
            entered = np.asarray(part.P_pi(c.distribution)[known].sum(axis=0)).ravel() + part.d0 > 0
            avoided = ~known & ~(part.terminal & entered) & (visits is None or visits[self.rows] == 0)
        if not on_states:
            avoided &= ~part.terminal  # a step ends there, and pays for itself
        weights = np.ones(part.n_states) if visits is None else visits[self.rows]
        weights = weights / weights[known].mean() if known.any() else weights
        self.partly = PartlyKnown(part, c, known, avoided, weights, active)
        self.stats: dict[str, Any] = {"programs": {}}
        if not self.counted.any():
            mend = ' Use reward_on="state-action".' if on_states else ""
            raise DegenerateExpert(
                f"none of the {known.sum()} reachable states where the expert is known compares it with an action of other "
                f"successors that it leaves out: every reward makes it optimal.{mend}{c.caveat}"
            )

    def program(self, *, soft: bool) -> SoftProgram:
        """The program, with slack or with hard rows."""
        learner = self.learner
        return SoftProgram(self.partly, learner.reward_on, self.counted, learner.slack if soft else None, self.solving)

    def fit(self) -> Outcome[TabularReward, FiniteProof]:
        """Learn the reward."""
        learner, r_max = self.learner, self.learner.r_max
        cap, need = self.settle()
        wanted = learner.l1 == "auto" or learner.l1 > 0 or learner.report_lambda_0
        lambda_0 = self.lambda_0() if wanted and (learner.l1 == "auto" or not self.partly.avoided.any()) else None
        l1 = JUST_BELOW * lambda_0 if learner.l1 == "auto" and lambda_0 is not None else float(learner.l1)
        if l1 > 0:
            unit = r_max
            found = self.recorded("reward", self.program(soft=True).best(1.0, None if cap is None else cap / r_max, l1))
            bound = found.bound * unit
        else:
            unit = r_max if cap is None else cap
            if need is None:
                best = self.recorded("margins", self.program(soft=True).best(r_max / unit, None if cap is None else 1.0, 0.0))
                bound, needs = best.bound * unit, [self._needed(best, cap, leeway) for leeway in LEEWAYS]
            else:
                counted = np.unique(self.partly.comparisons.states[self.counted])
                bound, needs = float(unit * self.partly.weights[counted].sum()), [need]
            found = self.recorded("reward", self._simplest(r_max / unit, needs))
            self.stats["price"] = -found.objective * unit
            self.stats["least_price"] = -found.bound * unit
        return self._result(found, unit, bound, Terms(r_max, l1, cap, learner.slack, self.counted, self.unbreakable), lambda_0)

    def _simplest(self, bound: float, needs: list[np.ndarray]) -> Found:
        """The simplest reward with what the rows need: the first of `needs` (n,) that the solver can meet."""
        for need in needs[:-1]:
            with suppress(SolverInfeasible):
                return self._simplest(bound, [need])
        soft = self.learner.slack is not None and bool((needs[-1] < 0).any())
        return self.program(soft=soft).simplest(bound, needs[-1])

    def recorded(self, name: str, found: Found) -> Found:
        """Note what the solver did."""
        self.stats["programs"][name] = found.answer.to_json()
        return found

    def lambda_0(self) -> float:
        """The l1 above which R = 0 is optimal.

        Raises:
            InvalidParameter: states to avoid, where R = 0 is never optimal.
            DegenerateExpert: no reward has a positive margin.
        """
        count = int(self.partly.avoided.sum())
        if count:
            raise InvalidParameter(
                f"lambda_0 was asked for, but {count} reachable states are to be avoided, where R = 0 has a price: expected "
                'unvisited="free", or l1 as a number.'
            )
        found = self.recorded("lambda_0", self.program(soft=True).best(1.0, None, 0.0, norm=1.0))
        if found.objective <= NO_MARGIN:
            raise self.degenerate()
        return found.objective

    def settle(self) -> tuple[float | None, np.ndarray | None]:
        """The cap, and what `cap` says that the rows need; leaves in `counted` the rows that count.

        Raises:
            DegenerateExpert: the cap is "auto", and no row can be strict.
        """
        if self.learner.margin_cap == "auto":
            return self.cap()
        if self.learner.margin_cap is not None:
            with suppress(DegenerateExpert):  # no row can be strict where slack buys nothing: then none is left out
                self.cap()
        return self.learner.margin_cap, None

    def cap(self) -> tuple[float, np.ndarray | None]:
        """Half of the largest uniform margin, and what the rows need where no row has to be given up, in units of the cap."""
        c, hard = self.partly.comparisons, self.program(soft=False)
        need = np.where(self.counted, 1.0, 0.0)
        given_up = np.zeros(c.states.size, dtype=bool)
        bound = self._uniform(hard, need)
        if bound is None and self.learner.slack is not None:
            tried = self.program(soft=True).best(GIVEN_UP_BELOW, 1.0, 0.0)
            least = self._least(self.recorded("given up", tried), self.partly.active)
            given_up = np.isin(c.states, np.flatnonzero(least < -GIVEN_UP))
            need[given_up] = np.nan
            hard = self._without(given_up)
            bound = self._uniform(hard, need) if hard.counted.any() else None
        if bound is None:
            if not hard.counted.any():
                raise self.degenerate()
            served = strict_rows(c.states, hard.counted, lambda rows: self._serve(given_up, rows))
            if not served.any():
                raise self.degenerate()
            unbreakable = hard.counted & ~served
            self.stats["rows_without_margin"] = int(unbreakable.sum())
            need[unbreakable] = 0.0
            self.counted, self.unbreakable = self.counted & ~unbreakable, unbreakable
            rounds = self.partly.mdp.n_actions
            bound = self._uniform(hard, need, (2 * rounds + 1) * LARGEST_BOUND)
            if bound is None:
                raise self.degenerate()
        self.stats["uniform_margin"] = self.learner.r_max / bound
        self.stats["states_given_up"] = int(np.unique(c.states[given_up]).size)
        return self.learner.r_max / bound / 2, None if given_up.any() else need

    def _serve(self, given_up: np.ndarray, rows: np.ndarray) -> np.ndarray:
        program = self._without(given_up, rows)
        return self._margins(self.recorded("attainable", program.best(LARGEST_BOUND, 1.0, 0.0)))

    def _without(self, given_up: np.ndarray, counted: np.ndarray | None = None) -> SoftProgram:
        """The hard program in which the expert is not known where its rows were given up."""
        full, c = self.partly, self.partly.comparisons
        known = full.known.copy()
        known[c.states[given_up]] = False
        partly = PartlyKnown(full.mdp, c, known, full.avoided, full.weights, full.active & ~given_up)
        counted = self.counted & ~given_up if counted is None else counted
        return SoftProgram(partly, self.learner.reward_on, counted, None, self.solving)

    def _uniform(self, program: SoftProgram, need: np.ndarray, largest: float = LARGEST_BOUND) -> float | None:
        try:
            bound = -self.recorded("uniform margin", program.least_bound(need)).objective
        except SolverInfeasible:
            return None
        return bound if 0 < bound < largest else None

    def _least(self, found: Found, rows: np.ndarray) -> np.ndarray:
        """(S,) the smallest margin of some rows; NaN where there is none."""
        return least_per_state(self._margins(found)[rows], self.partly.comparisons.states[rows], self.partly.mdp.n_states)

    def _margins(self, found: Found) -> np.ndarray:
        """(n,) of all rows, from V and R as solved."""
        mdp, c = self.partly.mdp, self.partly.comparisons
        if self.learner.reward_on == "state":
            return c.rows @ found.V
        stacked = c.states * mdp.n_actions + c.actions
        return found.V[c.states] - found.R.ravel()[stacked] - mdp.gamma * (mdp.P[stacked] @ found.V)

    def _needed(self, best: Found, cap: float | None, leeway: float) -> np.ndarray:
        """(n,) what each row needs so that no state has less than under the best reward, in units of the cap or R_max.

        Rows that count and rows that do not are apart, as in the program: each kind has its own violation.
        """
        c, others = self.partly.comparisons, self.partly.active & ~self.counted
        least = np.minimum(self._least(best, others)[c.states], 0.0)
        counted = np.minimum(self._least(best, self.counted)[c.states], np.inf if cap is None else 1.0)
        kept = np.where(counted > -leeway, np.maximum(counted - leeway, 0.0), counted)
        need = np.where(self.counted, kept, least)
        short = need < -leeway
        need[short] -= leeway / (self.learner.slack or 1.0)  # a violation costs C
        need[~short & (need < 0)] = 0.0
        return np.where(self.partly.active, need, np.nan)

    def degenerate(self) -> DegenerateExpert:
        """Why there is nothing to learn."""
        where = "state reward" if self.learner.reward_on == "state" else "reward"
        mend = ' Use reward_on="state-action".' if self.learner.reward_on == "state" else ""
        return DegenerateExpert(
            f"equation (4) holds for this expert only with every margin 0, as for R = constant: no {where} prefers its actions "
            f"in any of the {self.partly.known.sum()} reachable states where it is known. More demonstrations may tell.{mend}"
        )

    def _result(
        self, found: Found, unit: float, bound: float, terms: Terms, lambda_0: float | None
    ) -> Outcome[TabularReward, FiniteProof]:
        learner = self.learner
        values = np.zeros((self.mdp.n_states, *found.R.shape[1:]))
        if np.abs(found.R).max() * unit > NO_MARGIN * learner.r_max:
            values[self.rows] = np.clip(found.R * unit, -learner.r_max, learner.r_max)
        note = {"learner": "FiniteLP", "reward_on": learner.reward_on, "unvisited": learner.unvisited}
        reward = TabularReward.learned(values, note)
        proof = prove_partly(self.partly, self.rows, reward, terms, bound=bound, lambda_0=lambda_0)
        if terms.l1 == 0 and proof.objective <= NO_MARGIN * min(learner.r_max, terms.cap or np.inf):
            raise self.degenerate()
        return Outcome(reward, Status.ZERO if proof.zero else found.answer.status, proof, self.stats)
