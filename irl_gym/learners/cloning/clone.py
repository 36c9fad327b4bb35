"""Behaviour cloning by counting: a table of what the demonstrations do, or one row of it for each cell of states.

    pi(a | s) = (n(c, a) + alpha) / (n(c) + A alpha),   c the cell of s; without cells each state is its own
Abbeel & Ng (2004, section 5) compare with three such clones: `Clone()`, which "mimics the expert", and one distribution, or the
most frequent action, for each macrocell of a grid. Axes: S states, A actions.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Literal

import numpy as np

from irl_gym._typing import Matrix, StateMask
from irl_gym.checks import any_array, checked_number, discrete_actions, float_array, is_word
from irl_gym.demonstrations.demonstrated import checked_counts
from irl_gym.errors import InvalidDemonstrations, InvalidParameter, MissingPart
from irl_gym.facts import counted
from irl_gym.learners.base import Outcome
from irl_gym.learners.cloning.nearest import nearest
from irl_gym.learners.cloning.proofs import CloneProof, acting_in, told_of
from irl_gym.learners.needs import Needs
from irl_gym.learners.problem import Problem
from irl_gym.mdp.episodes import EmpiricalPolicy
from irl_gym.mdp.tabular_mdp import TransitionTable
from irl_gym.programs.status import Status
from irl_gym.spaces.states import States

Elsewhere = Literal["uniform", "nearest", "refuse"]


@dataclass(frozen=True, eq=False)
class Clone:
    """Behaviour cloning by counting.

    Raises:
        InvalidParameter: a field outside its range, or smoothing of a majority.
    """

    smoothing: float = 0.0
    """alpha, of how many more times each action counts, at least 0; 1 is Laplace's rule."""
    unseen: Elsewhere = "uniform"
    """Where nothing was demonstrated: uniformly random actions; what is done in the nearest state where something was, by
    transitions of the table (`nearest`); or refuse, an error if such a state can be reached."""
    majority: bool = False
    """The most frequent action, the lowest of those that tie, in place of the shares: of an expert that errs now and then."""
    cells: Sequence[int] | np.ndarray | None = None
    """(S,) the cell of each state, whole numbers from 0: states of a cell are not told apart. None: each state is its own."""
    needs: ClassVar[Needs] = Needs(("demonstrations",), ("dynamics",), "inferred")
    """The parts of a problem that `learn` reads; the dynamics tell which states matter, and which are near."""
    how: ClassVar[str] = "cloned from the episodes"
    """How its policy comes about."""
    on_rows: ClassVar[bool] = True
    """Its policy is one of numbered states, so that without them there is none."""

    def __post_init__(self) -> None:
        checked_number("smoothing", self.smoothing, "a number of at least 0", least=0)
        if not is_word(self.unseen, "uniform", "nearest", "refuse"):
            raise InvalidParameter(f"unseen is {self.unseen!r}: expected 'uniform', 'nearest' or 'refuse'.")
        if not isinstance(self.majority, bool) or (self.majority and self.smoothing):
            raise InvalidParameter(
                f"majority is {self.majority!r} and smoothing {self.smoothing:g}: expected True or False, and a smoothing of 0 "
                "where it is True."
            )

    def learn(self, problem: Problem, rng: np.random.Generator | None = None) -> Outcome[None, CloneProof]:
        """The same as `fit`, of a problem; nothing is drawn.

        Args:
            problem: with demonstrations; with a table, where the nearest state is asked for.
            rng: not used.

        Raises:
            MissingPart: one of these is not there. And whatever `fit` raises.
            NotDiscrete: observations that cannot be numbered, or actions that are not one number.
        """
        known = self.needs.of(problem, self)
        discrete_actions(known.spaces.actions)
        table = known.dynamics if isinstance(known.dynamics, TransitionTable) else None
        return replace(self.fit(known.shown.weights, table), inferred=known.inferred)

    def fit(
        self, seen: EmpiricalPolicy | np.ndarray, table: TransitionTable | None = None, /, *, states: States | None = None
    ) -> Outcome[None, CloneProof]:
        """Clone what was seen.

        Args:
            seen: how often each action was taken in each state, as `empirical_policy(episodes, states, A)` or, of millions of
                steps in flat arrays, `counted_pairs(states, actions, S, A)` says; or (S, A) weights, such as an occupancy.
            table: P and d0, which tell what can be reached; None where they are not known.
            states: not used, since counting needs no observations; `SoftmaxClone.fit` takes it.

        Raises:
            InvalidDemonstrations: counts that no episodes could have given, or of another table; or there are none in a state
                that can be reached, and `unseen` is "refuse".
            InvalidParameter: cells that are not one whole number a state.
            MissingPart: `unseen` is "nearest", and there is no table.
        """
        counts = weights_of(seen, table)
        pooled, cells = self._pooled(counts)
        total = pooled.sum(axis=1, keepdims=True)
        A, alpha, shown = counts.shape[1], float(self.smoothing), total[:, 0] > 0
        if self.majority:
            shares = np.eye(A)[pooled.argmax(axis=1)]
        else:
            shares = (pooled + alpha) / np.maximum(total + A * alpha, np.finfo(float).tiny)
        policy, told = self._elsewhere(np.where(shown[:, None], shares, 1 / A), shown, table)
        return Outcome(
            None, Status.LEARNED, CloneProof(**told_of(counts, policy, shown, table, told)), {"cells": cells}, policy
        )

    def fit_costs(
        self, costs: np.ndarray, visited: StateMask, table: TransitionTable | None = None, /, *, states: States | None = None
    ) -> Outcome[None, CloneProof]:
        """The policy of the class that costs least where it was visited: the cheapest action of each cell, the lowest of ties.

        Args:
            costs: (S, A) what each action costs, added up over all visits of a state.
            visited: (S,) where that is known.
            table: as `fit`, and so the errors.
            states: not used.
        """
        gains = np.where(visited[:, None], costs.max(axis=1, keepdims=True) - costs, 0.0)
        gains[visited] += np.finfo(float).eps * (gains.max() or 1.0)  # a state where all cost the same was visited too
        return replace(self, majority=True, smoothing=0.0).fit(gains, table)

    def _pooled(self, counts: Matrix) -> tuple[Matrix, int]:
        """(S, A) the counts of each state's cell, and how many cells there are."""
        if self.cells is None:
            return counts, len(counts)
        cells = any_array("cells", self.cells, "(S,) whole numbers", InvalidParameter)
        if cells.shape != counts.shape[:1] or cells.dtype.kind not in "iu" or cells.min() < 0:
            raise InvalidParameter(
                f"cells has shape {cells.shape} and dtype {cells.dtype}: expected ({len(counts)},) whole numbers of at least "
                "0, the cell of each state."
            )
        names, numbers = np.unique(cells, return_inverse=True)
        pooled = np.zeros((names.size, counts.shape[1]))
        np.add.at(pooled, numbers, counts)
        return pooled[numbers], names.size

    def _elsewhere(self, policy: Matrix, shown: StateMask, table: TransitionTable | None) -> tuple[Matrix, str]:
        """The policy (S, A), filled in where nothing was shown, and what is done there in words."""
        missing = acting_in(table, len(policy)) & ~shown
        if self.unseen == "refuse" and missing.any():
            raise InvalidDemonstrations(
                f"{counted(int(missing.sum()))}, state {int(np.argmax(missing))} first, can be reached and "
                f"{'have' if missing.sum() > 1 else 'has'} no demonstrations, and unseen is 'refuse': expected a step in each. "
                "Record more episodes, or use unseen='uniform' or unseen='nearest'."
            )
        if self.unseen != "nearest":
            return policy, "random actions there"
        if table is None:
            raise MissingPart(
                "unseen is 'nearest', and there is no table: expected the dynamics, whose transitions say what is near. Give "
                "`tabulate(env, gamma=...).mdp`, or use unseen='uniform'."
            )
        rows, apart = nearest(table, shown & ~table.terminal)
        found = ~shown & (rows >= 0)
        lost, farthest = int((missing & (rows < 0)).sum()), int(apart[missing].max(initial=0))
        told = f"there the nearest state that has some is copied, at most {counted(farthest, 'transition')} apart"
        told += f"; {lost:,} of them are joined to none, and have random actions" if lost else ""
        return np.where(found[:, None], policy[np.where(found, rows, 0)], policy), told


def weights_of(seen: Any, table: TransitionTable | None) -> Matrix:
    """(S, A) counts or weights as floats.

    Raises:
        InvalidDemonstrations: neither; negative, not finite, all 0; or of another number of states or actions than the table.
    """
    if isinstance(seen, EmpiricalPolicy):
        weights = checked_counts(seen).astype(np.float64)
    else:
        expected = "an EmpiricalPolicy, such as `empirical_policy` gives, or (S, A) weights"
        weights = float_array("what was seen", seen, expected, InvalidDemonstrations)
        if weights.ndim != 2 or not np.isfinite(weights).all() or (weights < 0).any() or not weights.any():
            raise InvalidDemonstrations(
                f"what was seen has shape {weights.shape}, from {np.min(weights, initial=0):g} to "
                f"{np.max(weights, initial=0):g}: expected (S, A) finite weights of at least 0, some above."
            )
    if table is not None and weights.shape != (table.n_states, table.n_actions):
        raise InvalidDemonstrations(
            f"what was seen has shape {weights.shape}: expected ({table.n_states}, {table.n_actions}), the table's."
        )
    return weights
