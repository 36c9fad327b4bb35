"""Does `env.step` do what the table says? Sampled, and compared.

A copy of the environment runs with random actions, without its TimeLimit. Three comparisons:
    support      a transition that the table says is impossible, or one that ends when the table says it goes on, is an error
    probability  Pearson's chi-square over the rows visited often enough that each successor is expected 5 times
    reward       each row's rewards against the table's: exactly where a row always pays the same, else their mean within six
                 standard errors
"""

import copy
from dataclasses import dataclass

import gymnasium as gym
import numpy as np
from scipy.stats import chi2

from irl_gym._typing import Matrix
from irl_gym.errors import NotTabular, TableMismatch
from irl_gym.mdp import TabularMDP
from irl_gym.states import StateIndex

LEAST_P_VALUE = 1e-6
"""A right table fails the chi-square test once in a million checks."""


@dataclass(frozen=True)
class SelfCheck:
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


def compare_with_steps(
    env: gym.Env, mdp: TabularMDP, states: StateIndex, R: Matrix, deviation: Matrix, *, steps: int, seed: int
) -> SelfCheck:
    """Sample steps of a copy of the environment and compare them with a table.

    Raises:
        NotTabular: the environment cannot be copied.
        TableMismatch: a step the table says is impossible, or frequencies that it makes all but impossible.
    """
    walker = _copy_of(env)
    rng = np.random.default_rng(seed)
    A = mdp.n_actions
    first_action = int(getattr(env.action_space, "start", 0))
    seen = np.empty((steps, 2), dtype=np.int64)
    paid = np.empty(steps)
    row = states.encode(walker.reset(seed=seed)[0])
    _check_start(mdp, row)
    limit = 20 * mdp.n_states  # a walk that never ends is started again
    age = 0
    for i in range(steps):
        a = int(rng.integers(A))
        observation, paid[i], terminated, _, _ = walker.step(a + first_action)
        following = states.encode(observation, terminated=bool(terminated))
        seen[i] = row * A + a, following
        _check_transition(mdp, row, a, following, bool(terminated))
        age += 1
        if terminated or age >= limit:
            row, age = states.encode(walker.reset()[0]), 0
            _check_start(mdp, row)
        else:
            row = following
    _check_rewards(R, deviation, seen[:, 0], paid)
    return _chi_square(mdp, seen, steps)


def _copy_of(env: gym.Env) -> gym.Env:
    try:
        return copy.deepcopy(env.unwrapped)
    except (TypeError, AttributeError, ValueError) as error:
        if env.spec is None:
            raise NotTabular(
                f"{type(env.unwrapped).__name__} cannot be copied ({error}) and has no spec to make it again: the table "
                "cannot be checked. Pass check_steps=0 to go without."
            ) from error
        kwargs = {**env.spec.kwargs, "render_mode": None}
        return gym.make(env.spec.id, **kwargs).unwrapped


def _check_start(mdp: TabularMDP, row: int) -> None:
    if not mdp.d0[row] > 0:
        raise TableMismatch(f"reset began in state {row}, which has probability 0 in d0: correct `initial_state_distrib`.")


def _check_transition(mdp: TabularMDP, s: int, a: int, following: int, terminated: bool) -> None:
    row = s * mdp.n_actions + a
    possible = mdp.P.indices[mdp.P.indptr[row] : mdp.P.indptr[row + 1]]
    if following not in possible:
        raise TableMismatch(
            f"step took (s={s}, a={a}) to {following}, terminated={terminated}: the table allows {possible.tolist()} only. "
            "Something acts outside the published P."
        )
    if terminated != bool(mdp.terminal[following]):
        raise TableMismatch(
            f"step from (s={s}, a={a}) to {following} said terminated={terminated}: the table says "
            f"{not terminated}. Something acts outside the published P."
        )


def _check_rewards(R: np.ndarray, deviation: np.ndarray, rows: np.ndarray, paid: np.ndarray) -> None:
    expected = R.ravel()
    certain = deviation.ravel()[rows] == 0
    wrong = np.flatnonzero(certain & ~np.isclose(paid, expected[rows], rtol=1e-6, atol=1e-9))
    if wrong.size:
        s, a = divmod(int(rows[wrong[0]]), R.shape[1])
        raise TableMismatch(
            f"step from (s={s}, a={a}) paid {paid[wrong[0]]}: the table says {R[s, a]:.6g}. Is the reward changed outside the "
            "published P?"
        )
    visits = np.maximum(np.bincount(rows, minlength=R.size), 1)
    mean = np.bincount(rows, weights=paid, minlength=R.size) / visits
    allowed = 6 * deviation.ravel() / np.sqrt(visits) + 1e-9
    far = np.flatnonzero((visits >= 30) & (deviation.ravel() > 0) & (np.abs(mean - expected) > allowed))
    if far.size:
        s, a = divmod(int(far[0]), R.shape[1])
        raise TableMismatch(
            f"{visits[far[0]]} steps from (s={s}, a={a}) paid {mean[far[0]]:.4g} on average: the table says {R[s, a]:.4g}. Is "
            "the reward changed outside the published P?"
        )


def _chi_square(mdp: TabularMDP, seen: np.ndarray, steps: int) -> SelfCheck:
    visits = np.bincount(seen[:, 0], minlength=mdp.P.shape[0])
    statistic, degrees = 0.0, 0
    for row in np.flatnonzero(visits):
        columns = mdp.P.indices[mdp.P.indptr[row] : mdp.P.indptr[row + 1]]
        expected = visits[row] * mdp.P.data[mdp.P.indptr[row] : mdp.P.indptr[row + 1]]
        if columns.size < 2 or expected.min() < 5:
            continue
        found = seen[seen[:, 0] == row, 1]
        counts = np.array([(found == column).sum() for column in columns])
        statistic += float(((counts - expected) ** 2 / expected).sum())
        degrees += columns.size - 1
    p_value = float(chi2.sf(statistic, degrees)) if degrees else 1.0
    if p_value < LEAST_P_VALUE:
        raise TableMismatch(
            f"{steps} steps differ from the table's probabilities: chi-square {statistic:.1f} on {degrees} degrees of "
            f"freedom, p = {p_value:.1e}. Something acts outside the published P."
        )
    acting = mdp.reachable & ~mdp.terminal
    return SelfCheck(steps, int((visits > 0).sum()), int(acting.sum()) * mdp.n_actions, statistic, degrees, p_value)
