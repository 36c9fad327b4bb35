import copy
import pickle

import models
import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given

from irl_gym.errors import InvalidDiscount, InvalidMDP, InvalidPolicy
from irl_gym.mdp.tabular_mdp import TabularMDP, TransitionTable

UNIFORM = np.full(3, 1 / 3)


def table(**changes):
    """Three states, two actions, the last state terminal; `changes` puts rows in place: {"s1a0": [...]}."""
    P = np.zeros((3, 2, 3))
    P[:2] = [[0.5, 0.5, 0], [0, 0, 1]]
    for name, row in changes.items():
        P[int(name[1]), int(name[3])] = row
    return P


@given(model=models.models())
def test_mdp_holds_the_dense_table(model):
    S, A = model.mdp.n_states, model.mdp.n_actions
    np.testing.assert_array_equal(model.mdp.P.todense().reshape(S, A, S), model.P)


@given(model=models.models())
def test_mdp_terminal_states_are_those_with_zero_rows(model):
    np.testing.assert_array_equal(model.mdp.terminal, ~model.P.any(axis=(1, 2)))


@given(model=models.models())
def test_p_a_is_the_rows_of_one_action(model):
    for a in range(model.mdp.n_actions):
        np.testing.assert_array_equal(model.mdp.P_a(a).todense(), model.P[:, a])


@given(model=models.models())
def test_p_pi_takes_each_row_from_the_action_of_its_state(model):
    expected = model.P[np.arange(model.mdp.n_states), model.expert]
    np.testing.assert_array_equal(model.mdp.P_pi(model.expert).todense(), expected)


@given(model=models.models())
def test_p_pi_mixes_rows_by_the_probabilities(model):
    S, A = model.mdp.n_states, model.mdp.n_actions
    policy = np.random.default_rng(0).dirichlet(np.ones(A), size=S)
    np.testing.assert_allclose(model.mdp.P_pi(policy).todense(), np.einsum("sa,sat->st", policy, model.P), atol=1e-15)


def test_p_pi_takes_a_set_uniformly():
    model = models.random_model(0)
    expected = (model.P[:, 0] + model.P[:, 2]) / 2
    np.testing.assert_allclose(model.mdp.P_pi(np.tile([True, False, True], (7, 1))).todense(), expected)


def test_mdp_adds_up_duplicate_successors():
    P = sp.csr_array(([0.25, 0.75, 1, 1, 1], [1, 1, 0, 0, 0], [0, 2, 3, 4, 5]), shape=(4, 2))
    mdp = TabularMDP(P, 0.9, [1, 0])
    assert mdp.P.nnz == 4 and mdp.P[0, 1] == 1


def test_mdp_drops_explicit_zeros():
    P = sp.csr_array(([1.0, 0.0, 1.0], ([0, 0, 1], [0, 1, 1])), shape=(2, 2))
    assert TabularMDP(P, 0.9, [1, 0]).P.nnz == 2


def test_reachable_leaves_out_states_that_no_action_leads_to():
    P = np.zeros((4, 2, 4))
    P[0, 0, 1] = P[0, 1, 0] = 1  # 1 is terminal
    P[2, :, 3] = P[3, :, 0] = 1
    mdp = TabularMDP.from_dense(P, 0.9, [1, 0, 0, 0])
    assert mdp.reachable.tolist() == [True, True, False, False]


@given(model=models.models())
def test_reachable_is_what_powers_of_the_table_reach(model):
    start = np.eye(model.mdp.n_states)[0]
    step = model.P.sum(axis=1)
    mass = start
    for _ in range(model.mdp.n_states):
        mass = np.minimum(mass + mass @ step, 1)
    np.testing.assert_array_equal(TabularMDP(model.mdp.P, 0.9, start).reachable, mass > 0)


def test_restrict_renumbers_the_states():
    P = np.zeros((3, 1, 3))
    P[0, 0, 2] = P[2, 0, 0] = P[1, 0, 0] = 1
    part = TabularMDP.from_dense(P, 0.9, [1, 0, 0]).restrict(np.array([2, 0]))
    np.testing.assert_array_equal(part.P.todense(), [[0, 1], [1, 0]])


@pytest.mark.parametrize(("start", "rows"), [([1.0, 0, 0], [0, 2]), ([0, 1.0, 0], [2])])
def test_restrict_refuses_states_that_are_not_closed(start, rows):
    mdp = TabularMDP.from_dense(table(), 0.9, start)
    with pytest.raises(InvalidMDP, match=f"the {len(rows)} states are not closed"):
        mdp.restrict(np.array(rows))


@pytest.mark.parametrize("again", [lambda x: pickle.loads(pickle.dumps(x)), copy.deepcopy])
@pytest.mark.parametrize("kind", [TabularMDP, TransitionTable])
def test_table_survives_copies(kind, again):
    args = (0.9, UNIFORM) if kind is TabularMDP else (UNIFORM,)
    before = kind.from_dense(table(), *args)
    after = again(before)
    assert type(after) is kind and (before.P != after.P).nnz == 0 and (before.d0 == after.d0).all()


@pytest.mark.parametrize("again", [lambda x: x, lambda x: pickle.loads(pickle.dumps(x)), copy.deepcopy])
def test_mdp_arrays_are_not_writeable(again):
    mdp = again(TabularMDP.from_dense(table(), 0.9, UNIFORM))
    arrays = (mdp.P.data, mdp.P.indices, mdp.P.indptr, mdp.d0, mdp.terminal, mdp.reachable)
    assert not any(array.flags.writeable for array in arrays)


