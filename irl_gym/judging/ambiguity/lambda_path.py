"""The path of FiniteLP's reward as lambda, the price of ||R||_1, rises from 0 to lambda_0: every breakpoint, with a proof.

    f(lambda) = max sum_s t(s) - lambda ||R||_1    subject to (4), |R| <= R_max   (Ng & Russell 2000, section 3.2)
Ng and Russell search by hand for the lambda just below lambda_0, where R is simple. But f is a maximum of finitely many lines,
one a vertex: T - lambda N, with T the total margin and N = ||R||_1. So the optimum does not change but at breakpoints, and
there is nothing to search: `lambda_path` lists all rewards that any lambda gives. At each breakpoint the reward jumps to one
of smaller norm and smaller total margin; above lambda_0 it is 0.
Unique, and so the same for any solver: breakpoints, T and N of each piece. Not always unique: R itself, of which many may
have the same T and N; the one shown is a vertex, the same for the same input.
Axes: k pieces, S states, A actions.
"""

import os
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from irl_gym._typing import Numbers
from irl_gym.checks import checked_number
from irl_gym.errors import DegenerateExpert, InvalidPolicy, InvalidReward
from irl_gym.judging.ambiguity.envelope import envelope
from irl_gym.judging.ambiguity.feasible import jsonable
from irl_gym.judging.ambiguity.path_changes import Change, changes
from irl_gym.judging.ambiguity.priced import PricedProgram
from irl_gym.judging.ambiguity.widths import served_actions
from irl_gym.learners.linear_programs.finite import FiniteLP
from irl_gym.learners.linear_programs.programs import NO_MARGIN, RewardOn
from irl_gym.mdp.policies import completed
from irl_gym.mdp.rewards import TabularReward, read_archive, write_archive
from irl_gym.mdp.tabular_mdp import TabularMDP, checked_mdp
from irl_gym.programs.deadline import Deadline
from irl_gym.records import Record

FORMAT = "irl_gym.LambdaPath/1"
ARRAYS = ("breakpoints", "rewards", "margins", "l1_norms", "total_margins", "gaps")
NUMBERS = ("gap", "exact", "r_max", "margin_cap", "solves")
CERTIFIED = 1e-6
"""Certified: no gap is larger, relative to the total margin at price 0, and no violation of (4), relative to R_max
or the cap, the smaller."""


