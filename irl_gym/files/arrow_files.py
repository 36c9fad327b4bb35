"""Arrow and Parquet files from anybody, looked through before they are read.

Arrow believes what a file says of its own buffers: numbers may point outside of it, and a few kilobytes may unpack to any size.
So sizes are added up from the messages without unpacking one, and then Arrow's own full check is made. A message of Arrow's is
a flatbuffer; what is read of it here are its buffers, each with a place in the body of the message, and where they are packed,
the size of each before that, which stands in its first 8 bytes (Arrow's format, "Body compression").

The footer of a Parquet file may lie about sizes; the header before each page cannot: Arrow unpacks a page into as many bytes as
its header tells, and fails where there are more. A header is a struct of Thrift's compact protocol.
"""

import struct
from pathlib import Path
from typing import Any

from irl_gym.errors import DamagedFile
from irl_gym.files.archives import check_declared
from irl_gym.files.hdf5_files import BROKEN

_MAGIC = 8
"""Bytes before the first message."""
_SHARING = ("list_view", "large_list_view", "string_view", "binary_view", "run_end_encoded")
_HEADER, _BUFFERS, _COMPRESSION = 2, 2, 3
"""Which fields of a message, and of the batch that is its header."""
_I32, _BINARY, _STRUCT = 5, 8, 12
"""Kinds of Thrift's fields."""
_SIZES = {3: 1, 7: 8}
"""Bytes of those that always take as many: a byte, a double."""
_KIND, _IN_MEMORY, _IN_FILE = (1, _I32), (2, _I32), (3, _I32)
_VALUES = {0: (5, _STRUCT), 3: (8, _STRUCT)}
"""Fields of a page's header, by number and kind: what it is, its sizes, and by what it is, where its values are counted."""
_DEEPEST = 8
"""Structs within another; a page's statistics are 2 deep."""
_SHORT = 100
"""Bytes that old writers left out of the length of a column; Arrow reads on."""


def check_arrow(path: Path) -> None:
    """Look through a file of record batches.

    Raises:
        DamagedFile: it is none, declares more than it can hold, or leads outside of itself.
    """
    import pyarrow as pa

    try:
        with pa.memory_map(str(path)) as file:
            file.seek(_MAGIC)
            declared, messages = 0, pa.ipc.MessageReader.open_stream(file)
            while (message := _next(messages)) is not None:
                declared += _unpacked(message)
            check_declared(declared, path.stat().st_size)
            file.seek(0)
            batches = pa.ipc.open_file(file)
            held = 0
            for i in range(batches.num_record_batches):
                batches.get_batch(i).validate(full=True)
                held += sum(map(_content, batches.get_batch(i).columns))
                check_declared(held, path.stat().st_size)
    except DamagedFile:
        raise
    except (pa.ArrowException, struct.error, StopIteration, *BROKEN) as error:
        raise DamagedFile(f"{path.parent.name}/{path.name} is damaged: {' '.join(str(error).split())[:200]}") from error


def check_parquet(path: Path) -> None:
    """Check that a Parquet file declares no more than it can hold: its pages, before one is unpacked, then its values. Texts,
    all of which may be one that lies in the file once, are counted a few at a time.

    Raises:
        DamagedFile: it does, or is none.
    """
    import pyarrow as pa
    import pyarrow.parquet

    try:
        about, size = pyarrow.parquet.read_metadata(path), path.stat().st_size
        groups = [about.row_group(i) for i in range(about.num_row_groups)]
        chunks = [one.column(i) for one in groups for i in range(about.num_columns)]
        if sum(one.total_compressed_size for one in chunks) > size:
            raise ValueError("its columns take more than the file")
        with pa.memory_map(str(path)) as file:
            told = memoryview(file.read_buffer()).cast("B")
            check_declared(sum(_pages(told, one) for one in chunks), size)
        columns = [about.schema.column(i) for i in range(about.num_columns)]
        held = sum(one.column(i).num_values * max(8, columns[i].length) for one in groups for i in range(len(columns)))
        declared = max(8 * about.num_rows * about.num_columns, held)  # a number that is often there lies in the file once
        check_declared(declared, size)
        texts = [one.path for one in columns if one.physical_type == "BYTE_ARRAY"]
        with pyarrow.parquet.ParquetFile(path, read_dictionary=texts) as file:
            for i in range(about.num_row_groups if texts else 0):  # each has texts of its own
                for batch in file.iter_batches(1024, row_groups=[i], columns=texts):
                    declared += sum(map(_content, batch.columns))
                    check_declared(declared, size)
    except DamagedFile:
        raise
    except (pa.ArrowException, *BROKEN) as error:
        raise DamagedFile(f"{path.parent.name}/{path.name} is damaged: {' '.join(str(error).split())[:200]}") from error


