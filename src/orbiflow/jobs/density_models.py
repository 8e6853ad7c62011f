"""Models that jobs read, and whether a table fits them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from orbiflow.arrays import Array
from orbiflow.density import (
    MODEL,
    Space,
    SymmetricDensity,
    Table,
    read_density,
)
from orbiflow.errors import InputFileError
from orbiflow.jobs.run import Sink
from orbiflow.jobs.wording import counted
from orbiflow.runtime import Note

FEW_ROWS = 10
"""Fewer may all be within 2 pi degrees without a word."""

DIRECTIONS = (2, 3)
"""Columns of directions: latitude and longitude, or a vector."""


def model_at(path: Path) -> tuple[SymmetricDensity, dict[str, Any]]:
    """The density in a file or in the folder of a fit, and what was saved with it.

    Raises:
        InputFileError: if there is none, or it cannot be read.
    """
    file = path / MODEL if path.is_dir() else path
    if not file.exists():
        missing = f"there is no {MODEL} in it" if path.is_dir() else "there is no such folder"
        raise InputFileError(
            f"cannot read {path}: {missing}; give the folder that `orbiflow density fit` wrote"
        )
    return read_density(file)


def check_fits(data: Path, table: Table, space: Space, extra: dict[str, Any], tell: Sink) -> None:
    """Nothing, for a table that may be of the model; warns of angles that seem to be in another unit.

    Args:
        extra: saved with the model.

    Raises:
        InputFileError: for another number of columns.
    """
    wanted: list[str] = list(extra.get("columns") or space.columns)
    # directions are known by their number of columns
    widths = DIRECTIONS if space.is_round else (len(space.columns),)
    if len(table.columns) not in widths:
        raise InputFileError(
            f"{data}: {counted(len(table.columns), 'column')} ({', '.join(table.columns)}) cannot be "
            f"those of the model, which was fitted to {len(wanted)} ({', '.join(wanted)}): say with "
            "--columns which they are, in this order"
        )
    warning = unit_warning(space, table.values, table.columns)
    if warning:
        tell(Note(f"WARNING: {data}: {warning}"))


def unit_warning(space: Space, values: Array, columns: Sequence[str]) -> str | None:
    """What makes one doubt that angles (N, k) are in the model's unit; None where nothing does."""
    most = np.nanmax(np.abs(values), axis=0, initial=0.0)
    beyond = float(most.max()) > 2 * math.pi + 1e-9
    if space.unit == "radians" and beyond:
        return (
            f"column {columns[int(most.argmax())]!r} has {most.max():g}, beyond 2 pi, and the model's "
            "angles are in radians: if these are degrees, convert them"
        )
    if space.unit == "degrees" and not beyond and len(values) >= FEW_ROWS:
        return (
            "all values are within 2 pi, and the model's angles are in degrees: if these are radians, "
            "convert them"
        )
    return None
