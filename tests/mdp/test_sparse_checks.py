"""Sparse matrices from outside: SciPy believes what they say of themselves, so it is checked first."""

import numpy as np
import pytest
import scipy.sparse as sp

from irl_gym.checks import checked_csr
from irl_gym.errors import InvalidMDP
from irl_gym.mdp.tabular_mdp import TabularMDP

D0 = np.array([1.0, 0.0])


def matrix(kind="csr"):
    """Two states, one action each; P as a matrix of SciPy's."""
    P = sp.csr_array(np.array([[0.5, 0.5], [1.0, 0.0]]))
    return P.tobsr(blocksize=(1, 1)) if kind == "bsr" else P.asformat(kind)


def changed(kind, part, at, value):
    P = matrix(kind)
    getattr(P, part)[at] = value
    return P


def parts(**other):
    P = matrix()
    return {"data": P.data, "indices": P.indices, "indptr": P.indptr, **other}


@pytest.mark.parametrize("kind", ["csr", "csc", "coo", "bsr", "lil", "dok", "dia"])
def test_a_whole_matrix_of_any_kind_makes_a_table(kind):
    assert (TabularMDP(matrix(kind), 0.9, D0).P.toarray() == [[0.5, 0.5], [1, 0]]).all()


def test_a_table_holds_a_copy_of_its_matrix():
    P = matrix()
    mdp = TabularMDP(P, 0.9, D0)
    P.data[:] = 7
    assert mdp.P.data.max() == 1


@pytest.mark.parametrize("kind", ["csr", "csc", "bsr"])
@pytest.mark.parametrize(
    ("part", "at", "value", "says"),
    [
        ("indices", 0, 10**6, r"P\.indices\[0\] is 1000000: expected 0 to"),
        ("indices", 0, -1, r"P\.indices\[0\] is -1: expected 0 to"),
        ("indptr", -1, 10**6, "pointers from 0 to"),
        ("indptr", 0, -4, "pointers from -4 to"),
        ("indptr", 1, 10**6, r"P\.indptr\[2\] is \d, after 1000000: expected pointers that never fall"),
    ],
)
def test_a_matrix_whose_parts_lead_outside_is_refused(kind, part, at, value, says):
    with pytest.raises(InvalidMDP, match=says):
        TabularMDP(changed(kind, part, at, value), 0.9, D0)


def test_entries_outside_the_shape_are_refused():
    P = matrix("coo")
    P.coords[1][0] = 9
    with pytest.raises(InvalidMDP, match="entries outside its shape"):
        TabularMDP(P, 0.9, D0)


def test_lists_that_lead_outside_are_refused():
    P = matrix("lil")
    P.rows[0] = [0, 9]
    with pytest.raises(InvalidMDP, match=r"P\.indices\[1\] is 9"):
        TabularMDP(P, 0.9, D0)


@pytest.mark.parametrize("kind", ["csr", "coo"])
def test_complex_numbers_are_refused(kind):
    with pytest.raises(InvalidMDP, match="dtype complex128: expected real numbers"):
        TabularMDP(matrix(kind).astype(complex), 0.9, D0)


@pytest.mark.parametrize("value", [np.nan, np.inf, -0.5])
def test_numbers_that_are_no_probabilities_are_refused(value):
    with pytest.raises(InvalidMDP, match=r"P\[s=0, a=0"):
        TabularMDP(changed("csr", "data", 0, value), 0.9, D0)


@pytest.mark.parametrize(
    ("other", "says"),
    [
        ({"indices": np.array([0.0, 1.0, 0.5])}, r"P\.indices has shape \(3,\) and dtype float64: expected whole numbers"),
        ({"indptr": np.array([0.0, 2.0, 3.0])}, r"P\.indptr has shape \(3,\) and dtype float64"),
        ({"data": np.array([1j, 1, 1])}, r"P\.data has shape \(3,\) and dtype complex128: expected real numbers"),
        ({"data": np.array([[1.0], [1], [1]])}, r"P\.data has shape \(3, 1\)"),
        ({"data": np.array(["a", "b", "c"])}, r"P\.data has shape"),
        ({"indptr": np.array([0, 3])}, "and 3 pointers from 0"),
        ({"indptr": np.array([], dtype=int)}, "0 pointers: expected"),
        ({"data": np.ones(2)}, "2 numbers, 3 indices"),
    ],
)
def test_parts_that_are_no_matrix_are_refused(other, says):
    with pytest.raises(InvalidMDP, match=says):
        checked_csr(**parts(**other), shape=(2, 2), name="P", error=InvalidMDP)


@pytest.mark.parametrize("P", [np.zeros((0, 3, 0)), np.zeros((2, 0, 2)), np.zeros((0, 0, 0))])
def test_a_dense_table_without_states_or_actions_is_refused(P):
    with pytest.raises(InvalidMDP, match="at least one state and one action"):
        TabularMDP.from_dense(P, 0.9, np.zeros(P.shape[0]))


@pytest.mark.parametrize("shape", [(0, 0), (4, 0), (0, 2)])
def test_a_table_without_states_or_actions_is_refused(shape):
    with pytest.raises(InvalidMDP):
        TabularMDP(sp.csr_array(shape), 0.9, np.zeros(shape[1]))


@pytest.mark.parametrize("value", [10**400, [10**400]])
def test_numbers_beyond_floats_are_refused(value, unchecked):
    with pytest.raises(InvalidMDP, match=r"d0 is .* cannot be read as numbers"):
        TabularMDP(matrix(), 0.9, value)
