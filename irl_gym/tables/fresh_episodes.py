"""Does `env.step` do what a table says that was itself estimated? Fresh episodes, compared as a second sample.

A table from samples is no truth that steps could contradict: it lacks what its samples missed, and its shares are off by noise.
So fresh episodes of random actions, of which the table knows nothing, are compared with the samples behind it:

    new steps    pairs (s, a), successors or payments that the table has never seen are counted, and told with the share of
                 episodes that hold one. Where a row was enumerated they are an error
    successors   chi-square of two samples (Pearson 1911) over first states and rows, where each value is expected at least 5
                 times in both; rarer ones are taken together
    rewards      the means of each row in both samples, within Bernstein's bound

Steps that differ beyond chance are an error too, as they are where a table is exact; but where the table's own episodes have
shown that observations hide state, they are to be expected, and told. Axes: S states, A actions, n steps.
"""

from typing import Any

import gymnasium as gym
import numpy as np
from scipy.stats import chi2

from irl_gym.errors import TableMismatch, UnknownObservation
from irl_gym.mdp.episodes import Episode
from irl_gym.spaces.batches import take
from irl_gym.tables.counted.counting import interact
from irl_gym.tables.selfcheck import LEAST_P_VALUE, OUTSIDE, SelfCheck, copy_of
from irl_gym.tables.tabulation import Samples, Tabulation

FRESH = 0xF8E5
"""Added to the seed of the check, so that its episodes are not those that the table was counted from."""
UNKNOWN = -1
EXPECTED = 5
"""Times that a value is expected in both samples at least to be compared by itself."""


def compare_with_episodes(env: gym.Env, table: Tabulation, samples: Samples, *, steps: int, seed: int) -> SelfCheck:
    """Compare fresh episodes of a copy of the environment with the samples behind a table.

    Args:
        env: the environment; neither stepped nor reset.
        table: the table.
        samples: what it was estimated from.
        steps: of all episodes together; the last one is cut.
        seed: of resets and actions.

    Raises:
        NotTabular: the environment cannot be copied, or raises an error.
        TableMismatch: a step that an enumerated row does not have, or steps that differ from the samples beyond chance though
            no hidden state was found.
    """
    begin = int(np.random.SeedSequence([seed, FRESH]).generate_state(1)[0])
    mdp, A = table.mdp, table.mdp.n_actions
    found = [_rows(table, episode) for episode in interact(copy_of(env), steps, seed=begin)]
    first = np.array([rows[0] for rows, _, _ in found])
    s, following = (np.concatenate([rows[part] for rows, _, _ in found]) for part in (slice(None, -1), slice(1, None)))
    actions, paid = (np.concatenate([one[i] for one in found]) for i in (1, 2))
    owner = np.repeat(np.arange(len(found)), [len(one[1]) for one in found])
    pairs = np.where(s == UNKNOWN, UNKNOWN, s * A + actions)
    new = _new(table, samples, pairs, following, paid)
    _refuse_enumerated(table, pairs, following, paid, new)
    statistic, degrees = _start(table, samples, first)
    tried, visits = pairs[pairs != UNKNOWN], table.row_samples.ravel()
    for row in np.unique(tried[visits[tried] > 0]):
        part = slice(mdp.P.indptr[row], mdp.P.indptr[row + 1])
        one, freedom = _two_samples(following[pairs == row], mdp.P.indices[part], samples.frequencies[part], float(visits[row]))
        statistic, degrees = statistic + one, degrees + freedom
    p_value = float(chi2.sf(statistic, degrees)) if degrees else 1.0
    hides = table.evidence.repeats is not None and table.evidence.repeats.hidden
    if not hides and p_value < LEAST_P_VALUE:
        raise TableMismatch(
            f"{len(pairs)} steps of fresh episodes differ from the samples behind the table: chi-square {statistic:.1f} on "
            f"{degrees} degrees of freedom, p = {p_value:.1e}. {OUTSIDE}"
        )
    if not hides:
        _check_rewards(table, samples, pairs, paid)
    acting = mdp.reachable & ~mdp.terminal
    return SelfCheck(
        len(pairs), np.unique(tried).size, int(acting.sum()) * A, statistic, degrees, p_value, len(found), int(new.sum()),
        np.unique(owner[new]).size,
    )  # fmt: skip


def _rows(table: Tabulation, episode: Episode) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """States (T+1,) of an episode, UNKNOWN where the table has none or knows no such end; actions and rewards."""
    ended = np.zeros(len(episode) + 1, dtype=bool)
    ended[-1] = episode.terminated
    try:
        rows = episode.rows(table.states)
    except UnknownObservation:
        rows = np.array([_row(table, take(episode.observations, np.array([i])), end) for i, end in enumerate(ended)])
    rows = np.where((rows != UNKNOWN) & (table.mdp.terminal[rows] != ended), UNKNOWN, rows)
    return rows, episode.taken("a fresh episode"), np.asarray(episode.rewards, dtype=np.float64)


def _row(table: Tabulation, observation: Any, ended: bool) -> int:
    try:
        return int(table.states.encode_batch(observation, terminated=np.array([ended]))[0])
    except UnknownObservation:
        return UNKNOWN


