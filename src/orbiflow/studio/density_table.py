"""A table that somebody uploaded: its first rows, what its columns seem to be, where its rows live."""

from __future__ import annotations

import math
from dataclasses import asdict
from pathlib import Path
from typing import Any

from orbiflow.density import TableError, code_notes, read_table, seen_columns
from orbiflow.errors import OrbiflowError
from orbiflow.studio.density_files import MAX_SHOWN

MAX_ROWS, FIRST = 200_000, 6
"""Rows that a table may have, and rows that are shown of it."""

MAX_NAME = 200
"""Letters of a column's name."""


def table_view(path: Path) -> dict[str, Any]:
    """Return what a page shows of a table before anything is fitted.

    Raises:
        OrbiflowError: If it is no table of numbers, or too large.
    """
    try:
        table = read_table(path, columns=None, width=None, max_rows=MAX_ROWS, keep_missing=True)
    except TableError as error:
        cause = str(error).removeprefix(f"{path}: ").partition(";")[0]
        raise OrbiflowError(
            f"this table cannot be read: {cause}; save it again as CSV, with a row for each thing and "
            "plain numbers in its columns: decimal points, and nothing between thousands"
        ) from None
    shown = table.columns[:MAX_SHOWN]
    if max(map(len, shown)) > MAX_NAME:
        raise OrbiflowError(f"the name of a column has over {MAX_NAME} letters; shorten it")
    columns, guessed = seen_columns(table, MAX_SHOWN)
    first = table.values[:FIRST, : len(shown)].tolist()
    return {
        "rows": len(table.values),
        "columns": [asdict(column) for column in columns],
        "more": len(table.columns) - len(shown),
        "first": [[None if math.isnan(v) else float(f"{v:.6g}") for v in row] for row in first],
        "notes": [*table.notes, *code_notes(table)],
        "guess": asdict(guessed),
    }
