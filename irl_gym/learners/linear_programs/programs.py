"""The linear programs of Ng & Russell (2000), section 3.2, in V-form, written with cvxpy.

Take V as the unknown and the reward as an expression of it; every row is then as sparse as P, and no inverse is formed.

    unknowns     V (S,)          value of the expert's policy, equation (5)
                 R               states: R = (I - gamma P_pi) V, an expression; steps: R (S*A,) with V = R_pi + gamma P_pi V
                 t (m,) >= 0     margin of each state that can have one
                 R+ >= R, 0      positive part: ||R||_1 = sum(2 R+ - R)
    margins      states: (P_pi(s) - P_a(s)) V          steps: V(s) - R(s, a) - gamma P_a(s) V
    constraint   (4): margins >= 0, and = 0 for actions that the expert takes too
Axes: S states, A actions, n rows of (4), m states with a margin.
"""

from dataclasses import dataclass
from typing import Any, Literal

import cvxpy as cp
import numpy as np
import scipy.sparse as sp

from irl_gym.checks import float_array
from irl_gym.errors import InvalidParameter
from irl_gym.mdp.optimality_rows import Comparisons
from irl_gym.mdp.tabular_mdp import TabularMDP
from irl_gym.mdp.time_expanded import Repeated
from irl_gym.programs.solvers import Answer, Solving, solve

RewardOn = Literal["state", "state-action"]
JUST_BELOW = 1 - 1e-3
"""`l1="auto"` is lambda_0 times this."""
NO_MARGIN = 1e-9
"""A margin below this, relative to R_max, is none: it is the solvers' rounding."""
LARGEST_BOUND = 1e6
"""A margin below R_max over this is none: such a row is left out of the uniform margin."""


@dataclass(frozen=True, eq=False)
class Solved:
    """A solved program: the reward, the duals of (4) and of the margins, and how the solver did."""

    R: np.ndarray
    """(S,) or (S, A); of a tie its k numbers."""
    y: np.ndarray
    """(n,) dual of each row of (4), >= 0 where the row is an inequality."""
    answer: Answer


class Program:
    """The unknowns and expressions that the programs below share, for one MDP and expert.

    Args:
        mdp: every state in it gets a reward; restrict it to the reachable ones first.
        comparisons: the rows of (4).
        reward_on: what the reward is a function of.
        rows: (n,) booleans, the rows that count towards margins; their states are those with a margin.
        solving: with which solver, and until when.
        tie: of a reward that is the same in several rows; None where each has its own.
    """

    def __init__(
        self, mdp: TabularMDP, comparisons: Comparisons, reward_on: RewardOn, rows: np.ndarray, solving: Solving,
        tie: Repeated | None = None,
    ):  # fmt: skip
        self.shape = (mdp.n_states,) if reward_on == "state" else (mdp.n_states, mdp.n_actions)
        if tie is not None:
            self.shape = tie.used.shape
        told = None if tie is None else cp.Variable(tie.used.size)
        self.solving = solving
        self.equal = comparisons.equal
        self.counted = rows
        self.states, self._position = np.unique(comparisons.states[rows], return_inverse=True)
        V = cp.Variable(mdp.n_states)
        P_pi = mdp.P_pi(comparisons.distribution)
        closing = sp.csr_array(sp.eye_array(mdp.n_states) - mdp.gamma * P_pi)
        self.constraints: list[Any] = []
        if reward_on == "state":
            self.R: Any = closing @ V  # (5)
            if tie is not None:
                self.constraints += [self.R == tie.at @ told]
            self.margins = comparisons.rows @ V  # (4)
        else:
            self.R = cp.Variable(mdp.n_states * mdp.n_actions) if tie is None else tie.at @ told
            unit = mdp.effective_horizon  # weighs (5), so that its residual is not multiplied by this in V
            here_R = sp.csr_array(unit * mdp.mixing(comparisons.distribution))
            self.constraints += [sp.csr_array(unit * closing) @ V == here_R @ self.R]  # (5) on steps
            stacked = comparisons.states * mdp.n_actions + comparisons.actions
            here = picking(comparisons.states, mdp.n_states)
            pair = picking(stacked, mdp.n_states * mdp.n_actions)
            self.margins = sp.csr_array(here - mdp.gamma * mdp.P[stacked]) @ V - pair @ self.R
            ended = np.repeat(mdp.terminal, mdp.n_actions)
            if ended.any() and tie is None:
                self.constraints += [self.R[np.flatnonzero(ended)] == 0]
        if tie is not None:
            self.R = told

    @property
    def n_margins(self) -> int:
        """Number m of states that count."""
        return self.states.size

    def l1(self) -> Any:
        """||R||_1 by its positive part; adds R+ >= R and R+ >= 0 to the constraints."""
        positive = cp.Variable(self.R.shape[0], nonneg=True)
        self.constraints += [positive >= self.R]
        return 2 * cp.sum(positive) - cp.sum(self.R)

    def bounded(self, bound: float | cp.Expression) -> None:
        """Add |R| <= bound."""
        self.constraints += [self.R <= bound, self.R >= -bound]

    def solve(self, objective: cp.Maximize | cp.Minimize, margin: cp.Expression | float) -> Solved:
        """Optimise subject to (4), with `margin` (m,) below the margins of the rows that count."""
        vector = margin if isinstance(margin, cp.Expression) else cp.Constant(np.full(self.n_margins, margin))
        groups = [
            (self.counted, picking(self._position, self.n_margins) @ vector),
            (~self.counted & ~self.equal, None),
        ]
        rows: list[tuple[np.ndarray, Any]] = []
        for mask, least in groups:
            if mask.any():
                chosen = self.margins[np.flatnonzero(mask)]
                rows.append((mask, chosen >= (0 if least is None else least)))
        if self.equal.any():
            rows.append((self.equal, self.margins[np.flatnonzero(self.equal)] == 0))
        constraints = [*self.constraints, *(row for _, row in rows)]
        problem = cp.Problem(objective, constraints)
        size = sum(constraint.size for constraint in constraints)
        answer = solve(problem, rows=size, solving=self.solving)
        y = np.zeros(self.counted.size)
        for mask, row in rows:
            y[mask] = np.asarray(row.dual_value).ravel()
        return Solved(np.asarray(self.R.value).reshape(self.shape), y, answer)