def _new(
    table: Tabulation, samples: Samples, pairs: np.ndarray, following: np.ndarray, paid: np.ndarray
) -> np.ndarray:  # fmt: skip
    """(n,) steps that the samples do not have."""
    mdp, entries, visits = table.mdp, table.payments.entries, table.row_samples.ravel()
    known: dict[tuple[int, int], float] = {}
    for row in np.unique(pairs[pairs != UNKNOWN]).tolist():
        if visits[row] > 0:
            for i in range(mdp.P.indptr[row], mdp.P.indptr[row + 1]):
                if samples.frequencies[i] > 0:
                    known[row, int(mdp.P.indices[i])] = np.nan if entries is None else float(entries[i])
    close = 1e-9 * table.payments.largest
    found = [known.get(step) for step in zip(pairs.tolist(), following.tolist(), strict=True)]
    return np.array(
        [pays is None or abs(pays - one) > close + 1e-6 * abs(one) for pays, one in zip(found, paid.tolist(), strict=True)]
    )


def _refuse_enumerated(table: Tabulation, pairs: np.ndarray, following: np.ndarray, paid: np.ndarray, new: np.ndarray) -> None:
    """A row that was enumerated has every successor."""
    sure = (pairs != UNKNOWN) & np.isinf(table.row_samples.ravel()[pairs])
    wrong = np.flatnonzero(new & sure)
    if wrong.size:
        i = wrong[0]
        s, a = divmod(int(pairs[i]), table.mdp.n_actions)
        part = slice(table.mdp.P.indptr[pairs[i]], table.mdp.P.indptr[pairs[i] + 1])
        to = "a state that it does not hold" if following[i] == UNKNOWN else str(following[i])
        raise TableMismatch(
            f"step took (s={s}, a={a}) to {to} and paid {paid[i]:.6g}: the table, in which that row was enumerated, allows "
            f"{table.mdp.P.indices[part].tolist()} only. {OUTSIDE}"
        )


def _start(table: Tabulation, samples: Samples, first: np.ndarray) -> tuple[float, int]:
    begins = np.flatnonzero(table.mdp.d0)
    return _two_samples(first, begins, table.mdp.d0[begins], samples.starts)


def _two_samples(found: np.ndarray, values: np.ndarray, shares: np.ndarray, n: float) -> tuple[float, int]:
    """Chi-square and degrees of freedom of a fresh sample (m,) against shares of n others; infinite n is the truth."""
    m = found.size
    fresh = np.array([*((found == value).sum() for value in values), 0.0])
    fresh[-1] = m - fresh.sum()  # of values that the others have not
    shares = np.append(shares, 0.0)
    weight = m / (m + n)
    pooled = (1 - weight) * shares + weight * fresh / m
    order = np.argsort(pooled)
    fresh, shares, pooled = fresh[order], shares[order], pooled[order]
    least = EXPECTED / min(m, n)
    rare = int(np.searchsorted(np.cumsum(pooled), least)) + 1  # so many are taken together
    fresh, shares, pooled = (np.append(one[rare:], one[:rare].sum()) for one in (fresh, shares, pooled))
    if pooled.size < 2 or pooled.min() < least:
        return 0.0, 0
    # each value's difference of shares has variance pooled (1 / m + 1 / n)
    return float(((fresh / m - shares) ** 2 / pooled).sum() / (1 / m + 1 / n)), pooled.size - 1


def _check_rewards(table: Tabulation, samples: Samples, pairs: np.ndarray, paid: np.ndarray) -> None:
    """Means of fresh rewards against those of the samples; what only a prior moved is not compared."""
    mdp, visits = table.mdp, table.row_samples.ravel()
    size = visits.size
    kept = (pairs != UNKNOWN) & (visits[pairs] > 0)
    rows, m = pairs[kept], np.maximum(np.bincount(pairs[kept], minlength=size), 1)
    mean = np.bincount(rows, weights=paid[kept], minlength=size) / m
    squares = np.bincount(rows, weights=paid[kept] ** 2, minlength=size) / m
    deviation = np.maximum(table.payments.deviation.ravel(), np.sqrt(np.maximum(squares - mean**2, 0.0)))
    width = max(samples.rewards[1], paid.max()) - min(samples.rewards[0], paid.min())
    logarithm = np.log(4 * size / LEAST_P_VALUE)
    inverse = 1 / m + 1 / np.maximum(visits, 1)
    allowed = deviation * np.sqrt(2 * logarithm * inverse) + 7 / 3 * width * logarithm * inverse
    moved = np.bincount(np.repeat(np.arange(size), np.diff(mdp.P.indptr)), np.abs(mdp.P.data - samples.frequencies), size)
    seen = np.bincount(rows, minlength=size) > 0
    gap = np.where(seen & (visits > 0), np.abs(mean - table.payments.mean.ravel()), 0.0)
    far = np.flatnonzero(gap > allowed + width * moved + 1e-9 * table.payments.largest)
    if far.size:
        s, a = divmod(int(far[0]), mdp.n_actions)
        raise TableMismatch(
            f"{m[far[0]]} steps from (s={s}, a={a}) in fresh episodes paid {mean[far[0]]:.4g} on average: the samples behind "
            f"the table {table.payments.mean[s, a]:.4g}. {OUTSIDE}"
        )
