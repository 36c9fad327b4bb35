"""What is certain of a clone: what it was shown, where it was shown nothing, and how far it is from what it was shown.

Of n(s, a), N = sum n, and a policy pi:
    mistakes   sum n(s, a) (1 - pi(a | s)) / N    how often a draw from pi differs from a demonstrated step
    log loss   -sum n(s, a) log pi(a | s) / N     nats a step
No policy of the table makes fewer mistakes than the most frequent actions, or has less log loss than n(s, a) / n(s). They are
of the demonstrated steps: of states that the clone comes to and the expert did not, they say nothing.
Axes: S states, A actions.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.special import xlogy

from irl_gym._typing import Matrix, StateMask
from irl_gym.facts import Fact, counted, plain
from irl_gym.mdp.tabular_mdp import TransitionTable

ROUNDING = 1e-12
"""Share of a sum of weights up to which it is a whole number."""


@dataclass(frozen=True)
class CloneProof:
    """What is certain of a clone."""

    steps: float
    """N, or the sum of the weights."""
    shown: int
    """States in which a step was demonstrated."""
    acting: int
    """States to act in that can be reached, of a table; else all that are numbered."""
    on_table: bool
    """Is the table known, so that it is known where there is something to do?"""
    unshown: int
    """Of the states to act in, those without demonstrations."""
    elsewhere: str
    """What is done there, in words."""
    mistakes: float
    """Share of the demonstrated steps."""
    least_mistakes: float
    """That no policy is below."""
    log_loss: float
    """Nats a step; infinite where a demonstrated action is never taken."""
    least_log_loss: float
    """That no policy is below."""

    @property
    def brief(self) -> str:
        """How the clone came about, in a few words."""
        never = f"{self.unshown:,} of {counted(self.acting, 'state')} never seen"
        return f"cloned from {self.steps:,.0f} steps; {never if self.unshown else 'every state was seen'}"

    def facts(self) -> tuple[Fact, ...]:
        """What was shown, where nothing was, and how the steps that were shown are imitated."""
        where = "states to act in that can be reached" if self.on_table else "states that there are numbers for"
        nothing = Fact("without demonstrations", f"none of the {self.acting:,} {where}", "good")
        if self.unshown:
            told = f"{self.unshown:,} of the {self.acting:,} {where}: {self.elsewhere}"
            nothing = Fact("without demonstrations", told, "open")
        whole = abs(self.steps - round(self.steps)) < ROUNDING * self.steps  # but for rounding, where actions were inferred
        steps = f"{self.steps:,.0f} steps" if whole else f"steps of a weight of {self.steps:.6g}"
        least = f"{self.least_mistakes:.4%} with the most frequent actions"
        found = (
            Fact("learned from", f"{steps}, in {counted(self.shown)}"),
            nothing,
            Fact("mistakes on these steps", f"{self.mistakes:.4%} of them, if actions are drawn from the policy; {least}"),
        )
        if not np.isfinite(self.log_loss):
            return found
        above = max(0.0, self.log_loss - self.least_log_loss)
        return (*found, Fact("log loss", f"{self.log_loss:.4g} nats a step, {above:.2g} above the least of all policies"))

    def to_json(self) -> dict[str, Any]:
        """As json holds it."""
        return plain(self)


@dataclass(frozen=True)
class SoftmaxProof(CloneProof):
    """What is certain of a softmax of features besides: how near it is to the best of its class."""

    weights: int
    """K A."""
    l2: float
    """Price of half the sum of the squared weights."""
    gradient_norm: float
    """Of the penalised log loss f, Euclidean."""

    @property
    def suboptimality(self) -> float:
        """How far f is above its least at most: f - f* <= ||grad f||^2 / (2 l2), since it is l2-strongly convex."""
        return self.gradient_norm**2 / (2 * self.l2)

    def facts(self) -> tuple[Fact, ...]:
        """The same, and the bound."""
        told = f"at most {self.suboptimality:.1e} above the least of its class, by a gradient of {self.gradient_norm:.1e}"
        return (*super().facts(), Fact("penalised log loss", told))

    def to_json(self) -> dict[str, Any]:
        """As json holds it."""
        return plain(self, "suboptimality")


def told_of(
    counts: np.ndarray, policy: Matrix, shown: StateMask, table: TransitionTable | None, elsewhere: str
) -> Mapping[str, Any]:
    """The fields of a CloneProof.

    Args:
        counts: (S, A) how often, or with what weight, each action was demonstrated.
        policy: (S, A) the clone.
        shown: (S,) states whose actions are known from demonstrations, their own or their cell's.
        table: None where it is not known.
        elsewhere: what is done in the others, in words.
    """
    acting = acting_in(table, len(counts))
    total = counts.sum()
    loss = max(0.0, -float(xlogy(counts, policy).sum() / total))
    least = float((xlogy(counts.sum(axis=1), counts.sum(axis=1)).sum() - xlogy(counts, counts).sum()) / total)
    return {
        "steps": float(total), "shown": int((counts.sum(axis=1) > 0).sum()), "acting": int(acting.sum()),
        "on_table": table is not None, "unshown": int((acting & ~shown).sum()), "elsewhere": elsewhere,
        "mistakes": max(0.0, float((counts * (1 - policy)).sum() / total)),
        "least_mistakes": float(1 - counts.max(axis=1).sum() / total), "log_loss": loss, "least_log_loss": least,
    }  # fmt: skip


def acting_in(table: TransitionTable | None, n_states: int) -> StateMask:
    """(S,) the states in which there is something to do, as far as is known."""
    return np.ones(n_states, dtype=bool) if table is None else table.reachable & ~table.terminal
