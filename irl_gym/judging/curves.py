"""The learning curve of a run: what the agent earned under the true reward as it trained.

    environment_steps   made so far
    true_value          discounted, from the start: exact on a table, the mean of a few episodes elsewhere
    mean_return         undiscounted, of sampled episodes, with a 95 % interval (`intervals`)
Axes: n points.
"""

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from irl_gym.checks import LARGEST
from irl_gym.files.own_files import write_bytes
from irl_gym.intervals import mean_interval
from irl_gym.mdp.sampling import Successors
from irl_gym.records import Record
from irl_gym.tables.tabulation import Tabulation

EPISODES = 100
"""Sampled at each point of a curve, where there is a table."""
AT_ONCE = 20_000
"""Episodes that are stepped together at most."""

COLUMNS = ("environment_steps", "true_value", "mean_return", "return_low", "return_high")


@dataclass(frozen=True, eq=False)
class Curve(Record):
    """A learning curve."""

    steps: np.ndarray
    """(n,) environment steps, increasing."""
    value: np.ndarray
    """(n,) discounted true value from the start."""
    mean: np.ndarray
    """(n,) mean undiscounted true return; NaN in runs of earlier versions, as are the next two."""
    low: np.ndarray
    """(n,) lower end of its 95 % interval; NaN where that is unknown, too."""
    high: np.ndarray
    """(n,) upper end."""


NO_CURVE = Curve(*np.zeros((5, 0)))
"""Of an agent that was not trained step by step, or of none."""


def write_curve(curve: Curve, path: Path) -> None:
    """Write a curve as csv; what is not known is left empty."""
    numbers = (curve.value, curve.mean, curve.low, curve.high)
    points = zip(curve.steps.tolist(), *(["" if np.isnan(x) else x for x in one.tolist()] for one in numbers), strict=True)
    text = io.StringIO(newline="")
    csv.writer(text).writerows([COLUMNS, *((int(steps), *rest) for steps, *rest in points)])
    write_bytes(path, text.getvalue().encode())


def read_curve(path: Path) -> Curve:
    """Read a curve; one of an earlier version has no returns.

    Raises:
        OSError, ValueError: no such file, or another one.
    """
    with path.open(newline="") as file:
        try:
            heading, *lines = csv.reader(file)
        except csv.Error as error:  # none of Python's own kinds
            raise ValueError(str(error)) from error
    if tuple(heading) not in (COLUMNS, COLUMNS[:2]):
        raise ValueError(f"its columns are {heading}: expected {list(COLUMNS)}")
    numbers = np.array([[one or "nan" for one in line] for line in lines], dtype=np.float64).reshape(-1, len(heading))
    steps, value = numbers[:, 0], numbers[:, 1]
    if not (np.isfinite(numbers[:, :2]).all() and (np.diff(steps, prepend=0.0) >= 0).all()) or (abs(numbers) > LARGEST).any():
        raise ValueError(f"it has the values {value[:9]} at the steps {steps[:9]}: expected numbers, and increasing steps")
    padded = np.full((len(numbers), len(COLUMNS)), np.nan)
    padded[:, : len(heading)] = numbers
    return Curve(*padded.T)


def curve_of(
    steps: Sequence[int],
    value: Sequence[float],
    returns: Sequence[np.ndarray],
    possible: tuple[float, float] | None = None,
) -> Curve:
    """The curve of points, each with the returns of its episodes; the two returns that are possible may be given."""
    found = np.array([mean_interval(one, possible=possible) for one in returns]).reshape(-1, 3)
    return Curve(np.array(steps, dtype=np.float64), np.array(value, dtype=np.float64), *found.T)


def two_returns(table: Tabulation) -> tuple[float, float] | None:
    """The only two undiscounted returns that episodes can have; None where that is not certain.

    It is where the table is exact, and every step pays 0 or one and the same reward, which ends the episode: an episode that is
    cut before, or ends without it, returns 0.
    """
    paid = table.payments.entries
    if not table.evidence.exact or paid is None:
        return None
    pays = np.flatnonzero(paid)
    if not pays.size or not table.mdp.terminal[table.mdp.P.indices[pays]].all():
        return None
    low, high = float(paid[pays].min()), float(paid[pays].max())
    if high - low > 1e-9 * max(abs(low), abs(high)):
        return None
    return (min(low, 0.0), max(high, 0.0))


def sampled_returns(
    table: Tabulation, policies: Sequence[np.ndarray], n_episodes: int, *, limit: int, seed: int
) -> list[np.ndarray]:
    """Undiscounted true returns of episodes of several policies, drawn from a table, all together.

    Args:
        table: P, d0 and what steps pay.
        policies: n policies, each (S,) actions.
        n_episodes: N of each.
        limit: steps after which an episode is cut.
        seed: of the generator.

    Returns:
        n arrays (N,).
    """
    rng, successors = np.random.default_rng(seed), Successors(table.mdp)
    together = max(1, AT_ONCE // n_episodes)
    found = []
    for first in range(0, len(policies), together):
        actions = np.stack([policy.astype(np.int64) for policy in policies[first : first + together]])
        found.extend(_returns(table, successors, actions, n_episodes, limit, rng))
    return found


def _returns(
    table: Tabulation, successors: Successors, actions: np.ndarray, n_episodes: int, limit: int, rng: np.random.Generator
) -> np.ndarray:
    """(n, N) returns of policies (n, S); their episodes are stepped together."""
    who = np.repeat(np.arange(len(actions)), n_episodes)
    total = np.zeros(who.size)
    rows = successors.start(who.size, rng)
    going = np.arange(who.size)
    for _ in range(limit):
        if not going.size:
            break
        here = rows[going]
        taken = actions[who[going], here]
        entries = successors.entries(here, taken, rng)
        paid = table.payments.entries
        total[going] += table.reward.values[here, taken] if paid is None else paid[entries]
        rows[going] = table.mdp.P.indices[entries]
        going = going[~table.mdp.terminal[rows[going]]]
    return total.reshape(len(actions), n_episodes)
