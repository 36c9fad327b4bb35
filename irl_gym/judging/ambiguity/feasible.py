"""The feasible reward set: all rewards under which the expert is optimal (Ng & Russell 2000, (4); Metelli et al. 2021).

Is a reward in the set, and by how much? A reward on states is judged by (4); a reward on steps by its decomposition (Metelli,
Ramponi, Concetti & Restelli 2021, "Provably Efficient Learning of Transferable Rewards", lemma 3.2):
    R(s, a) = V(s) - gamma P_sa V - 1{pi(a|s) = 0} zeta(s, a)    with zeta >= 0
V is the expert's value and zeta what another action loses at once. Every V and every zeta >= 0 give a member, and every member
has such a V and zeta: the set is a cone, with 0 in it.
Nothing is asked where nothing is known of the expert (rows of NaN): V is what acting best is worth there.
Axes: S states, A actions, n rows of (4).
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from irl_gym._typing import Indices, Matrix, Numbers, StateMask, Vector
from irl_gym.checks import checked_number, checked_rng, float_array
from irl_gym.errors import InvalidParameter
from irl_gym.mdp.margins import least_per_state, margins_of
from irl_gym.mdp.optimality_rows import Comparisons, as_compared, compare
from irl_gym.mdp.planning.dynamic_programming import optimum
from irl_gym.mdp.planning.howard import as_told
from irl_gym.mdp.policies import completed
from irl_gym.mdp.rewards import TabularReward, as_reward
from irl_gym.mdp.tabular_mdp import TabularMDP, checked_mdp


@dataclass(frozen=True, eq=False)
class Posed:
    """The reachable part of an MDP, and the rows of (4) in it."""

    rows: Indices
    """(r,) the reachable states."""
    part: TabularMDP
    """These alone, renumbered."""
    known: StateMask
    """(r,) something is known of the expert; terminal states count as known."""
    comparisons: Comparisons
    """(4) in the known states; the distribution is uniform elsewhere."""

    @property
    def taken(self) -> np.ndarray:
        """(r, A) the actions that the expert is known to take, in states that take any."""
        return (self.comparisons.distribution > 0) & (self.known & ~self.part.terminal)[:, None]

    def movable(self, on_states: bool) -> np.ndarray:
        """(n,) rows that a margin is asked of: not an equality, and not trivial for the reward's kind."""
        c = self.comparisons
        return ~c.equal & ~c.trivial if on_states else ~c.equal


def pose(mdp: TabularMDP, expert: Any) -> Posed:
    """Restrict a problem to its reachable states.

    Args:
        mdp: the MDP.
        expert: (S,) actions, (S, A) probabilities or (S, A) set; rows of NaN where nothing is known.

    Raises:
        InvalidMDP: not a TabularMDP.
        InvalidPolicy: an expert of the wrong shape or content, or one of which nothing is known.
    """
    distribution, known = completed(expert, checked_mdp(mdp).n_states)
    mdp.mixing(distribution)  # checks all states, reachable or not
    rows = np.flatnonzero(mdp.reachable)
    part = mdp.restrict(rows)
    seen = known[rows] | part.terminal
    return Posed(rows, part, seen, compare(part, np.asarray(distribution)[rows], np.flatnonzero(seen)))


@dataclass(frozen=True, eq=False)
class Membership:
    """Is a reward one under which the expert is optimal, and why. States that are never reached are not judged: NaN."""

    member: bool | None
    """Does every row of (4) hold, in every state? None where rounding hides whether one does."""
    worst_violation: float
    """The largest violation of (4), in units of value; 0 when none."""
    tolerance: float
    """A violation up to this is none, beside the rounding of the table's numbers: what the solver of R left open."""
    undecided: int
    """Rows of (4) that neither hold nor are violated for certain."""
    counted: bool
    """Is the table an estimate from counts, whose noise may hide it?"""
    ties: int
    """States in which another action, that R could tell from the expert's, is as good to rounding and `tolerance`."""
    margin: Vector
    """(S,) smallest margin of the expert over another action; NaN where (4) has no row that R can move."""
    violated_rows: np.ndarray
    """(v, 2) state and action of each violated row: the action is worth more than the expert's under R."""
    violations: Numbers
    """(v,) by how much, in units of value."""
    V: Vector
    """(S,) value under R of what the expert does, and of acting best where nothing is known of it: V = R + gamma P_pi V."""
    advantages: Matrix
    """(S, A) zeta: what each action is worth less than the expert's, V(s) - Q(s, a); negative where (4) is violated."""

    def __str__(self) -> str:
        """The finding in a sentence or two."""
        finite = self.margin[np.isfinite(self.margin)]
        if self.member is None:
            hides = "the noise of the counts" if self.counted else "rounding"
            return (
                f"Undecided: no row of (4) is violated for certain, and {hides} hides whether {self.undecided} of them hold; "
                f"the largest violation is {self.worst_violation:.3g}."
            )
        if not self.member:
            worst = np.flatnonzero(self.violations >= (1 - 1e-6) * self.worst_violation)[0]  # the first of equals
            s, a = self.violated_rows[worst]
            count = self.violations.size
            return (
                f"The expert is not optimal: {count} rows of (4) are violated, by {self.worst_violation:.3g} at most, where "
                f"action {a} in state {s} is worth more than the expert's."
            )
        if not finite.size:
            return "The expert is optimal: no row of (4) compares it with an action of other successors."
        tied = f"; in {self.ties} of {finite.size} states another action is as good" if self.ties else ""
        return f"The expert is optimal, with margins from {0.0 if self.ties else finite.min():.3g} to {finite.max():.3g}{tied}."

    def to_json(self) -> dict[str, Any]:
        """As json holds it: NaN becomes None."""
        return {name: jsonable(getattr(self, name)) for name in self.__dataclass_fields__}