@dataclass(frozen=True, eq=False)
class LambdaPath(Record):
    """The rewards that FiniteLP gives as lambda rises, and where each begins and ends.

    Piece i is optimal for lambda from breakpoints[i] to breakpoints[i + 1], both included; R = 0 is above the last.
    """

    breakpoints: np.ndarray
    """(k+1,) increasing: 0, where each piece ends, and so lambda_0 at last."""
    rewards: np.ndarray
    """(k, S) or (k, S, A), 0 in states that are never reached. One optimal reward of each piece: T and N are unique, R may not
    be."""
    margins: np.ndarray
    """(k, S) smallest margin of the expert over another action, above the cap too; NaN where (4) has no row that R can move."""
    l1_norms: Numbers
    """(k,) N = ||R||_1, falling."""
    total_margins: Numbers
    """(k,) T, the sum that the program makes large: margins up to the cap, over the states that count; falling."""
    gaps: np.ndarray
    """(k+1,) by how much f can be above the path at each breakpoint: Lagrange's bound there, minus the objective."""
    gap: float
    """The largest such distance at any lambda: what the path can fall short of the optimum, whatever the solver did."""
    whole: bool
    """Was each crossing followed? False where `most_pieces` stopped the search: other pieces may lie between these, and the
    breakpoints are where the known pieces cross. Says nothing of what the solver missed: `exact` does."""
    r_max: float
    """R_max, the bound on |R|."""
    margin_cap: float | None
    """The cap on margins; None in Ng & Russell's own program."""
    solves: int = 0
    """Linear programs solved."""
    violation: float = 0.0
    """The largest violation of (4) by a piece, recomputed from P, relative to R_max or the cap, the smaller; NaN where the file
    that the path is read from does not say."""

    FORMATS: ClassVar[tuple[str, ...]] = (FORMAT,)

    @property
    def exact(self) -> bool:
        """Is it certified that these are all pieces? Each crossing was followed, and no gap or violation is above CERTIFIED."""
        proved = self.gap <= CERTIFIED * self.total_margins[0] and self.violation <= CERTIFIED
        return bool(self.whole and proved)  # a NaN proves nothing

    @property
    def lambda_0(self) -> float:
        """The price above which R = 0 is optimal: FiniteLP's `critical_l1`."""
        return float(self.breakpoints[-1])

    @property
    def n_pieces(self) -> int:
        """Number k of pieces."""
        return len(self.l1_norms)

    @cached_property
    def changes(self) -> tuple[Change, ...]:
        """(k+1,) what changes at each breakpoint; the first, at price 0, is where the path begins."""
        return changes(
            self.breakpoints, self.rewards, self.margins, self.total_margins, self.l1_norms, r_max=self.r_max,
            margin_cap=self.margin_cap,
        )  # fmt: skip

    def piece(self, lam: float) -> int | None:
        """The piece for a lambda; at a breakpoint the one before it, of larger norm; None above lambda_0.

        Raises:
            InvalidParameter: lam below 0 or not finite.
        """
        price = checked_number("lam", lam, "a price of at least 0", least=0)
        if price > self.lambda_0:
            return None
        return max(int(np.searchsorted(self.breakpoints, price)) - 1, 0)

    def at(self, lam: float) -> TabularReward:
        """An optimal reward for a lambda; at a breakpoint the one of larger norm; R = 0 above lambda_0.

        Raises:
            InvalidParameter: lam below 0 or not finite.
        """
        piece = self.piece(lam)
        values = np.zeros(self.rewards.shape[1:]) if piece is None else self.rewards[piece].copy()
        return TabularReward.learned(values, {"learner": "FiniteLP", "l1": float(lam), "piece": piece})

    def objective(self, lam: float) -> float:
        """f(lambda) = T - lambda N of the piece; at most `gap` below the optimum.

        Raises:
            InvalidParameter: lam below 0 or not finite.
        """
        piece = self.piece(lam)
        return 0.0 if piece is None else float(self.total_margins[piece] - lam * self.l1_norms[piece])

    def __str__(self) -> str:
        """The path in three lines."""
        kind = "all" if self.exact else "some of its" if not self.whole else "not certified:"
        off = "" if self.violation <= CERTIFIED else f", and violates (4) by {self.violation:.1e} of what a margin can be"
        off = ", and how far it violates (4) was not noted" if np.isnan(self.violation) else off
        return (
            f"lambda path     {kind} {self.n_pieces} pieces from 0 to lambda_0 = {self.lambda_0:.6g}, at most {self.gap:.1e} "
            f"below the optimum{off}\n||R||_1         {self.l1_norms[0]:.6g} to {self.l1_norms[-1]:.6g}\ntotal margin    "
            f"{self.total_margins[0]:.6g} to {self.total_margins[-1]:.6g}"
        )

    def to_json(self) -> dict[str, Any]:
        """As json holds it, with the changes: NaN becomes None."""
        arrays = {name: jsonable(getattr(self, name)) for name in ARRAYS}
        header = {name: None if value != value else value for name, value in self._header().items()}
        return arrays | header | {"lambda_0": self.lambda_0, "changes": [one.to_json() for one in self.changes]}

    def _header(self) -> dict[str, Any]:
        return {name: getattr(self, name) for name in (*NUMBERS, "whole", "violation")}

    def save(self, path: str | os.PathLike) -> None:
        """Write an npz without pickle. Beside first, then renamed."""
        write_archive(path, {"format": FORMAT} | self._header(), {name: getattr(self, name) for name in ARRAYS})

    @classmethod
    def load(cls, path: str | os.PathLike) -> "LambdaPath":
        """Read what `save` wrote. Nothing is unpickled.

        Raises:
            FileNotFoundError: no such file.
            InvalidReward: the file holds no path.
        """
        header, arrays = read_archive(path, cls.FORMATS)
        missing = [name for name in NUMBERS if name not in header] + [name for name in ARRAYS if name not in arrays]
        if missing:
            raise InvalidReward(f"{path} has no {missing[0]}: expected a file written by LambdaPath.save.")
        numbers = {name: header[name] for name in NUMBERS if name != "exact"}  # a property; before it was the search's own word
        numbers |= {"whole": header.get("whole", header["exact"]), "violation": header.get("violation", np.nan)}
        _check(path, arrays, numbers)
        return cls(**{name: arrays[name] for name in ARRAYS}, **numbers)


