"""The nearest state on a table, against all shortest paths."""

import numpy as np
import pytest
from models import KINDS, random_model
from scipy.sparse.csgraph import shortest_path

from irl_gym.learners.cloning.nearest import nearest
from irl_gym.mdp.tabular_mdp import TransitionTable


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(4))
def test_the_nearest_state_is_the_lowest_of_those_at_the_end_of_a_shortest_path(kind, seed):
    table = random_model(seed, S=12, A=2, kind=kind).mdp
    among = np.random.default_rng(seed).random(12) < 0.3
    among[seed] = True
    follows = table.P.toarray().reshape(12, 2, 12).sum(axis=1) * ~table.terminal
    apart = shortest_path(follows, directed=False, unweighted=True)[:, among]
    rows, steps = nearest(table, among)
    linked = np.isfinite(apart.min(axis=1))
    np.testing.assert_array_equal(rows, np.where(linked, np.flatnonzero(among)[apart.argmin(axis=1)], -1))
    np.testing.assert_array_equal(steps, np.where(linked, apart.min(axis=1), -1))


def test_an_end_that_states_share_does_not_join_them():
    table = TransitionTable([[0, 0, 1.0], [0, 0, 1.0], [0, 0, 0]], [0.5, 0.5, 0])
    rows, steps = nearest(table, np.array([True, False, False]))
    assert rows.tolist() == [0, -1, -1] and steps.tolist() == [0, -1, -1]


def test_a_long_way_is_counted_whole():
    n = 1_000
    table = TransitionTable(np.roll(np.eye(n), 1, axis=1) * (np.arange(n) < n - 1)[:, None], np.eye(n)[0])
    rows, steps = nearest(table, np.arange(n) == 0)
    assert not rows[:-1].any() and steps[: n - 1].tolist() == list(range(n - 1))
