"""Tables that the density jobs read."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orbiflow.density import (
    MissingCellsError,
    Table,
    column_names,
    is_identifier,
    listing,
    read_table,
)
from orbiflow.errors import InputFileError, OrbiflowError
from orbiflow.jobs.density_columns import check_order
from orbiflow.jobs.density_requests import Unit
from orbiflow.jobs.run import Sink
from orbiflow.runtime import Note, RecordError


def read_data(
    data: Path,
    columns: tuple[str, ...] | None,
    width: int | None,
    tell: Sink,
    *,
    has_header: bool | None = None,
    drop_missing: bool = False,
    keep_missing: bool | None = None,
) -> Table:
    """The columns asked for, else those of numbers, `width` of them, less identifiers; tells notes.

    Args:
        keep_missing: None where the request could not ask for it.

    Raises:
        InputFileError: for a table that cannot be read, or lacks values that it must have.
    """
    how: dict[str, Any] = {"has_header": has_header, "drop_missing": drop_missing}
    try:
        table = _read(data, columns, width, tell, {**how, "keep_missing": bool(keep_missing)})
    except MissingCellsError as error:
        if keep_missing is None:
            raise
        raise InputFileError(f"{error} (on tori --missing marginalise keeps them)") from error
    for note in table.notes:
        tell(Note(note))
    return table


def _read(
    data: Path,
    columns: tuple[str, ...] | None,
    width: int | None,
    tell: Sink,
    how: dict[str, Any],
) -> Table:
    """As `read_data`, whose notes are still to be told."""
    chosen = None if columns is None else list(columns)
    if chosen is not None:
        return read_table(data, columns=chosen, width=None, **how)
    try:
        table = read_table(data, columns=None, width=width, **how)
    except InputFileError:
        # one more than wanted may be an identifier
        if width is None:
            raise
        table = _without_identifiers(read_table(data, columns=None, width=None, **how), tell)
        if len(table.columns) != width:
            raise
        return table
    return table if width is not None else _without_identifiers(table, tell)


def _without_identifiers(table: Table, tell: Sink) -> Table:
    for column in reversed(range(len(table.columns))):
        name = table.columns[column]
        if len(table.columns) > 1 and is_identifier(name, table.values[:, column]):
            table = table.without(column)
            tell(Note(f"left out the column {name!r}, which numbers the rows; --columns takes it"))
    return table


def read_weighed(
    data: Path,
    columns: tuple[str, ...] | None,
    width: int | None,
    weights: str | None,
    tell: Sink,
    **how: Any,
) -> tuple[Table, NDArray[np.float64] | None]:
    """As `read_data`, and the weights (N,) of the rows, from a column that is no other's.

    Raises:
        OrbiflowError: as `read_data`, and for weights that are missing or wanted as data as well.
    """
    if weights is None:
        return read_data(data, columns, width, tell, **how), None
    own = {name: value for name, value in how.items() if name != "keep_missing"}
    column = read_table(data, columns=[weights], width=1, **own)
    name = column.columns[0]
    table = read_data(data, columns, None if columns is None else width, tell, **how)
    if columns is None and name in table.columns and len(table.columns) > 1:
        table = table.without(table.columns.index(name))
    if name in table.columns:
        raise InputFileError(
            f"{data}: {name!r} holds the rows' weights and cannot be a column of the data as well"
        )
    if width is not None and len(table.columns) != width:
        raise InputFileError(
            f"{data}: {width} columns must be taken beside the weights {name!r}, there are "
            f"{', '.join(table.columns)}; choose with --columns"
        )
    kept = np.isin(table.lines, column.lines)
    table = replace(
        table,
        values=table.values[kept],
        lines=table.lines[kept],
        dropped=table.dropped | column.dropped,
    )
    return table, column.values[np.isin(column.lines, table.lines), 0]


def unit_of(space: str, unit: Unit | None, table: Table, tell: Sink) -> Unit:
    """The unit of angles: as said, else radians where all values are within a turn either way.

    Raises:
        OrbiflowError: if none was said and the values cannot be radians; for another unit than degrees,
            or a longitude before its latitude, where columns are latitude and longitude.
    """
    if space not in ("torus", "klein-bottle"):
        check_order(table.columns, space)
        if unit in ("radians", "turns"):
            raise RecordError(
                f"{{unit}} {unit} is of angles on the torus and the Klein bottle: latitude and "
                "longitude are degrees; convert them, or give unit vectors x,y,z"
            )
        return "radians"
    if unit is not None:
        return unit
    beyond = np.nanmax(abs(table.values), axis=0, initial=0) > 2 * math.pi + 1e-9
    if beyond.any():
        column = int(beyond.argmax())
        most = table.values[np.nanargmax(abs(table.values[:, column])), column]
        raise OrbiflowError(
            f"column {table.columns[column]!r} has {most:g}, beyond 2 pi: say --unit degrees, radians "
            "or turns"
        )
    tell(Note("no --unit was given and all values are within 2 pi: they were read as radians"))
    return "radians"


def same_columns(
    data: Path, extra: dict[str, Any], tell: Sink, *, has_header: bool | None = None
) -> tuple[str, ...] | None:
    """The columns of the fit, which a file that names its columns must have; else None, which is said.

    Raises:
        OrbiflowError: if the file names other columns.
    """
    names: tuple[str, ...] = tuple(extra.get("columns") or ())
    if not names or all(re.fullmatch(r"column\d+", name) for name in names):
        return None  # they had no names
    own = column_names(data, wanted=names, has_header=has_header)
    if own is None:
        tell(Note(f"{data} has no header: its columns were taken for {', '.join(names)}"))
        return None
    known = {name.casefold() for name in own}
    missing = [name for name in names if name.casefold() not in known]
    if missing:
        raise OrbiflowError(
            f"{data}: the model was fitted to {', '.join(names)}, and the file has "
            f"{'no ' + ', '.join(missing) + ' among ' if len(missing) < len(names) else ''}"
            f"{listing(own)}: say with --columns which they are, in this order"
        )
    return names
