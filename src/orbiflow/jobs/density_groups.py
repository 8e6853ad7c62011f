"""Tables some of whose columns are data, and one names the group of each row."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Protocol

from orbiflow.arrays import Array
from orbiflow.density import (
    Table,
    column_names,
    find,
)
from orbiflow.errors import InputFileError
from orbiflow.jobs.density_data import read_weighed
from orbiflow.jobs.run import Sink


class Grouped(Protocol):
    """A request of such a table."""

    @property
    def data(self) -> Path: ...
    @property
    def columns(self) -> tuple[str, ...] | None: ...
    @property
    def header(self) -> bool | None: ...
    @property
    def drop_missing(self) -> bool: ...
    @property
    def missing(self) -> str: ...
    @property
    def weights(self) -> str | None: ...
    @property
    def group(self) -> str | None: ...


def read_beside_groups(
    request: Grouped, width: int | None, tell: Sink
) -> tuple[Table, Array | None]:
    """The table without its groups, and its weights.

    Raises:
        OrbiflowError: for a table, columns or weights that cannot be used.
    """
    how: dict[str, Any] = {
        "has_header": request.header,
        "drop_missing": request.drop_missing or request.missing == "drop",
        "keep_missing": request.missing == "marginalise",
    }
    columns = request.columns
    if request.group is None or columns is not None:
        return read_weighed(request.data, columns, width, request.weights, tell, **how)
    name = _name_of(request, request.group)
    table, weights = read_weighed(request.data, None, None, request.weights, tell, **how)
    if name in table.columns and len(table.columns) > 1:
        table = table.without(table.columns.index(name))
    if width is not None and len(table.columns) != width:
        raise InputFileError(
            f"{request.data}: {width} columns must be taken beside the groups {name!r}, there are "
            f"{', '.join(table.columns)}; choose with --columns"
        )
    return table, weights


def _name_of(request: Grouped, column: str) -> str:
    """What a table calls a column that is given by its name or number."""
    names = column_names(request.data, wanted=[column], has_header=request.header)
    if names is None:
        number = column.strip()
        return f"column{int(number)}" if number.isdecimal() else number
    return names[find(request.data, names, column)]
