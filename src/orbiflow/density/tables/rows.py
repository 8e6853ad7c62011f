"""The rows of a table that a density is fitted to or compared with, read as the settings say."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orbiflow.arrays import Array
from orbiflow.density.tables.files import column_names, is_identifier, read_labels, read_table
from orbiflow.density.tables.settings import (
    SPACES,
    RowSettings,
    SpaceSettings,
    TableSettings,
    Unit,
    is_angular,
)
from orbiflow.density.tables.table import MissingCellsError, Table, TableError, find, quote
from orbiflow.errors import SettingError, literal
from orbiflow.runtime import Note, Sink

NORTH = frozenset({"lat", "latitude", "plunge", "inclination"})
EAST = frozenset({"lon", "long", "lng", "longitude", "trend", "azimuth"})
"""First words of names of the angle towards the pole, and of that around it."""


@dataclass(frozen=True, eq=False)
class TableRows:
    """The rows of a table, what each weighs, and the column that names what rows belong to.

    - `weights`: How much each row counts, (N,). None: all the same.
    - `header`: Whether the first line of the file names the columns, None to look.
    """

    path: Path
    table: Table
    weights: Array | None
    group: str | None
    header: bool | None

    def only(self, kept: NDArray[np.bool_]) -> TableRows:
        """Return the rows of a mask (N,)."""
        weights = None if self.weights is None else self.weights[kept]
        return TableRows(self.path, self.table.only(kept), weights, self.group, self.header)

    @property
    def whole(self) -> NDArray[np.bool_]:
        """Which rows (N,) lack no value, or all, if none is whole: others have another unit."""
        found = np.logical_and.reduce(np.isfinite(self.table.values), axis=1)
        return found if found.any() else np.ones_like(found)

    @cached_property
    def labels(self) -> NDArray[np.str_] | None:
        """What each row belongs to, (N,), or None if no column says so."""
        if self.group is None:
            return None
        return read_labels(self.path, self.group, self.table, has_header=self.header)


def read_rows(
    path: Path,
    settings: TableSettings,
    tell: Sink,
    *,
    width: int | None = None,
    group: str | None = None,
) -> TableRows:
    """Return the rows of a table of `width` columns, and tell what was decided for the user.

    Without `columns` in the settings, all columns of numbers are taken but those that count the rows,
    and those of weights and groups.
    """
    rows = settings if isinstance(settings, RowSettings) else RowSettings(**settings.to_json())
    dropped = rows.drop_missing or rows.missing == "drop"
    how: dict[str, Any] = {"has_header": rows.header, "drop_missing": dropped}
    name = None if group is None or rows.columns is not None else _name(path, group, rows.header)
    weighing = None
    if rows.weights is not None:
        weighing = read_table(path, columns=[rows.weights], width=1, **how)
    others = [*(weighing.columns if weighing else ()), *([name] if name else [])]
    try:
        how["keep_missing"] = rows.missing == "marginalise"
        table = _read(path, rows.columns, None if others else width, tell, how)
    except MissingCellsError as error:
        if rows is not settings:  # the command has no way to keep them
            raise
        raise TableError(
            f"{error.template} (on tori {{missing}} marginalise keeps them)"
        ) from error
    for note in table.notes:
        tell(Note(note))
    for other in others if rows.columns is None else ():
        if other in table.columns and len(table.columns) > 1:
            table = table.without(table.columns.index(other))
    weights = None
    if weighing is not None:
        table, weights = _weighed(path, table, weighing)
    if others and width not in (None, len(table.columns)):
        raise TableError(
            literal(
                f"{path}: {width} columns must be taken beside {' and '.join(map(quote, others))}, "
                f"there are {', '.join(table.columns)}"
            )
            + "; choose with {columns}"
        )
    return TableRows(path, table, weights, group, rows.header)


def _read(
    path: Path, columns: Sequence[str] | None, width: int | None, tell: Sink, how: dict[str, Any]
) -> Table:
    if columns is not None:
        return read_table(path, columns=list(columns), width=None, **how)
    try:
        table = read_table(path, columns=None, width=width, **how)
    except TableError:
        # one more than wanted may be an identifier
        if width is None:
            raise
        table = _without_identifiers(read_table(path, columns=None, width=None, **how), tell)
        if len(table.columns) != width:
            raise
        return table
    return table if width is not None else _without_identifiers(table, tell)


def _without_identifiers(table: Table, tell: Sink) -> Table:
    for column in reversed(range(len(table.columns))):
        name = table.columns[column]
        if len(table.columns) > 1 and is_identifier(name, table.values[:, column]):
            table = table.without(column)
            tell(Note(f"left out the column {name!r}, which numbers the rows; name all to keep it"))
    return table


def _weighed(path: Path, table: Table, weighing: Table) -> tuple[Table, Array]:
    """Return the rows that have a weight, and their weights."""
    name = weighing.columns[0]
    if name in table.columns:
        raise TableError(
            literal(f"{path}: {name!r} holds the rows' weights and cannot be a column of the data")
            + " as well; leave it out of {columns}"
        )
    table = table.only(np.isin(table.lines, weighing.lines))
    return table, weighing.values[np.isin(weighing.lines, table.lines), 0]


def _name(path: Path, column: str, header: bool | None) -> str:
    """Return what a table calls a column that is given by its name or number."""
    names = column_names(path, wanted=[column], has_header=header)
    if names is None:
        number = column.strip()
        return f"column{int(number)}" if number.isdecimal() else number
    return names[find(path, names, column)]


def angle_unit(where: SpaceSettings, table: Table, tell: Sink) -> Unit:
    """Return the unit of angles: the given one, or else radians if all values are within 2 pi.

    A cell that was not given is told, too: data of another size would be folded into it.
    """
    space, unit = where.space, where.unit
    if space not in SPACES and where.cell is None:
        tell(
            Note("no cell was given: its lengths are taken to be about 1, in the unit of the data")
        )
    if not is_angular(space, len(table.columns)):
        check_order(table.columns, space)
        return "radians"
    if unit is not None:
        return unit
    beyond = np.nanmax(abs(table.values), axis=0, initial=0) > 2 * math.pi + 1e-9
    if beyond.any():
        column = int(beyond.argmax())
        most = table.values[np.nanargmax(abs(table.values[:, column])), column]
        raise SettingError(
            literal(f"column {table.columns[column]!r} has {most:g}, beyond 2 pi")
            + "; give {unit} degrees, radians or turns"
        )
    tell(Note("no unit was given and all values are within 2 pi: they were read as radians"))
    return "radians"


def check_order(columns: Sequence[str], space: str) -> None:
    """Refuse a longitude before its latitude: it would be taken for another place.

    >>> check_order(["lat", "lon"], "sphere")
    >>> check_order(["Longitude (deg)", "Latitude (deg)"], "sphere")
    Traceback (most recent call last):
    ...
    orbiflow.errors.SettingError: the columns are 'Longitude (deg)', 'Latitude (deg)', and the sphere \
takes latitude before longitude; give columns 'Latitude (deg),Longitude (deg)'
    """
    words = [re.search(r"[^\W\d_]+", name) for name in columns]
    east, *rest = [found[0].casefold() if found else "" for found in words]
    if east not in EAST or len(rest) != 1 or rest[0] not in NORTH:
        return
    first, second = columns
    raise SettingError(
        literal(f"the columns are {first!r}, {second!r}, and the {space} takes latitude before ")
        + "longitude; give {columns} "
        + literal(f"'{second},{first}'")
    )
