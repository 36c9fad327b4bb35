"""Files as a stranger, a bad disk or a newer version may leave them: bytes changed, or one value replaced by a hostile one.

A change that keeps a file's structure (a value of its json, an array of its zip, an object of its tree) is found by no
checksum, so it reaches what reads the file. A `Change` says where and what, in numbers that hypothesis can shrink.
"""

import base64
import csv
import io
import json
import pickle
import pickletools
import zipfile
from dataclasses import dataclass
from pathlib import Path

import h5py
import hypothesis.strategies as st
import numpy as np


def nested(depth):
    inside = []
    for _ in range(depth):
        inside = [inside]
    return inside


DEEP = "[" * 10_000 + "]" * 10_000
"""Json itself cannot write what is nested as deeply."""
VALUES = [
    10**400, -(10**400), 2**63, -(2**63) - 1, 10**12, 1e308, float("nan"), float("inf"), -1, 0, 1, 0.5, "", "x", "nan",
    "a\x00b",
    "\ud800", "é" * 1000, "../../etc/passwd", "<script>", None, True, False, [], {}, [[]], [None], [1, [2]], {"x": 1},
    {"type": "Box"}, nested(30), [0] * 1000, DEEP,
]  # fmt: skip
"""In place of a value of json."""
OPCODES = [
    *(pickle.dumps(one, 4)[2:-1] for one in (10**400, -1, 7, 0.5, np.nan, np.inf, "x", "mean", b"x" * 8)),
    *(b"\x8c" + bytes([len(one)]) + one for one in (b"f2", b"f4", b"f8", b"f16", b"O8", b"c8", b"i8", b"U4", b">", b"|", b"F")),
    *(bytes([one]) for one in b"N])}(.Rbaesu0\x81\x85\x86\x88\x89\x93\x94"), b"h\x00", b"h\x05", b"cos\nsystem\n",
    b"cnumpy\ndtype\n",
]  # fmt: skip
"""In place of one of a pickle, or beside it."""


@dataclass(frozen=True)
class Change:
    """What is done to a file."""

    kind: int
    """Which kind of change."""
    place: int
    """Which of the things that can be changed."""
    value: int
    """Which of the values that are put there."""

    def pick(self, things, by="place"):
        things = list(things)
        return things[getattr(self, by) % len(things)]


CHANGES = st.builds(Change, st.integers(0, 999), st.integers(0, 2**32), st.integers(0, 2**16))


def changed(path: Path, change: Change) -> None:
    """Change a file: one time in four its bytes, else what it holds."""
    if change.kind % 4 == 0 or path.suffix not in STRUCTURED:
        path.write_bytes(of_bytes(path.read_bytes(), change))
    else:
        STRUCTURED[path.suffix](path, change)


def of_bytes(data: bytes, change: Change) -> bytes:
    at, byte = change.place % (len(data) + 1), bytes([change.value % 256])
    n = 1 << change.value % 8
    return change.pick([
        data[:at], data[:at] + byte + data[at + 1 :], data[:at] + byte * n + data[at:], data[:at] + data[at + n :],
        data[:at] + bytes(n) + data[at + n :], data[:at] + data[at : at + n] * 2 + data[at + n :], b"\xff" * n, data + data,
        data[:at] + bytes(b ^ 1 << change.value % 8 for b in data[at : at + 1]) + data[at + 1 :],
    ], "kind")  # fmt: skip


def spots(value, to=()):
    """The places in json, each a path of keys."""
    yield to
    inside = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, one in inside:
        yield from spots(one, (*to, key))


def of_value(value, change: Change):
    """Json with one value changed, left out, or under another name; text in it that is json itself is changed inside."""
    to = change.pick(spots(value))
    if not to:
        return change.pick(VALUES, "value")
    holder = value
    for key in to[:-1]:
        holder = holder[key]
    held = holder[to[-1]]
    if to[-1] == ":serialized:" and change.kind % 2:  # Stable-Baselines3's name of a pickle
        holder[to[-1]] = base64.b64encode(of_opcodes(base64.b64decode(held), change)).decode()
        return value
    if isinstance(held, str) and held[:1] in "{[" and held and change.kind % 2:
        try:
            holder[to[-1]] = json.dumps(of_value(json.loads(held), change))
            return value
        except ValueError:
            pass
    if change.kind % 10 == 7 and isinstance(holder, dict):
        holder[f"{to[-1]}?"] = holder.pop(to[-1])
    elif change.kind % 10 == 9:
        del holder[to[-1]]
    else:
        holder[to[-1]] = change.pick(VALUES, "value")
    return value


