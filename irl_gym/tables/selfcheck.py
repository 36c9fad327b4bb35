"""Does `env.step` do what the table says? Sampled, and compared.

A copy of the environment runs with random actions, without its TimeLimit, but where the table has a horizon. Three
comparisons:
    support      a transition that the table says is impossible, or one that ends when the table says it goes on, is an error
    probability  Pearson's chi-square over first states and rows, where each value is expected at least 5 times
    reward       each payment against the table's, exactly; where s, a and s' do not settle it, the mean of each row within
                 Bernstein's bound
"""

from dataclasses import dataclass, replace
from typing import Any

import gymnasium as gym
import numpy as np
from scipy.stats import chi2

from irl_gym._typing import Matrix
from irl_gym.errors import NotTabular, TableMismatch, UnknownObservation
from irl_gym.intervals import mean_interval
from irl_gym.mdp.policies import generator
from irl_gym.mdp.tabular_mdp import TabularMDP, entry_positions
from irl_gym.records import Record
from irl_gym.spaces.states import States
from irl_gym.tables.copies.stripped import without_watchers
from irl_gym.tables.copies.time_limits import with_limits

LEAST_P_VALUE = 1e-9
"""Of the chi-square test and of the rewards' bound. The statistic's tail is heavier than chi-square's where few are
expected, so that a right table fails more often than this, if still hardly ever."""

LONG = 2_000
"""Steps that every other walk may take at least."""
OUTSIDE = (
    "Something acts outside the table. Where it was enumerated, the observation may hide part of the state: show it with "
    "`irl_gym.environments.reveal.Reveal`."
)


@dataclass(frozen=True, eq=False)
class Payments(Record):
    """What the table says of rewards."""

    mean: Matrix
    """(S, A) expected reward of a step."""
    deviation: Matrix
    """(S, A) its standard deviation."""
    entries: np.ndarray | None
    """(nnz,) reward of each transition in the order of P.data; None where s, a and s' do not settle it."""
    largest: float
    """The largest |reward| of any step."""


@dataclass(frozen=True)
class SelfCheck(Record):
    """What sampling `env.step` found; it found no contradiction, or an error was raised."""

    steps: int
    """Steps compared."""
    rows_seen: int
    """Pairs (s, a) tried at least once."""
    rows_total: int
    """Pairs (s, a) of reachable states that are not terminal."""
    chi_square: float
    """Pearson's statistic over the rows visited often enough."""
    degrees: int
    """Its degrees of freedom; 0 when every such row has one successor."""
    p_value: float
    """Probability of a statistic this large when the table is right."""
    episodes: int = 0
    """Fresh episodes that the steps were made in, where the table is an estimate; 0 where it is exact."""
    new_steps: int = 0
    """Steps that such a table has never seen: what follows, what is paid, or the pair (s, a) itself. Few samples miss some."""
    new_episodes: int = 0
    """Episodes with such a step."""

    def __str__(self) -> str:
        seen = f"{self.steps:,} steps, {self.rows_seen:,} of {self.rows_total:,} pairs (s, a)"
        if not self.episodes:
            return f"{seen}, no contradiction; p = {self.p_value:.2g}"
        share = mean_interval(np.repeat([1.0, 0.0], [self.new_episodes, self.episodes - self.new_episodes]), possible=(0, 1))
        return (
            f"{seen}, in {self.episodes:,} fresh episodes: {self.new_steps:,} steps that the table has never seen, in "
            f"{share.estimate:.1%} of episodes ({share.low:.1%} to {share.high:.1%}); the rest agree with the table's own "
            f"samples: p = {self.p_value:.2g}"
        )


def compare_with_steps(
    env: gym.Env, mdp: TabularMDP, states: States, payments: Payments, *, steps: int, seed: int
) -> SelfCheck:
    """Sample steps of a copy of the environment and compare them with a table.

    Raises:
        NotTabular: the environment cannot be copied.
        TableMismatch: a step the table says is impossible, or frequencies that it makes all but impossible.
    """
    walker = copy_of(env, limits=mdp.horizon is not None)
    rng = generator(seed)
    A = mdp.n_actions
    first_action = int(getattr(walker.action_space, "start", 0))
    seen, paid, starts = np.empty((steps, 2), dtype=np.int64), np.empty(steps), []
    # A walk that never ends is started again: in turn late, since an environment may count its steps, and early.
    limits = 20 * mdp.n_states, max(20 * mdp.n_states, LONG)

    def begin(**kwargs: Any) -> int:
        starts.append(_row_of(states, walker.reset(**kwargs)[0], terminated=False))
        _check_start(mdp, starts[-1])
        return starts[-1]

    row, age = begin(seed=seed), 0
    for i in range(steps):
        a = int(rng.integers(A))
        observation, paid[i], terminated, truncated, _ = walker.step(a + first_action)
        following = _row_of(states, observation, terminated=bool(terminated))
        seen[i] = row * A + a, following
        _check_transition(mdp, row, a, following, bool(terminated))
        age += 1
        row = following
        if terminated or truncated or age >= limits[len(starts) % 2]:
            row, age = begin(), 0
    _check_rewards(mdp, payments, seen, paid)
    return _chi_square(mdp, seen, np.array(starts))


def _row_of(states: States, observation: Any, *, terminated: bool) -> int:
    try:
        return states.encode(observation, terminated=terminated)
    except UnknownObservation as error:
        raise TableMismatch(f"the environment showed what the table does not hold: {error} {OUTSIDE}") from error


