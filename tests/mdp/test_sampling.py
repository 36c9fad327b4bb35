"""Draws have the table's distribution, whatever its size."""

import numpy as np
import pytest
from models import episodic_model
from scipy.stats import chisquare

from irl_gym.errors import InvalidMDP
from irl_gym.mdp.sampling import Successors
from irl_gym.mdp.tabular_mdp import TransitionTable

N = 20_000


def test_draw_has_the_frequencies_of_the_row():
    table = TransitionTable.from_dense(np.tile([[0.5, 0.3, 0.2]], (3, 2, 1)).reshape(3, 2, 3), [1, 0, 0])
    drawn = Successors(table).draw(np.ones(N, dtype=int), np.zeros(N, dtype=int), np.random.default_rng(0))
    assert chisquare(np.bincount(drawn), N * np.array([0.5, 0.3, 0.2])).pvalue > 1e-3


def test_draw_never_leaves_the_support():
    mdp = episodic_model(1, S=12, A=3).mdp
    rng = np.random.default_rng(2)
    acting = np.flatnonzero(~mdp.terminal)
    states, actions = rng.choice(acting, N), rng.integers(mdp.n_actions, size=N)
    drawn = Successors(mdp).draw(states, actions, rng)
    assert (np.asarray(mdp.P[states * mdp.n_actions + actions, drawn]) > 0).all()


def test_start_has_the_frequencies_of_d0():
    table = TransitionTable(np.eye(3), [0.25, 0.0, 0.75])
    drawn = Successors(table).start(N, np.random.default_rng(0))
    assert chisquare(np.bincount(drawn)[[0, 2]], [N / 4, 3 * N / 4]).pvalue > 1e-3


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize("u", [0.0, 1 - 2**-53])
def test_draw_stays_in_the_row_at_the_ends_of_the_unit_interval(u):
    class Fixed:
        def random(self, n):
            return np.full(n, u)

    P = np.tile([0.1, 0.2, 0.7], (6, 1))  # row 3 is (s=1, a=1)
    drawn = Successors(TransitionTable(P, [1, 0, 0])).draw(np.array([1]), np.array([1]), Fixed())
    assert drawn[0] == (0 if u == 0 else 2)


def test_successors_refuse_an_episode_that_begins_at_its_end():
    with pytest.raises(InvalidMDP, match="state 1 is terminal"):
        Successors(TransitionTable(np.eye(2, k=1), [0.5, 0.5]))
