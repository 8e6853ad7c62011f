"""Which rows of a table are read, by the cells of other columns: `--where phase=1,site=north`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from orbiflow.density.tables.files import read_labels
from orbiflow.density.tables.table import Table, TableError, listing
from orbiflow.errors import SettingError, literal

MOST_LISTED = 12
"""Values of a column that a message names at most."""


def conditions_of(where: Sequence[str]) -> dict[str, list[str]]:
    """Return the values that rows may have, by columns.

    >>> conditions_of(["phase=1", "phase=2", "site = north"])
    {'phase': ['1', '2'], 'site': ['north']}
    """
    found: dict[str, list[str]] = {}
    for text in where:
        column, sign, value = (part.strip() for part in text.partition("="))
        if not (column and sign and value):
            raise SettingError(
                f"{{where}} must hold columns with values, such as phase=1, got {literal(repr(text))}"
            )
        found.setdefault(column, []).append(value)
    return found


def rows_where(
    path: Path, table: Table, where: Sequence[str], *, has_header: bool | None = None
) -> NDArray[np.bool_]:
    """Return which rows (N,) of a file's table have one of the values asked for, in each column.

    Numbers are compared as numbers, so 1 is 1.0. Raises TableError if there is no such row.
    """
    kept = np.ones(len(table.lines), dtype=bool)
    for column, values in conditions_of(where).items():
        cells = read_labels(path, column, table, has_header=has_header, empty=True)
        kinds, numbers = np.unique(cells, return_inverse=True)
        chosen = np.array([any(_are_equal(kind, value) for value in values) for kind in kinds])
        if not chosen.any():
            own = [kind for kind in kinds.tolist() if kind]
            rest = f" and {len(own) - MOST_LISTED} others" if len(own) > MOST_LISTED else ""
            raise TableError(
                literal(f"{path}: no row has {column} {' or '.join(values)}; there are ")
                + literal(f"{listing(own[:MOST_LISTED])}{rest}")
                + ": change {where}"
            )
        kept &= chosen[numbers.reshape(-1)]
    if not kept.any():
        raise TableError(
            literal(f"{path}: no row has all of {', '.join(where)}: change ") + "{where}"
        )
    return kept


def _are_equal(cell: str, value: str) -> bool:
    if cell == value:
        return True
    try:
        return float(cell) == float(value)
    except ValueError:
        return False
