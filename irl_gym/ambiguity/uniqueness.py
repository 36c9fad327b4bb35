"""Is the learned reward the only optimum? The face of all optima of `FiniteLP`'s program, and how wide it is in each state.

    the paper's program, and with a cap     maximise sum_s t_s - l1 ||R||_1
    the cap's limit l1 -> 0                 minimise ||R||_1 subject to margins >= tau
One optimum is found, with the prices (duals) of all rows and bounds. By complementary slackness every optimum keeps each row
and bound that has a price where it is, and every feasible point that keeps them is an optimum: they are fixed there, and what
is left is the face. A price below `tolerance` is none, so all rewards counted as optimal are within tolerance, times what the
rows and bounds leave, of the optimum. Then R(s) is made least and largest over the face.

    unknowns     states: V (S,), R = (I - gamma P_pi) V;      steps: V (S,) and R (S, A), each R(s, a) = V(s) - gamma P_sa V
                 for actions that the expert takes
                 t (m,), R+ >= R, 0: as in `learners.programs`
Axes: S states, A actions, n rows of (4), m states with a margin.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp

from irl_gym._typing import Indices, Sparse
from irl_gym.ambiguity.extremes import Polytope, extremes
from irl_gym.ambiguity.feasible import Posed, jsonable, over_all_states, pose
from irl_gym.ambiguity.widths import served_states
from irl_gym.checks import checked_number
from irl_gym.errors import DegenerateExpert, InvalidParameter
from irl_gym.learners.finite import FiniteLP
from irl_gym.learners.programs import JUST_BELOW, RewardOn, picking
from irl_gym.mdp import TabularMDP
from irl_gym.warm_lp import Vertex

SAME = 1e-6
"""Widths up to this, in units of R_max, are the solver's rounding."""


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
        return self.high - self.low

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
        tolerance: a row or bound whose price in the objective is below this may be left.
        workers: processes, as in `feasible_widths`.

    Raises:
        InvalidMDP, InvalidPolicy: not a TabularMDP, or an expert of the wrong shape or content.
        InvalidParameter: a learner with slack, an expert that is not known everywhere (their programs say R = min over actions,
            so their optima are no face), or a tolerance not above 0.
        DegenerateExpert: no reward has a margin.
        SolverTimeout, SolverFailed: no answer.
    """
    learner = FiniteLP() if learner is None else learner
    if not isinstance(learner, FiniteLP):
        raise InvalidParameter(f"learner is a {type(learner).__name__}: expected a FiniteLP, whose program has the face.")
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
    sparsest = learner.margin_cap == "auto" and l1 == 0
    r_max = learner.r_max
    program = _Priced(posed, learner.reward_on, counted)
    if sparsest:
        polytope, cost = program.sparsest(cap / r_max if cap else 0.0)
    else:
        polytope, cost = program.best(l1, None if cap is None else cap / r_max)
    vertex = polytope.program(learner.time_limit).minimise(cost)
    face = _kept(polytope, vertex, tolerance)
    least, most = extremes(face, program.rewards(), workers=workers, time_limit=learner.time_limit)
    low, high = (over_all_states(posed, mdp, program.shaped(values) * r_max) for values in (least, np.maximum(least, most)))
    objective = r_max * (vertex.objective if sparsest else -vertex.objective)
    return Face(low, high, objective, sparsest, r_max, l1, cap)


def _settled(mdp: TabularMDP, expert: Any, learner: FiniteLP, posed: Posed) -> tuple[float, float | None, np.ndarray]:
    """What the learner settles on: l1, the cap, and (n,) the rows that count towards margins."""
    counted, c = posed.movable(learner.reward_on == "state"), posed.comparisons
    if learner.margin_cap is None and learner.reward_on == "state":
        counted = counted & ~np.isin(c.states, c.states[c.trivial & ~c.equal])
    if not counted.any():
        learner.fit(mdp, expert)  # says why
        raise DegenerateExpert("no state compares the expert with another action: every reward makes it optimal.")
    l1 = JUST_BELOW * learner.critical_l1(mdp, expert) if learner.l1 == "auto" else float(learner.l1)
    cap = learner.margin_cap
    if cap == "auto":
        served, cap = served_states(learner, mdp, expert)
        counted = counted & np.isin(posed.rows, served)[c.states]
    return l1, cap, counted


class _Priced:
    """The programs in units of R_max. The unknowns by block: V, R of steps, t, R+."""

    def __init__(self, posed: Posed, on: RewardOn, counted: np.ndarray):
        part, c = posed.part, posed.comparisons
        S, A = part.n_states, part.n_actions
        self.on_states, self.shape = on == "state", (S,) if on == "state" else (S, A)
        self.ended = np.repeat(part.terminal, A)
        self.counted, self.equal, self.taken = counted, c.equal, posed.taken.ravel()
        self.position = np.unique(c.states[counted], return_inverse=True)[1]
        self.n_margins = int(self.position.max()) + 1
        self.largest_value = 1 / (1 - part.gamma)
        if self.on_states:
            self.R: Sparse = sp.csr_array(sp.eye_array(S) - part.gamma * part.P_pi(c.distribution))
            self.margins: Sparse = c.rows
            self.ties: Sparse = sp.csr_array((0, S))
        else:
            pairs = np.arange(S * A)
            worth = picking(pairs // A, S) - part.gamma * part.P
            losing = sp.csr_array(sp.hstack([worth, -sp.eye_array(S * A)]))  # zeta of each pair
            self.R = sp.csr_array(sp.hstack([sp.csr_array((S * A, S)), sp.eye_array(S * A)]))
            self.margins = losing[c.states * A + c.actions]
            self.ties = losing[np.flatnonzero(self.taken)]
        self.columns = self.R.shape[1]
        self.value = np.full(self.columns, self.largest_value)
        if not self.on_states:
            self.value = np.concatenate([np.where(part.terminal, 0.0, self.largest_value), np.where(self.ended, 0.0, 1.0)])

    def rewards(self) -> Sparse:
        """(k, n) R as functions of the unknowns; of steps where one is taken."""
        chosen = self.R if self.on_states else self.R[np.flatnonzero(~self.ended)]
        return sp.csr_array(sp.hstack([chosen, sp.csr_array((chosen.shape[0], self.unknowns - self.columns))]))

    def shaped(self, values: np.ndarray) -> np.ndarray:
        """(S,) or (S, A)."""
        if self.on_states:
            return values
        found = np.full(self.ended.size, np.nan)
        found[~self.ended] = values
        return found.reshape(self.shape)

    def best(self, l1: float, cap: float | None) -> tuple[Polytope, np.ndarray]:
        """Maximise sum(t) - l1 ||R||_1, 0 <= t (<= cap)."""
        return self._program(0.0, l1, gains=True, cap=cap)

    def sparsest(self, margin: float) -> tuple[Polytope, np.ndarray]:
        """Minimise ||R||_1 with margins of at least `margin`."""
        return self._program(margin, 1.0, gains=False, cap=None)

    def _program(self, margin: float, l1: float, *, gains: bool, cap: float | None) -> tuple[Polytope, np.ndarray]:
        k, n = self.R.shape[0], self.counted.size
        m, p = self.n_margins if gains else 0, k if l1 > 0 else 0
        self.unknowns = self.columns + m + p
        less = sp.lil_array((n, m))
        if gains:
            less[np.flatnonzero(self.counted), self.position] = -1.0
        blocks: list[list[Any]] = [
            [self.R, sp.csr_array((k, m)), sp.csr_array((k, p))],
            [self.margins, less, sp.csr_array((n, p))],
            [self.ties, sp.csr_array((self.ties.shape[0], m)), sp.csr_array((self.ties.shape[0], p))],
            [-self.R[:p], sp.csr_array((p, m)), sp.eye_array(p)],
        ]
        A = sp.csr_array(sp.vstack([sp.hstack(row) for row in blocks]))
        tied = np.zeros(self.ties.shape[0])
        polytope = Polytope(
            A,
            np.concatenate([np.full(k, -1.0), np.where(self.counted, margin, 0.0), tied, np.zeros(p)]),
            np.concatenate([np.ones(k), np.where(self.equal, 0.0, np.inf), tied, np.full(p, np.inf)]),
            np.concatenate([-self.value, np.zeros(m + p)]),
            np.concatenate([self.value, np.full(m, np.inf if cap is None else cap), np.ones(p)]),
        )
        cost = np.concatenate([-l1 * np.asarray(self.R.sum(axis=0)).ravel(), np.full(m, -1.0), np.full(p, 2 * l1)])
        return polytope, cost


def _kept(polytope: Polytope, vertex: Vertex, tolerance: float) -> Polytope:
    """The polytope with each row and bound that has a price fixed where it is."""
    rows = _fixed(polytope.low, polytope.high, polytope.A @ vertex.x, np.abs(vertex.row_duals) > tolerance)
    unknowns = _fixed(polytope.least, polytope.most, vertex.x, np.abs(vertex.reduced_costs) > tolerance)
    return Polytope(polytope.A, *rows, *unknowns)


def _fixed(low: np.ndarray, high: np.ndarray, at: np.ndarray, priced: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The bounds, both at the nearer one where it has a price."""
    nearer = np.where(np.abs(at - low) <= np.abs(at - high), low, high)
    return np.where(priced, nearer, low), np.where(priced, nearer, high)
