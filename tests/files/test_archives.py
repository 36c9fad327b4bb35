"""Archives of NumPy arrays: what is whole comes back, and what lies is refused before it takes memory."""

import io
import os
import tracemalloc
import zipfile

import numpy as np
import pytest

from irl_gym.errors import DamagedFile
from irl_gym.files import archives
from irl_gym.files.archives import json_in, read_arrays, read_settings


@pytest.fixture
def path(tmp_path):
    np.savez(tmp_path / "a.npz", numbers=np.arange(6.0).reshape(2, 3), words=np.array(["a", "öß"]), one=np.array("{}"))
    return tmp_path / "a.npz"


def with_member(path, data, compress=zipfile.ZIP_STORED):
    """An archive of one array's bytes."""
    with zipfile.ZipFile(path, "w", compress) as archive:
        archive.writestr("x.npy", data)
    return path


def saved(array, **how):
    file = io.BytesIO()
    np.save(file, array, **how)
    return file.getvalue()


@pytest.mark.parametrize("save", [np.savez, np.savez_compressed])
def test_arrays_come_back_as_they_were(tmp_path, save):
    arrays = {
        "c": np.arange(6).reshape(2, 3), "f": np.asfortranarray(np.arange(6.0).reshape(2, 3)), "none": np.zeros((0, 4)),
        "text": np.array([["a", "öß"]]), "truth": np.array([True, False]), "zero": np.array(3, dtype=np.uint8),
    }  # fmt: skip
    save(tmp_path / "a.npz", **arrays)
    found = read_arrays(tmp_path / "a.npz")
    assert found.keys() == arrays.keys()
    for name, array in arrays.items():
        assert found[name].dtype == array.dtype and found[name].shape == array.shape and (found[name] == array).all()


def test_numbers_of_another_byte_order_become_this_machines(tmp_path):
    np.savez(tmp_path / "a.npz", x=np.arange(3, dtype=">i4"))
    assert read_arrays(tmp_path / "a.npz")["x"].dtype == np.int32


def test_only_the_arrays_that_are_asked_for_are_read(path):
    assert set(read_arrays(path, {"one", "other"})) == {"one"}


def test_an_archive_that_declares_more_than_it_can_hold_is_refused_before_it_is_unpacked(tmp_path, monkeypatch):
    np.savez_compressed(tmp_path / "bomb.npz", x=np.zeros(1_000_000))
    monkeypatch.setattr(archives, "FREE", 1 << 10)
    tracemalloc.start()
    with pytest.raises(DamagedFile, match=r"bytes and declares 8,000,128: expected at most .* without compression"):
        read_arrays(tmp_path / "bomb.npz")
    assert tracemalloc.get_traced_memory()[1] < 1_000_000
    tracemalloc.stop()


def test_the_mend_for_an_archive_that_declares_too_much_works(tmp_path, monkeypatch):
    monkeypatch.setattr(archives, "FREE", 1 << 10)
    np.savez(tmp_path / "a.npz", x=np.zeros(1_000_000))
    assert read_arrays(tmp_path / "a.npz")["x"].size == 1_000_000


@pytest.mark.parametrize("shape", [(10**12,), (2**62, 4), (0, 10**30), (-1,), (10**400,), (1,) * 100])
def test_an_array_whose_header_lies_about_its_shape_is_refused(tmp_path, shape):
    header = f"{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}"
    body = b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header.encode() + bytes(8)
    with pytest.raises(DamagedFile, match="damaged"):
        read_arrays(with_member(tmp_path / "a.npz", body))


@pytest.mark.parametrize(
    "array",
    [
        np.array([1j]), np.array([(1, 2.0)], dtype=[("a", int), ("b", float)]), np.array(["2020-01-01"], dtype="M8[D]"),
        np.array([b"bytes"]),
    ],
)  # fmt: skip
def test_arrays_of_other_than_numbers_and_text_are_refused(tmp_path, array):
    with pytest.raises(DamagedFile, match="no booleans, numbers or text"):
        read_arrays(with_member(tmp_path / "a.npz", saved(array)))


def test_pickled_objects_are_refused(tmp_path):
    with pytest.raises(DamagedFile, match="pickled objects, which are never read"):
        read_arrays(with_member(tmp_path / "a.npz", saved(np.array([{}], dtype=object), allow_pickle=True)))


@pytest.mark.parametrize(
    ("array", "last", "says"),
    [
        (np.array([True]), b"\x07", "neither 0 nor 1"),
        (np.array(["a"]), b"\x00\x00\x00\x77", "no Unicode"),
        (np.array(["a"]), b"\x00\xd8\x00\x00", "no Unicode"),
    ],
)
def test_bits_that_no_value_has_are_refused(tmp_path, array, last, says):
    with pytest.raises(DamagedFile, match=says):
        read_arrays(with_member(tmp_path / "a.npz", saved(array)[: -len(last)] + last))


@pytest.mark.parametrize("method", [zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_other_compressions_are_refused(tmp_path, method):
    with pytest.raises(DamagedFile, match="packed in a way"):
        read_arrays(with_member(tmp_path / "a.npz", saved(np.arange(3)), method))


def test_a_pipe_is_refused_at_once(tmp_path):
    os.mkfifo(tmp_path / "a.npz")
    with pytest.raises(DamagedFile, match="no regular file"):
        read_arrays(tmp_path / "a.npz")


def test_an_archive_that_is_cut_off_anywhere_is_refused(path):
    whole = path.read_bytes()
    for n in range(0, len(whole), 7):
        path.write_bytes(whole[:n])
        with pytest.raises(DamagedFile):
            read_arrays(path)


def test_an_archive_with_a_changed_byte_is_refused_or_reads_the_same(path):
    whole, before = path.read_bytes(), read_arrays(path)
    for at in range(0, len(whole), 5):
        path.write_bytes(whole[:at] + bytes([whole[at] ^ 0x41]) + whole[at + 1 :])
        try:
            found = read_arrays(path)
        except DamagedFile:
            continue
        for name, array in found.items():  # a date or a name may have changed; the numbers have checksums
            assert name not in before or (array == before[name]).all()


@pytest.mark.parametrize("text", [np.array("{"), np.array(3.0), np.array(["{}"]), np.array("[" * 100_000)])
def test_text_that_is_no_json_is_refused(text):
    with pytest.raises(DamagedFile, match="its header is no json"):
        json_in({"header": text}, "header")


def test_settings_that_are_nested_too_deeply_are_refused(tmp_path):
    with zipfile.ZipFile(tmp_path / "agent.zip", "w") as archive:
        archive.writestr("data", "[" * 100_000)
    with pytest.raises(DamagedFile, match="damaged"):
        read_settings(tmp_path / "agent.zip", "data")
