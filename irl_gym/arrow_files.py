"""Arrow and Parquet files from anybody, looked through before they are read.

Arrow believes what a file says of its own buffers: numbers may point outside of it, and a few kilobytes may unpack to any size.
So sizes are added up from the messages without unpacking one, and then Arrow's own full check is made. A message of Arrow's is
a flatbuffer; what is read of it here are its buffers, each with a place in the body of the message, and where they are packed,
the size of each before that, which stands in its first 8 bytes (Arrow's format, "Body compression").
"""

import struct
from pathlib import Path
from typing import Any

from irl_gym.archives import check_declared
from irl_gym.errors import DamagedFile
from irl_gym.hdf5_files import BROKEN

_MAGIC = 8
"""Bytes before the first message."""
_SHARING = ("list_view", "large_list_view", "string_view", "binary_view", "run_end_encoded")
_HEADER, _BUFFERS, _COMPRESSION = 2, 2, 3
"""Which fields of a message, and of the batch that is its header."""


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
    """Check that a Parquet file declares no more than it can hold. Texts, all of which may be one that lies in the file once,
    are counted a few at a time.

    Raises:
        DamagedFile: it does, or is none.
    """
    import pyarrow as pa
    import pyarrow.parquet

    try:
        about, size = pyarrow.parquet.read_metadata(path), path.stat().st_size
        groups = [about.row_group(i) for i in range(about.num_row_groups)]
        check_declared(sum(one.total_byte_size for one in groups), size)
        columns = [about.schema.column(i) for i in range(about.num_columns)]
        held = sum(one.column(i).num_values * max(8, columns[i].length) for one in groups for i in range(len(columns)))
        declared = max(8 * about.num_rows * about.num_columns, held)  # a number that is often there lies in the file once
        check_declared(declared, size)
        texts = [one.path for one in columns if one.physical_type == "BYTE_ARRAY"]
        with pyarrow.parquet.ParquetFile(path, read_dictionary=texts) as file:
            for batch in file.iter_batches(1024, columns=texts) if texts else ():
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

    if str(array.type).startswith(_SHARING):
        raise DamagedFile(f"it holds {str(array.type)[:80]}, in which one value may stand for many")
    if pa.types.is_nested(array.type):
        return sum(map(_content, array.flatten() if pa.types.is_struct(array.type) else [array.flatten()]))
    if not pa.types.is_dictionary(array.type):
        return array.nbytes
    compute: Any = pyarrow.compute
    return compute.sum(compute.binary_length(array.dictionary).take(array.indices)).as_py() or 0


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