def _check(path: str | os.PathLike, arrays: dict[str, np.ndarray], numbers: dict[str, Any]) -> None:
    """Check that what a file holds is a path: k pieces, one after the other.

    Raises:
        InvalidReward: naming what is not.
    """
    k, R = arrays["l1_norms"].size, arrays["rewards"].shape[1:]
    shapes = {"breakpoints": (k + 1,), "gaps": (k + 1,), "l1_norms": (k,), "total_margins": (k,), "rewards": (k, *R)}
    shapes |= {"margins": (k, *R[:1])}
    for name, shape in shapes.items():
        one = arrays[name]
        if one.shape != shape or one.dtype.kind != "f" or not one.size or len(R) not in (1, 2):
            raise InvalidReward(f"{path} has {name} of shape {one.shape} and dtype {one.dtype}: expected {shape} floats.")
        fine = ~np.isinf(one) if name == "margins" else np.isfinite(one)
        if not fine.all():
            raise InvalidReward(f"{path} has {one[~fine][0]} among its {name}: expected finite numbers.")
    if (np.diff(arrays["breakpoints"]) < 0).any() or arrays["breakpoints"][0] < 0:
        raise InvalidReward(f"{path} has breakpoints {arrays['breakpoints'][:9]}: expected them from 0 on, increasing.")
    for name, value in numbers.items():
        if name == "whole":
            if not isinstance(value, bool):
                raise InvalidReward(f"{path} has {name} {value!r:.80}: expected true or false.")
        elif not (name == "margin_cap" and value is None) and not (name in ("gap", "violation") and value != value):
            least = None if name == "gap" else 0
            checked_number(f"{name} of {path}", value, "a finite number", least=least, error=InvalidReward)


def lambda_path(
    mdp: TabularMDP,
    expert: Any,
    *,
    r_max: float = 1.0,
    margin_cap: Any = None,
    reward_on: RewardOn = "state",
    most_pieces: int | None = None,
    time_limit: float | None = None,
) -> LambdaPath:
    """All rewards that FiniteLP gives as lambda rises from 0 to lambda_0.

    Args:
        mdp: only states reachable from d0 get a reward; the others get 0.
        expert: (S,) actions, (S, A) probabilities or (S, A) set of optimal actions, known in every state that is reached.
        r_max: R_max, the bound on |R|.
        margin_cap: None for the paper's program; the cap on margins; or "auto", FiniteLP's own, for the same expert.
        reward_on: "state" for R(s), "state-action" for R(s, a).
        most_pieces: pieces at most, at least 2: those that bring the path nearest to f first. None for all.
        time_limit: seconds for all linear programs together; those that choose the cap have as many.

    Raises:
        InvalidMDP: mdp is no TabularMDP.
        InvalidParameter: a number outside its range.
        InvalidPolicy: an expert of the wrong shape or content, or one that is not known in every state that is reached.
        DegenerateExpert: (4) leaves no reward with a positive margin anywhere.
        SolverTimeout, SolverFailed: no answer.
    """
    learner = FiniteLP(r_max=r_max, margin_cap=margin_cap, reward_on=reward_on, time_limit=time_limit)
    if most_pieces is not None:
        checked_number("most_pieces", most_pieces, "a whole number of at least 2, or None for all", least=2, whole=True)
    expert = _known(checked_mdp(mdp), expert)
    served, cap = (None, None) if margin_cap is None else served_actions(learner, mdp, expert)
    cap = cap if margin_cap == "auto" else margin_cap
    on_states, deadline = reward_on == "state", Deadline.after(time_limit)
    program = PricedProgram(mdp, expert, r_max=r_max, cap=cap, on_states=on_states, served=served, deadline=deadline)
    nothing = NO_MARGIN * min(r_max, np.inf if cap is None else cap)
    found = envelope(program.at, most_pieces, nothing) if program.states.size else None
    if found is None or found.breakpoints[-1] <= NO_MARGIN:
        learner.critical_l1(mdp, expert)  # says why
        raise DegenerateExpert("no reward has a margin above rounding: expected one that prefers the expert's actions.")
    return LambdaPath(
        breakpoints=found.breakpoints,
        rewards=np.stack([line.R for line in found.lines]),
        margins=np.stack([line.margins for line in found.lines]),
        l1_norms=np.array([line.norm for line in found.lines]),
        total_margins=np.array([line.total for line in found.lines]),
        gaps=found.gaps,
        gap=found.gap,
        whole=found.exact,
        violation=found.violation,
        r_max=float(r_max),
        margin_cap=None if cap is None else float(cap),
        solves=found.solves,
    )


def _known(mdp: TabularMDP, expert: Any) -> Any:
    """The expert, if it is known wherever it acts."""
    full, known = completed(expert, mdp.n_states)
    mdp.mixing(full)  # checks shape and content for all states
    acting = mdp.reachable & ~mdp.terminal
    unknown = np.flatnonzero(acting & ~known)
    if unknown.size:
        raise InvalidPolicy(
            f"expert[s={unknown[0]}] is NaN, as in {unknown.size} of {acting.sum()} states that are reached and act: expected "
            "an expert known in all of them. For one that is not the program is another, without a path here: use "
            "FiniteLP(l1=...) at a few prices."
        )
    return full
