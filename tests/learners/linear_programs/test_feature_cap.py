"""FeatureLP with capped margins: the program, its bound, and the cap that it chooses."""

import models
import numpy as np
import pytest
import reference
from certified import certified
from hypothesis import given
from hypothesis import strategies as st

from irl_gym.agents.planners import ValueIteration, tabular_actions
from irl_gym.environments.tabular_vec_env import TabularVecEnv
from irl_gym.errors import InvalidParameter
from irl_gym.features.bases import Fourier
from irl_gym.features.feature_maps import OneHot, Unravel
from irl_gym.judging.metrics import normalised_score, optimal_actions, policy_value, random_value
from irl_gym.learners.linear_programs import weights
from irl_gym.learners.linear_programs.expressible import most_agreement, uniform_margin
from irl_gym.learners.linear_programs.feature import FeatureLP
from irl_gym.learners.linear_programs.weights import Rows, best_weights


def drawn(seed, kind, K=None):
    """A model, K features (any number from 1 to 9 if None), and a sample of half of the states or more."""
    rng = np.random.default_rng([seed, 1])
    Phi = rng.normal(size=(8, K or rng.integers(1, 10)))
    return models.random_model(seed, S=8, kind=kind), Phi, np.sort(rng.choice(8, size=rng.integers(4, 9), replace=False))


samples = st.builds(drawn, seed=st.integers(0, 2**32 - 1), kind=st.sampled_from(models.KINDS))


def uniform(model, Phi, S_0):
    return reference.uniform_margin(model.P, 0.9, model.expert, Phi, S_0)


# --- the program ---


@pytest.mark.parametrize("kind", models.KINDS)
@pytest.mark.parametrize("cap", [0.01, 0.3, 5.0])
@pytest.mark.parametrize(("penalty", "l1"), [(2.0, 0.0), (20.0, 0.1)])
def test_capped_objective_equals_the_dense_lp(kind, cap, penalty, l1):
    for seed in range(3):
        model, Phi, S_0 = drawn(seed, kind)
        settings = {"penalty": penalty, "l1": l1}
        expected, _ = reference.section_4_lp(model.P, 0.9, model.expert, Phi, S_0, cap=cap, **settings)
        found = FeatureLP(Phi, S_0=S_0, margin_cap=cap, **settings).fit(model.mdp, model.expert)
        assert found.proof.objective == pytest.approx(expected, rel=1e-7, abs=1e-7)


def test_a_cap_above_all_margins_changes_nothing():
    model, Phi, S_0 = drawn(2, "dense")
    plain, capped = (FeatureLP(Phi, S_0=S_0, margin_cap=cap).fit(model.mdp, model.expert) for cap in (None, 1e4))
    assert capped.proof.objective == pytest.approx(plain.proof.objective)


@given(sample=samples, cap=st.sampled_from([0.01, 0.3, 5.0]))
def test_capped_duals_close_the_gap(sample, cap):
    model, Phi, S_0 = sample
    certificate = certified(FeatureLP(Phi, S_0=S_0, margin_cap=cap), model.mdp, model.expert)
    assert certificate.margin_cap == cap and -1e-9 <= certificate.duality_gap < 1e-6


@given(seed=st.integers(0, 2**32 - 1), cap=st.sampled_from([0.01, 1.0, 100.0, np.inf]), slope=st.sampled_from([1.0, 2.0, 50.0]))
def test_the_bound_is_above_every_objective_whatever_the_duals(seed, cap, slope):
    rng = np.random.default_rng(seed)
    rows = Rows(rng.normal(size=(9, 3)), np.sort(np.concatenate([np.arange(4), rng.integers(4, size=5)])))
    y = rng.choice([0.0, 1.0], size=9) * rng.exponential(size=9) * rng.choice([0.01, 1.0, 100.0]) - rng.integers(2)
    l1 = rng.choice([0.0, 0.5])
    program = {"slope": slope, "l1": l1, "cap": cap}
    best = rows.objective(best_weights(rows, **program).alpha, **program)
    tried = [rows.objective(alpha, **program) for alpha in rng.uniform(-1, 1, size=(50, 3))]
    assert rows.bound(y, **program) >= max(best, *tried) - 1e-7


@pytest.mark.parametrize("cap", [0.01, 0.3])
def test_the_capped_objective_is_the_same_by_generated_kinks(cap, monkeypatch):
    model, Phi, _ = drawn(2, "sparse")
    whole = FeatureLP(Phi, margin_cap=cap).fit(model.mdp, model.expert).proof.objective
    monkeypatch.setattr(weights, "SAMPLE", 2)
    assert FeatureLP(Phi, margin_cap=cap).fit(model.mdp, model.expert).proof.objective == pytest.approx(whole, abs=1e-7)


# --- the cap that it chooses ---

WITH_MARGIN = [(seed, kind) for kind in ("dense", "sparse", "walls") for seed in range(4)]


@pytest.mark.parametrize(("seed", "kind"), WITH_MARGIN)
def test_the_automatic_cap_is_half_of_the_uniform_margin(seed, kind):
    model = models.random_model(seed, S=8, kind=kind)
    found = FeatureLP(OneHot(8), margin_cap="auto").fit(model.mdp, model.expert)
    most = uniform(model, np.eye(8), range(8))
    assert most > 1e-6 and found.proof.margin_cap == pytest.approx(most / 2, rel=1e-5)


