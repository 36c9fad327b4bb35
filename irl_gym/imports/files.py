"""CSV and Parquet files as data frames, and where a row of them stands.

Rows are counted from 1, as a person counts them, without the header; lines of a CSV file as an editor counts them.
"""

import csv
import itertools
import warnings
from collections.abc import Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from irl_gym.errors import DatasetMissing, InvalidDemonstrations, InvalidParameter, NotInstalled
from irl_gym.imports.members import Name

SEPARATORS = {".csv": ",", ".tsv": "\t"}
PARQUET = (".parquet", ".pq")


def read_frame(source: Any, columns: dict[str, str], optional: frozenset[str] = frozenset()) -> tuple[Any, Name]:
    """Some columns of a data frame or a file, and what names its rows.

    Args:
        source: a pandas DataFrame, or the path of a CSV, TSV or Parquet file.
        columns: what a column is for -> its name.
        optional: what a column may be missing for.

    Raises:
        InvalidParameter: something else than a frame or such a file.
        NotInstalled: no pandas, or no pyarrow for a Parquet file.
        DatasetMissing: no such file.
        InvalidDemonstrations: a file that cannot be read, or a column that is not there.
    """
    try:
        import pandas as pd
    except ImportError as error:
        raise NotInstalled(
            'data frames need pandas, which is missing: expected it installed. pip install "irl_gym[data]".'
        ) from error
    if isinstance(source, pd.DataFrame):
        _check_columns("the frame", list(source.columns), columns, optional)
        return source, lambda row: f"row {row + 1} (index {source.index[row]})"
    if not isinstance(source, str | Path):
        raise InvalidParameter(f"the source is {type(source).__name__}: expected a pandas DataFrame or the path of a file.")
    path = Path(source)
    if path.suffix not in (*SEPARATORS, *PARQUET):
        raise InvalidParameter(f"{path} ends in {path.suffix!r}: expected .csv, .tsv, .parquet or .pq. Or pass a DataFrame.")
    if not path.is_file():
        raise DatasetMissing(f"{path} is not a file: expected one with the demonstrations.")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", pd.errors.ParserWarning)  # rows that are longer than the header
            return _read(pd, path, columns, optional)
    except ImportError as error:
        raise NotInstalled('Parquet files need pyarrow, which is missing: expected it. pip install "irl_gym[data]".') from error
    except pd.errors.EmptyDataError as error:
        raise InvalidDemonstrations(f"{path.name} is empty: there are no rows, expected a header and at least one.") from error
    except pd.errors.ParserWarning as error:
        raise InvalidDemonstrations(f"{path.name} has rows with more fields than its header: expected as many.") from error
    except InvalidDemonstrations:
        raise
    except (ValueError, OSError) as error:
        reason = " ".join(str(error).split())
        raise InvalidDemonstrations(f"{path.name} cannot be read ({reason}): expected {path.suffix} with a header.") from error


def _read(pd: Any, path: Path, columns: dict[str, str], optional: frozenset[str]) -> tuple[Any, Name]:
    if path.suffix in PARQUET:
        import pyarrow.parquet

        there = pyarrow.parquet.read_schema(path).names
        _check_columns(path.name, there, columns, optional)
        wanted = [one for one in dict.fromkeys(columns.values()) if one in there]
        return pd.read_parquet(path, columns=wanted), lambda row: f"row {row + 1} of {path.name}"
    separator = SEPARATORS[path.suffix]
    header = pd.read_csv(path, sep=separator, nrows=0, index_col=False)
    _check_columns(path.name, list(header.columns), columns, optional)
    old = tuple(map(int, pd.__version__.split(".")[:2])) < (3, 1)
    exact = {"float_precision": "round_trip"} if old else {}  # since 3.1 the default: the floats that were written
    frame = pd.read_csv(path, sep=separator, index_col=False, low_memory=False, **exact)
    return frame, lambda row: f"row {row + 1} (line {_line(path, separator, row)} of {path.name})"


def _line(path: Path, separator: str, row: int) -> int:
    """The line at which a data row of a CSV file starts; blank lines are no rows, and a row may have several lines."""
    with open(path, newline="", encoding="utf-8-sig", errors="replace") as file:
        reader = csv.reader(file, delimiter=separator)
        before = itertools.chain([0], (reader.line_num for _ in itertools.repeat(None)))
        filled = (
            line + 1 for line, fields in zip(before, reader, strict=False) if any(map(str.strip, fields)) or len(fields) > 1
        )
        return next(itertools.islice(filled, row + 1, None))


def _check_columns(where: str, there: Sequence[Any], columns: dict[str, str], optional: frozenset[str]) -> None:
    for role, column in columns.items():
        if list(there).count(column) == 1 or (role in optional and column not in there):
            continue
        if column in there:
            raise InvalidDemonstrations(f"{where} has {list(there).count(column)} columns {column!r}: expected one.")
        taken = {other for key, other in columns.items() if key != role}
        close = get_close_matches(column, [str(one) for one in there if one not in taken], 1, 0.5)
        mend = f"Did you mean {role}={close[0]!r}?" if close else f"Name the right one with {role}=..."
        raise InvalidDemonstrations(
            f"{where} has no column {column!r}: expected it for {role}, among the columns {[str(one) for one in there]}. {mend}"
        )
