"""Pickles are read as data: nothing that they name is imported or called."""

import collections
import os
import pickle
import pickletools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from irl_gym.files.pickles import PickledCall, PickledName, as_numbers, read_pickle

PLAIN = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(max_size=9) | st.binary(max_size=9),
    lambda inner: (
        st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=3), inner, max_size=4) | st.tuples(inner, inner)
    ),
    max_leaves=9,
)


class Command:
    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return os.system, (f"touch {self.path}",)


@given(PLAIN, st.sampled_from([3, 4, 5]))
@settings(max_examples=60, deadline=None)
def test_plain_values_are_read_as_pickle_reads_them(value, protocol):
    raw = pickle.dumps(value, protocol)
    assert read_pickle(raw) == pickle.loads(raw)


@given(st.binary(max_size=60), st.integers(0, 200), st.integers(0, 255))
@settings(max_examples=150, deadline=None)
def test_any_bytes_are_read_or_refused(tail, at, byte):
    raw = bytearray(pickle.dumps({"a": [1, (2.5, np.arange(3))], "b": collections.deque([{"r": 1.0}])}, 4) + tail)
    raw[at % len(raw)] = byte
    try:
        read_pickle(bytes(raw))
    except ValueError:
        pass


def test_what_a_pickle_would_call_is_a_record_and_is_not_called(tmp_path):
    raw = pickle.dumps({"state": Command(tmp_path / "called")})
    found = read_pickle(raw)["state"]
    assert isinstance(found, PickledCall) and isinstance(found.maker, PickledName) and found.maker.name == "system"
    assert not (tmp_path / "called").exists()


def test_no_module_is_imported_that_a_pickle_names(monkeypatch):
    raw = pickletools.optimize(b"\x80\x02cnobody_has_this_module\nthing\n)R.")
    assert read_pickle(raw).maker == PickledName("nobody_has_this_module", "thing")


@pytest.mark.parametrize("protocol", [4, 5])
@pytest.mark.parametrize("dtype", ["f8", "f4", "i8", "u1", "b1", ">f8"])
def test_arrays_are_recognised(protocol, dtype):
    array = np.arange(6).reshape(2, 3).astype(dtype)
    for one in (array, np.asfortranarray(array), array[:, 0]):
        np.testing.assert_array_equal(as_numbers(read_pickle(pickle.dumps(one, protocol))), one)


def test_numbers_are_recognised():
    for one in (2.5, 3, np.float64(0.5), np.float32(0.25)):
        assert as_numbers(read_pickle(pickle.dumps(one))) == one


@pytest.mark.parametrize("value", ["text", [1.0], np.array(["a"]), np.array([None]), {"a": 1}])
def test_what_is_no_number_is_refused(value):
    with pytest.raises(ValueError, match="it has"):
        as_numbers(read_pickle(pickle.dumps(value)))


@pytest.mark.parametrize(
    "raw", [b"", b"nothing", b"\x80\x04", b"\x80\x04N", b"\x80\x04Pid\n.", b"\x80\x040.", b"\x80\x04h\x05."]
)
def test_what_is_no_pickle_of_data_is_refused(raw):
    with pytest.raises(ValueError, match="it is no pickle of plain data"):
        read_pickle(raw)


def test_a_pickle_that_is_too_large_is_refused(monkeypatch):
    monkeypatch.setattr("irl_gym.files.pickles.MOST_BYTES", 10)
    with pytest.raises(ValueError, match="expected 10 at most"):
        read_pickle(pickle.dumps("x" * 20))


SHARED = b")" + b"".join(b"q" + bytes([i]) + b"h" + bytes([i]) + b"\x86" for i in range(60))
"""A tuple of one tuple twice, of one tuple twice, ..., of which Python would hash or write out 2 ** 60."""


@pytest.mark.parametrize(
    "raw", [b"}" + b")" + b"\x85" * 100_000 + b"Ns.", b"}" + SHARED + b"Ns.", b"(" + SHARED + b"Nd.", SHARED * 2 + b"\x93."]
)
def test_tuples_within_tuples_are_neither_hashed_nor_written_out(raw):
    with pytest.raises(ValueError, match="it is no pickle of plain data"):
        read_pickle(raw)


@pytest.mark.parametrize(
    ("kind", "state", "match"),
    [((), (3, "<"), "none"), (("f8",), (3,), "none"), (("f8",), {"a": 1}, "none"), ((1,), (3, "<"), "without a name")],
)
def test_an_array_of_an_odd_dtype_is_refused(kind, state, match):
    dtype = PickledCall(PickledName("numpy", "dtype"), kind, state)
    with pytest.raises(ValueError, match=match):
        as_numbers(PickledCall(PickledName("numpy._core.numeric", "_frombuffer"), (bytes(8), dtype, (1,), "C")))


def test_a_number_that_is_no_float_is_refused():
    with pytest.raises(ValueError, match="none"):
        as_numbers(10**400)
