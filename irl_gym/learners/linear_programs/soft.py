"""The linear programs for experts that are known in some states only, or that err (Ng & Russell 2000, section 3.2, relaxed).

Where nothing is known of the expert its value is not defined, so here V is the value of acting best under R, *everywhere*:
    V(s) = R(s) + gamma max_a P_a(s) V
For an expert known in all states that satisfies (4) this is its own value (5), and the programs are those of `programs.py`.

    unknowns     V (S,), and R read off it: R(s) = min_a r_a(s), r_a = (I - gamma P_a) V
                 t (m,) >= 0     margin of each state that counts, up to the cap
                 xi (m,) >= 0    violation of the rows that count, in each of these states; none where rows are hard
                 eta (k,) >= 0   violation of the other rows, in each state that has some: the equalities of (4), first of all
    maximise     sum_s w_s (t_s - C xi_s - C eta_s) - l1 N
    subject to   (4): (P_pi(s) - P_a(s)) V >= t_s - xi_s       rows that count: of actions that the expert leaves out
                      (P_pi(s) - P_a(s)) V >= -eta_s           other rows: of actions that it takes too, so that all are equal
                 both in states where the expert is known, and nowhere else
                 r_a(s) >= -R_max for each a,  r_pi(s) <= R_max    so that |R| <= R_max; pi is uniform where it is not known
                 N = sum_s r_pi(s)+ + max_a (-r_a(s))+, which is ||R||_1 where (4) holds
The violations of the two kinds are priced each on its own: were one xi_s the worst of both, an equality that is violated
anyhow would lift t_s by as much, a margin that the reward does not have.
So the margins are differences of what actions are truly worth under R. No policy is invented where none was seen, and no
state can hold a value that acting in it does not earn. gamma xi_s is what the expert's action loses at once in s
against those that it leaves out.
States "to avoid" (never seen, or terminal and not entered from a known state by the expert's actions) cost r_pi(s) + R_max
in N instead: they are worth as little as the margins allow, and an agent that strays into them returns to what it knows.
Departs: l1 prices ||R||_1 itself in the paper; N is the convex function above it.
Axes: S states, A actions, n rows of (4), m states with a margin, k states with other rows, x all unknowns in a vector.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp

from irl_gym._typing import StateMask, Vector
from irl_gym.learners.linear_programs.programs import RewardOn, picking
from irl_gym.mdp.optimality_rows import Comparisons
from irl_gym.mdp.tabular_mdp import TabularMDP
from irl_gym.programs.linear_program import LinearProgram
from irl_gym.programs.solvers import Answer, Solving


@dataclass(frozen=True, eq=False)
class PartlyKnown:
    """The reachable part of an MDP, and what is known of the expert in it."""

    mdp: TabularMDP
    """S states, all reachable."""
    comparisons: Comparisons
    """The rows of (4) in the states where the expert is known; its distribution is uniform elsewhere."""
    known: StateMask
    """(S,) acting states where the expert is known."""
    avoided: StateMask
    """(S,) states to avoid; none with `unvisited="free"`."""
    weights: Vector
    """(S,) w, of margins and violations."""
    active: np.ndarray
    """(n,) rows that a reward can move."""

    @property
    def unknown(self) -> StateMask:
        """(S,) acting states where nothing is known of the expert."""
        return ~self.known & ~self.mdp.terminal


@dataclass(frozen=True, eq=False)
class Found:
    """An answer: V, the reward, and the multipliers that bound the program."""

    V: Vector
    R: np.ndarray
    """(S,) or (S, A)."""
    objective: float
    bound: float
    """No feasible point has a larger objective, whatever the solver did; NaN where the bound on |R| is an unknown."""
    answer: Answer


class SoftProgram:
    """The programs for one expert.

    Args:
        partly: the MDP and what is known.
        reward_on: what the reward is a function of; rewards on steps have no slack, since none is ever needed.
        counted: (n,) rows that count towards margins.
        slack: C >= 1, or None for hard rows.
        solving: with which solver, and until when.
    """

    def __init__(
        self, partly: PartlyKnown, reward_on: RewardOn, counted: np.ndarray, slack: float | None, solving: Solving
    ) -> None:
        mdp, c = partly.mdp, partly.comparisons
        self.partly, self.solving, self.counted, self.slack = partly, solving, counted, slack
        self.on_states = reward_on == "state"
        self.states = np.unique(c.states[counted])
        self.others = np.unique(c.states[partly.active & ~counted])
        identity = sp.eye_array(mdp.n_states, format="csr")
        self.r_pi = sp.csr_array(identity - mdp.gamma * mdp.P_pi(c.distribution))
        self.stepped = partly.known if not self.on_states else np.zeros(mdp.n_states, dtype=bool)  # R(s, a) in these

    def best(self, bound: float, cap: float | None, l1: float, norm: float | None = None) -> Found:
        """The program of the title; with `norm` also N <= norm."""
        parts = _Parts(self, bound, priced=l1 > 0 or norm is not None, gains=True)
        weights = self.partly.weights
        parts.cost["t"][:] = weights[self.states]
        parts.upper["t"][:] = np.inf if cap is None else cap
        if self.slack is not None:
            parts.cost["xi"][:] = -self.slack * weights[self.states]
            parts.cost["eta"][:] = -self.slack * weights[self.others]
        return self._found(parts, l1, np.zeros(self.counted.size), norm)

    def least_bound(self, need: np.ndarray) -> Found:
        """The least bound on |R| with margins of at least `need` (n,), NaN where a row is left out: the objective is -it."""
        parts = _Parts(self, None, priced=False, gains=False)
        parts.cost["bound"][:] = -1.0
        return self._found(parts, 0.0, need, None)

    def simplest(self, bound: float, need: np.ndarray) -> Found:
        """The least N with margins of at least `need` (n,), NaN where a row is left out: the objective is -N."""
        return self._found(_Parts(self, bound, priced=True, gains=False), 1.0, need, None)

    def _found(self, parts: "_Parts", l1: float, need: np.ndarray, norm: float | None) -> Found:
        parts.margins(need)
        parts.bounds()
        if parts.priced:
            parts.price(l1, norm)
        program = parts.program()
        x, y, answer = program.solve(self.solving)
        bound = program.bound(y) if parts.bound is not None else float("nan")
        V = x[parts.where["V"]]
        return Found(V, self._reward(V, x, parts), float(program.cost @ x) + program.constant, bound, answer)

    def _reward(self, V: np.ndarray, x: np.ndarray, parts: "_Parts") -> np.ndarray:
        """R under which V is the value of acting best."""
        mdp = self.partly.mdp
        R = V - mdp.gamma * (mdp.P @ V).reshape(mdp.n_states, mdp.n_actions).max(axis=1)
        if not self.on_states:
            R = np.where(mdp.terminal, 0.0, R)[:, None].repeat(mdp.n_actions, axis=1)
            if self.stepped.any():
                steps = x[parts.where["pos"]] - x[parts.where["neg"]]
                R[self.stepped] = steps[parts.steps].reshape(-1, mdp.n_actions)
        most = np.inf if parts.bound is None else parts.bound
        return np.clip(R, -most, most)


def _picked(states: np.ndarray, among: np.ndarray, rows: np.ndarray) -> sp.csr_array:
    """(n, m) of each of some rows the position of its state in `among` (m,), increasing; nothing in the other rows."""
    at = np.searchsorted(among, states).clip(max=among.size - 1)
    return sp.csr_array(sp.diags_array(rows.astype(float)) @ picking(at, among.size))


class _Parts:
    """The unknowns of one program by name, and its rows as they are added.

    `pos` and `neg` hold the positive and negative part of R: of states, and then of the steps of `stepped` states.
    """

    def __init__(self, program: SoftProgram, bound: float | None, *, priced: bool, gains: bool):
        self.of, self.bound, self.priced = program, bound, priced
        partly = program.partly
        S, A = partly.mdp.n_states, partly.mdp.n_actions
        n_steps = int(program.stepped.sum()) * A
        self.steps = slice(S, S + n_steps)
        parts = S + n_steps if priced or n_steps else 0
        soft = gains and program.slack is not None
        sizes = {
            "V": S,
            "t": program.states.size if gains else 0,
            "xi": program.states.size if soft else 0,
            "eta": program.others.size if soft else 0,
            "pos": parts,
            "neg": parts,
            "bound": int(bound is None),
        }
        ends = np.cumsum([0, *sizes.values()])
        self.where = {name: slice(ends[i], ends[i + 1]) for i, name in enumerate(sizes)}
        self.sizes: Mapping[str, int] = sizes
        largest = np.inf if bound is None else bound
        value = largest * partly.mdp.effective_horizon
        most = 2 * value
        boxes = {"V": value, "t": most, "xi": most, "eta": most, "pos": largest, "neg": largest, "bound": np.inf}
        self.cost = {name: np.zeros(size) for name, size in sizes.items()}
        self.lower = {name: np.full(size, -np.inf if name == "V" else 0.0) for name, size in sizes.items()}
        self.upper = {name: np.full(size, largest if name in ("pos", "neg") else np.inf) for name, size in sizes.items()}
        self.box = {name: np.full(size, boxes[name]) for name, size in sizes.items()}
        if not program.on_states:
            self.lower["V"][partly.mdp.terminal] = self.upper["V"][partly.mdp.terminal] = 0.0
        self.rows: list[sp.csr_array] = []
        self.right: list[np.ndarray] = []
        self.constant = 0.0

    def add(self, right: np.ndarray, **blocks: sp.csr_array) -> None:
        """Rows sum_name blocks[name] x[name] <= right."""
        if right.size:
            empty = [sp.csr_array((right.size, size)) for size in self.sizes.values()]
            named = dict(zip(self.sizes, empty, strict=True)) | blocks
            self.rows.append(sp.csr_array(sp.hstack(list(named.values()))))
            self.right.append(right)

    def margins(self, need: np.ndarray) -> None:
        """(4): (P_pi - P_a) V - t + xi >= need, or + eta in rows that do not count; for the rows that are not left out."""
        program, partly = self.of, self.of.partly
        mdp, c = partly.mdp, partly.comparisons
        chosen = np.flatnonzero(partly.active & ~np.isnan(need))
        states, blocks = c.states[chosen], {}
        if program.on_states:
            blocks["V"] = -c.rows[chosen]
        else:
            stacked = states * mdp.n_actions + c.actions[chosen]
            blocks["V"] = sp.csr_array(mdp.gamma * mdp.P[stacked] - picking(states, mdp.n_states))
            columns = self.steps.start + np.searchsorted(np.flatnonzero(program.stepped), states) * mdp.n_actions
            blocks["pos"] = picking(columns + c.actions[chosen], self.sizes["pos"])
            blocks["neg"] = -blocks["pos"]
        counted = program.counted[chosen]
        if self.sizes["t"]:
            blocks["t"] = _picked(states, program.states, counted)
        if self.sizes["xi"]:
            blocks["xi"] = -blocks["t"]
        if self.sizes["eta"]:
            blocks["eta"] = -_picked(states, program.others, ~counted)
        self.add(-need[chosen], **blocks)

    def bounds(self) -> None:
        """R between -bound and bound, in its positive and negative part where these are priced."""
        program, partly = self.of, self.of.partly
        mdp = partly.mdp
        S, A = mdp.n_states, mdp.n_actions
        plain = np.flatnonzero(~program.stepped & (program.on_states | ~mdp.terminal))
        self._below(plain, program.r_pi[plain], "pos")
        hard = partly.known if program.slack is None else np.zeros(S, dtype=bool)
        closed = plain[(hard | mdp.terminal)[plain]]
        self._below(closed, -program.r_pi[closed], "neg")
        opened = np.setdiff1d(plain, closed).repeat(A)
        r_a = picking(opened, S) - mdp.gamma * mdp.P[opened * A + np.tile(np.arange(A), opened.size // A)]
        self._below(opened, sp.csr_array(-r_a), "neg")
        stepped = np.flatnonzero(program.stepped)
        if stepped.size:
            unit = mdp.effective_horizon  # weighs (5), so that its residual is not multiplied by this in V
            mixing: Any = sp.csr_array(unit * partly.mdp.mixing(partly.comparisons.distribution)[stepped])
            columns = (stepped[:, None] * A + np.arange(A)).ravel()
            here = sp.csr_array(sp.hstack([sp.csr_array((stepped.size, S)), mixing[:, columns]]))
            V = sp.csr_array(unit * program.r_pi[stepped])
            for sign in (1.0, -1.0):  # V = R_pi + gamma P_pi V
                self.add(np.zeros(stepped.size), V=sign * V, pos=-sign * here, neg=sign * here)
            if self.bound is None:
                every = picking(np.arange(S, self.sizes["pos"]), self.sizes["pos"])
                least = sp.csr_array(-np.ones((columns.size, 1)))
                for name in ("pos", "neg"):
                    self.add(np.zeros(columns.size), **{name: every, "bound": least})

    def _below(self, states: np.ndarray, rows: sp.csr_array, part: str) -> None:
        """Rows of V below the positive or negative part of R; below the bound where that part is not priced."""
        priced = self.priced & ~self.of.partly.avoided[states]
        free = np.flatnonzero(~priced)
        if self.bound is None:
            self.add(np.zeros(free.size), V=rows[free], bound=sp.csr_array(-np.ones((free.size, 1))))
        else:
            self.add(np.full(free.size, self.bound), V=rows[free])
        kept = np.flatnonzero(priced)
        if kept.size:
            self.add(np.zeros(kept.size), **{"V": rows[kept], part: -picking(states[kept], self.sizes[part])})

    def price(self, l1: float, norm: float | None) -> None:
        """L1 N in the objective; N <= norm."""
        partly = self.of.partly
        count = 1 if self.of.on_states else partly.mdp.n_actions
        each = np.concatenate([np.full(partly.mdp.n_states, count), np.ones(self.steps.stop - self.steps.start)])
        avoided = count * partly.avoided.astype(float)
        self.cost["pos"] -= l1 * each
        self.cost["neg"] -= l1 * each
        self.cost["V"] -= l1 * (self.of.r_pi.T @ avoided)
        if self.bound is not None:
            self.constant -= l1 * self.bound * float(avoided.sum())
        if norm is not None:
            self.add(np.array([norm]), pos=sp.csr_array(each[None]), neg=sp.csr_array(each[None]))

    def program(self) -> LinearProgram:
        """All of it, as matrices."""
        joined = [np.concatenate(list(part.values())) for part in (self.cost, self.lower, self.upper, self.box)]
        cost, lower, upper, box = joined
        A = sp.csr_array(sp.vstack(self.rows))
        return LinearProgram(cost, A, np.concatenate(self.right), lower, upper, box, self.constant)
