"""What counts tell of the rows of (4): rows with the same successors, and the errors of margins."""

import pickle

import numpy as np
import pytest
from counted import counted, episode
from scipy.stats import poisson

from irl_gym.errors import InvalidMDP
from irl_gym.mdp.optimality import certify
from irl_gym.mdp.optimality_rows import compare
from irl_gym.mdp.rewards import TabularReward
from irl_gym.mdp.tabular_mdp import TabularMDP

SHAPES = {
    "two, even": [0.5, 0.5],
    "two, one rare": [0.999, 0.001],
    "Poisson": poisson.pmf(range(12), 3),
    "long tail": 0.5 ** np.arange(1, 25),
    "one, and many rare": [0.9, *[0.002] * 50],
}


def table(counts):
    """A table of states that all act, from counts (S, A, S)."""
    counts = np.asarray(counts)
    visits = counts.sum(axis=2)
    rows = np.where(visits[:, :, None] > 0, counts / np.maximum(visits, 1)[:, :, None], np.eye(len(counts))[:, None, :])
    return TabularMDP(rows.reshape(-1, len(counts)), 0.9, np.full(len(counts), 1 / len(counts)), visits)


def drawn(rng, p, n, size=60):
    """Counts of a table in which every row is p, seen n[a] times."""
    p = np.asarray(p) / np.sum(p)
    counts = np.zeros((size, len(n), size), dtype=int)
    for s in range(size):
        for a, times in enumerate(n):
            counts[s, a, : p.size] = rng.multinomial(times, p)
    return counts


def two(first, second, size=60):
    """Counts of two actions in state 0, the same in all others."""
    counts = np.zeros((size, 2, size), dtype=int)
    counts[1:, :, 0] = 50
    counts[0, 0, : len(first)], counts[0, 1, : len(second)] = first, second
    return counts


def first_row(first, second):
    return compare(table(two(first, second)), np.zeros(60, dtype=int), np.array([0]))


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("n", [(10, 1000), (30, 30), (1000, 100)])
def test_rows_of_one_distribution_are_told_apart_in_5_of_100_tables_at_most(shape, n):
    rng = np.random.default_rng(0)
    policy = np.zeros(60, dtype=int)
    found = [compare(table(drawn(rng, SHAPES[shape], n)), policy) for _ in range(30)]
    wrong = [bool((~c.sampling.few & ~c.trivial).any()) for c in found]
    assert np.sum(wrong) <= 4  # of 30; more than 4 has a chance of 0.02 at 5 in 100


def test_rows_that_share_no_successor_are_told_apart():
    assert not first_row([1000], [0, 3]).trivial[0] and not first_row([1000], [0, 3]).sampling.few[0]


def test_rows_that_are_far_apart_are_told_apart():
    assert not first_row([600, 400], [400, 600]).trivial[0]


def test_rows_within_their_sampling_error_are_zero():
    found = first_row([520, 480], [480, 520])
    assert found.trivial[0] and found.rows.nnz == 0


def test_a_step_seen_once_is_kept_where_it_leads_elsewhere():
    found = first_row([1], [0, 1])
    assert found.sampling.few[0] and not found.trivial[0]


def test_few_steps_that_differ_no_more_than_chance_are_the_same():
    found = first_row([2, 1, 1], [1, 1, 1])
    assert found.sampling.few[0] and found.trivial[0]


def test_pairs_never_visited_are_left_as_the_rule_made_them():
    found = first_row([0, 100], [0])
    assert found.sampling.unvisited[0] and not found.trivial[0]


def test_a_pair_never_visited_has_an_error_of_all_that_V_allows():
    V = np.linspace(-1, 1, 60)
    assert first_row([0, 100], [0]).sampling.of_margins(V)[0] >= np.ptp(V)


def test_an_exact_table_has_no_sampling_error():
    made = table(two([520, 480], [480, 520]))
    exact = compare(TabularMDP(made.P, 0.9, made.d0), np.zeros(60, dtype=int))
    assert exact.sampling is None and not exact.trivial.all()


def test_actions_of_a_mixture_are_compared_with_the_others():
    counts = np.zeros((60, 3, 60), dtype=int)
    counts[:, :, 0] = 50
    counts[0] = 0
    counts[0, :, :2] = [[520, 480], [480, 520], [500, 500]]
    found = compare(table(counts), np.eye(3)[[0] * 60] / 2 + np.eye(3)[[1] * 60] / 2, np.array([0]))
    assert found.trivial.all() and found.equal.tolist() == [True, True, False]


def test_a_mixture_with_an_action_that_leads_elsewhere_is_told_apart():
    counts = np.zeros((60, 3, 60), dtype=int)
    counts[:, :, 0] = 50
    counts[0] = 0
    counts[0, 0, 1] = counts[0, 1, 2] = 50
    counts[0, 2, 1:3] = 25, 25
    found = compare(table(counts), np.eye(3)[[0] * 60] / 2 + np.eye(3)[[1] * 60] / 2, np.array([0]))
    assert found.trivial.tolist() == [False, False, True]  # the third does what the mixture does


@pytest.mark.parametrize("shape", SHAPES)
def test_errors_hold_for_all_rows_at_once_also_where_counts_chose_V(shape):
    rng, policy, wrong = np.random.default_rng(1), np.zeros(60, dtype=int), 0
    for _ in range(20):
        counts = drawn(rng, SHAPES[shape], (1000, 40))
        mdp = table(counts)
        differences = (mdp.P[::2] - mdp.P[1::2]).toarray()
        sampling = compare(mdp, policy).sampling
        for V in (rng.normal(size=60), differences[int(rng.integers(60))], np.sign(differences[0])):
            wrong += bool((np.abs(differences @ V) > sampling.of_margins(V) + 1e-12).any())  # every true margin is 0
    assert wrong <= 6  # of 60; more has a chance of 0.03 at 5 in 100


def test_visits_survive_restriction_and_pickling():
    mdp = counted([episode([0, 1, 0], [0, 1])] * 3).table.mdp
    again = pickle.loads(pickle.dumps(mdp.restrict(np.flatnonzero(mdp.reachable))))
    assert mdp.visits is not None and again.visits.tolist() == mdp.visits.tolist()


@pytest.mark.parametrize("visits", [np.ones((2, 1), dtype=int), np.ones((2, 2)), -np.ones((2, 2), dtype=int)])
def test_visits_that_are_no_counts_are_refused(visits):
    with pytest.raises(InvalidMDP, match="visits has shape"):
        TabularMDP(np.full((4, 2), 0.5), 0.9, [1, 0], visits)


def test_feature_rewards_have_no_margin_within_noise():
    mdp, policy, R = table(two([520, 480], [480, 520])), np.zeros(60, dtype=int), np.linspace(-1, 1, 60)
    assert np.isnan(certify(mdp, policy, TabularReward(R)).margin[0])
