"""Tables that are estimates are compared with fresh episodes, as a second sample."""

import re

import gymnasium as gym
import numpy as np
import pytest
from tiny_env import TableEnv, both_ways, coin, lottery
from windy_env import Calm, Windy

from irl_gym.errors import TableMismatch
from irl_gym.tables.counted.counting import Counting, Interaction
from irl_gym.tables.enumeration.table import Enumeration
from irl_gym.tables.fresh_episodes import _two_samples
from irl_gym.tables.tabulate import tabulate

pytestmark = pytest.mark.usefixtures("unchecked")


def check(env, by, steps=1_000, seed=0):
    return tabulate(env, gamma=0.9, by=by, check_steps=steps, seed=seed).evidence.check


@pytest.mark.parametrize("steps", [1, 3, 10, 30, 100, 1_000])
@pytest.mark.parametrize("seed", range(3))
def test_a_table_of_few_samples_does_not_fail_for_being_small(steps, seed):
    for env in (TableEnv(coin(), [1, 0]), TableEnv(lottery(0.3), [1, 0]), TableEnv(both_ways(), [1, 0, 0]), Calm()):
        assert check(env, Interaction(steps, seed=seed), seed=seed).p_value > 1e-7


def test_steps_that_a_small_table_has_never_seen_are_told_with_their_share_of_episodes():
    few, many = (check(gym.make("FrozenLake-v1"), Interaction(steps)) for steps in (30, 20_000))
    assert few.new_steps > 100 > 10 > many.new_steps
    told = re.search(r"in (\d+) fresh episodes: (\d+) steps .* never seen, in ([\d.]+)% of episodes \(([\d.]+)% to", str(few))
    episodes, new, share, low = map(float, told.groups())
    assert (episodes, new) == (few.episodes, few.new_steps)
    assert share == pytest.approx(100 * few.new_episodes / episodes, abs=0.06) and low < share


def test_the_table_is_not_held_to_be_the_truth():
    """Its shares of 40 tosses are off by more than 4,000 fresh ones would allow a true one."""
    env = TableEnv(coin(0.5, ends=False), [1, 0])
    shares = [tabulate(env, gamma=0.9, by=Interaction(40, seed=s), check_steps=4_000, seed=s) for s in range(10)]
    gaps = [abs(table.mdp.P.toarray()[0, 0] - 0.5) for table in shares]
    assert max(gaps) > 3 * 0.5 / np.sqrt(4_000) * 3 and min(table.evidence.check.p_value for table in shares) > 1e-3


class Later(TableEnv):
    """Another coin, once it has been tossed in many episodes; they are counted outside of what is copied."""

    tossed = 0

    def __init__(self, table, later, after):
        super().__init__(table, [1, 0])
        self.later, self.after = later, after

    def reset(self, **kwargs):
        type(self).tossed += 1
        self.truth = self.P if type(self).tossed <= self.after else self.later
        return super().reset(**kwargs)

    P = property(lambda self: self._P, lambda self, P: setattr(self, "_P", P))


@pytest.mark.parametrize(
    ("later", "message"),
    [(coin(0.9), "steps of fresh episodes differ from the samples behind the table: chi-square"),
     (coin(0.5, win=1.0, lose=1.0), r"in fresh episodes paid 0\.\d+ on average: the samples behind the table 0\.5")],
)  # fmt: skip
def test_an_environment_that_has_become_another_one_is_an_error(later, message):
    Later.tossed = 0
    with pytest.raises(TableMismatch, match=message):
        check(Later(coin(0.5), later, after=1_000), Interaction(1_500), steps=1_500)


def test_a_row_that_was_enumerated_admits_no_new_step():
    with pytest.raises(TableMismatch, match=r"to a state that it does not hold .* in which that row was enumerated"):
        check(Windy(), Enumeration(start_runs=50, revisits=0), steps=10_000)


def test_where_hidden_state_was_found_differences_are_told_and_no_error():
    found = tabulate(Windy(), gamma=0.9, by=Interaction(20_000), check_steps=5_000).evidence
    assert found.repeats.hidden and found.check.episodes == 10


def test_fresh_episodes_are_not_those_that_were_counted():
    one = Interaction(400, seed=0)
    fresh = check(TableEnv(coin(0.5), [1, 0]), one, steps=400, seed=0)
    assert fresh.chi_square > 0


def test_the_check_compares_with_counts_where_a_prior_moved_the_shares():
    by = Interaction(2_000, Counting(prior=500.0))
    assert check(TableEnv(both_ways(), [1, 0, 0]), by).p_value > 1e-6
    assert check(TableEnv(lottery(0.1), [1, 0]), by).p_value > 1e-6


def test_no_check_is_made_where_none_is_asked_for():
    assert check(Calm(), Interaction(100), steps=0) is None


@pytest.mark.parametrize("seed", range(4))
def test_enumerations_with_counted_rows_are_checked_too(seed):
    told = check(Calm(), Enumeration(runs=100, start_runs=100, seed=seed), seed=seed)
    assert told.episodes > 0 and told.new_steps < 5 and told.p_value > 1e-6


@pytest.mark.parametrize(("n", "m"), [(1_000, 1_000), (2_000, 100), (100, 2_000), (np.inf, 300)])
def test_the_statistic_of_two_samples_is_chi_square_on_its_degrees_of_freedom(n, m):
    rng, p = np.random.default_rng(0), np.array([0.5, 0.2, 0.1, 0.1, 0.05, 0.03, 0.01, 0.01])
    found = []
    for _ in range(500):
        shares = rng.multinomial(n, p) / n if np.isfinite(n) else p
        seen = np.flatnonzero(shares)
        found.append(_two_samples(rng.choice(8, m, p=p), seen, shares[seen], float(n)))
    statistic, degrees = np.sum(found, axis=0)
    assert abs(statistic - degrees) < 5 * np.sqrt(2 * degrees) and degrees >= 2 * 500
