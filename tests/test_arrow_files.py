"""What an Arrow or Parquet file holds is counted before it is read."""

import numpy as np
import pytest

from irl_gym import archives
from irl_gym.arrow_files import check_arrow, check_parquet
from irl_gym.errors import DamagedFile

pa = pytest.importorskip("pyarrow")
LONG = "x" * 20_000


def in_parquet(path, array):
    import pyarrow.parquet

    pyarrow.parquet.write_table(pa.table({"observations": array}), path)
    check_parquet(path)


def in_arrow(path, array):
    batch = pa.RecordBatch.from_arrays([array], names=["observations"])
    with pa.OSFile(str(path), "wb") as file, pa.ipc.new_file(file, batch.schema) as writer:
        writer.write_batch(batch)
    check_arrow(path)


def one_for_all():
    return pa.DictionaryArray.from_arrays(pa.array(np.zeros(1000, np.int32)), pa.array([LONG]))


SHARED = {
    "a text": (in_parquet, one_for_all),
    "a text within": (in_parquet, lambda: pa.StructArray.from_arrays([pa.array([LONG] * 1000)], ["word"])),
    "a text of lists": (in_parquet, lambda: pa.array([[LONG] * 2] * 500)),
    "a number": (in_parquet, lambda: pa.array([[0] * 10_000] * 100)),
    "a text of Arrow": (in_arrow, one_for_all),
}


@pytest.mark.parametrize("name", SHARED)
def test_values_that_all_are_one_are_refused_before_they_are_read(tmp_path, monkeypatch, name):
    monkeypatch.setattr(archives, "FREE", 1 << 20)
    check, values = SHARED[name]
    with pytest.raises(DamagedFile, match="bytes and declares"):
        check(tmp_path / "a", values())


def test_arrays_in_which_one_value_may_stand_for_many_are_refused(tmp_path):
    array = pa.RunEndEncodedArray.from_arrays([1000], [LONG])
    with pytest.raises(DamagedFile, match="it holds run_end_encoded"):
        in_arrow(tmp_path / "a", array)


@pytest.mark.parametrize("check", [in_parquet, in_arrow])
def test_texts_and_lists_that_lie_in_the_file_are_no_damage(tmp_path, monkeypatch, check):
    monkeypatch.setattr(archives, "FREE", 1 << 10)
    rng = np.random.default_rng(0)
    check(tmp_path / "a", pa.array([rng.bytes(100).hex() for _ in range(100)]))
    check(tmp_path / "b", pa.array(rng.random((100, 3)).tolist(), pa.list_(pa.float64(), 3)))
