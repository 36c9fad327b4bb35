"""The program over weights: solved whole or by generated kinks, its bound, and whether a reward can agree at all."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from irl_gym.errors import SolverTimeout
from irl_gym.learners.linear_programs import weights
from irl_gym.learners.linear_programs.expressible import most_agreement
from irl_gym.learners.linear_programs.weights import Rows, best_weights
from irl_gym.programs.solvers import Solving

WHOLE = 10**9
KINDS = ("normal", "ties", "low rank", "zeros", "scaled")


def random_rows(seed, kind="normal", G=60, K=5):
    """Rows of G groups of one to four, nineteen in twenty of which agree with some weights.

    normal      no ties
    ties        small whole numbers, so that many rows of a group are least together
    low rank    of rank 2
    zeros       a third of the groups has a row of zeros
    scaled      a thousand times larger in half of the features
    """
    rng = np.random.default_rng(seed)
    groups = np.repeat(np.arange(G), rng.integers(1, 5, G))
    d = rng.normal(size=(groups.size, K))
    if kind == "ties":
        d = rng.integers(-1, 2, size=d.shape).astype(float)
    elif kind == "low rank":
        d = d[:, :2] @ rng.normal(size=(2, K))
    disagree = (d @ rng.uniform(-1, 1, K) < 0) & (rng.random(len(d)) < 0.95)
    d[disagree] *= -1
    if kind == "zeros":
        d[np.unique(groups, return_index=True)[1][::3]] = 0
    elif kind == "scaled":
        d[:, ::2] *= 1000
    return Rows(d, groups)


def concave(rows, alpha, *, slope, l1):
    """The objective, group by group."""
    least = [min(row @ alpha for row in rows.d[rows.groups == g]) for g in range(rows.n_groups)]
    return sum(x if x >= 0 else slope * x for x in least) - l1 * np.abs(alpha).sum()


# --- solved whole ---


def test_best_weights_of_one_row_are_the_signs():
    found = best_weights(Rows(np.array([[2.0, -3.0]]), np.zeros(1, dtype=int)), slope=2.0, l1=0.0)
    np.testing.assert_allclose(found.alpha, [1, -1])


def test_best_weights_weigh_losses_by_the_slope():
    rows = Rows(np.array([[3.0], [-2.0]]), np.array([0, 1]))  # 3 alpha - 2 slope alpha above 0; -2 alpha below
    objectives = [rows.objective(best_weights(rows, slope=s, l1=0.0).alpha, slope=s, l1=0.0) for s in (1.0, 1.4, 2.0)]
    np.testing.assert_allclose(objectives, [1, 0.2, 0], atol=1e-9)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("slope", [1.0, 2.0, 4.0])
@pytest.mark.parametrize("l1", [0.0, 2.0])
def test_best_weights_reach_the_bound(kind, slope, l1):
    rows = random_rows(0, kind)
    found = best_weights(rows, slope=slope, l1=l1)
    assert rows.bound(found.y, slope=slope, l1=l1) == pytest.approx(
        rows.objective(found.alpha, slope=slope, l1=l1), abs=1e-8 * rows.scale * rows.n_groups
    )


@pytest.mark.parametrize("solver", ["highs", "clarabel"])
def test_best_weights_do_not_depend_on_the_solver(solver):
    rows = random_rows(0)
    found = best_weights(rows, slope=2.0, l1=0.5, solving=Solving(solver))
    assert found.answer.solver == solver
    assert rows.objective(found.alpha, slope=2.0, l1=0.5) == pytest.approx(
        rows.objective(best_weights(rows, slope=2.0, l1=0.5).alpha, slope=2.0, l1=0.5), rel=1e-7
    )


def test_best_weights_stop_when_the_time_is_up():
    with pytest.raises(SolverTimeout, match="1e-09 s"):
        best_weights(random_rows(0, G=500, K=50), slope=2.0, l1=0.1, solving=Solving.begun("clarabel", 1e-9))


# --- by generated kinks ---


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("slope", [1.0, 2.0, 4.0])
@pytest.mark.parametrize("l1", [0.0, 2.0])
@pytest.mark.parametrize("sample", [1, 6, 30])
def test_generated_kinks_give_the_objective_of_the_whole(monkeypatch, kind, slope, l1, sample):
    for seed in range(2):
        rows = random_rows(seed, kind)
        expected = rows.objective(best_weights(rows, slope=slope, l1=l1).alpha, slope=slope, l1=l1)
        with monkeypatch.context() as patch:
            patch.setattr(weights, "SAMPLE", sample)
            found = best_weights(rows, slope=slope, l1=l1)
        objective = rows.objective(found.alpha, slope=slope, l1=l1)
        bound = rows.bound(found.y, slope=slope, l1=l1)
        size = 1e-8 * rows.scale * rows.n_groups
        assert objective == pytest.approx(expected, abs=size) and bound == pytest.approx(expected, abs=size)


def test_generated_kinks_do_not_loop_when_every_row_is_the_same(monkeypatch):
    rows = Rows(np.tile([1.0, -1.0], (40, 1)), np.repeat(np.arange(20), 2))
    monkeypatch.setattr(weights, "SAMPLE", 3)
    assert rows.objective(best_weights(rows, slope=2.0, l1=0.0).alpha, slope=2.0, l1=0.0) == pytest.approx(40)


# --- property: the rows ---


weighting = st.tuples(st.integers(0, 2**32 - 1), st.sampled_from(KINDS), st.sampled_from([1.0, 2.0, 4.0]))


@given(drawn=weighting, l1=st.sampled_from([0.0, 0.7]), sparsity=st.floats(0, 1))
def test_bound_is_above_every_objective_whatever_the_duals(drawn, l1, sparsity):
    seed, kind, slope = drawn
    rng, rows = np.random.default_rng(seed), random_rows(seed, kind, G=12)
    y = rng.exponential(10 ** rng.uniform(-3, 3), len(rows.d)) * (rng.random(len(rows.d)) > sparsity)
    corners = np.sign(rng.normal(size=(20, 5)))
    alphas = [*rng.uniform(-1, 1, size=(20, 5)), *corners, best_weights(rows, slope=slope, l1=l1).alpha]
    best = max(rows.objective(alpha, slope=slope, l1=l1) for alpha in alphas)
    assert rows.bound(y, slope=slope, l1=l1) >= best - 1e-9 * rows.scale * rows.n_groups


@pytest.mark.parametrize("y", [np.nan, -3.0, 0.0])
def test_bound_holds_when_the_duals_are_useless(y):
    rows = random_rows(3)
    best = rows.objective(best_weights(rows, slope=2.0, l1=0.1).alpha, slope=2.0, l1=0.1)
    assert rows.bound(np.full(len(rows.d), y), slope=2.0, l1=0.1) >= best


@given(drawn=weighting, alpha=hnp.arrays(float, 5, elements=st.floats(-1, 1)))
def test_objective_is_the_sum_over_groups(drawn, alpha):
    seed, kind, slope = drawn
    rows = random_rows(seed, kind, G=12)
    expected = concave(rows, alpha, slope=slope, l1=0.3)
    assert rows.objective(alpha, slope=slope, l1=0.3) == pytest.approx(expected, rel=1e-9, abs=1e-9 * rows.scale)


@given(drawn=weighting, alpha=hnp.arrays(float, 5, elements=st.floats(-1, 1)))
def test_active_rows_are_the_least_of_their_groups(drawn, alpha):
    seed, kind, slope = drawn
    rows = random_rows(seed, kind, G=12)
    chosen, weight = rows.active(alpha, slope)
    np.testing.assert_array_equal(rows.groups[chosen], np.arange(12))
    np.testing.assert_allclose(rows.d[chosen] @ alpha, rows.least(alpha))
    np.testing.assert_array_equal(weight, np.where(rows.least(alpha) < 0, slope, 1.0))


@pytest.mark.parametrize("rank", [0, 1, 3, 6])
def test_rank_is_that_of_the_rows(rank):
    rng = np.random.default_rng(0)
    d = rng.normal(size=(50, rank)) @ rng.normal(size=(rank, 6))
    assert Rows(d, np.arange(50)).rank == np.linalg.matrix_rank(d) == rank


@pytest.mark.parametrize("rows", [1, 3, 50])
def test_rank_counts_directions_that_are_small_but_not_rounding(rows):
    basis = np.linalg.qr(np.random.default_rng(0).normal(size=(6, 6)))[0]
    d = np.random.default_rng(1).normal(size=(rows, 6)) @ (basis * 10.0 ** -np.arange(0, 12, 2))
    assert Rows(d, np.arange(rows)).rank == min(rows, 6)


def test_rank_does_not_depend_on_the_blocks_of_rows(monkeypatch):
    rows = random_rows(0, "low rank")
    monkeypatch.setattr("irl_gym.features.feature_maps.BLOCK", 12)
    assert rows.rank == 2


# --- can any reward agree ---


def one_row_a_group(d):
    return Rows(np.asarray(d, dtype=float), np.arange(len(d)))


INEXPRESSIBLE = {
    "nothing but zeros": np.zeros((4, 3)),
    "a feature and its negative": [[1.0], [-1.0]],
    "rows that cancel": [[1.0, 0.0], [0.0, 1.0], [-1.0, -1.0]],
    "mirrored": np.concatenate([np.eye(3), -np.eye(3)]),
}


@pytest.mark.parametrize("sample", [1, WHOLE])
@pytest.mark.parametrize("d", INEXPRESSIBLE.values(), ids=INEXPRESSIBLE.keys())
def test_most_agreement_is_nothing_when_the_features_cannot_express_the_expert(monkeypatch, d, sample):
    monkeypatch.setattr(weights, "SAMPLE", sample)
    assert most_agreement(one_row_a_group(d)) <= 1e-9


@pytest.mark.parametrize("sample", [1, 7, WHOLE])
def test_most_agreement_is_above_a_reward_that_agrees(monkeypatch, sample):
    monkeypatch.setattr(weights, "SAMPLE", sample)
    for seed in range(10):
        rng = np.random.default_rng(seed)
        truth, d = rng.uniform(-1, 1, 4), rng.normal(size=(40, 4))
        d *= np.sign(d @ truth)[:, None]  # every row agrees with the truth
        assert most_agreement(one_row_a_group(d)) >= (d @ truth).mean() / np.abs(d).max() - 1e-9


@pytest.mark.parametrize("sample", [1, 7, WHOLE])
def test_most_agreement_does_not_depend_on_the_rows_that_are_generated(monkeypatch, sample):
    rows = [one_row_a_group(np.random.default_rng(seed).normal(0.4, 1, size=(30, 6))) for seed in range(10)]
    expected = [most_agreement(one) for one in rows]
    monkeypatch.setattr(weights, "SAMPLE", sample)
    np.testing.assert_allclose([most_agreement(one) for one in rows], expected, atol=1e-8)


def test_most_agreement_sees_a_single_row_that_a_tie_elsewhere_allows():
    assert most_agreement(one_row_a_group([[1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])) == pytest.approx(1 / 3)