def copy_of(env: gym.Env, *, limits: bool = False) -> gym.Env:
    """A copy without watchers, or the environment made anew where it cannot be copied; with its time limits, if they count.

    Raises:
        NotTabular: neither can be done.
    """
    made = with_limits if limits else without_watchers
    try:
        return made(env)
    except NotTabular as error:
        if env.spec is None:
            raise NotTabular(f"{error} Or pass check_steps=0 to go without the check.") from error
        return made(gym.make(replace(env.spec, kwargs={**env.spec.kwargs, "render_mode": None})))


def _check_start(mdp: TabularMDP, row: int) -> None:
    if not mdp.d0[row] > 0:
        raise TableMismatch(
            f"reset began in state {row}, which has probability 0 in d0: expected a first state of the table. Correct the "
            f"start that is published, where one is. {OUTSIDE}"
        )


def _check_transition(mdp: TabularMDP, s: int, a: int, following: int, terminated: bool) -> None:
    row = s * mdp.n_actions + a
    possible = mdp.P.indices[mdp.P.indptr[row] : mdp.P.indptr[row + 1]]
    if following not in possible:
        raise TableMismatch(
            f"step took (s={s}, a={a}) to {following}, terminated={terminated}: the table allows {possible.tolist()} only. "
            f"{OUTSIDE}"
        )
    if terminated != bool(mdp.terminal[following]):
        raise TableMismatch(
            f"step from (s={s}, a={a}) to {following} said terminated={terminated}: the table says {not terminated}. {OUTSIDE}"
        )


def _check_rewards(mdp: TabularMDP, payments: Payments, seen: np.ndarray, paid: np.ndarray) -> None:
    rows = seen[:, 0]
    if payments.entries is not None:  # s, a and s' settle what is paid
        expected = payments.entries[entry_positions(mdp.P, rows, seen[:, 1])]
    else:
        certain = payments.deviation.ravel()[rows] == 0
        expected = np.where(certain, payments.mean.ravel()[rows], paid)
    wrong = np.flatnonzero(~np.isclose(paid, expected, rtol=1e-6, atol=1e-9 * payments.largest))
    if wrong.size:
        (s, a), following = divmod(int(rows[wrong[0]]), mdp.n_actions), int(seen[wrong[0], 1])
        raise TableMismatch(
            f"step from (s={s}, a={a}) to {following} paid {paid[wrong[0]]}: the table says {expected[wrong[0]]:.6g}. {OUTSIDE}"
        )
    visits = np.maximum(np.bincount(rows, minlength=payments.mean.size), 1)
    mean = np.bincount(rows, weights=paid, minlength=payments.mean.size) / visits
    # Bernstein's inequality for payments that differ by at most 2 `largest`, over all rows at once.
    logarithm = np.log(2 * payments.mean.size / LEAST_P_VALUE)
    allowed = payments.deviation.ravel() * np.sqrt(2 * logarithm / visits) + 4 / 3 * payments.largest * logarithm / visits
    gap = np.where(np.bincount(rows, minlength=visits.size) > 0, np.abs(mean - payments.mean.ravel()), 0.0)
    far = np.flatnonzero(gap > allowed + 1e-9 * payments.largest)
    if far.size:
        s, a = divmod(int(far[0]), mdp.n_actions)
        raise TableMismatch(
            f"{visits[far[0]]} steps from (s={s}, a={a}) paid {mean[far[0]]:.4g} on average: the table says "
            f"{payments.mean[s, a]:.4g}. {OUTSIDE}"
        )


def _chi_square(mdp: TabularMDP, seen: np.ndarray, starts: np.ndarray) -> SelfCheck:
    visits = np.bincount(seen[:, 0], minlength=mdp.P.shape[0])
    first = np.flatnonzero(mdp.d0)
    statistic, degrees = _pearson(starts, first, mdp.d0[first])
    order = np.argsort(seen[:, 0], kind="stable")
    groups = np.split(seen[order, 1], np.cumsum(visits)[:-1])
    for row in np.flatnonzero(visits):
        part = slice(mdp.P.indptr[row], mdp.P.indptr[row + 1])
        one, freedom = _pearson(groups[row], mdp.P.indices[part], mdp.P.data[part])
        statistic, degrees = statistic + one, degrees + freedom
    p_value = float(chi2.sf(statistic, degrees)) if degrees else 1.0
    if p_value < LEAST_P_VALUE:
        raise TableMismatch(
            f"{len(seen)} steps differ from the table's probabilities: chi-square {statistic:.1f} on {degrees} degrees of "
            f"freedom, p = {p_value:.1e}. {OUTSIDE}"
        )
    acting = mdp.reachable & ~mdp.terminal
    return SelfCheck(len(seen), int((visits > 0).sum()), int(acting.sum()) * mdp.n_actions, statistic, degrees, p_value)


def _pearson(found: np.ndarray, values: np.ndarray, probabilities: np.ndarray) -> tuple[float, int]:
    """Pearson's statistic and degrees of freedom; 0, 0 where some value is expected fewer than 5 times."""
    expected = found.size * probabilities
    if values.size < 2 or expected.min() < 5:
        return 0.0, 0
    counts = np.array([(found == value).sum() for value in values])
    return float(((counts - expected) ** 2 / expected).sum()), values.size - 1
