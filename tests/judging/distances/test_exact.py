"""Exact distances: against loops over every triple, as pseudometrics, and unchanged by what each claims to ignore."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from models import models, random_model
from scipy.stats import spearmanr

from irl_gym.errors import UndefinedDistance
from irl_gym.judging.distances import (
    DARD,
    EPIC,
    STARC,
    AsGiven,
    MinimalNorm,
    Pearson,
    Spearman,
    ValueAdjustedLevelling,
    dard,
    distance_matrix,
    epic,
    pearson,
    spearman,
    starc,
)
from irl_gym.judging.distances.canonical import FreshDraws, ModelDraws
from irl_gym.judging.distances.coverage import coverage_of
from irl_gym.judging.distances.gridworlds import gridworld, gridworld_rewards, other_than_printed
from irl_gym.judging.distances.payments import payments
from irl_gym.judging.distances.random_rewards import redistributed, shaped
from irl_gym.mdp.planning.dynamic_programming import occupancy
from irl_gym.mdp.rewards import TabularReward

LEVELLED = {
    "VAL": STARC(),
    "minimal": STARC(MinimalNorm()),
    "L1": STARC(norm=1, metric=1),
    "L infinity": STARC(MinimalNorm(), norm=np.inf, metric=np.inf),
    "mixed norms": STARC(norm=2, metric=1),
}
SHAPED = {
    "EPIC": EPIC(),
    "Spearman": Spearman(),
    "VAL, not levelled": STARC(ValueAdjustedLevelling(levelled=False)),
    "minimal, not levelled": STARC(MinimalNorm(levelled=False)),
}
ALL = {**LEVELLED, **SHAPED, "DARD": DARD(), "raw": Pearson(AsGiven())}
CONTINUING = ("dense", "sparse", "deterministic")
seeds = st.integers(0, 2**32 - 1)


def drawn(mdp, seed, form):
    shape = {"S": (mdp.n_states,), "SA": (mdp.n_states, mdp.n_actions), "SAS": (mdp.n_states, mdp.n_actions, mdp.n_states)}
    return np.random.default_rng(seed).normal(size=shape[form])


def expanded(mdp, R):
    """(S, A, S)."""
    shape = (mdp.n_states, mdp.n_actions, mdp.n_states)
    return np.broadcast_to(R if R.ndim != 2 else R[:, :, None], shape)


def naive_epic(P, R, gamma):
    """The formula of the paper, triple by triple, uniform D_S and D_A; no terminal states."""
    S, A = R.shape[:2]
    C = np.empty(R.shape)
    for s in range(S):
        for a in range(A):
            for x in range(S):
                C[s, a, x] = R[s, a, x] + gamma * R[x].mean() - R[s].mean() - gamma * R.mean()
    return C


def naive_dard(P, R, gamma):
    """The formula of the paper, triple by triple, uniform D_A; no terminal states."""
    S, A = R.shape[:2]
    C = R.copy()
    for s in range(S):
        for x in range(S):
            for b in range(A):
                here, there = P[s, b], P[x, b]
                more = gamma * there @ R[x, b] - here @ R[s, b] - gamma * here @ R[:, b] @ there
                C[s, :, x] += more / A
    return C


@pytest.mark.parametrize("kind", CONTINUING)
@pytest.mark.parametrize(("form", "naive"), [(FreshDraws(), naive_epic), (ModelDraws(), naive_dard)])
def test_canonical_form_is_the_formula_of_the_paper(kind, form, naive):
    model = random_model(3, 5, 3, kind)
    R, coverage = drawn(model.mdp, 0, "SAS"), coverage_of(model.mdp, None)
    values = form.values(model.mdp, payments(model.mdp, R), coverage)
    expected = naive(model.P, R, 0.9)[coverage.states, coverage.actions, coverage.next_states]
    np.testing.assert_allclose(values, expected, atol=1e-12)


def test_value_adjusted_levelling_is_the_advantage_of_the_policy():
    model = random_model(4, 6, 2, "terminal")
    R, coverage = drawn(model.mdp, 0, "SAS"), coverage_of(model.mdp, None)
    values = ValueAdjustedLevelling(np.zeros(6, dtype=int)).values(model.mdp, payments(model.mdp, R), coverage)
    step = (model.P * R).sum(axis=2)
    V = np.linalg.solve(np.eye(6) - 0.9 * model.P[:, 0], step[:, 0])
    np.testing.assert_allclose(values, (step + 0.9 * model.P @ V - V[:, None])[coverage.states, coverage.actions], atol=1e-12)


@pytest.mark.parametrize("levelled", [True, False])
def test_minimal_norm_is_the_least_squares_solution(levelled):
    model = random_model(5, 6, 2, "terminal")
    R, coverage = drawn(model.mdp, 0, "SAS"), coverage_of(model.mdp, None)
    values = MinimalNorm(levelled).values(model.mdp, payments(model.mdp, R), coverage)
    eye, s, x = np.eye(6)[:, :4], coverage.states, coverage.next_states
    if levelled:
        rows, right = (0.9 * model.P @ eye - eye[:, None])[:4].reshape(-1, 4), (model.P * R).sum(axis=2)[:4].ravel()
        weights = np.ones(8)
    else:
        rows, right, weights = 0.9 * eye[x] - eye[s], R[s, coverage.actions, x], np.sqrt(coverage.weights)
    Phi = np.linalg.lstsq(rows * weights[:, None], -right * weights, rcond=None)[0]
    least = right + rows @ Phi
    np.testing.assert_allclose(values, least.reshape(4, 2)[s, coverage.actions] if levelled else least, atol=1e-10)


def test_epic_gridworlds_have_the_distances_that_the_paper_prints():
    matrix = distance_matrix(EPIC(), gridworld(), gridworld_rewards())
    assert other_than_printed(matrix) == []
    assert other_than_printed(matrix + 1e-3)[0] == "Sparse-Dense is 0.0010: the paper prints 0.0000"


def test_epic_gridworlds_have_the_distances_of_the_formula():
    """All pairs of the figure to four decimals, from definition 4.1 written out: D uniform over states and actions."""
    mdp, rewards = gridworld(), gridworld_rewards()
    P = mdp.P.toarray().reshape(9, 5, 9)
    found = np.array([(naive_epic(P, R, 0.99) * P).sum(axis=2).ravel() for R in rewards.values()])  # s' is certain
    np.testing.assert_allclose(
        distance_matrix(EPIC(), mdp, rewards), np.sqrt(np.clip(1 - np.corrcoef(found), 0, 2) / 2), atol=1e-7
    )


def test_opposite_rewards_are_1_apart():
    rewards = gridworld_rewards()
    assert all(
        abs(d.distance(gridworld(), rewards["Sparse"], rewards["Penalty"]) - 1) < 1e-12 for d in (EPIC(), DARD(), STARC())
    )


def test_functions_are_the_records():
    model = random_model(6)
    a, b = model.R, drawn(model.mdp, 1, "SA")
    pairs = [(epic, EPIC()), (dard, DARD()), (starc, STARC()), (pearson, Pearson()), (spearman, Spearman())]
    assert all(function(model.mdp, a, b) == record.distance(model.mdp, a, b) for function, record in pairs)


@given(models(), seeds, st.sampled_from(sorted(ALL)), st.tuples(*[st.sampled_from(["S", "SA", "SAS"])] * 3))
def test_distance_is_a_pseudometric(model, seed, name, forms):
    rewards = [drawn(model.mdp, seed + i, form) for i, form in enumerate(forms)]
    d = np.array([[ALL[name].distance(model.mdp, a, b) for b in rewards] for a in rewards])
    assert np.diag(d).max() < 1e-12
    np.testing.assert_allclose(d, d.T, atol=1e-12)
    assert d[0, 2] <= d[0, 1] + d[1, 2] + 1e-12
    assert name == "mixed norms" or d.max() <= 1 + 1e-12


@given(models(), seeds, st.sampled_from(sorted(ALL)), st.sampled_from(["S", "SA"]))
def test_a_short_form_equals_its_expansion(model, seed, name, form):
    R = drawn(model.mdp, seed, form)
    assert ALL[name].distance(model.mdp, R, expanded(model.mdp, R)) < 1e-8


@given(models(), seeds, st.sampled_from(sorted(ALL)), st.sampled_from(["S", "SA", "SAS"]))
def test_positive_scaling_is_ignored(model, seed, name, form):
    R = drawn(model.mdp, seed, form)
    assert ALL[name].distance(model.mdp, R, 1e3 * R) < 1e-8


@given(models(), seeds, st.sampled_from(sorted(LEVELLED | SHAPED)), st.sampled_from(["S", "SA", "SAS"]))
def test_potential_shaping_is_ignored(model, seed, name, form):
    R = drawn(model.mdp, seed, form)
    again = shaped(np.random.default_rng(seed), model.mdp, expanded(model.mdp, R))
    again[model.mdp.terminal] = 77.0  # what is said of steps out of terminal states is not read
    assert (LEVELLED | SHAPED)[name].distance(model.mdp, R, again) < 1e-8


@given(models(), seeds)
def test_potential_shaping_is_ignored_by_dard_when_it_reaches_the_triples_out_of_terminal_states(model, seed):
    R = drawn(model.mdp, seed, "SAS")
    assert dard(model.mdp, R, shaped(np.random.default_rng(seed), model.mdp, R)) < 1e-8


@given(models(("terminal", "walls")), seeds, st.sampled_from(sorted(LEVELLED | SHAPED)))
def test_a_potential_that_is_not_0_at_a_terminal_state_is_seen(model, seed, name):
    R, Phi = drawn(model.mdp, seed, "SAS"), 50.0 * model.mdp.terminal
    assert (LEVELLED | SHAPED)[name].distance(model.mdp, R, R + model.mdp.gamma * Phi) > 1e-3


@given(models(), seeds, st.sampled_from(sorted(LEVELLED)), st.sampled_from(["S", "SA", "SAS"]))
def test_redistribution_is_ignored_by_levelled_starc(model, seed, name, form):
    R = drawn(model.mdp, seed, form)
    moved = redistributed(np.random.default_rng(seed), model.mdp, expanded(model.mdp, R))
    assert LEVELLED[name].distance(model.mdp, R, 3 * shaped(np.random.default_rng(seed), model.mdp, moved)) < 1e-8


@given(models(("dense", "sparse")), seeds, st.sampled_from(["EPIC", "VAL, not levelled", "minimal, not levelled", "DARD"]))
def test_redistribution_is_seen_by_the_others(model, seed, name):
    R = drawn(model.mdp, seed, "SAS")
    moved = redistributed(np.random.default_rng(seed), model.mdp, R)
    assert ALL[name].distance(model.mdp, R, moved) > 1e-3


@given(models(CONTINUING), seeds, st.sampled_from(sorted(ALL)))
def test_a_constant_is_ignored_where_no_state_is_terminal(model, seed, name):
    R = drawn(model.mdp, seed, "SAS")
    assert ALL[name].distance(model.mdp, R, R + 5.0) < 1e-8


def test_spearman_ignores_an_increasing_change_that_pearson_sees():
    mdp, R = gridworld(), gridworld_rewards()["Path"]
    bent = np.exp(R)
    assert Spearman(AsGiven()).distance(mdp, R, bent) < 1e-12 < 0.01 < Pearson(AsGiven()).distance(mdp, R, bent)


def test_coverage_of_a_policy_looks_at_what_it_visits():
    model = random_model(8, 6, 2, "deterministic")
    visits = occupancy(model.mdp, np.zeros(6, dtype=int))
    a = drawn(model.mdp, 0, "SA")
    b = a.copy()
    b[:, 1] += 9.0  # action 1 is never taken
    assert pearson(model.mdp, a, b, canonical=AsGiven(), coverage=visits / visits.sum()) < 1e-12


def test_a_reward_that_no_policy_can_change_is_half_a_unit_from_others_with_starc():
    model = random_model(9)
    only_a_potential = shaped(np.random.default_rng(0), model.mdp, np.zeros((7, 3, 7)))
    assert starc(model.mdp, only_a_potential, model.R) == pytest.approx(0.5)
    assert starc(model.mdp, only_a_potential, np.zeros(7)) == 0


def test_a_tabular_reward_is_its_values():
    model = random_model(10)
    assert epic(model.mdp, TabularReward(model.R), model.R) == 0


@given(seed=seeds, scale=st.sampled_from([1.0, 1e3, 1e11]))
@pytest.mark.parametrize("distance", [*LEVELLED.values(), SHAPED["VAL, not levelled"], ALL["raw"]])
def test_impossible_transitions_are_not_read(distance, seed, scale):
    model = random_model(seed % 50, 6, 2, "terminal")
    rng = np.random.default_rng(seed)
    R, other = rng.normal(size=(2, 6, 2, 6))
    changed = np.where(model.P > 0, R, scale * rng.normal(size=R.shape))
    assert distance.distance(model.mdp, R, changed) < 1e-7
    assert distance.distance(model.mdp, other, changed) == pytest.approx(distance.distance(model.mdp, other, R), abs=1e-7)


@pytest.mark.parametrize("distance", [EPIC(), STARC(), STARC(MinimalNorm())])
def test_steps_out_of_terminal_states_are_not_read(distance):
    model = random_model(0, 6, 2, "terminal")
    R, other = np.random.default_rng(0).normal(size=(2, 6, 2))
    changed = np.where(model.mdp.terminal[:, None], 1e13, R)
    assert distance.distance(model.mdp, R, changed) < 1e-7
    assert distance.distance(model.mdp, other, changed) == pytest.approx(distance.distance(model.mdp, other, R), abs=1e-7)


@pytest.mark.parametrize("change", [np.exp, lambda x: np.where(x == x.max(), 1e10, x), lambda x: x**3, np.copy])
def test_spearman_of_raw_rewards_is_that_of_scipy(change):
    model = random_model(0, 6, 4)
    one, other = 30 * np.random.default_rng(0).random((2, 6, 4))
    rho = spearmanr(one.ravel(), other.ravel()).statistic
    distance = Spearman(AsGiven()).distance
    assert distance(model.mdp, one, change(one)) == 0.0
    assert distance(model.mdp, one, change(other)) == pytest.approx(np.sqrt((1 - rho) / 2))


@pytest.mark.parametrize("distance", [EPIC(), Pearson(), Spearman(), DARD()])
def test_a_potential_in_single_precision_has_no_correlation(distance):
    model = random_model(0, 6, 2)
    only = shaped(np.random.default_rng(0), model.mdp, np.zeros((6, 2, 6))).astype(np.float32)
    with pytest.raises(UndefinedDistance, match="only a potential"):
        distance.distance(model.mdp, only, model.R)
    assert STARC().distance(model.mdp, only, model.R) == pytest.approx(0.5)