def jsonable(value: Any) -> Any:
    """An array as nested lists with None for NaN; anything else as it is."""
    if not isinstance(value, np.ndarray):
        return value
    entries = value.astype(object)
    if value.dtype.kind == "f":
        entries[np.isnan(value)] = None
    return entries.tolist()


def membership(
    mdp: TabularMDP, expert: Any, reward: TabularReward | np.ndarray, *, tolerance: float | None = None
) -> Membership:
    """Is the expert optimal under a reward, and by how much?

    Args:
        mdp: only states reachable from d0 are judged.
        expert: (S,) actions, (S, A) probabilities or (S, A) set; rows of NaN where nothing is known: no rows there. In a state
            where it takes several actions these have to be equally good.
        reward: (S,) paid on arrival, judged as in (4), or (S, A).
        tolerance: a violation up to this, in units of value, is none, beside the rounding of the table's numbers; the default
            is what the solver of the reward left open (`TabularReward.tolerance`), nothing for a reward that is given.

    Raises:
        InvalidMDP: not a TabularMDP.
        InvalidPolicy: an expert of the wrong shape or content.
        InvalidReward: a reward of the wrong shape, or not finite.
        InvalidParameter: a negative tolerance.
    """
    posed, reward = pose(mdp, expert), as_reward(reward)
    reward.expected(mdp)  # checks the shape
    part, R = posed.part, reward.of_rows(posed.rows)
    tolerance = R.tolerance if tolerance is None else tolerance
    tolerance = checked_number("tolerance", tolerance, "a number of at least 0, in units of value, or None", least=0)
    posed = _acting_best(posed, R)
    c = posed.comparisons
    found = optimum(as_compared(part, c, R.on_states), R)
    margins = margins_of(found, c, tolerance)
    usable = posed.movable(R.on_states)
    violations, held, violated = margins.violations(c.equal), margins.hold(c.equal), margins.violated(c.equal)
    behind, unsure = found.behind(c.distribution)
    V, advantages = found.V - behind, found.less_than(behind, unsure)[0]
    if R.on_states:  # V = R + gamma W, and Q likewise
        V, advantages = R.values + part.gamma * V, part.gamma * advantages
    advantages[part.terminal] = 0.0
    spread = {
        "margin": least_per_state(margins.values[usable], c.states[usable], part.n_states),
        "V": V,
        "advantages": advantages,
    }
    undecided = int((~held & ~violated).sum())
    return Membership(
        member=False if violated.any() else (None if undecided else True),
        worst_violation=float(violations.max(initial=0.0)),
        tolerance=tolerance,
        undecided=undecided,
        counted=part.visits is not None,
        ties=np.unique(c.states[usable & margins.tied]).size,
        violated_rows=np.stack([posed.rows[c.states[violated]], c.actions[violated]], axis=1).astype(np.int64),
        violations=violations[violated],
        **{name: over_all_states(posed, mdp, array) for name, array in spread.items()},
    )


def over_all_states(posed: Posed, mdp: TabularMDP, values: np.ndarray) -> np.ndarray:
    """Numbers of the reachable states as numbers of all; NaN in the others."""
    full = np.full((mdp.n_states, *values.shape[1:]), np.nan)
    full[posed.rows] = values
    return full


