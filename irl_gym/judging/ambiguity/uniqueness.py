"""Is the learned reward the only optimum? The face of all optima of `FiniteLP`'s program, and how wide it is in each state.

    the paper's program, and with a cap     maximise sum_s t_s - l1 ||R||_1
    the cap's limit l1 -> 0                 minimise ||R||_1 subject to margins >= tau
One optimum is found, with the prices (duals) of all rows and bounds. By complementary slackness every optimum keeps each row
and bound that has a price where it is, and every feasible point that keeps them is an optimum: they are fixed there, and what
is left is the face. A price below `tolerance` is none, so all rewards counted as optimal are within tolerance, times what the
rows and bounds leave, of the optimum. Then R(s) is made least and largest over the face.

The unknowns and constraints are those of `PricedRewards`, in units of R_max. Axes: S states, A actions, n rows of (4).
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from irl_gym._typing import Indices
from irl_gym.checks import checked_number
from irl_gym.errors import DegenerateExpert, InvalidParameter
from irl_gym.judging.ambiguity.extremes import Polytope, extremes
from irl_gym.judging.ambiguity.feasible import Posed, jsonable, over_all_states, pose
from irl_gym.judging.ambiguity.priced_rewards import PricedRewards
from irl_gym.judging.ambiguity.widths import served_actions
from irl_gym.learners.linear_programs.finite import FiniteLP, checked_finite
from irl_gym.learners.linear_programs.programs import JUST_BELOW
from irl_gym.mdp.tabular_mdp import TabularMDP
from irl_gym.programs.deadline import Deadline
from irl_gym.programs.warm_lp import Vertex

SAME = 1e-6
"""Widths up to this, in units of R_max, are the solver's rounding."""


LEAST_L1 = 1e-8
"""Prices of the norm below this are lost in the solver's tolerance."""


@dataclass(frozen=True, eq=False)
class Face:
    """All optima of a program: the least and the largest reward of each state among them."""

    low: np.ndarray
    """(S,) or (S, A); NaN in states never reached, and of steps in terminal states."""
    high: np.ndarray
    """(S,) or (S, A)."""
    objective: float
    """The program's optimum: sum of margins less l1 ||R||_1; or the least ||R||_1 where `sparsest`."""
    sparsest: bool
    """Is the program that of the least ||R||_1 with all margins at the cap?"""
    r_max: float
    """The bound on |R|."""
    l1: float
    """lambda."""
    margin_cap: float | None
    """tau; None in the paper's program."""

    @property
    def width(self) -> np.ndarray:
        """(S,) or (S, A) high - low: 0 where all optima agree."""
        return self.high - self.low + 0.0  # not -0

    @property
    def unique(self) -> bool:
        """Is there one optimum only?"""
        return not self.differing.size

    @property
    def differing(self) -> Indices:
        """States in which two optima differ, by more than the solver's rounding."""
        differs = np.nan_to_num(self.width) > SAME * self.r_max
        return np.flatnonzero(differs if differs.ndim == 1 else differs.any(axis=1))

    def __str__(self) -> str:
        """The finding in a sentence."""
        if self.unique:
            return "The optimum is unique: no other reward is as good."
        states = self.differing
        shown = ", ".join(map(str, states[:8])) + (", ..." if states.size > 8 else "")
        return (
            f"The optimum is not unique: rewards that are as good differ in {states.size} states ({shown}), by up to "
            f"{np.nanmax(self.width):.3g}."
        )

    def to_json(self) -> dict[str, Any]:
        """As json holds it: NaN becomes None."""
        found = {name: jsonable(getattr(self, name)) for name in self.__dataclass_fields__}
        return found | {"width": jsonable(self.width), "unique": self.unique, "differing": self.differing.tolist()}


