"""Tables that the density jobs read, with the settings of the operations."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Protocol

from orbiflow.arrays import Array
from orbiflow.density.operations import with_columns_of
from orbiflow.density.tables import RowSettings, Table, TableSettings, read_rows
from orbiflow.jobs.run import Sink


class Grouped(Protocol):
    """A request of a table whose rows may have weights and groups."""

    @property
    def data(self) -> Path: ...
    @property
    def columns(self) -> tuple[str, ...] | None: ...
    @property
    def header(self) -> bool | None: ...
    @property
    def drop_missing(self) -> bool: ...
    @property
    def missing(self) -> Any: ...
    @property
    def weights(self) -> str | None: ...
    @property
    def group(self) -> str | None: ...


def read_data(
    data: Path,
    columns: tuple[str, ...] | None,
    tell: Sink,
    *,
    header: bool | None = None,
    drop_missing: bool = False,
) -> Table:
    """Return the columns asked for, else those of numbers less identifiers."""
    settings = TableSettings(columns=columns, header=header, drop_missing=drop_missing)
    return read_rows(data, settings, tell).table


def read_beside_groups(
    request: Grouped, width: int | None, tell: Sink
) -> tuple[Table, Array | None]:
    """Return the table of a request without its groups, and its weights."""
    settings = RowSettings(
        columns=request.columns,
        header=request.header,
        drop_missing=request.drop_missing,
        missing=request.missing,
        weights=request.weights,
    )
    rows = read_rows(request.data, settings, tell, width=width, group=request.group)
    return rows.table, rows.weights


def same_columns(
    data: Path, extra: dict[str, Any], tell: Sink, *, has_header: bool | None = None
) -> tuple[str, ...] | None:
    """Return the columns of the fit, which a file that names its columns must have; else None."""
    return with_columns_of(TableSettings(header=has_header), data, extra, tell).columns