def _acting_best(posed: Posed, R: TabularReward) -> Posed:
    """The same, with an expert that acts best where nothing is known of it, given what it does elsewhere."""
    if posed.known.all():
        return posed
    part, told = posed.part, posed.comparisons.distribution
    as_expert = TabularMDP(as_told(part, told, ~posed.known), part.gamma, part.d0, None, part.horizon)
    paid = R.expected(part)
    paid = np.where(posed.known[:, None], (told * paid).sum(axis=1, keepdims=True), paid)
    best = optimum(as_expert, paid).policy
    distribution = np.where(posed.known[:, None], told, np.eye(part.n_actions)[best])
    return Posed(posed.rows, part, posed.known, compare(part, distribution, np.flatnonzero(posed.known)))


def feasible_reward(mdp: TabularMDP, expert: Any, V: Any, advantages: Any) -> TabularReward:
    """The member with given values and advantages (Metelli et al. 2021, lemma 3.2).

        R(s, a) = V(s) - gamma P_sa V - 1{pi(a|s) = 0} zeta(s, a)
    Where nothing is known of the expert the least advantage of a state is taken off it, since acting best loses nothing.

    Args:
        mdp: the MDP.
        expert: as in `membership`.
        V: (S,) values; 0 in terminal states, where no step is paid.
        advantages: (S, A) zeta >= 0; those of actions that the expert takes do not matter.

    Raises:
        InvalidPolicy: an expert of the wrong shape or content.
        InvalidParameter: V or advantages of the wrong shape, not finite, negative, or V other than 0 in a terminal state.
    """
    posed = pose(mdp, expert)
    S, A = mdp.n_states, mdp.n_actions
    V = _finite("V", V, (S,))
    zeta = _finite("advantages", advantages, (S, A))
    wrong = np.flatnonzero(mdp.terminal & (V != 0))
    if wrong.size:
        raise InvalidParameter(f"V[s={wrong[0]}] is {V[wrong[0]]:g}: expected 0 in a terminal state, where no step is paid.")
    wrong = np.argwhere(zeta < 0)
    if wrong.size:
        s, a = wrong[0]
        raise InvalidParameter(
            f"advantages[s={s}, a={a}] is {zeta[s, a]:g}: expected at least 0, what the action is worth less than the expert's."
        )
    taken, unknown = np.zeros((S, A), dtype=bool), np.zeros(S, dtype=bool)
    taken[posed.rows], unknown[posed.rows] = posed.taken, ~posed.known
    zeta = np.where(unknown[:, None], zeta - zeta.min(axis=1, keepdims=True), zeta)
    R = V[:, None] - mdp.gamma * (mdp.P @ V).reshape(S, A) - np.where(taken, 0.0, zeta)
    return TabularReward(np.where(mdp.terminal[:, None], 0.0, R), {"feasible": "of given values and advantages"})


def _finite(name: str, value: Any, shape: tuple[int, ...]) -> np.ndarray:
    array = float_array(name, value, f"an array of shape {shape}", InvalidParameter)
    if array.shape != shape:
        raise InvalidParameter(f"{name} has shape {array.shape}: expected {shape}, for the states and actions of the table.")
    wrong = np.argwhere(~np.isfinite(array))
    if wrong.size:
        where = tuple(int(i) for i in wrong[0])
        raise InvalidParameter(f"{name}{list(where)} is {array[where]}: expected a finite number.")
    return array


def sample_feasible(mdp: TabularMDP, expert: Any, *, rng: np.random.Generator, r_max: float = 1.0) -> TabularReward:
    """Draw a member (S, A): V uniform in +-1, zeta uniform in 0 to 1, then scaled until max |R| is r_max.

    It is a draw from the whole set, with any potential: what the expert leaves open looks like this.

    Args:
        mdp: the MDP.
        expert: as in `membership`.
        rng: drawn from.
        r_max: the largest |R|.

    Raises:
        InvalidMDP, InvalidPolicy: not a TabularMDP, or an expert of the wrong shape or content.
        InvalidParameter: r_max not above 0, or an rng that is none.
    """
    r_max = checked_number("r_max", r_max, "a bound above 0, such as 1.0", above=0)
    mdp, rng = checked_mdp(mdp), checked_rng(rng)
    V = np.where(mdp.terminal, 0.0, rng.uniform(-1, 1, mdp.n_states))
    zeta = rng.uniform(0, 1, (mdp.n_states, mdp.n_actions))
    drawn = feasible_reward(mdp, expert, V, zeta).values
    largest = float(np.abs(drawn).max())
    return TabularReward(drawn * (r_max / largest) if largest > 0 else drawn, {"feasible": "drawn"})
