"""What a table has beside its numbers: the names of its columns, and a column of labels."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from orbiflow.density.tables.binary import npy_names, parquet_labels, parquet_names
from orbiflow.density.tables.files import kind_of_file, read_table
from orbiflow.density.tables.table import Table, find
from orbiflow.density.tables.text import layout_of, split_line, text_lines
from orbiflow.errors import InputFileError


def column_names(
    path: str | Path, *, wanted: Sequence[str] | None = None, has_header: bool | None = None
) -> tuple[str, ...] | None:
    """Names of all columns of a file, None where it names none.

    `wanted` and `has_header` are as for `read_table`: they tell a header from a row.

    Raises `InputFileError` for a file that is no table.
    """
    path = Path(path)
    kind = kind_of_file(path)
    if kind == "text":
        return layout_of(path, wanted, has_header).header
    return npy_names(path) if kind == "npy" else parquet_names(path)


def read_labels(
    path: str | Path, column: str, table: Table, *, has_header: bool | None = None
) -> NDArray[np.str_]:
    """The cells (N,) of a column, numbers or not, of the rows of a `table` read from the file.

    Raises `InputFileError` for an unknown column, an empty cell, or a file that has changed.
    """
    path = Path(path)
    kind = kind_of_file(path)
    if kind == "npy":
        numbers = read_table(path, columns=[column], width=1, drop_missing=True)
        cells = numbers.values[:, 0].astype(str).tolist()
        found = dict(zip(numbers.lines.tolist(), cells, strict=True))
        return _picked(path, column, found, table)
    if kind == "parquet":
        cells = parquet_labels(path, column)
        return _picked(path, column, {k: c for k, c in enumerate(cells, start=1) if c}, table)
    layout = layout_of(path, [column], has_header)
    index = find(path, layout.names, column)
    found: dict[int, str] = {}
    for number, line, is_comment in text_lines(path):
        if is_comment:
            continue
        cells = split_line(path, number, line, layout.delimiter)
        cell = cells[index].strip() if index < len(cells) else ""
        if cell:
            found[number] = cell
    return _picked(path, column, found, table)


def _picked(path: Path, column: str, found: dict[int, str], table: Table) -> NDArray[np.str_]:
    """Cells by the numbers of their lines, for the rows of the table."""
    missing = [line for line in table.lines.tolist() if line not in found]
    if missing:
        raise InputFileError(
            f"{path}: {len(missing)} rows have no {column!r}, the first in line {missing[0]}; fill "
            "it in"
        )
    return np.array([found[line] for line in table.lines.tolist()])
