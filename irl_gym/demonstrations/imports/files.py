"""CSV and Parquet files as data frames, and where a row of them stands.

Rows are counted from 1, as a person counts them, without the header; lines of a CSV file as an editor counts them.
"""

import csv
import itertools
import re
import warnings
from collections.abc import Iterable, Iterator, Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from irl_gym.demonstrations.imports.values import Name, shown
from irl_gym.errors import DatasetMissing, InvalidDemonstrations, InvalidParameter, NotInstalled, a_type
from irl_gym.files.arrow_files import check_parquet
from irl_gym.files.hdf5_files import BROKEN

SEPARATORS = {".csv": ",", ".tsv": "\t"}
PARQUET = (".parquet", ".pq")
NAMES = {",": "commas", ";": "semicolons", "\t": "tabs", "|": "bars", " ": "spaces"}
"""What may stand between the fields of a line."""
VALUE = re.compile(r"\s*([-+]?\d*\.?\d*(e[-+]?\d+)?|nan|[-+]?inf|true|false|[(\[].*)\s*", re.IGNORECASE)
"""A number, a truth, a vector, or nothing: what a step has, and no name of a column."""


def read_frame(source: Any, columns: dict[str, str], optional: frozenset[str] = frozenset()) -> tuple[Any, Name]:
    """Some columns of a data frame or a file, and what names its rows.

    Args:
        source: a pandas DataFrame, or the path of a CSV, TSV or Parquet file.
        columns: what a column is for -> its name.
        optional: what a column may be missing for.

    Raises:
        InvalidParameter: something else than a frame or such a file.
        NotInstalled: no pyarrow for a Parquet file.
        DatasetMissing: no such file.
        InvalidDemonstrations: a file that cannot be read, or a column that is not there.
    """
    import pandas as pd

    if isinstance(source, pd.DataFrame):
        _check_columns("the frame", list(source.columns), columns, optional)
        return source, lambda row: f"row {row + 1} (index {source.index[row]})"
    if not isinstance(source, str | Path):
        raise InvalidParameter(f"the source is {a_type(source)}: expected a pandas DataFrame or the path of a file.")
    path = Path(source)
    kind = path.suffix.lower()
    if kind not in (*SEPARATORS, *PARQUET):
        raise InvalidParameter(f"{path} ends in {path.suffix!r}: expected .csv, .tsv, .parquet or .pq. Or pass a DataFrame.")
    if not path.is_file():
        raise DatasetMissing(f"{path} is not a file: expected one with the demonstrations.")
    try:
        if kind in PARQUET:
            return _read_parquet(path, columns, optional)
        return _read_text(pd, path, SEPARATORS[kind], columns, optional)
    except ImportError as error:
        raise NotInstalled('Parquet files need pyarrow, which is missing: expected it. pip install "irl_gym[data]".') from error
    except InvalidDemonstrations:
        raise
    except (*BROKEN, csv.Error, pd.errors.ParserWarning) as error:
        reason = " ".join(str(error).split())
        raise InvalidDemonstrations(f"{path.name} cannot be read ({reason}): expected {kind} with a header.") from error


def _read_parquet(path: Path, columns: dict[str, str], optional: frozenset[str]) -> tuple[Any, Name]:
    import pyarrow as pa
    import pyarrow.parquet

    check_parquet(path)
    there = pyarrow.parquet.read_schema(path).names
    _check_columns(path.name, there, columns, optional)
    wanted = [one for one in dict.fromkeys(columns.values()) if one in there]
    try:
        table = pyarrow.parquet.read_table(path, columns=wanted)
        table.validate(full=True)
        return table.to_pandas(ignore_metadata=True), lambda row: f"row {row + 1} of {path.name}"
    except pa.ArrowException as error:  # most of them are a ValueError too, but not all
        raise ValueError(error) from error


