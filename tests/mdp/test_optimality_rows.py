import models
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from irl_gym.errors import InvalidPolicy
from irl_gym.mdp.optimality_rows import compare


@given(model=models.models())
def test_compare_has_a_row_for_each_other_action_of_acting_states(model):
    found = compare(model.mdp, model.expert)
    expected = ~model.mdp.terminal[:, None] & (np.arange(model.mdp.n_actions) != model.expert[:, None])
    np.testing.assert_array_equal(np.argwhere(expected), np.stack([found.states, found.actions], axis=1))


@given(model=models.models())
def test_compare_rows_are_differences_of_successors(model):
    found = compare(model.mdp, model.expert)
    expected = model.P[found.states, model.expert[found.states]] - model.P[found.states, found.actions]
    np.testing.assert_allclose(found.rows.todense(), expected, atol=1e-13)


@given(model=models.models())
def test_compare_calls_rows_trivial_that_have_the_same_successors(model):
    found = compare(model.mdp, model.expert)
    difference = model.P[found.states, model.expert[found.states]] - model.P[found.states, found.actions]
    np.testing.assert_array_equal(found.trivial, np.abs(difference).max(axis=1) < 1e-12)


@given(model=models.models(kinds=("walls", "deterministic")))
def test_compare_stores_nothing_where_successors_cancel(model):
    found = compare(model.mdp, model.expert)
    assert np.abs(found.rows.data).min(initial=1.0) > 1e-14 and (np.diff(found.rows.indptr)[found.trivial] == 0).all()


def test_compare_demands_equality_for_each_action_of_a_set():
    model = models.random_model(0)
    both = np.zeros((7, 3), dtype=bool)
    both[:, 0] = True
    both[4, 2] = True
    found = compare(model.mdp, both)
    assert np.stack([found.states, found.actions])[:, found.equal].T.tolist() == [[4, 0], [4, 2]]


def test_compare_measures_a_stochastic_expert_by_its_mixture():
    model = models.random_model(0)
    expert = np.tile([0.25, 0.75, 0.0], (7, 1))
    found = compare(model.mdp, expert)
    mixed = np.einsum("sa,sat->st", expert, model.P)
    np.testing.assert_allclose(found.rows.todense(), mixed[found.states] - model.P[found.states, found.actions], atol=1e-13)


def test_compare_knows_the_actions_of_the_expert():
    model = models.random_model(0)
    np.testing.assert_array_equal(compare(model.mdp, model.expert).distribution, np.eye(3)[model.expert])


def test_compare_refuses_what_is_no_policy():
    with pytest.raises(InvalidPolicy, match=r"policy\[s=6\] is action 3"):
        compare(models.random_model(0).mdp, np.array([0, 0, 0, 0, 0, 0, 3]))


@given(model=models.models(), seed=st.integers(0, 99))
def test_compare_among_some_states_gives_their_rows_of_the_whole(model, seed):
    among = np.flatnonzero(np.random.default_rng(seed).random(model.mdp.n_states) < 0.5)
    whole, part = compare(model.mdp, model.expert), compare(model.mdp, model.expert, among)
    kept = np.isin(whole.states, among)
    for name in ("states", "actions", "equal", "trivial"):
        np.testing.assert_array_equal(getattr(part, name), getattr(whole, name)[kept])
    np.testing.assert_array_equal(part.rows.todense(), whole.rows.todense()[kept])


def test_compare_among_some_states_demands_equality_of_a_set_there():
    model = models.random_model(0)
    both = np.zeros((7, 3), dtype=bool)
    both[:, 0] = both[[1, 4], 2] = True
    found = compare(model.mdp, both, np.array([4, 5]))
    assert found.states.tolist() == [4, 4, 4, 5, 5] and found.equal.tolist() == [True, False, True, False, False]


def test_compare_among_terminal_states_has_no_rows():
    model = models.random_model(0, kind="terminal")
    assert compare(model.mdp, model.expert, np.array([5, 6])).states.size == 0


def test_compare_among_no_states_has_no_rows():
    found = compare(models.random_model(0).mdp, np.zeros(7, dtype=int), np.zeros(0, dtype=int))
    assert found.states.size == found.trivial.size == 0


def test_compare_among_some_states_still_checks_the_policy_in_all():
    with pytest.raises(InvalidPolicy, match=r"policy\[s=6\] is action 3"):
        compare(models.random_model(0).mdp, np.array([0, 0, 0, 0, 0, 0, 3]), np.array([0]))