def _content(array: Any) -> int:
    """Bytes that an array takes where each value stands for itself.

    Raises:
        DamagedFile: it is of another kind in which one value may stand for many.
    """
    import pyarrow as pa
    import pyarrow.compute

    array = getattr(array, "storage", array)  # of a type that is not Arrow's own
    if str(array.type).startswith(_SHARING):
        raise DamagedFile(f"it holds {str(array.type)[:80]}, in which one value may stand for many")
    if pa.types.is_nested(array.type):
        return sum(map(_content, array.flatten() if pa.types.is_struct(array.type) else [array.flatten()]))
    if not pa.types.is_dictionary(array.type):
        return array.nbytes
    kind = array.type.value_type
    if pa.types.is_primitive(kind) or pa.types.is_decimal(kind) or pa.types.is_fixed_size_binary(kind):
        return len(array) * max(1, kind.bit_width // 8)
    if kind not in (pa.string(), pa.large_string(), pa.binary(), pa.large_binary()):
        return len(array) * _content(array.dictionary)  # at most: each value may be all of them
    compute: Any = pyarrow.compute
    return compute.sum(compute.binary_length(array.dictionary).take(array.indices)).as_py() or 0


def _pages(told: memoryview, chunk: Any) -> int:
    """Bytes that the pages of a column, which are read until all its values were seen, take in memory.

    Raises:
        ValueError: the pages are none, or too few.
    """
    at, seen, declared = chunk.data_page_offset, 0, 0
    if chunk.has_dictionary_page and 0 < chunk.dictionary_page_offset < at:
        at = chunk.dictionary_page_offset
    if min(at, chunk.total_compressed_size) < 0:
        raise ValueError("a column before the beginning")
    end = min(at + chunk.total_compressed_size + _SHORT, len(told))
    while seen < chunk.num_values:
        header, at = _struct(told, at, end)
        unpacked, packed = header.get(_IN_MEMORY, -1), header.get(_IN_FILE, -1)
        values = header.get(_VALUES.get(header.get(_KIND, -1)), {}).get((1, _I32), 0)
        if min(unpacked, packed, values) < 0:
            raise ValueError(f"a page of {packed} bytes that hold {unpacked}, and {values} values")
        at, seen, declared = at + packed, seen + values, declared + unpacked
    return declared


def _struct(told: memoryview, at: int, end: int, deep: int = 0) -> tuple[dict[Any, Any], int]:
    """The whole numbers and structs of a struct by number and kind, as Arrow tells fields apart, and where it ends.

    Raises:
        ValueError: it is none, or holds lists or maps, which no page's header has.
    """
    fields, number = {}, 0
    while at < end and deep < _DEEPEST:
        step, kind = divmod(told[at], 16)
        at += 1
        if not step and not kind:
            return fields, at
        if step:
            number += step
        else:
            coded, at = _varint(told, at, end)
            number = _signed(coded)
        if not 0 < number < 1 << 15:
            break
        if kind == _STRUCT:
            fields[number, kind], at = _struct(told, at, end, deep + 1)
        elif kind in (4, _I32, 6, _BINARY):  # 4 and 6: shorter and longer numbers
            coded, at = _varint(told, at, end)
            if kind == _I32 and coded >> 32:  # Arrow would cut it off
                break
            fields[number, kind] = _signed(coded)
            at += coded if kind == _BINARY else 0
        elif kind in _SIZES:
            at += _SIZES[kind]
        elif kind not in (1, 2):  # no and yes, which take no more
            break
    raise ValueError(f"no header of a page ends at byte {at}")


def _varint(told: memoryview, at: int, end: int) -> tuple[int, int]:
    """A number of 7 bits a byte, and where it ends.

    Raises:
        ValueError: it does not end.
    """
    value = 0
    for i, one in enumerate(told[at : min(at + 10, end)]):
        value |= (one & 127) << 7 * i
        if one < 128:
            return value, at + i + 1
    raise ValueError(f"no number ends behind byte {at}")


def _signed(coded: int) -> int:
    """What is coded as twice itself, or, where negative, as the odd number beside that."""
    return coded >> 1 ^ -(coded & 1)


def _next(messages: Any) -> Any:
    """The next message; None behind the last."""
    try:
        return messages.read_next_message()
    except StopIteration:
        return None


def _unpacked(message: Any) -> int:
    """Bytes that the body of a message takes in memory: what is not packed stays in the file."""
    if message.type not in ("record batch", "dictionary") or message.body is None:
        return 0
    told, body = message.metadata.to_pybytes(), message.body
    batch = _field(told, _number("<I", told, 0), _HEADER)
    if message.type == "dictionary" and batch:  # a batch of its own within
        batch = _field(told, batch, 1)
    if not batch or not _field(told, batch, _COMPRESSION) or not (buffers := _field(told, batch, _BUFFERS)):
        return 0
    declared = 0
    for i in range(_number("<I", told, buffers)):
        place, length = struct.unpack_from("<qq", told, buffers + 4 + 16 * i)
        if length >= 8:
            declared += max(_number("<q", body[place : place + 8].to_pybytes(), 0), 0)
    return declared


def _field(told: bytes, table: int, which: int) -> int:
    """Where what a field of a flatbuffer's table refers to begins; 0 where the table has no such field."""
    described = table - _number("<i", told, table)
    if 4 + 2 * which >= _number("<H", told, described):
        return 0
    offset = _number("<H", told, described + 4 + 2 * which)
    return table + offset + _number("<I", told, table + offset) if offset else 0


def _number(kind: str, told: bytes, at: int) -> int:
    if at < 0:
        raise struct.error(f"a place before the beginning: {at}")
    return struct.unpack_from(kind, told, at)[0]
