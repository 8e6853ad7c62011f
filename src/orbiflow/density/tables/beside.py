"""What columns of a table say of the ones beside them that are taken: hemispheres, calm, counts."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from orbiflow.density.data import is_count_named, words_of
from orbiflow.density.tables.files import column_names, read_labels, read_table
from orbiflow.density.tables.settings import RowSettings
from orbiflow.density.tables.table import Table, TableError
from orbiflow.errors import literal
from orbiflow.runtime import Note, Sink

_HEMISPHERES = {"N", "S", "E", "W", "NORTH", "SOUTH", "EAST", "WEST"}


def check_hemispheres(path: Path, table: Table, header: bool | None) -> None:
    """Refuse degrees to the south or west that only a column of letters tells of."""
    for name in column_names(path, has_header=header) or ():
        words = {"ns", "ew", "n", "e", "hemisphere", "hemi", "dir", "direction"}
        if name in table.columns or not words.intersection(words_of(name)):
            continue
        letters = {
            cell.strip().upper() for cell in read_labels(path, name, table, has_header=header)
        }
        if letters <= _HEMISPHERES and letters & {"S", "W", "SOUTH", "WEST"}:
            raise TableError(
                literal(
                    f"{path}: column {name!r} says which rows are south or west, and it is not read: "
                    "make their latitudes and longitudes negative"
                )
            )


SPEEDS = frozenset(
    {"speed", "spd", "wspd", "wsp", "ws", "velocity", "vel", "sknt", "windspeed", "ff"}
    | {"windgeschwindigkeit", "wg"}
)
"""Words for the speed of a wind, in names of columns."""


def tell_of_calm(path: Path, table: Table, rows: RowSettings, tell: Sink) -> None:
    """Tell of directions that are 0 in just the rows in which a speed is 0, which have none."""
    names = column_names(path, has_header=rows.header) or ()
    beside = [n for n in names if SPEEDS.intersection(words_of(n)) and n not in table.columns]
    if len(beside) != 1 or len(table.columns) != 1 or not (table.values == 0).any():
        return
    how: dict[str, Any] = {"has_header": rows.header, "decimal": rows.decimal}
    try:
        speeds = read_table(path, columns=beside, width=1, keep_missing=True, **how)
    except TableError:  # it is text
        return
    still = speeds.lines[speeds.values[:, 0] == 0]
    zero = table.lines[table.values[:, 0] == 0]
    both = np.isin(zero, still)
    if not both.all() or np.isin(still, table.lines).sum() != len(zero):
        return
    several = "s" * (len(zero) > 1)
    text = (
        f"WARNING: {table.columns[0]!r} is 0 in just the {len(zero)} row{several} in which "
        f"{beside[0]!r} is 0: calm has no direction; leave it out with --missing-codes 0 "
        "--drop-missing"
    )
    tell(Note(text))


def tell_of_counts(path: Path, table: Table, header: bool | None, tell: Sink) -> None:
    """Tell that a column beside evenly spaced, different angles may count them."""
    names = column_names(path, has_header=header) or ()
    beside = [name for name in names if is_count_named(name) and name not in table.columns]
    if not beside or len(table.columns) != 1:
        return
    steps = np.diff(np.sort(table.values[:, 0]))
    if len(steps) > 1 and steps.min() > 0 and bool(np.isclose(steps, steps.min(), rtol=0.01).all()):
        text = (
            f"the values of {table.columns[0]!r} are evenly spaced, as the middles of bins are: if "
            f"{beside[0]!r} says how many rows are in each, give --counts {beside[0]}"
        )
        tell(Note(text))
