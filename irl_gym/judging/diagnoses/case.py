"""The evidence that the doctor works on, of a result in memory and of a run's folder alike.

What follows from P, the expert and R is computed again; of the learner's proof only what it alone knows is taken.
Axes: S states, A actions, n rows of (4) among the reachable states in which the expert is known.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np

from irl_gym._typing import ActionSets, Indices, Matrix, Numbers, StateMask
from irl_gym.errors import DegenerateExpert, IrlGymError
from irl_gym.judging.metrics import Tie, ties_of, worst_tie
from irl_gym.learners.base import Outcome
from irl_gym.learners.linear_programs.finite import FiniteLP
from irl_gym.learners.linear_programs.proofs.finite_proof import served
from irl_gym.mdp.margins import JudgedRows, Margins, margins_under
from irl_gym.mdp.optimality import Optimality, certify
from irl_gym.mdp.optimality_rows import compare
from irl_gym.mdp.planning.discounted import EPSILON
from irl_gym.mdp.planning.dynamic_programming import optimum
from irl_gym.mdp.planning.howard import Optimum
from irl_gym.mdp.policies import as_distribution, completed
from irl_gym.mdp.rewards import TabularReward
from irl_gym.mdp.tabular_mdp import TabularMDP
from irl_gym.programs.status import Status

SMALL = 2_000
"""Reachable states up to which programs are solved again, to say what another learner would find."""


@dataclass(frozen=True, eq=False)
class Case:
    """What is known of one learned reward."""

    mdp: TabularMDP | None = None
    """The table; None where the environment was only stepped."""
    expert: Any = None
    """(S,) actions, (S, A) probabilities, NaN where nothing is known, or (S, A) set; None where it is not known at all."""
    reward: TabularReward | None = None
    """R in the table; None where no reward came out, or there is no table."""
    claims: Mapping[str, Any] = field(default_factory=dict)
    """What a certificate says, by name (`certificates.claims_in`), or a proof's terms; empty where there is neither."""
    status: Status | None = None
    """What became of the program; None where there was none, or nothing is known of it."""
    stats: Mapping[str, Any] = field(default_factory=dict)
    """Solver, attempts, rounds."""
    true: TabularReward | None = None
    """The true reward, where it is known."""
    shaped: bool = False
    """Is the agent retrained on the expected advantage?"""
    judged: Mapping[str, Any] = field(default_factory=dict)
    """The content of a run's metrics.json; empty where nothing was judged."""
    weights: np.ndarray | None = None
    """(K,) alpha of a reward that is linear in features; None for another."""
    gone: str | None = None
    """Why the expert is not known, where it was once."""

    @cached_property
    def on_states(self) -> bool:
        """Is R a reward on states?"""
        return self.reward is None or self.reward.on_states

    @cached_property
    def states(self) -> Indices:
        """The reachable states."""
        return np.zeros(0, dtype=np.int64) if self.mdp is None else np.flatnonzero(self.mdp.reachable)

    @cached_property
    def acting(self) -> StateMask:
        """(S,) reachable states that are not terminal."""
        return np.zeros(0, dtype=bool) if self.mdp is None else self.mdp.reachable & ~self.mdp.terminal

    @cached_property
    def small(self) -> bool:
        """Is the table small enough to solve programs again?"""
        return 0 < self.states.size <= SMALL

    @cached_property
    def _completed(self) -> tuple[Matrix, StateMask]:
        assert self.mdp is not None
        policy, known = completed(self.expert, self.mdp.n_states)
        return as_distribution(policy, self.mdp.n_states, self.mdp.n_actions), known

    @property
    def distribution(self) -> Matrix:
        """(S, A) the expert, uniform where nothing is known of it. Ask only where there is one."""
        return self._completed[0]

    @cached_property
    def known(self) -> StateMask:
        """(S,) where the expert is known."""
        return np.zeros_like(self.acting) if self.mdp is None or self.expert is None else self._completed[1]

    @cached_property
    def has_expert(self) -> bool:
        """Is the expert known in any reachable state where it acts?"""
        return bool((self.known & self.acting).any())

    @cached_property
    def fully_known(self) -> bool:
        """Is the expert known wherever it can act?"""
        return self.has_expert and bool(self.known[self.acting].all())

    @cached_property
    def optimum(self) -> Optimum | None:
        """What acting best is worth under R."""
        return None if self.mdp is None or self.reward is None else optimum(self.mdp, self.reward)

    @cached_property
    def true_optimum(self) -> Optimum | None:
        """What acting best is worth under the true reward."""
        return None if self.mdp is None or self.true is None else optimum(self.mdp, self.true)

    @cached_property
    def scale(self) -> float:
        """The largest |R| that can be paid."""
        return 0.0 if self.reward is None or self.mdp is None else self.reward.largest(self.mdp)

    @cached_property
    def ties(self) -> ActionSets:
        """(S, A) actions that are or may be greedy under R. Ask only where there is a reward in a table."""
        assert self.optimum is not None and self.reward is not None
        return ties_of(self.optimum, self.reward.tolerance).possible

    @cached_property
    def continued(self) -> Matrix | None:
        """(S, A) the expert where it is known, and the best under the true reward elsewhere; None where that is not known."""
        if self.mdp is None or self.true_optimum is None:
            return None
        best = np.eye(self.mdp.n_actions)[self.true_optimum.policy]
        return best if self.expert is None else np.where(self.known[:, None], self.distribution, best)

    @cached_property
    def worst(self) -> Tie | None:
        """The worst policy under the true reward among those greedy under R; None where there is no such reward."""
        if self.mdp is None or self.reward is None or self.true is None:
            return None
        return worst_tie(self.mdp, self.reward, self.true)

    @cached_property
    def true_tie(self) -> float:
        """Differences of values from the start up to this are rounding, under the true reward; 0 where it is not known."""
        if self.mdp is None or self.true_optimum is None:
            return 0.0
        size = float(self.mdp.d0 @ np.abs(self.true_optimum.V)) * self.mdp.effective_horizon
        return float(self.mdp.d0 @ self.true_optimum.error) + 64 * EPSILON * size

    @cached_property
    def rows(self) -> JudgedRows | None:
        """The rows of (4); None without a table or an expert."""
        return self.rows_at(None) if self.has_expert else None

    def rows_at(self, gamma: float | None) -> JudgedRows:
        """The rows of (4) for another discount, or for the table's own."""
        assert self.mdp is not None
        keep = self.states
        part = self.mdp.restrict(keep)
        if gamma is not None:
            part = TabularMDP(part.P, gamma, part.d0, part.visits, part.horizon)
        c = compare(part, self.distribution[keep], np.flatnonzero((self.known & self.acting)[keep]))
        nothing, errors = np.full(c.states.size, np.nan), np.zeros(c.states.size)
        margins = Margins(nothing, nothing, nothing, nothing, nothing > 0, nothing > 0, nothing)
        either = c.equal
        if self.reward is not None:
            # As `certify`: what follows an unknown state, or an error, is worth what acting best is.
            best = not self.fully_known or self.errs
            margins, either = margins_under(part, c, self.reward.of_rows(keep), best=best)[1], c.equal & (not best)
            if c.sampling is not None:
                errors = c.sampling.of_margins(margins.worth)
        usable = ~c.equal & (~c.trivial | (not self.on_states))
        return JudgedRows(keep[c.states], c.actions.astype(np.int64), c.equal, c.trivial, margins, either, usable, errors)

    @cached_property
    def optimality(self) -> Optimality | None:
        """What R says of the expert, ties that no reward breaks left out as a program finds them now; None without either."""
        if self.rows is None or self.mdp is None or self.reward is None:
            return None
        tied = self.rows.usable & self.rows.tied
        possible = self.can_have_margin if self.speaks and tied.any() else None
        pairs = np.column_stack([self.rows.states[tied], self.rows.actions[tied]])
        without = None if possible is None else pairs[~possible[pairs[:, 0], pairs[:, 1]]]
        return certify(self.mdp, self.expert, self.reward, errs=self.errs, unbreakable=without)

    @property
    def counted(self) -> bool:
        """Is the table an estimate from counts?"""
        return self.mdp is not None and self.mdp.visits is not None

    @cached_property
    def beyond(self) -> StateMask:
        """(S,) states in which every row that R can move has a margin, beyond its own rounding."""
        if (told := self.optimality) is None:
            return np.zeros_like(self.acting)
        found = np.isfinite(told.margin)
        found[told.marginless] = False
        return found

    @property
    def margins(self) -> Numbers:
        """(m,) their smallest margins."""
        return np.zeros(0) if self.optimality is None else self.optimality.margin[self.beyond]

    @property
    def errs(self) -> bool:
        """May the expert err, as the learner took it?"""
        return bool(self.claims.get("errs", self.claims.get("slack") is not None))

    @cached_property
    def prefers(self) -> bool:
        """Is some action worse than another under R, for certain?"""
        return self.optimum is not None and not self.ties[self.acting].all()

    @property
    def speaks(self) -> bool:
        """Does R prefer some action to another, in a table with an expert?"""
        return self.prefers and self.has_expert

    @cached_property
    def judges_states(self) -> bool:
        """Does the learner promise margins in states? Not where it compares sampled values of whole policies, by features."""
        return "gaps" not in self.claims or (self.reward is not None and self.weights is None)

    @cached_property
    def linear(self) -> bool:
        """Is R in the span of features?"""
        return "n_features" in self.claims

    def learner(self, **changes: Any) -> FiniteLP:
        """FiniteLP with capped margins, for rewards of this kind."""
        kind: Literal["state", "state-action"] = "state" if self.on_states else "state-action"
        unvisited = "avoid" if self.reward is None else self.reward.note.get("unvisited", "avoid")
        return replace(FiniteLP(reward_on=kind, unvisited=unvisited), **changes)

    @cached_property
    def can_have_margin(self) -> ActionSets | None:
        """(S, A) rows of (4) that some reward makes strict; None where that is not known."""
        if self.mdp is None or self.best is None or isinstance(self.best, DegenerateExpert):
            return None
        return served(self.mdp, self.expert, self.best.reward, self.best.proof)

    @cached_property
    def best(self) -> Outcome | DegenerateExpert | None:
        """What FiniteLP with hard rows and capped margins finds; why there is nothing; None where that is not known."""
        if not (self.small and self.has_expert and self.mdp is not None):
            return None
        try:
            return self.learner().fit(self.mdp, self.expert)
        except DegenerateExpert as reason:
            return reason
        except IrlGymError:  # a solver without an answer: nothing is claimed
            return None
