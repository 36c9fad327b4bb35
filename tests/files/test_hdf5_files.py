"""What an HDF5 file holds is counted before it is read."""

import tracemalloc

import h5py
import numpy as np
import pytest

from irl_gym.errors import DamagedFile
from irl_gym.files import archives
from irl_gym.files.hdf5_files import check_hdf5, read_attributes


def test_a_file_that_declares_much_and_holds_it_is_read(tmp_path, monkeypatch):
    monkeypatch.setattr(archives, "FREE", 1 << 10)
    with h5py.File(tmp_path / "a.hdf5", "w") as file:
        file["x"] = np.zeros(100_000)
    check_hdf5(tmp_path / "a.hdf5")


def test_text_booleans_and_pictures_are_no_damage(tmp_path):
    with h5py.File(tmp_path / "a.hdf5", "w") as file:
        file.create_dataset("text", data=["a", "b"], dtype=h5py.string_dtype())
        file["truth"] = np.array([True])
        file.create_dataset("pictures", (2,), dtype=h5py.vlen_dtype(np.uint8))
        file["packed"] = np.zeros(2)
        file.create_dataset("small", data=np.arange(10), compression="lzf", shuffle=True, fletcher32=True)
    check_hdf5(tmp_path / "a.hdf5")


def test_texts_that_all_are_one_long_text_are_refused_before_they_are_read(tmp_path, monkeypatch):
    monkeypatch.setattr(archives, "FREE", 1 << 20)
    path, long = tmp_path / "a.hdf5", "x" * 100_000
    with h5py.File(path, "w") as file:
        file.create_dataset("text", data=[long, *["x"] * 999], dtype=h5py.string_dtype())
    raw = path.read_bytes()
    at = raw.index(len(long).to_bytes(4, "little"))  # where a text lies is told in 16 bytes, of which the first are its length
    path.write_bytes(raw[:at] + raw[at : at + 16] * 1000 + raw[at + 16_000 :])
    tracemalloc.start()
    with pytest.raises(DamagedFile, match="bytes and declares"):
        check_hdf5(path)
    assert tracemalloc.get_traced_memory()[1] < 30_000_000
    tracemalloc.stop()


def test_texts_that_are_long_and_lie_in_the_file_are_no_damage(tmp_path, monkeypatch):
    monkeypatch.setattr(archives, "FREE", 1 << 10)
    with h5py.File(tmp_path / "a.hdf5", "w") as file:
        file.create_dataset("text", data=["x" * 1000] * 500, dtype=h5py.string_dtype())
        file.create_dataset("one", data="x" * 1000, dtype=h5py.string_dtype())
    check_hdf5(tmp_path / "a.hdf5")


@pytest.mark.parametrize("length", [0, (1 << 64) - 16, 1 << 40])
def test_a_list_of_texts_that_does_not_end_is_refused_where_hdf5_would_go_round_it_for_ever(tmp_path, length):
    path = tmp_path / "a.hdf5"
    with h5py.File(path, "w") as file:
        file.create_dataset("text", data=["abc", "de"], dtype=h5py.string_dtype())
    check_hdf5(path)
    raw = path.read_bytes()
    at = raw.index(b"GCOL") + 16 + 2 * 24  # the objects are a head of 16 bytes and a text in 8; then comes what is free
    assert raw[at : at + 8] == bytes(8)
    path.write_bytes(raw[: at + 8] + length.to_bytes(8, "little") + raw[at + 16 :])
    with pytest.raises(DamagedFile, match="do not follow each other"):
        check_hdf5(path)


def test_texts_in_more_than_one_row_are_refused(tmp_path):
    with h5py.File(tmp_path / "a.hdf5", "w") as file:
        file.create_dataset("text", (2, 2), dtype=h5py.string_dtype())
    with pytest.raises(DamagedFile, match="/text has text or pictures of any length in more than one row"):
        check_hdf5(tmp_path / "a.hdf5")


def test_attributes_of_many_texts_each_of_which_may_be_the_file_are_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(archives, "FREE", 1 << 10)
    with h5py.File(tmp_path / "a.hdf5", "w") as file:
        for count in (50, 101):
            file.create_group(str(count)).attrs["words"] = ["x"] * count
    with h5py.File(tmp_path / "a.hdf5") as file:
        assert len(read_attributes(file, "50")["words"]) == 50
        with pytest.raises(DamagedFile, match="bytes and declares"):
            read_attributes(file, "101")


def test_an_attribute_that_is_no_number_and_no_text_is_refused_by_name(tmp_path):
    with h5py.File(tmp_path / "a.hdf5", "w") as file:
        file.attrs["which"] = file.ref
        with pytest.raises(DamagedFile, match="/ has the attribute 'which', and no numbers"):
            read_attributes(file, "/")