def _read_text(pd: Any, path: Path, separator: str, columns: dict[str, str], optional: frozenset[str]) -> tuple[Any, Name]:
    line, header = next(_records(path, separator), (1, []))
    if not header:
        raise InvalidDemonstrations(f"{path.name} is empty: there are no rows, expected a header and at least one.")
    if not set(columns.values()) & set(header):
        _check_header(f"line {line} of {path.name}", separator, header, columns)
    there = [one or f"Unnamed: {i}" for i, one in enumerate(header)]  # as pandas calls them
    _check_columns(path.name, there, columns, optional)
    old = tuple(map(int, pd.__version__.split(".")[:2])) < (3, 1)
    exact = {"float_precision": "round_trip"} if old else {}  # since 3.1 the default: the floats that were written
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", pd.errors.ParserWarning)
            frame = pd.read_csv(path, sep=separator, index_col=False, low_memory=False, **exact)
    except (pd.errors.ParserWarning, pd.errors.ParserError) as error:
        for line, fields in _records(path, separator):
            if len(fields) > len(header):
                raise InvalidDemonstrations(
                    f"line {line} of {path.name} has {len(fields)} fields, more fields than its header: expected "
                    f"{len(header)}. Put quotes around values that hold {NAMES[separator]}."
                ) from error
        raise

    def name(row: int) -> str:
        try:
            line, _ = next(itertools.islice(_records(path, separator), row + 1, None))
        except csv.Error:  # a field that is too long for the module csv, but not for pandas
            return f"row {row + 1} of {path.name}"
        return f"row {row + 1} (line {line} of {path.name})"

    return frame, name


def _records(path: Path, separator: str) -> Iterator[tuple[int, list[str]]]:
    """Line and fields of each row, the header first; blank lines are no rows, and a row may have several lines."""
    with open(path, newline="", encoding="utf-8-sig") as file:
        reader, line = csv.reader(file, delimiter=separator), 1
        for fields in reader:
            if any(map(str.strip, fields)) or len(fields) > 1:
                yield line, fields
            line = reader.line_num + 1


def _check_header(where: str, separator: str, header: list[str], columns: dict[str, str]) -> None:
    """Refuse a first line that names none of the columns, where it looks like something else than a header."""
    text, wanted = separator.join(header), list(dict.fromkeys(columns.values()))
    other = max((one for one in NAMES if one != separator), key=text.count)
    if text.lstrip().startswith("#"):
        named = set(re.split(r"[#\s,;|]+", text)) & set(wanted)
        apart = f"Take the '#' away, and pass pandas.read_csv(..., sep={other!r})."
        mend = apart if named else "Delete the comments, or pass pandas.read_csv(..., comment='#')."
        what = f"a header, such as {wanted}, before any comment. {mend}"
    elif text.count(other) >= len(header) and (other != " " or len(header) == 1):
        suffix = next((f"Let the file end in {one}, or pass" for one, sign in SEPARATORS.items() if sign == other), "Pass")
        what = f"{NAMES[separator]} between the columns, not {NAMES[other]}. {suffix} pandas.read_csv(..., sep={other!r})."
    elif 2 * sum(VALUE.fullmatch(one) is not None for one in header) > len(header):
        what = f"a header, such as {wanted}, before the values. Write one, or pass pandas.read_csv(..., names=[...])."
    else:
        return
    raise InvalidDemonstrations(f"{where} is {shown(text)}: expected {what}")


def _check_columns(where: str, there: Sequence[Any], columns: dict[str, str], optional: frozenset[str]) -> None:
    for role, column in columns.items():
        if list(there).count(column) == 1 or (role in optional and column not in there):
            continue
        if column in there:
            raise InvalidDemonstrations(f"{where} has {list(there).count(column)} columns {column!r}: expected one.")
        taken = {other for key, other in columns.items() if key != role}
        close = closest(column, [str(one) for one in there if one not in taken])
        mend = f"Did you mean {role}={close!r}?" if close else f"Name the right one with {role}=..."
        if role == "action":
            mend += " If only the states are known, pass action=None."
        known = [str(one)[:80] for one in there]
        raise InvalidDemonstrations(
            f"{where} has no column {column!r}: expected it for {role}, among the columns {known}. {mend}"
        )


def closest(name: str, there: Iterable[str]) -> str | None:
    """The name that is most like another, whatever its case, or an abbreviation of it; None if none is like it."""
    folded = {one.strip().casefold(): one for one in there}
    name = name.strip().casefold()
    close = get_close_matches(name, folded, 1, 0.5) or [one for one in folded if len(one) > 1 and name.startswith(one)]
    return folded[close[0]] if close else None
