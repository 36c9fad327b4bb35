"""How far the samples behind a table leave rewards and values open.

Values planned on a table that is an estimate are wrong by more than noise: the best of several noisy actions looks better than
it is. With the Bellman operators T of the truth and T' of the table, Q' - Q* = (T'Q' - T'Q*) + (T'Q* - TQ*), so that

    |V'(s) - V*(s)| <= U(s) = max_a e(s, a) + gamma sum_s' P'(s' | s, a) U(s')       the same for any policy's values
    e(s, a) >= |mean of n samples of X - E X|,   X = r + gamma V*(s')

V* is fixed, if not known, so that no sum over all successors is needed. For M rows at once e is the least of Hoeffding's bound
and of Maurer & Pontil's empirical Bernstein bound (2009, theorem 4),

    e = range(X) sqrt(log(4 M / delta) / (2 n))
    e = sqrt(2 L / (n - 1)) sd(X) + 7 L range(X) / (3 (n - 1)), L = log(8 M / delta)

sd and range of V* are at most those of V' and what U lets V* differ. So U is iterated downwards, and each iterate is a bound:
from the range of all values, or the simulation lemma's (max |R' - R| + gamma max ||P' - P||_1 range(V') / 2) / (1 - gamma).
States that no sample has met are held to be worth what others are, rewards to lie between the least and the largest seen, and
the number of visits to have been decided before. Axes: S states, A actions.
"""

import math
from dataclasses import replace

import numpy as np

from irl_gym._typing import Vector
from irl_gym.mdp.planning.dynamic_programming import policy_iteration
from irl_gym.mdp.tabular_mdp import TabularMDP, entry_rows
from irl_gym.tables.tabulation import Samples, Tabulation

CONFIDENCE = 0.95
"""With which all of a table's errors hold at once, of one kind."""
DELTA = (1 - CONFIDENCE) / 4
"""Of values: for rows, for their rewards and for their successors in the uniform bound, and for the first states."""
MOST_PLANNED = 3_000
"""States up to which V' is planned; of more, the range of values does."""
MOST_SWEEPS, SETTLED = 2_000, 1e-4
"""Sweeps of U at most, each of which is a bound, and the change, as a share of the range of values, at which they stop."""


def with_errors(table: Tabulation) -> Tabulation:
    """A table with the errors of its rewards and values in its evidence; none are known where hidden state was found."""
    told, samples = table.evidence, table.samples
    if samples is None:
        return table
    if told.repeats is not None and told.repeats.hidden:
        return replace(table, evidence=replace(told, error=None, reward_error=None, value_error=None))
    errors = {"reward_error": reward_error(table, samples), "value_error": value_error(table, samples)}
    return replace(table, evidence=replace(told, **errors))


def reward_error(table: Tabulation, samples: Samples) -> float | None:
    """Bound on |R - truth|, for all pairs at once with 95 % confidence, if no step pays less or more than was seen.

    None where all steps paid the same: they do not say what else there is.
    """
    width = samples.rewards[1] - samples.rewards[0]
    if not width:
        return None
    n = table.row_samples
    off = _off(table.payments.deviation.ravel(), width, n.ravel(), 1 - CONFIDENCE)
    off = np.minimum(off + width * _moved(table.mdp, samples), width).reshape(n.shape)
    return float(off[~table.mdp.terminal].max(initial=0.0))


def value_error(table: Tabulation, samples: Samples) -> float | None:
    """Bound on |V' - V*| from the first state, and as much for any policy's value, with 95 % confidence.

    At most the range of values, which is all that is known where the samples are too few; None where all steps paid the same.
    """
    mdp, (low, high) = table.mdp, samples.rewards
    most = ((max(high, 0.0) - min(low, 0.0)) if mdp.terminal.any() else high - low) * mdp.effective_horizon
    if high == low:
        return None
    V = policy_iteration(mdp, table.reward).V if mdp.n_states <= MOST_PLANNED else None
    span = most if V is None else min(most, float(np.ptp(V[mdp.reachable])))
    rows = _Rows(table, samples, V, span, most)
    U = np.where(mdp.terminal | ~mdp.reachable, 0.0, min(most, rows.uniform()))
    for _ in range(MOST_SWEEPS):
        before, U = U, np.minimum(U, (rows.errors(U) + mdp.gamma * (mdp.P @ U)).reshape(U.size, -1).max(axis=1))
        if np.max(before - U) <= SETTLED * most:
            break
    start = math.sqrt(math.log(2 / DELTA) / (2 * samples.starts)) if samples.starts < math.inf else 0.0
    return min(most, float(mdp.d0 @ U) + min(1.0, start) * min(most, span + 2 * float(U.max())))


