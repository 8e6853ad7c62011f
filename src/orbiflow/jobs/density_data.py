"""Tables and models that the density jobs read."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from orbiflow.density import SymmetricDensity, read_density
from orbiflow.density.tables import Table, read_table
from orbiflow.errors import OrbiflowError
from orbiflow.export.density_plots import MODEL
from orbiflow.jobs.events import Note
from orbiflow.jobs.run import Sink

REPORT = "report.json"


def model_at(path: Path) -> tuple[SymmetricDensity, dict[str, Any]]:
    """The density in a file or in the folder of a fit, and what was saved with it."""
    return read_density(path / MODEL if path.is_dir() else path)


def read_data(data: Path, columns: tuple[str, ...] | None, width: int | None, tell: Sink) -> Table:
    """The columns asked for, else those that `read_table` takes for `width`; tells its notes."""
    chosen = None if columns is None else list(columns)
    table = read_table(data, columns=chosen, width=width if chosen is None else None)
    for note in table.notes:
        tell(Note(note))
    return table


def same_columns(data: Path, extra: dict[str, Any]) -> tuple[str, ...] | None:
    """The columns of the fit, if the file has a header that names them all."""
    names = extra.get("columns")
    if not names:
        return None
    try:
        read_table(data, columns=names, width=None, max_rows=10**9)
    except OrbiflowError:
        return None
    return tuple(names)
