"""FeatureLP with a cap leaves out the rows that no weights make strict, one by one: an LP a row says which these are."""

import models
import numpy as np
import pytest
from certified import certified
from scipy.optimize import linprog

from irl_gym.features.feature_maps import OneHot
from irl_gym.learners.linear_programs import expressible, weights
from irl_gym.learners.linear_programs.feature import FeatureLP
from irl_gym.learners.linear_programs.weights import Rows
from irl_gym.mdp.optimality_rows import compare
from irl_gym.mdp.tabular_mdp import TabularMDP


def swapping() -> TabularMDP:
    """States A, B, T; actions: swap A and B (the expert's), stay, fall to T for ever."""
    P = np.zeros((3, 3, 3))
    P[0], P[1], P[2] = np.eye(3)[[1, 0, 2]], np.eye(3)[[0, 1, 2]], np.eye(3)[[2, 2, 2]]
    return TabularMDP.from_dense(P, 0.9, [1.0, 0, 0])


def drawn(seed):
    """A random deterministic table, a policy that is mostly optimal for nothing, features, and a sample of the states."""
    rng = np.random.default_rng([7, seed])
    S, A = int(rng.integers(4, 8)), int(rng.integers(2, 5))
    mdp = TabularMDP.from_dense(np.eye(S)[rng.integers(S, size=(S, A))], 0.9, np.full(S, 1 / S))
    Phi = np.eye(S) if seed % 2 else rng.integers(-1, 2, size=(S, int(rng.integers(2, S + 1)))).astype(float)
    return mdp, rng.integers(A, size=S), Phi, np.sort(rng.choice(S, size=int(rng.integers(2, S + 1)), replace=False))


def rows_of(mdp, expert, Phi, S_0):
    """The rows of (10) that are not trivial: states, actions and d (n, K), by the explicit inverse."""
    c = compare(mdp, expert)
    V = np.linalg.inv(np.eye(mdp.n_states) - mdp.gamma * mdp.P_pi(expert).toarray()) @ Phi
    kept = np.isin(c.states, S_0) & ~c.trivial
    return c.states[kept], c.actions[kept], (c.rows.toarray() @ V)[kept]


def breakable(d):
    """(n,) rows that weights within -1 and 1 make strict, with no row below 0: a linear program each."""
    solved = [linprog(-row, A_ub=-d, b_ub=np.zeros(len(d)), bounds=(-1, 1)) for row in d]
    return np.array([-one.fun > 1e-7 for one in solved])


def check(seeds, cap):
    """Rows left out are those that none makes strict, and the others have the cap; how many fits, and rows left out."""
    fits = left_out = 0
    for seed in seeds:
        mdp, expert, Phi, S_0 = drawn(seed)
        states, actions, d = rows_of(mdp, expert, Phi, S_0)
        can = breakable(d) if len(d) else np.zeros(0, dtype=bool)
        if not can.any():
            continue  # nothing to compare, or inexpressible
        found = FeatureLP(Phi, S_0=S_0, margin_cap=cap).fit(mdp, expert)
        certificate, margins = found.proof, d @ found.reward.alpha
        assert certificate.unbreakable_rows.tolist() == np.stack([states, actions], axis=1)[~can].tolist(), seed
        assert (margins[can] >= certificate.margin_cap * (1 - 1e-6)).all() and margins.min() > -1e-7, seed
        assert certificate.expressible and -1e-9 <= certificate.duality_gap < 1e-6, seed
        fits, left_out = fits + 1, left_out + int((~can).sum())
    return fits, left_out


@pytest.mark.parametrize("cap", ["auto", 1e-4])
def test_rows_are_left_out_one_by_one_as_an_lp_a_row_says(cap):
    fits, left_out = check(range(20), cap)
    assert fits > 10 and left_out > 10


def test_the_same_rows_can_be_strict_where_binding_rows_are_generated(monkeypatch):
    monkeypatch.setattr(weights, "SAMPLE", 4)
    for seed in (1, 3, 5):
        states, _, d = rows_of(*drawn(seed))
        wanted = np.ones(len(d), dtype=bool)
        np.testing.assert_array_equal(expressible.breakable(Rows(d, states), states, wanted), breakable(d))


@pytest.mark.slow
@pytest.mark.parametrize("cap", ["auto", 1e-4])
def test_rows_are_left_out_one_by_one_on_many_tables(cap):
    fits, left_out = check(range(700), cap)
    print(f"{fits} fits, {left_out} rows left out")
    assert fits >= 400


@pytest.mark.parametrize("cap", ["auto", 0.5])
def test_falling_has_a_margin_where_staying_can_have_none(cap):
    certificate = certified(FeatureLP(OneHot(3), margin_cap=cap), swapping(), np.zeros(3, dtype=int))
    assert certificate.unbreakable_rows.tolist() == [[0, 1], [1, 1]] and certificate.unbreakable.tolist() == [0, 1]
    assert certificate.margin[:2] == pytest.approx([certificate.margin_cap] * 2, rel=1e-6) and certificate.expert_optimal
    assert "always tied" in certificate.told and "2 actions in 2 states: no reward in the span" in certificate.told


def test_the_program_of_the_paper_leaves_no_row_out():
    certificate = certified(FeatureLP(OneHot(3)), swapping(), np.zeros(3, dtype=int))
    assert certificate.unbreakable_rows.shape == (0, 2) and certificate.margin[:2] == pytest.approx([0, 0], abs=1e-9)


def test_what_other_features_break_is_left_out_of_these_only():
    mdp, expert = swapping(), np.zeros(3, dtype=int)
    blind = np.array([[1.0], [1.0], [1.0]])  # of nothing that differs
    assert not FeatureLP(blind, margin_cap="auto").fit(mdp, expert).proof.expressible
    fallen = certified(FeatureLP(np.array([[0.0], [0.0], [1.0]]), margin_cap="auto"), mdp, expert)
    assert fallen.unbreakable_rows.tolist() == [[0, 1], [1, 1]] and fallen.margin[0] > 0


def test_an_expert_of_several_actions_gains_a_margin_over_the_others():
    grid = models.paper_grid()
    rows = np.full((25, 4), False)
    rows[np.arange(25), grid.expert] = True
    rows[0, :] = [True, True, False, False] if not rows[0, 2:].any() else [False, False, True, True]
    found = certified(FeatureLP(OneHot(25), margin_cap=0.01), grid.mdp, rows)
    finite = found.margin[np.isfinite(found.margin)]
    assert found.expert_optimal and (finite > -1e-9).all() and (finite >= 0.01 * (1 - 1e-6)).mean() > 0.5
