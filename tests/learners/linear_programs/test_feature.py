"""FeatureLP is the program of section 4 of Ng & Russell (2000), and its results prove what they say."""

import json
import pickle

import models
import numpy as np
import pytest
import reference
from certified import both, certified
from gymnasium import spaces
from hypothesis import given
from hypothesis import strategies as st

from irl_gym.features.feature_maps import Functions, OneHot, Table
from irl_gym.learners.base import Learner, Proof
from irl_gym.learners.linear_programs import weights
from irl_gym.learners.linear_programs.feature import FeatureLP
from irl_gym.learners.linear_programs.finite import FiniteLP
from irl_gym.mdp.optimality import certify
from irl_gym.programs.solvers import Status
from irl_gym.spaces.states import StateIndex

ALL_DIFFERENT = ("dense", "sparse", "terminal")
"""Kinds without actions of equal successors, where the programs of sections 3 and 4 count the same rows."""


# --- oracle: the paper ---


@pytest.mark.parametrize("kind", models.KINDS)
@pytest.mark.parametrize("penalty", [1.0, 2.0, 50.0])
@pytest.mark.parametrize("l1", [0.0, 0.3])
def test_feature_lp_objective_equals_the_dense_lp(kind, penalty, l1):
    for seed in range(6):
        model, Phi, S_0 = models.with_features(seed, kind)
        expected, _ = reference.section_4_lp(model.P, 0.9, model.expert, Phi, S_0, penalty=penalty, l1=l1)
        found = FeatureLP(Phi, S_0=S_0, penalty=penalty, l1=l1).fit(model.mdp, model.expert)
        assert found.proof.objective == pytest.approx(expected, rel=1e-7, abs=1e-7)


@pytest.mark.parametrize("seed", range(50))
def test_feature_lp_of_one_hot_features_is_the_finite_lp_when_the_penalty_is_large(seed):
    model = models.random_model(seed, kind=ALL_DIFFERENT[seed % 3])
    finite = FiniteLP(margin_cap=None, l1=0.0).fit(model.mdp, model.expert)
    large = FeatureLP(OneHot(7), penalty=1e4).fit(model.mdp, model.expert)
    assert large.proof.objective == pytest.approx(finite.proof.objective, rel=1e-6)


@pytest.mark.parametrize("seed", range(50))
def test_feature_lp_of_one_hot_features_has_the_expert_among_the_greedy_policies(seed):
    model = models.random_model(seed, kind=ALL_DIFFERENT[seed % 3])
    acting = np.flatnonzero(~model.mdp.terminal)
    for learner in (FiniteLP(margin_cap=None, l1=0.0), FeatureLP(OneHot(7), penalty=1e4)):
        found = learner.fit(model.mdp, model.expert)
        R = found.reward.values if isinstance(learner, FiniteLP) else found.reward.tabular(7).values
        Q = reference.action_values(model.P, 0.9, model.P @ R, reference.values(model.P, 0.9, model.P @ R))
        best = Q >= Q.max(axis=1, keepdims=True) - 1e-7
        assert both(found, model.mdp, model.expert).expert_optimal and best[acting, model.expert[acting]].all()


def test_feature_lp_objective_is_12_6837_on_the_grid_of_the_paper():
    grid = models.paper_grid()
    found = FeatureLP(OneHot(25), penalty=1e3).fit(grid.mdp, grid.expert)
    assert found.proof.objective == pytest.approx(12.6837, abs=1e-4) and both(found, grid.mdp, grid.expert).expert_optimal


# --- property: what every result proves ---


@given(sample=models.featured, penalty=st.sampled_from([1.0, 2.0, 50.0]), l1=st.sampled_from([0.0, 0.1, 1.0]))
def test_feature_lp_duals_close_the_gap(sample, penalty, l1):
    model, Phi, S_0 = sample
    certificate = certified(FeatureLP(Phi, S_0=S_0, penalty=penalty, l1=l1), model.mdp, model.expert)
    assert -1e-9 <= certificate.duality_gap < 1e-6


@given(sample=models.featured)
def test_feature_lp_keeps_the_weights_within_the_box(sample):
    model, Phi, S_0 = sample
    assert np.abs(FeatureLP(Phi, S_0=S_0).fit(model.mdp, model.expert).reward.alpha).max() <= 1


@given(sample=models.featured)
def test_feature_lp_pays_less_for_the_weights_when_l1_is_larger(sample):
    model, Phi, S_0 = sample
    low, high = (FeatureLP(Phi, S_0=S_0, l1=l1).fit(model.mdp, model.expert).proof for l1 in (0.01, 0.5))
    assert high.alpha_l1_norm <= low.alpha_l1_norm + 1e-7


@given(model=models.models())
def test_feature_lp_has_the_margins_of_its_reward(model):
    found = FeatureLP(OneHot(model.mdp.n_states)).fit(model.mdp, model.expert)
    expected = certify(model.mdp, model.expert, found.reward.tabular(model.mdp.n_states))
    judged = ~model.mdp.terminal
    least = reference.margins(model.P, model.mdp.gamma, model.expert, found.reward.alpha)
    least[np.isnan(expected.margin)] = np.nan  # where a reward on states can give no margin
    mixed = np.isin(np.arange(judged.size), expected.inseparable)
    np.testing.assert_allclose(expected.margin[judged & ~mixed], least[judged & ~mixed], atol=1e-9)