def text_of(value) -> bytes:
    return json.dumps(value).replace(json.dumps(DEEP), DEEP).encode()


def of_json(path, change):
    path.write_bytes(text_of(of_value(json.loads(path.read_text()), change)))


def of_array(array: np.ndarray, change: Change) -> np.ndarray:
    """Another array: of another dtype or shape, or with a value that does not belong there."""
    if array.dtype.kind == "U" and array.ndim == 0 and array.item()[:1] in ("{", "["):
        return np.array(text_of(of_value(json.loads(array.item()), change)).decode())
    flat, values = array.ravel(), [np.nan, np.inf, -np.inf, -1, 2**31, 2**62, 0.5, 1e308, -0.0, 7]

    def put(at, value):
        other = array.astype(np.float64).ravel() if array.dtype.kind in "biuf" else flat.copy()
        if array.dtype.kind in "biu" and value == value and abs(value) < 2**63 and value == int(value):
            other = array.astype(np.int64).ravel()
        if other.size:
            other[at % other.size] = value
        return other.reshape(array.shape)

    def cast(kind):
        return flat.astype(kind) if flat.dtype.kind in "biuf" else flat

    value = change.pick(values, "value")
    return change.pick([
        lambda: put(change.place, value), lambda: put(change.place, value), lambda: put(0, value), lambda: put(-1, value),
        lambda: flat[:-1], lambda: np.append(flat, flat[:1]), lambda: flat[:0], lambda: array[None], lambda: array.T,
        lambda: np.zeros((0, 5, 0)), lambda: np.zeros((3, 0)), lambda: np.array(0.5), lambda: np.array("x"),
        lambda: np.array([{}], dtype=object), lambda: cast(complex), lambda: cast("f2"), lambda: cast("f4"),
        lambda: cast(">f8"), lambda: cast(bool),
        lambda: np.zeros(2, dtype=[("a", "i4")]), lambda: np.array(["a", "b"]), lambda: np.array("{}"),
        lambda: flat[::-1].copy(), lambda: np.full(array.shape, 10**18), lambda: np.zeros(1 << 16), lambda: np.array(DEEP),
    ], "kind")()  # fmt: skip


def of_npz(path, change):
    """An array of an archive changed, left out, or with a header that lies; or its json settings, for an agent's zip."""
    with zipfile.ZipFile(path) as archive:
        parts = {name: archive.read(name) for name in archive.namelist()}
    name = change.pick(parts)
    if not name.endswith(".npy"):
        parts[name] = text_of(of_value(json.loads(parts[name]), change))
    elif change.value % 11 == 0:
        del parts[name]
    elif change.value % 11 == 1:
        shape = change.pick([(10**15,), (2**62, 2), (0, 2**40), (-1,), (10**400,), (1,) * 70], "kind")
        header = f"{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}"
        parts[name] = b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header.encode() + bytes(64)
    elif change.value % 11 == 2:
        parts[name] = of_bytes(parts[name], change)
    else:
        file = io.BytesIO()
        np.save(file, of_array(np.load(io.BytesIO(parts[name])), change), allow_pickle=True)
        parts[name] = file.getvalue()
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED if change.kind % 3 else zipfile.ZIP_STORED) as archive:
        for name, data in parts.items():
            archive.writestr(name, data)


def of_hdf5(path, change):
    """An object of a tree changed, left out, or replaced by a link."""
    with h5py.File(path, "a") as file:
        names = []
        file.visit(names.append)
        name = change.pick(names)
        held = file[name]
        attributes = list(held.attrs)
        if attributes and change.value % 3 == 0:
            value = change.pick(
                [*(v for v in VALUES if isinstance(v, int | float | str) and abs(hash(v)) < 2**62), np.nan], "kind"
            )
            try:
                held.attrs[change.pick(attributes)] = value
            except (TypeError, ValueError, OverflowError, OSError):  # h5py writes no such value, and may have deleted the old
                held.attrs[change.pick(attributes)] = -1
            return
        array = held[()] if isinstance(held, h5py.Dataset) and held.dtype.kind in "biuf" else np.arange(3)
        del file[name]
        parent = file[name.rpartition("/")[0] or "/"]
        last = name.rpartition("/")[2]

        def put():
            other = of_array(array, change)
            if other.dtype.kind == "U":
                other = other.astype("S9")
            parent.create_dataset(last, data=array[:0] if other.dtype.kind == "O" else other)

        change.pick([
            put, put, put, put, put, put, lambda: None, lambda: parent.create_group(last),
            lambda: parent.__setitem__(last, h5py.SoftLink("/")), lambda: parent.__setitem__(last, h5py.ExternalLink("x", "/")),
            lambda: parent.__setitem__(last, file["/"]), lambda: parent.__setitem__(last, np.dtype("i4")),
            lambda: parent.__setitem__(last, h5py.Empty("f8")),
            lambda: parent.create_dataset(last, (10**12,), "i8", chunks=(1000,)),
            lambda: parent.create_dataset(last, (4,), h5py.vlen_dtype(np.int64)),
            lambda: parent.create_dataset(last, (3,), h5py.string_dtype()),
            lambda: parent.create_dataset(last, (1,), "i8", external=[("secret", 0, 8)]),
        ], "value")()  # fmt: skip


