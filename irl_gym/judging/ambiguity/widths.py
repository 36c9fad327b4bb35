"""How far apart the rewards of one state can be, when all that is known is that the expert is optimal: 2 S linear programs.

The feasible set (Ng & Russell 2000, (4)) is a cone: with R it holds 2 R, and 0. Without an anchor every width is infinite or
says nothing, so the set is cut in two places:
    |R| <= R_max           the scale
    margins >= tau         in every row that can be strict; tau > 0 keeps out R = 0 and all that ties the expert with others
tau is half of the largest margin that all these can have at once, as in `FiniteLP(margin_cap="auto")`: the set is then that of
all optima of the capped program as l1 goes to 0, before the norm chooses among them. What `FiniteLP()` learns lies in it.
`margin=None` asks for (4) alone, `pinned` for rewards that are known, such as a goal's.

    unknowns     V (S,), in units of R_max
    states       R(s) = V(s) - gamma P_pi(s) V;       margins (P_pi(s) - P_a(s)) V
    steps        R(s, a) = V(s) - gamma P_sa V        for actions that the expert takes
                 R(s, a) <= the same - tau            for the others, so their least reward is always -R_max
Where nothing is known of the expert V(s) is what acting best is worth, R(s) + gamma max_a P_a(s) V. Its >= is kept and its <=
left out, which is not convex: the bounds hold for every feasible reward, but may not be attained. Axes: S states, A actions.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from numbers import Integral
from typing import Any, Literal

import numpy as np

from irl_gym._typing import ActionSets, Indices
from irl_gym.checks import checked_number, is_word
from irl_gym.errors import InvalidParameter, SolverInfeasible, a_type
from irl_gym.judging.ambiguity.feasible import Posed, jsonable, over_all_states, pose
from irl_gym.judging.ambiguity.reward_sets import RewardSet, StateRewards, StepRewards
from irl_gym.learners.linear_programs.finite import FiniteLP
from irl_gym.learners.linear_programs.programs import NO_MARGIN, RewardOn
from irl_gym.learners.linear_programs.proofs.finite_proof import served
from irl_gym.mdp.tabular_mdp import TabularMDP
from irl_gym.programs.deadline import Deadline
from irl_gym.records import Record

Pins = Mapping[Any, float]
"""State, or (state, action), -> its reward."""
NAMED = 5
"""Pins that an error names."""


@dataclass(frozen=True, eq=False)
class Widths(Record):
    """The least and the largest reward that the feasible set leaves each state, or each state and action."""

    low: np.ndarray
    """(S,) or (S, A); NaN in states never reached, and of steps in terminal states, which none is taken in."""
    high: np.ndarray
    """(S,) or (S, A)."""
    reward_on: RewardOn
    """What the reward is a function of."""
    r_max: float
    """The bound on |R|."""
    margin: float
    """tau, the least margin; 0 for (4) alone."""
    with_margin: Indices
    """The states that have it: all that can have one."""
    pinned: tuple[tuple[Any, float], ...]
    """The rewards taken as known."""
    attained: bool
    """Is there a feasible reward at each bound? Not always, where nothing is known of the expert in some state."""
    anchor: str
    """What the scale is anchored to, in a sentence."""
    program: str
    """What was solved, in a sentence."""

    @property
    def width(self) -> np.ndarray:
        """(S,) or (S, A) high - low: 0 where the expert's optimality says all, 2 R_max where it says nothing."""
        return self.high - self.low

    def __str__(self) -> str:
        """The widths in two sentences."""
        width = self.width[np.isfinite(self.width)]
        if not width.size:
            return "No widths: every state that is reached is terminal, so no step is taken."
        kind = "states" if self.reward_on == "state" else "states and actions"
        return (
            f"Widths from {width.min():.3g} to {width.max():.3g}, {np.median(width):.3g} in the middle, over {width.size} "
            f"{kind}. {self.anchor}"
        )

    def to_json(self) -> dict[str, Any]:
        """As json holds it: NaN becomes None."""
        found = {name: jsonable(getattr(self, name)) for name in self.__dataclass_fields__}
        found["pinned"] = [[np.atleast_1d(where).tolist(), value] for where, value in self.pinned]
        return found | {"width": jsonable(self.width)}


