"""A table of an environment, and the evidence for it.

A source gives *lines*: row s * A + a, successor, probability, reward. `from_lines` adds up duplicates and says what steps pay.
Axes: S states, A actions, m lines.
"""

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from irl_gym._typing import Matrix, Sparse
from irl_gym.mdp.rewards import RewardFunction, TabularReward
from irl_gym.mdp.tabular_mdp import AS_GOOD_AS_EXACT, TabularMDP, TransitionTable, entry_positions, entry_rows
from irl_gym.records import Record
from irl_gym.spaces.states import States
from irl_gym.tables.repeats import Repeats
from irl_gym.tables.selfcheck import Payments, SelfCheck


@dataclass(frozen=True)
class Evidence(Record):
    """How a table was obtained, and what the check against `env.step` found."""

    method: str
    """Where the probabilities come from, in a sentence."""
    exact: bool
    """Are the probabilities exact, not estimated? They are those of the states that the observations show: where a table was
    enumerated, state that they hide was searched for and not found, which does not exclude it."""
    merged: int
    """Successors that stood more than once in a row and were added up."""
    split: int
    """States split into an ordinary row and a terminal copy."""
    check: SelfCheck | None
    """What sampling `env.step` found; None when it was not asked for."""
    error: float | None = 0.0
    """Sampling noise: if observations hide no state, all probabilities of P and d0 are within this of the environment's, with
    95 % confidence; 0 where exact, None where not known, as where hidden state was found."""
    reward_error: float | None = 0.0
    """The same of the mean rewards, if no step pays less or more than was seen; None too where all paid the same."""
    value_error: float | None = 0.0
    """The same of discounted values from the first states: the best one, and that of any policy."""
    repeats: Repeats | None = None
    """What repeated visits within an episode say about hidden state; None where the table was not counted from episodes."""

    def __str__(self) -> str:
        """The evidence in a few lines a person reads."""
        lines = [self.method, f"exact                    {'yes' if self.exact else 'no'}"]
        if not self.exact:
            lines += [f"{name:24} {told}" for name, told in self.errors().items()]
        if self.repeats is not None:
            lines.append(f"hidden state             {self.repeats}")
        lines.append(f"ends that are states too {self.split}")
        if self.check is not None:
            lines.append(f"checked against env.step {self.check}")
        return "\n".join(lines)

    def errors(self) -> dict[str, str]:
        """What is off, and by how much at most, in words."""
        if self.repeats is not None and self.repeats.hidden:
            return {
                "sampling noise": "not bounded, since observations hide state: show it with "
                "`irl_gym.environments.reveal.Reveal`"
            }
        if self.error is None:
            return {"probabilities": "off by an amount that is not known"}
        sure = f"within {self.error:.2g} for sampling noise, with 95 % confidence, if observations hide no state"
        told = {"probabilities": sure}
        for name, off in (("mean rewards", self.reward_error), ("values planned on it", self.value_error)):
            told[name] = "not known, as all steps paid the same"
            if off is not None:
                told[name] = f"within {off:.2g}, likewise, if no step pays less or more than was seen"
        return told


@dataclass(frozen=True, eq=False)
class Samples(Record):
    """The samples behind a table that is not exact."""

    frequencies: np.ndarray
    """(nnz,) the share of them that each entry of P had, in the order of P.data; P itself where there is no prior."""
    starts: float
    """Episodes behind d0; infinite where it was enumerated."""
    rewards: tuple[float, float]
    """The least and the largest reward seen."""


@dataclass(frozen=True, eq=False)
class Tabulation(Record):
    """An environment as a table."""

    mdp: TabularMDP
    """P, gamma and d0."""
    reward: TabularReward
    """(S, A) the environment's own reward, in expectation over successors."""
    payments: Payments
    """What single steps pay: mean, deviation, and the reward of each transition where s, a and s' settle it."""
    states: States
    """Observations to rows and back."""
    evidence: Evidence
    """How it was obtained."""
    samples: Samples | None = None
    """What it was estimated from; None where it is exact, of cells, or read from a file."""

    @property
    def row_samples(self) -> Matrix:
        """(S, A) samples of each row of P: `mdp.visits`, but infinite where the row is exact; 0 where a rule made it up."""
        visits = self.mdp.visits
        if visits is None:
            return np.full((self.mdp.n_states, self.mdp.n_actions), np.inf)
        return np.where(visits >= AS_GOOD_AS_EXACT, np.inf, visits)


def payments_of(table: TransitionTable, reward: RewardFunction) -> Payments:
    """What a reward function pays on the transitions of a table."""
    rows = entry_rows(table.P)
    states, actions = np.divmod(rows, table.n_actions)
    paid = np.asarray(reward.pay(states, actions, table.P.indices), dtype=np.float64)
    mean, deviation = moments(rows, table.P.data, paid, paid**2, (table.n_states, table.n_actions))
    return Payments(mean, deviation, paid, float(np.abs(paid).max(initial=0.0)))


def moments(
    rows: np.ndarray, p: np.ndarray, r: np.ndarray, squares: np.ndarray, shape: tuple[int, int]
) -> tuple[np.ndarray, np.ndarray]:
    """(S, A) mean and standard deviation of what a step pays, from lines of row, probability, mean reward and mean square."""
    R, square = (np.bincount(rows, weights=p * one, minlength=shape[0] * shape[1]).reshape(shape) for one in (r, squares))
    variance = square - R**2
    return R, np.sqrt(np.where(variance > 1e-12 * square, variance, 0.0))


@dataclass(frozen=True, eq=False)
class Lines:
    """What steps do: one successor of a pair (s, a) a line; several lines may have the same successor."""

    rows: np.ndarray
    """(m,) s * A + a."""
    successors: np.ndarray
    """(m,) s'."""
    probabilities: np.ndarray
    """(m,) those of a row add up to 1."""
    rewards: np.ndarray
    """(m,) what such a step pays."""


def from_lines(
    lines: Lines,
    d0: np.ndarray,
    n_actions: int,
    states: States,
    *,
    gamma: float,
    evidence: Evidence,
    horizon: int | None = None,
) -> Tabulation:
    """The table of some lines, in which terminal states have none; all episodes end within a horizon, where there is one."""
    rows, p, r = lines.rows, lines.probabilities, lines.rewards
    shape = (states.n_states * n_actions, states.n_states)
    mdp = TabularMDP(sp.coo_array((p, (rows, lines.successors)), shape=shape), gamma, d0, None, horizon)
    R, deviation = moments(rows, p, r, r**2, (states.n_states, n_actions))
    paid = _entry_rewards(mdp.P, rows, lines.successors, p, r)
    payments = Payments(R, deviation, paid, float(np.abs(r).max(initial=0.0)))
    evidence = replace(evidence, merged=rows.size - mdp.P.nnz)
    return Tabulation(mdp, TabularReward(R, {"source": "environment"}), payments, states, evidence)


def _entry_rewards(P: Sparse, rows: np.ndarray, columns: np.ndarray, p: np.ndarray, r: np.ndarray) -> np.ndarray | None:
    """(nnz,) rewards in the order of P.data; None where two lines of one (s, a, s') pay differently."""
    position = entry_positions(P, rows, columns)
    mean = np.bincount(position, weights=p * r, minlength=P.nnz) / P.data
    return mean if np.allclose(mean[position], r, rtol=1e-9, atol=1e-12) else None