def of_text(path, change):
    """A field of a table in text changed, or a row or column of them."""
    separator = "\t" if path.suffix == ".tsv" else ","
    rows = list(csv.reader(io.StringIO(path.read_text()), delimiter=separator))
    row = change.pick(range(len(rows)))
    column = change.value % max(len(rows[row]), 1)
    words = [str(v) if v is not DEEP else "[" * 100 for v in VALUES] + [
        "1e999",
        "0x10",
        "1_000",
        '"',
        "(1, 2)",
        "[1 2]",
        " ",
        "9" * 400,
    ]
    word = change.pick([one for one in words if "\ud800" not in one], "kind")
    [
        lambda: rows[row].__setitem__(slice(column, column + 1), [word]), lambda: rows.pop(row), lambda: rows[row].append(word),
        lambda: rows[row].pop() if rows[row] else None, lambda: rows.insert(row, [word] * len(rows[row])),
        lambda: rows[row].__setitem__(slice(column, column + 1), [word]), lambda: rows.append(rows[row]),
        lambda: [one.__setitem__(slice(column, column + 1), [word]) for one in rows],
    ][change.place // max(len(rows), 1) % 8]()  # fmt: skip
    file = io.StringIO()
    csv.writer(file, delimiter=separator).writerows(rows)
    path.write_text(file.getvalue(), encoding="utf-8")


def of_arrow(path, change):
    """A column of a table of Arrow's or Parquet's changed."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    parquet = path.suffix == ".parquet"
    table = pq.read_table(path) if parquet else pa.ipc.open_file(path).read_all()
    i, n = change.place % table.num_columns, table.num_rows
    name = table.column_names[i]
    if change.value % 9 == 0:
        table = table.remove_column(i)
    else:
        other = change.pick([
            pa.nulls(n), pa.array(["x"] * n), pa.array([[1, 2]] * n), pa.array([{"a": 1}] * n), pa.array([np.nan] * n),
            pa.array([2**62] * n), pa.array([-1] * n), pa.array([None, *[1] * (n - 1)]), pa.array([b"x"] * n),
            pa.array([0.5] * n), pa.array(["x"] * n).dictionary_encode(), pa.array([True] * n), pa.array([np.inf] * n),
            pa.array([[0] * (i % 3) for i in range(n)]), pa.array([10**9] * n, type=pa.timestamp("s")),
        ], "kind")  # fmt: skip
        table = table.set_column(i, name, other)
    table = table.slice(0, n - change.value % 3) if change.value % 5 == 0 else table
    if parquet:
        pq.write_table(table, path)
    else:
        with pa.OSFile(str(path), "wb") as file, pa.ipc.new_file(file, table.schema) as writer:
            writer.write_table(table)


def of_opcodes(raw: bytes, change: Change) -> bytes:
    """A pickle with an opcode changed, doubled, left out, or another put in."""
    starts = [at for _, _, at in pickletools.genops(raw)]
    parts = [raw[at:end] for at, end in zip(starts, [*starts[1:], len(raw)], strict=True)]
    at = change.place % len(parts)
    other = change.pick(OPCODES if change.kind % 3 else parts, "value")
    change.pick([
        lambda: parts.__setitem__(at, other), lambda: parts.insert(at, other), lambda: parts.__setitem__(at, other),
        lambda: parts.insert(at, parts[at]), lambda: parts.pop(at),
        lambda: parts.__setitem__(at, of_bytes(parts[at], change)),
    ], "kind")()  # fmt: skip
    return b"".join(parts)


def of_pickle(path, change):
    path.write_bytes(of_opcodes(path.read_bytes(), change))


STRUCTURED = {
    ".json": of_json, ".npz": of_npz, ".zip": of_npz, ".hdf5": of_hdf5, ".csv": of_text, ".tsv": of_text, ".arrow": of_arrow,
    ".parquet": of_arrow, ".pkl": of_pickle,
}  # fmt: skip
