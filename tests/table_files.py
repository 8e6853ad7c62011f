"""Writing and refusing tables, shared by the tests of what reads them."""

from pathlib import Path
from typing import Any

import numpy as np
from hypothesis import HealthCheck, settings

from orbiflow.arrays import Array
from orbiflow.density import read_table
from orbiflow.density.data import DataTable, TableRows
from orbiflow.density.tables import SpaceSettings, TableSettings, read_rows
from orbiflow.errors import InputFileError
from orbiflow.runtime import ignore
from refusals import refused

PROPERTY = settings(
    max_examples=50, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


def write(tmp_path: Path, content: str | bytes, name: str = "a.csv") -> Path:
    path = tmp_path / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def values_of(table: DataTable) -> Array:
    """All columns (N, k) of a table of numbers."""
    return np.stack([table.numbers(k) for k in range(len(table.names))], axis=1)


def rows_of_file(path: Path, **settings: Any) -> TableRows:
    """The rows of a file on a torus in degrees."""
    where = SpaceSettings(space="torus", unit="degrees")
    return read_rows(path, TableSettings(**settings), ignore, where=where)


def refuse(path: Path, about: str, **options: Any) -> None:
    """Reading a file's numbers is refused, by words that name the file and all that it is about."""
    with refused(*about.split(), kind=InputFileError) as caught:
        values_of(read_table(path, **options))
    assert str(caught.value).startswith(f"{path}: ")
    assert len(str(caught.value)) < 2 * len(str(path)) + 500