def feasible_widths(
    mdp: TabularMDP,
    expert: Any,
    *,
    r_max: float = 1.0,
    margin: float | Literal["auto"] | None = "auto",
    reward_on: RewardOn = "state",
    pinned: Pins | None = None,
    workers: int = 1,
    time_limit: float | None = None,
) -> Widths:
    """The least and the largest reward of each state over all rewards under which the expert is optimal.

    Args:
        mdp: only states reachable from d0 have a width; the others' is NaN.
        expert: (S,) actions, (S, A) probabilities or (S, A) set; rows of NaN where nothing is known: no rows there.
        r_max: the bound on |R|.
        margin: tau, what the expert is at least better by, in units of value, than every action that it can be better than.
            "auto" is half of the largest that all can have at once, given the pins; None or 0 asks for (4) alone.
        reward_on: "state" for R(s) paid on arrival, "state-action" for R(s, a).
        pinned: rewards that are known: state -> value, or (state, action) -> value.
        workers: processes; the same bytes with any number. More than one are spawned, so a script needs the usual
            `if __name__ == "__main__":`.
        time_limit: seconds for all linear programs together; those that choose the cap have as many.

    Raises:
        InvalidMDP, InvalidPolicy: not a TabularMDP, or an expert of the wrong shape or content.
        InvalidParameter: a number outside its range, a pin outside the table or above r_max, a margin that no reward attains,
            pins that no feasible reward has.
        DegenerateExpert: a margin is asked for, and no reward has one in any state.
        SolverTimeout, SolverFailed: no answer.
    """
    learner = FiniteLP(r_max=r_max, reward_on=reward_on, unvisited="free", time_limit=time_limit)  # checks these
    if margin is not None and not is_word(margin, "auto"):
        margin = checked_number("margin", margin, "a number of at least 0, 'auto' or None", least=0)
    posed = pose(mdp, expert)
    kind: type[RewardSet] = StateRewards if reward_on == "state" else StepRewards
    pins = _checked_pins({} if pinned is None else pinned, posed, mdp, reward_on, r_max)
    served, tau = np.zeros((mdp.n_states, mdp.n_actions), dtype=bool), 0.0
    if margin:
        served, tau = served_actions(learner, mdp, expert)
    deadline, with_margin = Deadline.after(time_limit), np.flatnonzero(served.any(axis=1))
    the_set = kind(posed, served[posed.rows], pins)
    if margin == "auto" and pins:
        tau = _half_of_largest(the_set, pinned, r_max, deadline)
    elif margin and margin != "auto":
        tau = margin
    unknowns, rows = _checked_size(the_set, pinned, tau, r_max, deadline)
    low, high, solved = the_set.bounds(tau / r_max, workers, deadline)
    return Widths(
        low=over_all_states(posed, mdp, r_max * low),
        high=over_all_states(posed, mdp, r_max * high),
        reward_on=reward_on,
        r_max=float(r_max),
        margin=float(tau),
        with_margin=with_margin,
        pinned=tuple((where, float(value)) for where, value in (pinned or {}).items()),
        attained=bool(posed.known.all()),
        anchor=_anchor(margin, tau, r_max, with_margin.size, pins),
        program=f"{solved} linear programs of {unknowns} unknowns and {rows} rows.",
    )


def served_actions(learner: FiniteLP, mdp: TabularMDP, expert: Any) -> tuple[ActionSets, float]:
    """(S, A) actions that the expert can be better than, and half of the largest margin over all of them at once.

    Raises:
        DegenerateExpert: there are none.
    """
    found = replace(learner, l1=0.0, margin_cap="auto").fit(mdp, expert)
    return served(mdp, expert, found.reward, found.proof), found.proof.margin_cap or 0.0


def _half_of_largest(the_set: RewardSet, pinned: Any, r_max: float, deadline: Deadline) -> float:
    """tau, given the pins."""
    try:
        largest = the_set.largest_margin(deadline)
    except SolverInfeasible as reason:
        raise _no_margin(pinned, r_max, 0.0) from reason
    if largest <= NO_MARGIN:
        raise _no_margin(pinned, r_max, largest * r_max or 1.0)
    return largest * r_max / 2