class _Rows:
    """e (S*A,) as a function of U.

    Args:
        table: the table.
        samples: behind it.
        V: (S,) V'; None where it is not planned.
        span: of V', at most.
        most: the range of all values.
    """

    def __init__(self, table: Tabulation, samples: Samples, V: Vector | None, span: float, most: float):
        self.P, self.gamma, self.span, self.most = table.mdp.P, table.mdp.gamma, span, most
        self.width, self.n = samples.rewards[1] - samples.rewards[0], table.row_samples.ravel()
        self.moved = _moved(table.mdp, samples)
        acting = np.repeat(table.mdp.reachable & ~table.mdp.terminal, table.mdp.n_actions)
        self.acting, peak = acting, np.zeros(self.n.size)
        np.maximum.at(peak, entry_rows(self.P), self.P.data)
        self.rest = np.minimum(1.0, 2 * np.sqrt(np.maximum(1 - peak, 0.0)))  # sd of numbers from -1 to 1, at most
        around = 0.0 if V is None else V - V.mean()
        squares = np.maximum(self.P @ around**2 - (self.P @ around) ** 2, 0.0) if V is not None else (self.rest * span / 2) ** 2
        self.pays = table.payments.deviation.ravel()
        self.deviation = self.pays + self.gamma * np.sqrt(squares)

    def uniform(self) -> float:
        """A bound on U in every state that needs no other: the simulation lemma's (Kearns & Singh 2002)."""
        K = max(self.P.shape[1], 2)
        L = K * math.log(2) + math.log(max(int(self.acting.sum()), 1) / DELTA)
        with np.errstate(divide="ignore"):
            apart = np.where(np.isfinite(self.n), np.minimum(np.sqrt(2 * L / self.n), 2.0), 0.0) / 2  # Weissman et al. (2003)
        paid = np.minimum(_off(self.pays, self.width, self.n, DELTA), self.width)
        e = paid + self.gamma * np.minimum(apart, 1.0) * self.span + (self.width + self.gamma * self.span) * self.moved
        return float(e[self.acting].max(initial=0.0)) / (1 - self.gamma)

    def errors(self, U: Vector) -> np.ndarray:
        """(S*A,) e, where |V' - V*| <= U."""
        largest = float(U.max())
        width = self.width + self.gamma * min(self.most, self.span + 2 * largest)
        deviation = self.deviation + self.gamma * np.minimum(np.sqrt(self.P @ U**2), self.rest * largest)
        e = _off(deviation, width, self.n, DELTA) + width * self.moved
        return np.where(self.acting, np.minimum(e, width), 0.0)


def _off(deviation: np.ndarray, width: float, n: np.ndarray, delta: float) -> np.ndarray:
    """Bound on the errors of means of n samples each, all at once: Bernstein's or Hoeffding's, whichever is less.

    Infinite where there are none, and 0 where n is infinite, since the mean is no estimate.
    """
    sampled = np.isfinite(n)
    L = math.log(8 * max(int(sampled.sum()), 1) / delta)
    with np.errstate(divide="ignore", invalid="ignore"):
        bernstein = np.sqrt(2 * L / (n - 1)) * deviation + 7 * L * width / (3 * (n - 1))
        hoeffding = width * np.sqrt((L - math.log(2)) / (2 * n))
    return np.where(sampled, np.where(n >= 2, np.minimum(bernstein, hoeffding), hoeffding), 0.0)


def _moved(mdp: TabularMDP, samples: Samples) -> np.ndarray:
    """(S*A,) the probability that the prior moved."""
    off = np.abs(mdp.P.data - samples.frequencies)
    return np.bincount(entry_rows(mdp.P), weights=off, minlength=mdp.P.shape[0]) / 2