def optimal_face(
    mdp: TabularMDP,
    expert: Any,
    learner: FiniteLP | None = None,
    *,
    tolerance: float = 1e-7,
    workers: int = 1,
) -> Face:
    """All rewards that are as good as the one that a learner finds.

    Args:
        mdp: only states reachable from d0 have a reward.
        expert: (S,) actions, (S, A) probabilities or (S, A) set, known in every reachable state.
        learner: whose program it is; the default is `FiniteLP()`.
        tolerance: a row or bound whose price in the objective is below this may be left. Of a program with a small price on the
            norm, a tenth of that, if it is less.
        workers: processes, as in `feasible_widths`.

    Raises:
        InvalidMDP, InvalidPolicy: not a TabularMDP, or an expert of the wrong shape or content.
        InvalidParameter: a learner with slack, an expert that is not known everywhere (their programs say R = min over actions,
            so their optima are no face), a price on the norm below 1e-8, or a tolerance not above 0.
        DegenerateExpert: no reward has a margin.
        SolverTimeout, SolverFailed: no answer.
    """
    learner = FiniteLP() if learner is None else checked_finite(learner)
    tolerance = checked_number("tolerance", tolerance, "a price above 0, such as 1e-7", above=0)
    if learner.slack is not None:
        raise InvalidParameter(f"slack is {learner.slack!r}: expected None, where the rows of (4) are hard.")
    posed = pose(mdp, expert)
    if not posed.known.all():
        states = posed.rows[~posed.known]
        raise InvalidParameter(
            f"nothing is known of the expert in {states.size} reachable states, such as {states[0]}: expected actions in each. "
            "`feasible_widths` takes such an expert."
        )
    l1, cap, counted = _settled(mdp, expert, learner, posed)
    if 0 < l1 < LEAST_L1:
        raise InvalidParameter(f"l1 is {l1:g}: expected 0 or at least {LEAST_L1:g}; a smaller price is the solver's rounding.")
    tolerance = min(tolerance, l1 / 10) if l1 > 0 else tolerance
    sparsest = bool(learner.margin_cap == "auto" and l1 == 0)
    r_max, top = learner.r_max, np.inf if cap is None else cap / learner.r_max
    program = PricedRewards(posed.part, posed.comparisons, on_states=learner.reward_on == "state", counted=counted)
    polytope = program.polytope(1.0, top if sparsest else 0.0, top)
    deadline = Deadline.after(learner.time_limit)
    vertex = polytope.program(deadline).minimise(program.cost(0.0, 1.0) if sparsest else program.cost(1.0, l1))
    asked = np.flatnonzero(polytope.most[-program.size :] > 0)  # no step is taken in a terminal state
    face = _kept(polytope, vertex, tolerance)
    least, most = extremes(face, program.picked[asked], workers=workers, deadline=deadline)
    low, high = (np.full(program.size, np.nan) for _ in range(2))
    low[asked], high[asked] = r_max * least, r_max * np.maximum(least, most)
    shape = (-1,) if program.on_states else (-1, mdp.n_actions)
    low, high = (over_all_states(posed, mdp, values.reshape(shape)) for values in (low, high))
    objective = r_max * (vertex.objective if sparsest else -vertex.objective)
    return Face(low, high, objective, sparsest, float(r_max), l1, None if cap is None else float(cap))


def _settled(mdp: TabularMDP, expert: Any, learner: FiniteLP, posed: Posed) -> tuple[float, float | None, np.ndarray]:
    """What the learner settles on: l1, the cap, and (n,) the rows that count towards margins."""
    counted, c = posed.movable(learner.reward_on == "state"), posed.comparisons
    if learner.margin_cap is None and learner.reward_on == "state":
        counted = counted & ~np.isin(c.states, c.states[c.trivial & ~c.equal])
    if not counted.any():
        learner.fit(mdp, expert)  # says why
        raise DegenerateExpert("no state compares the expert with another action: every reward makes it optimal.")
    l1 = JUST_BELOW * learner.critical_l1(mdp, expert) if learner.l1 == "auto" else float(learner.l1)
    if learner.margin_cap is None:
        return l1, None, counted
    served, cap = served_actions(learner, mdp, expert)
    counted = counted & served[posed.rows[c.states], c.actions]
    return l1, cap if learner.margin_cap == "auto" else learner.margin_cap, counted


def _kept(polytope: Polytope, vertex: Vertex, tolerance: float) -> Polytope:
    """The polytope with each row and bound that has a price fixed where it is."""
    rows = _fixed(polytope.low, polytope.high, polytope.A @ vertex.x, np.abs(vertex.row_duals) > tolerance)
    unknowns = _fixed(polytope.least, polytope.most, vertex.x, np.abs(vertex.reduced_costs) > tolerance)
    return Polytope(polytope.A, *rows, *unknowns)


def _fixed(low: np.ndarray, high: np.ndarray, at: np.ndarray, priced: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The bounds, both at the nearer one where it has a price."""
    nearer = np.where(np.abs(at - low) <= np.abs(at - high), low, high)
    return np.where(priced, nearer, low), np.where(priced, nearer, high)