def picking(columns: np.ndarray, width: int) -> sp.csr_array:
    """The (n, width) matrix that picks `columns`."""
    n = columns.size
    return sp.csr_array((np.ones(n), columns, np.arange(n + 1)), shape=(n, width))


def ng_russell(program: Program, r_max: float, l1: float, cap: float | None) -> Solved:
    """The LP of section 3.2: maximise sum(t) - l1 ||R||_1, 0 <= t (<= cap), subject to (4) and |R| <= R_max.

    Solved in units of R_max, in which it is homogeneous; the duals are the same.
    """
    t = cp.Variable(program.n_margins, nonneg=True)
    objective = cp.sum(t)
    if l1 > 0:
        objective = objective - l1 * program.l1()
    if cap is not None:
        program.constraints += [t <= cap / r_max]
    program.bounded(1.0)
    solved = program.solve(cp.Maximize(objective), t)
    return Solved(np.clip(solved.R, -1.0, 1.0) * r_max, solved.y, solved.answer)


def critical_l1(program: Program) -> Solved:
    """lambda_0, the l1 above which R = 0: maximise sum(t) subject to (4) and ||R||_1 <= 1.

    By homogeneity: sum(t) - l1 ||R||_1 is positive for some R exactly when l1 is below this maximum.
    """
    t = cp.Variable(program.n_margins, nonneg=True)
    program.constraints += [program.l1() <= 1]
    return program.solve(cp.Maximize(cp.sum(t)), t)


def uniform_margin(program: Program) -> Solved:
    """The largest margin that all rows that count can have at once, with |R| <= 1: maximise eps, margins >= eps.

    Solved for its reciprocal, the least bound r on |R| with all margins at least 1, which is well scaled however small eps.
    The answer's objective is r; eps = 1 / r.
    """
    bound = cp.Variable(nonneg=True)
    program.bounded(bound)
    return program.solve(cp.Minimize(bound), 1.0)


def attainable(program: Program, bound: float) -> Solved:
    """Which states can have a margin at all: maximise sum(t), 0 <= t <= 1, subject to (4) and |R| <= bound.

    Rewards that satisfy (4) form a cone and margins add up, so one reward serves every state that can be served, and scaling
    brings each of those to t = 1. With a bound, a state counts as served when t > 1/2: margins below 1 / bound are none.
    """
    t = cp.Variable(program.n_margins, nonneg=True)
    program.constraints += [t <= 1]
    program.bounded(bound)
    return program.solve(cp.Maximize(cp.sum(t)), t)


def sparsest(program: Program, r_max: float, margin: float) -> Solved:
    """The reward of least ||R||_1 with margins of at least `margin`: the capped LP as l1 goes to 0.

    Solved in units of `margin`, so that the scale of the rows does not depend on it. The duals are prices of ||R||_1 for a
    margin, in which that unit cancels.
    """
    program.bounded(r_max / margin)
    solved = program.solve(cp.Minimize(program.l1()), 1.0)
    return Solved(np.clip(solved.R * margin, -r_max, r_max), solved.y, solved.answer)


def checked_visits(visits: Any, needed: np.ndarray) -> np.ndarray | None:
    """(S,) visits, above 0 in the states `needed`; None when not given.

    Raises:
        InvalidParameter: of the wrong shape, or 0 where they are needed.
    """
    if visits is None:
        return None
    array = float_array("visits", visits, "(S,) numbers", InvalidParameter)
    if array.shape != needed.shape:
        raise InvalidParameter(f"visits has shape {array.shape}: expected ({needed.size},), one number for each state.")
    wrong = np.flatnonzero(~(array >= 0) | ~np.isfinite(array) | (needed & (array == 0)))
    if wrong.size:
        s = wrong[0]
        raise InvalidParameter(
            f"visits[s={s}] is {array[s]:g}: expected a number of at least 0, and above it where the expert is known. Where "
            "nothing is known, the expert's row is NaN."
        )
    return array
