"""What an Arrow or Parquet file holds is counted before it is read."""

import numpy as np
import pytest

from irl_gym.errors import DamagedFile
from irl_gym.files import archives
from irl_gym.files.arrow_files import check_arrow, check_parquet

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


def one_for_all_in_a_foreign_type():
    return pa.ExtensionArray.from_storage(pa.opaque(one_for_all().type, "text", "them"), one_for_all())


SHARED = {
    "a text": (in_parquet, one_for_all),
    "a text within": (in_parquet, lambda: pa.StructArray.from_arrays([pa.array([LONG] * 1000)], ["word"])),
    "a text of lists": (in_parquet, lambda: pa.array([[LONG] * 2] * 500)),
    "a number": (in_parquet, lambda: pa.array([[0] * 10_000] * 100)),
    "a text of Arrow": (in_arrow, one_for_all),
    "a text of a foreign type": (in_arrow, one_for_all_in_a_foreign_type),
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


PACKED = ("zstd", "snappy", "gzip", "lz4", "brotli", "none")


@pytest.mark.parametrize("version", ["1.0", "2.0"])
@pytest.mark.parametrize("compression", PACKED)
def test_honest_pages_are_no_damage(tmp_path, compression, version):
    import pyarrow.parquet

    texts = [None if i % 3 == 0 else f"text {i % 7}" for i in range(60)]
    table = pa.table({"a": range(60), "b": texts, "c": [[one, "x"] for one in texts], "d": [[[1.0, None], None]] * 60})
    for shared in (True, False):
        pyarrow.parquet.write_table(
            table, tmp_path / "a", compression=compression, data_page_version=version, use_dictionary=shared, row_group_size=20,
            data_page_size=100, write_page_checksum=shared,
        )  # fmt: skip
        check_parquet(tmp_path / "a")


@pytest.fixture
def long_text(tmp_path):
    """A file of one text that is long only where it is unpacked."""
    import pyarrow.parquet

    path, table = tmp_path / "long", pa.table({"a": ["a" * 8_000_000]})
    pyarrow.parquet.write_table(table, path, compression="zstd", use_dictionary=False, write_statistics=False)
    return path


def told_of(path):
    import pyarrow.parquet

    return pyarrow.parquet.read_metadata(path).row_group(0).column(0)


def lie(path, size, said):
    """Let the footer tell another size, in as many bytes."""
    long = (size.bit_length() + 7) // 7
    size, said = (bytes(2 * one >> 7 * i & 127 | 128 * (i < long - 1) for i in range(long)) for one in (size, said))
    told = path.read_bytes()
    footer = len(told) - 8 - int.from_bytes(told[-8:-4], "little")
    path.write_bytes(told[:footer] + told[footer:].replace(size, said))


def test_a_page_is_counted_before_it_is_unpacked_when_the_footer_lies(long_text, monkeypatch):
    monkeypatch.setattr(archives, "FREE", 1 << 20)
    lie(long_text, told_of(long_text).total_uncompressed_size, 100)
    assert told_of(long_text).total_uncompressed_size == 100
    usual, counted = pa.default_memory_pool(), pa.proxy_memory_pool(pa.default_memory_pool())
    pa.set_memory_pool(counted)
    try:
        with pytest.raises(DamagedFile, match="declares 8,000,0"):
            check_parquet(long_text)
    finally:
        pa.set_memory_pool(usual)
    assert counted.max_memory() < 1 << 20


def test_columns_that_take_more_than_the_file_are_damage(long_text):
    lie(long_text, told_of(long_text).total_compressed_size, 8000)
    with pytest.raises(DamagedFile, match="long is damaged: its columns take more than the file"):
        check_parquet(long_text)


NO_HEADERS = {
    "nothing": (b"\0", "a page of -1 bytes"),
    "a list": (b"\x19", "no header of a page"),
    "structs within structs": (b"\x1c" * 12 + b"\0" * 13, "no header of a page"),
    "a number without an end": (b"\x15" + b"\xff" * 12, "no number ends"),
    "a number that Arrow cuts off": (b"\x15\xfe\xff\xff\xff\x7f\0", "no header of a page"),
    "a field that Arrow takes for another": (b"\x05\x84\x80\x08\0\0", "no header of a page"),
    "a longer number than Arrow reads there": (b"\x15\0\x16\0\x15\0\0", "a page of 0 bytes that hold -1"),
    "a text to behind the end": (b"\x18\xff\xff\xff\x7f", "no header of a page"),
}


@pytest.mark.parametrize("name", NO_HEADERS)
def test_pages_without_a_sound_header_are_damage(long_text, name):
    header, wrong = NO_HEADERS[name]
    with long_text.open("r+b") as file:
        file.seek(4)
        file.write(header)
    with pytest.raises(DamagedFile, match=f"long is damaged: {wrong}"):
        check_parquet(long_text)


@pytest.mark.parametrize("values", [[1, 2, 1, None], [0.5], [True], [None], [b"a"], [[1, 2]], range(1000)])
def test_values_of_a_dictionary_are_no_damage(tmp_path, monkeypatch, values):
    monkeypatch.setattr(archives, "FREE", 1 << 10)
    in_arrow(tmp_path / "a", pa.DictionaryArray.from_arrays(pa.array(np.arange(len(values))), pa.array(values)))