@pytest.mark.parametrize(("seed", "kind"), WITH_MARGIN)
def test_the_automatic_cap_makes_the_expert_strictly_optimal_in_the_sample(seed, kind):
    model, _, S_0 = drawn(seed, kind)
    found = FeatureLP(OneHot(8), S_0=S_0, margin_cap="auto").fit(model.mdp, model.expert)
    margins = reference.margins(model.P, 0.9, model.expert, found.reward.alpha, skip_equal=True)[S_0]
    assert margins.min() >= found.proof.margin_cap * (1 - 1e-6) > 0


@given(sample=samples)
def test_uniform_margin_is_that_of_the_dense_program(sample):
    model, Phi, S_0 = sample
    P_pi = model.P[np.arange(8), model.expert]
    V = np.linalg.inv(np.eye(8) - 0.9 * P_pi) @ Phi
    pairs = [(i, s, a) for i, s in enumerate(S_0) for a in range(3) if np.abs(P_pi[s] - model.P[s, a]).max() > 1e-12]
    if not pairs:
        return
    rows = Rows(
        np.array([(P_pi[s] - model.P[s, a]) @ V for _, s, a in pairs]),
        np.unique([i for i, *_ in pairs], return_inverse=True)[1],
    )
    assert uniform_margin(rows) == pytest.approx(max(uniform(model, Phi, S_0), 0.0), rel=1e-5, abs=1e-6 * rows.scale)


def without_margin():
    """A model, and two features that leave no reward under which the expert is strictly best everywhere."""
    for seed in range(50):
        model, Phi, _ = drawn(seed, "dense", K=2)
        if uniform(model, Phi, range(8)) < 1e-9 and FeatureLP(Phi).fit(model.mdp, model.expert).proof.objective > 0.1:
            return model, Phi
    raise AssertionError("none of 50 models will do")


def test_the_automatic_cap_is_a_tenth_of_the_mean_margin_when_there_is_no_uniform_one():
    model, Phi = without_margin()
    plain = FeatureLP(Phi).fit(model.mdp, model.expert)
    margins = reference.margins(model.P, 0.9, model.expert, Phi @ plain.reward.alpha)
    found = FeatureLP(Phi, margin_cap="auto").fit(model.mdp, model.expert)
    assert found.proof.margin_cap == pytest.approx(np.maximum(margins, 0).mean() / 10, rel=1e-6)


@pytest.mark.parametrize("value", [0.0, 3.0])
def test_there_is_no_automatic_cap_when_nothing_has_a_margin(value):
    model = models.random_model(0)
    assert FeatureLP(np.full((7, 1), value), margin_cap="auto").fit(model.mdp, model.expert).proof.margin_cap is None


@pytest.mark.parametrize("scale", [1e-6, 1e6])
def test_the_automatic_cap_does_not_depend_on_the_scale_of_the_features(scale):
    model, Phi, _ = drawn(1, "dense", K=9)
    plain, scaled = (FeatureLP(f * Phi, margin_cap="auto").fit(model.mdp, model.expert).proof for f in (1.0, scale))
    assert scaled.margin_cap == pytest.approx(scale * plain.margin_cap, rel=1e-5)


def test_the_automatic_cap_counts_the_ties_of_a_set_of_actions():
    grid = models.paper_grid()
    Q = reference.action_values(grid.P, 0.9, grid.step_reward, reference.values(grid.P, 0.9, grid.step_reward))
    expert = Q >= Q.max(axis=1, keepdims=True) - 1e-9
    assert certified(FeatureLP(OneHot(25), margin_cap="auto", penalty=1e3), grid.mdp, expert).expert_optimal


@pytest.mark.parametrize("wrong", [0.0, -1.0, float("nan"), float("inf"), "none", True])
def test_a_cap_that_is_none_is_refused(wrong, unchecked):
    with pytest.raises(InvalidParameter, match="margin_cap is"):
        FeatureLP(OneHot(2), margin_cap=wrong)


def test_most_agreement_does_not_depend_on_where_it_begins():
    rng = np.random.default_rng(0)
    rows = Rows(rng.normal(size=(40, 5)) + 0.8, np.arange(40))
    found = [most_agreement(rows, near) for near in (None, np.zeros(5), np.ones(5), rng.uniform(-1, 1, 5))]
    assert found == pytest.approx([found[0]] * 4, abs=1e-7)


# --- the bar ---


@pytest.mark.parametrize(("cap", "least", "most"), [("auto", 1 - 1e-9, 1.0 + 1e-9), (None, -1, 0.1)])
def test_frozen_lake_needs_the_cap_with_few_smooth_features(toy_text, cap, least, most):
    table = toy_text("FrozenLake 8x8 slippery")
    mdp, true = table.mdp, table.reward
    expert = optimal_actions(mdp, true).argmax(axis=1)
    phi = Fourier([0, 0], [7, 7], 3, Unravel((8, 8)))
    learned = FeatureLP(phi, margin_cap=cap).fit(mdp, expert, states=table.states).reward.tabular(table.states)
    greedy = tabular_actions(ValueIteration().plan(TabularVecEnv(mdp, learned), gamma=0.99), table.states)
    values = policy_value(mdp, true, greedy), random_value(mdp, true), policy_value(mdp, true, expert)
    assert least <= normalised_score(*values) <= most
