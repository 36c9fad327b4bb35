"""The rows of FeatureLP: which states they are of, how many directions they have, and experts of whom not all is known."""

import models
import numpy as np
import pytest
from certified import certified
from hypothesis import given

from irl_gym.errors import DegenerateExpert, InvalidPolicy
from irl_gym.features.feature_maps import OneHot
from irl_gym.learners.linear_programs import feature_rows
from irl_gym.learners.linear_programs.feature import FeatureLP

# --- the sample ---


def chosen(S_0, model, seed=0):
    rng = np.random.default_rng(seed)
    return feature_rows.chosen_states(model.mdp, model.expert, S_0, rng).tolist()


def test_sample_is_all_acting_states_when_none_is_given():
    assert chosen(None, models.random_model(0, kind="terminal")) == [0, 1, 2, 3, 4]


def test_sample_leaves_out_states_without_a_row():
    model = models.random_model(1, S=30, A=2, kind="walls")  # with two actions a wall leaves its state without a row
    same = np.abs(model.P[:, 0] - model.P[:, 1]).max(axis=1) < 1e-12
    assert chosen(10**6, model) == np.flatnonzero(~same).tolist()


def test_sample_has_the_size_asked_for():
    model = models.random_model(1, S=30, A=2, kind="walls")
    assert [len(set(chosen(n, model))) for n in (1, 7, 15)] == [1, 7, 15]


def test_sample_is_the_same_for_one_seed_and_another_for_the_next():
    model = models.random_model(1, S=30)
    assert chosen(5, model, 3) == chosen(5, model, 3) != chosen(5, model, 4)


def test_sample_draws_each_state_alike():
    model = models.random_model(1, S=10)
    counts = np.bincount(np.concatenate([chosen(3, model, seed) for seed in range(1000)]), minlength=10)
    assert np.abs(counts - 300).max() < 4 * np.sqrt(300 * 0.7)


def test_feature_lp_repeats_itself_with_a_number_of_states():
    model = models.random_model(1, S=30)
    once, again = (FeatureLP(OneHot(30), S_0=5, seed=2).fit(model.mdp, model.expert) for _ in range(2))
    np.testing.assert_array_equal(once.reward.alpha, again.reward.alpha)
    assert once.proof.states == 5


def test_feature_lp_counts_a_state_once_when_it_is_given_twice():
    model = models.random_model(1)
    one, two = (FeatureLP(OneHot(7), S_0=S_0).fit(model.mdp, model.expert) for S_0 in ([1, 4], [4, 1, 4]))
    assert two.proof.objective == one.proof.objective and two.proof.states == 2


# --- the rows ---


@given(sample=models.featured)
def test_feature_lp_counts_the_rank_of_the_rows(sample):
    model, Phi, S_0 = sample
    mixed = np.hstack([Phi, Phi @ np.ones((Phi.shape[1], 2))])  # two columns that add nothing
    P_pi = model.P[np.arange(8), model.expert]
    V = np.linalg.inv(np.eye(8) - 0.9 * P_pi) @ mixed
    d = ((P_pi[S_0, None] - model.P[S_0]) @ V).reshape(-1, mixed.shape[1])
    certificate = certified(FeatureLP(mixed, S_0=S_0), model.mdp, model.expert)
    assert (certificate.rank, certificate.n_features) == (np.linalg.matrix_rank(d, tol=1e-9), mixed.shape[1])


@given(sample=models.featured)
def test_feature_lp_counts_states_with_and_without_a_row(sample):
    model, Phi, S_0 = sample
    P_pi = model.P[np.arange(8), model.expert]
    moving = np.abs(P_pi[:, None] - model.P).max(axis=(1, 2)) > 1e-12
    certificate = certified(FeatureLP(Phi, S_0=S_0), model.mdp, model.expert)
    assert (certificate.states, certificate.trivial) == (moving[S_0].sum(), (~moving[S_0]).sum())


@pytest.mark.parametrize("block", [1, 8, 24])
def test_rows_do_not_depend_on_the_blocks_of_columns(monkeypatch, block):
    model, Phi, S_0 = models.with_features(2, "sparse")
    whole = FeatureLP(Phi, S_0=S_0).fit(model.mdp, model.expert)
    monkeypatch.setattr(feature_rows, "BLOCK", block)
    parts = FeatureLP(Phi, S_0=S_0).fit(model.mdp, model.expert)
    np.testing.assert_allclose(parts.reward.alpha, whole.reward.alpha, atol=1e-12)


# --- experts of whom not all is known ---


def partly_known(model, unknown):
    """The expert's probabilities, NaN in some states."""
    probabilities = np.eye(model.mdp.n_actions)[model.expert]
    probabilities[unknown] = np.nan
    return probabilities


def test_rows_are_only_of_states_in_which_the_expert_is_known():
    model = models.random_model(1, S=10)
    certificate = certified(FeatureLP(OneHot(10)), model.mdp, partly_known(model, [2, 5]))
    assert certificate.states == 8 and np.flatnonzero(np.isnan(certificate.margin)).tolist() == [2, 5]


@pytest.mark.parametrize("S_0", [6, [2, 3, 4]])
def test_sample_leaves_out_states_in_which_the_expert_is_unknown(S_0):
    model = models.random_model(1, S=10)
    certificate = certified(FeatureLP(OneHot(10), S_0=S_0), model.mdp, partly_known(model, [2, 5, 7, 8]))
    assert certificate.states == (6 if S_0 == 6 else 2)


def test_expert_that_is_known_everywhere_gives_the_same_rows_as_actions():
    model = models.random_model(1, S=10)
    found = [FeatureLP(OneHot(10)).fit(model.mdp, expert).proof.objective for expert in (model.expert, partly_known(model, []))]
    assert found[0] == pytest.approx(found[1])


def test_expert_that_is_known_nowhere_is_refused():
    with pytest.raises(InvalidPolicy, match="nothing is known of the expert in any state"):
        FeatureLP(OneHot(7)).fit(models.random_model(0).mdp, np.full((7, 3), np.nan))


def test_expert_that_is_partly_nan_in_a_state_is_refused():
    model = models.random_model(0)
    probabilities = partly_known(model, [])
    probabilities[3, 1] = np.nan
    with pytest.raises(InvalidPolicy, match=r"policy\[s=3, a=1\] is nan"):
        FeatureLP(OneHot(7)).fit(model.mdp, probabilities)


def test_sample_of_unknown_states_only_is_refused():
    model = models.random_model(0)
    with pytest.raises(DegenerateExpert):
        FeatureLP(OneHot(7), S_0=[2, 5]).fit(model.mdp, partly_known(model, [2, 5]))