@given(model=models.models())
def test_feature_lp_makes_the_expert_optimal_when_the_true_reward_is_a_feature(model):
    found = FeatureLP(model.R[:, None], penalty=1e4).fit(model.mdp, model.expert)
    assert both(found, model.mdp, model.expert).expert_optimal and found.proof.expressible and found.status is Status.OPTIMAL


def test_feature_lp_judges_states_outside_the_sample():
    model = models.random_model(4, S=10)
    certificate = certified(FeatureLP(np.arange(10.0)[:, None], S_0=[2, 3]), model.mdp, model.expert)
    assert certificate.states == 2 and np.isfinite(certificate.margin).sum() == 10


# --- features ---


def test_feature_lp_reads_arrays_tables_and_functions_alike():
    model, Phi, S_0 = models.with_features(2, "dense")
    maps = (Phi, Table(Phi), Functions(lambda rows: Phi[rows], Phi.shape[1]))
    found = [FeatureLP(phi, S_0=S_0).fit(model.mdp, model.expert).proof.objective for phi in maps]
    assert found == pytest.approx([found[0]] * 3, abs=1e-12)


def test_feature_lp_asks_for_features_of_observations_when_states_are_given():
    model, Phi, _ = models.with_features(2, "dense")
    states = StateIndex(spaces.MultiDiscrete([2, 4]))
    of_pairs = Functions(lambda pairs: Phi[4 * pairs[:, 0] + pairs[:, 1]], Phi.shape[1])
    expected = FeatureLP(Phi).fit(model.mdp, model.expert).proof.objective
    assert FeatureLP(of_pairs).fit(model.mdp, model.expert, states=states).proof.objective == pytest.approx(expected, abs=1e-12)


# --- what the features cannot say ---


@pytest.mark.parametrize("value", [0.0, 3.0])
def test_feature_lp_says_inexpressible_when_the_features_are_constant(value):
    model = models.random_model(0)
    found = FeatureLP(np.full((7, 1), value)).fit(model.mdp, model.expert)
    assert found.status is Status.INEXPRESSIBLE and not found.proof.expressible


def test_feature_lp_says_inexpressible_when_no_sign_of_the_feature_will_do():
    model = models.random_model(0)
    for seed in range(5):  # one random feature: seven states will not all agree with it
        Phi = np.random.default_rng(seed).normal(size=(7, 1))
        found = FeatureLP(Phi).fit(model.mdp, model.expert)
        least = [reference.margins(model.P, 0.9, model.expert, sign * Phi[:, 0]).min() for sign in (1, -1)]
        assert (found.status is Status.INEXPRESSIBLE) == (max(least) < -1e-9)


def test_feature_lp_says_zero_weights_when_l1_is_too_high():
    model = models.random_model(0)
    found = FeatureLP(OneHot(7), l1=1e3).fit(model.mdp, model.expert)
    assert found.status is Status.ZERO_WEIGHTS and found.proof.zero and both(found, model.mdp, model.expert).degenerate


# --- kinds of expert ---


def test_feature_lp_reads_actions_distribution_and_set_alike():
    model = models.random_model(0, kind="walls")
    one_hot = np.eye(3)[model.expert]
    found = [FeatureLP(OneHot(7)).fit(model.mdp, expert).proof.objective for expert in (model.expert, one_hot, one_hot > 0)]
    assert found == pytest.approx([found[0]] * 3)


def test_feature_lp_ties_the_actions_of_a_set():
    grid = models.paper_grid()
    Q = reference.action_values(grid.P, 0.9, grid.step_reward, reference.values(grid.P, 0.9, grid.step_reward))
    optimal = Q >= Q.max(axis=1, keepdims=True) - 1e-9
    certificate = certified(FeatureLP(OneHot(25), penalty=1e3), grid.mdp, optimal)
    assert certificate.expert_optimal and -1e-6 < certificate.duality_gap < 1e-6


# --- the outcome ---


@pytest.fixture(scope="module")
def result():
    model = models.random_model(0)
    return FeatureLP(OneHot(7)).fit(model.mdp, model.expert)


def test_feature_lp_is_a_learner_with_a_proof(result):
    assert isinstance(FeatureLP(OneHot(7)), Learner) and isinstance(result.proof, Proof)


def test_feature_lp_result_survives_pickle(result):
    again = pickle.loads(pickle.dumps(result))
    assert again.proof.to_json() == result.proof.to_json() and again.status is result.status


def test_feature_lp_proof_is_json(result):
    assert json.loads(json.dumps(result.proof.to_json()))["objective"] == result.proof.objective


def test_feature_lp_proof_reads_as_a_page(result):
    text = str(result.proof)
    assert "objective of the program   " in text and "the rows have rank" in text


def test_feature_lp_notes_the_scaling_of_its_features(result):
    assert result.reward.note == {"learner": "FeatureLP", "scaling": "one-hot: 1 in the state, 0 elsewhere"}


def test_feature_lp_stats_name_the_program(result):
    assert result.stats["rows"] == 14 and result.stats["programs"]["weights"]["solver"] == "highs"


def test_feature_lp_reaches_the_same_objective_by_generated_kinks(monkeypatch):
    model, Phi, _ = models.with_features(2, "sparse")
    whole = FeatureLP(Phi, l1=0.1).fit(model.mdp, model.expert).proof.objective
    monkeypatch.setattr(weights, "SAMPLE", 2)
    assert FeatureLP(Phi, l1=0.1).fit(model.mdp, model.expert).proof.objective == pytest.approx(whole, abs=1e-7)
