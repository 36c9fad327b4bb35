"""A table with a row a run; what is the same in all of them is told once, below it."""

from collections.abc import Mapping
from typing import Any

NONE = "not there"
"""In place of an empty cell: the run has no such entry."""


def runs_as_rows(caption: str, told: Mapping[str, Mapping[str, str]]) -> dict[str, Any]:
    """What the template shows of several runs, or pools of them.

    Args:
        caption: of the table.
        told: what there is to say of each, by its name.
    """
    keys = dict.fromkeys(key for one in told.values() for key in one)
    cells = {key: [one.get(key, NONE) for one in told.values()] for key in keys}
    differ = [key for key in keys if len(set(cells[key])) > 1 or len(told) == 1]
    rows = [[name, *(cells[key][i] for key in differ)] for i, name in enumerate(told)] if differ else []
    same = [(key, cells[key][0]) for key in keys if key not in differ]
    return {"caption": caption, "headings": ["", *differ], "rows": rows, "same": same}