def test_mdp_does_not_change_with_the_arrays_it_was_made_from():
    P, d0 = sp.csr_array(table().reshape(6, 3)), UNIFORM.copy()
    mdp = TabularMDP(P, 0.9, d0)
    P.data[:] = d0[:] = 7
    assert mdp.P.max() <= 1 and mdp.d0.max() <= 1


def test_mdp_says_its_size():
    assert repr(TabularMDP.from_dense(table(), 0.9, UNIFORM)) == ("TabularMDP(3 states, 2 actions, 1 terminal, 6 transitions)")


@pytest.mark.parametrize(
    ("P", "message"),
    [
        (table(s1a0=[0.5, 0.25, 0.22]), r"P\[s=1, a=0\] sums to 0\.97"),
        (table(s0a1=[0.5, 0.5, 0.5]), r"P\[s=0, a=1\] sums to 1\.5"),
        (table(s1a1=[1.5, -0.5, 0]), r"P\[s=1, a=1, s'=1\] is -0\.5"),
        (table(s0a0=[1, np.nan, 0]), r"P\[s=0, a=0, s'=1\] is nan"),
        (table(s0a0=[1, 0, np.inf]), r"P\[s=0, a=0\] sums to inf"),
        (table(s1a0=[0, 0, 0]), r"P\[s=1\] has zero rows for actions \[0\] only"),
    ],
)
def test_mdp_names_the_first_row_that_is_no_distribution(P, message):
    with pytest.raises(InvalidMDP, match=message):
        TabularMDP.from_dense(P, 0.9, UNIFORM)


@pytest.mark.parametrize(
    ("d0", "message"),
    [
        ([0.5, 0.4, 0], r"d0 sums to 0\.9"),
        ([1.5, -0.5, 0], r"d0\[s=1\] is -0\.5"),
        ([np.nan, 1, 0], r"d0\[s=0\] is nan"),
        ([0.5, 0.5], r"d0 has shape \(2,\): expected \(3,\)"),
    ],
)
def test_mdp_refuses_a_start_that_is_no_distribution(d0, message):
    with pytest.raises(InvalidMDP, match=message):
        TabularMDP.from_dense(table(), 0.9, d0)


@pytest.mark.parametrize(
    ("P", "message"),
    [
        (np.full((4, 3), 1 / 3), r"P has shape \(4, 3\): expected \(S\*A, S\)"),
        (np.zeros((0, 3)), r"P has shape \(0, 3\)"),
        (table(), r"P has shape \(3, 2, 3\).*from_dense"),
    ],
)
def test_mdp_refuses_a_table_of_another_shape(P, message):
    with pytest.raises(InvalidMDP, match=message):
        TabularMDP(P, 0.9, UNIFORM)


@pytest.mark.parametrize("shape", [(6, 3), (3, 2, 4)])
def test_from_dense_refuses_a_table_of_another_shape(shape):
    with pytest.raises(InvalidMDP, match=rf"shape \({shape[0]}, {shape[1]}.*expected \(S, A, S\)"):
        TabularMDP.from_dense(np.zeros(shape), 0.9, UNIFORM)


@pytest.mark.parametrize("gamma", [0.0, 1.0, -0.5, 1.5, np.nan])
def test_mdp_refuses_a_discount_outside_0_and_1(gamma):
    with pytest.raises(InvalidDiscount, match=f"gamma is {gamma}"):
        TabularMDP.from_dense(table(), gamma, UNIFORM)


@pytest.mark.parametrize("action", [-1, 2])
def test_p_a_refuses_an_action_outside_the_table(action):
    with pytest.raises(InvalidMDP, match=f"action {action}: expected 0 to 1"):
        TabularMDP.from_dense(table(), 0.9, UNIFORM).P_a(action)


@pytest.mark.parametrize(
    ("policy", "message"),
    [(np.array([0, 0, 2]), r"policy\[s=2\] is action 2"), (np.array([0, -1, 0]), r"policy\[s=1\] is action -1")],
)
def test_p_pi_refuses_an_action_outside_the_table(policy, message):
    with pytest.raises(InvalidPolicy, match=message):
        TabularMDP.from_dense(table(), 0.9, UNIFORM).P_pi(policy)


def test_a_table_refuses_new_values_for_its_attributes():
    mdp = TabularMDP(np.eye(2, k=1), 0.9, [1, 0])
    with pytest.raises(AttributeError, match=r"TabularMDP\.gamma cannot be set"):
        mdp.gamma = 0.5


@pytest.mark.parametrize("gamma", ["0.9", None, True, np.array([0.9])])
def test_a_discount_that_is_no_number_is_refused(gamma, unchecked):
    with pytest.raises(InvalidDiscount, match="expected a discount strictly between 0 and 1"):
        TabularMDP(np.eye(2, k=1), gamma, [1, 0])


@pytest.mark.parametrize("P", [[["a"]], [[1.0], [0.5, 0.5]]])
def test_a_table_that_cannot_be_read_as_numbers_is_refused(P):
    with pytest.raises(InvalidMDP, match="P is a list that cannot be read as numbers"):
        TabularMDP(P, 0.9, [1.0])