def _anchor(margin: Any, tau: float, r_max: float, states: int, pins: Mapping[Any, float]) -> str:
    known = f", and {len(pins)} reward{'s' * (len(pins) > 1)} taken as known" if pins else ""
    if not margin:
        return f"All rewards with |R| <= {r_max:g} under which the expert is optimal, ties and R = 0 among them{known}."
    half = ", half of the largest that all of them can have at once" if margin == "auto" else ""
    return (
        f"All rewards with |R| <= {r_max:g} and a margin of at least {tau:.4g} in each of the {states} states that can have "
        f"one{half}{known}."
    )


def _checked_pins(pinned: Pins, posed: Posed, mdp: TabularMDP, on: RewardOn, r_max: float) -> dict[Any, float]:
    """The pins by the row of a state among the reachable ones, or by (row, action), in units of r_max."""
    if not isinstance(pinned, Mapping):
        raise InvalidParameter(f"pinned is {a_type(pinned)}: expected a mapping of places to rewards, such as {{7: 1.0}}.")
    found: dict[Any, float] = {}
    shape = (mdp.n_states,) if on == "state" else (mdp.n_states, mdp.n_actions)
    for key, value in pinned.items():
        where: tuple[Any, ...] = key if isinstance(key, tuple) else (key,)
        whole = len(where) == len(shape) and all(isinstance(one, Integral) and not isinstance(one, bool) for one in where)
        if not (whole and all(0 <= one < size for one, size in zip(where, shape, strict=True))):
            ranges = "a state" if on == "state" else "(state, action)"
            raise InvalidParameter(f"pinned has key {key!r}: expected {ranges} of the table, which has shape {shape}.")
        value = checked_number(f"pinned[{key!r}]", value, f"a reward from -{r_max:g} to {r_max:g}, or a larger r_max")
        if abs(value) > r_max:
            raise InvalidParameter(f"pinned[{key!r}] is {value:g}: expected at most r_max = {r_max:g} in size. Raise r_max.")
        row = int(np.searchsorted(posed.rows, where[0]))
        if not mdp.reachable[where[0]]:
            raise InvalidParameter(
                f"pinned has key {key!r}: no policy reaches state {where[0]}, so its reward is free. Drop it."
            )
        if on == "state-action" and posed.part.terminal[row]:
            raise InvalidParameter(f"pinned has key {key!r}: state {where[0]} is terminal, no step is taken there. Drop it.")
        found[row if on == "state" else (row, int(where[1]))] = value / r_max
    return found


def _no_margin(pinned: Any, r_max: float, tau: float) -> InvalidParameter:
    what = "gives a margin to every state that can have one" if tau else "makes the expert optimal"
    mend = "Use margin=None, leave a pin out, or raise r_max." if tau else "Leave a pin out, or raise r_max."
    return InvalidParameter(f"pinned is {_few(pinned)}: no reward with these values and |R| <= {r_max:g} {what}. {mend}")


def _few(pinned: Any) -> str:
    """The first pins."""
    told = [f"{where!r}: {value!r}" for where, value in dict(pinned or {}).items()]
    return "{" + ", ".join(told[:NAMED]) + ("}" if len(told) <= NAMED else f" and {len(told) - NAMED} more}}")


def _checked_size(the_set: RewardSet, pinned: Any, tau: float, r_max: float, deadline: Deadline) -> tuple[int, int]:
    """How many unknowns and rows the set has, once there is a reward in it."""
    polytope = the_set.polytope(tau / r_max)
    rows, unknowns = polytope.A.shape
    try:
        polytope.program(deadline).minimise(np.zeros(unknowns))
    except SolverInfeasible as reason:
        raise _empty(the_set, pinned, tau, r_max, deadline) from reason
    return unknowns, rows


def _empty(the_set: RewardSet, pinned: Any, tau: float, r_max: float, deadline: Deadline) -> InvalidParameter:
    """Why no reward is in the set: the pins, or the margin."""
    pins = f" and pinned={_few(pinned)}" if pinned else ""
    try:
        largest = r_max * the_set.largest_margin(deadline) if tau else 0.0
    except SolverInfeasible:
        largest = 0.0
    if largest <= NO_MARGIN * r_max:
        return _no_margin(pinned, r_max, tau)
    return InvalidParameter(
        f"margin is {tau:g}: expected at most {largest:.6g}, the largest that every state can have at once with "
        f"|R| <= {r_max:g}{pins}. Lower it, or raise r_max."
    )
