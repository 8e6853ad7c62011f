"""Saved densities, and the tables that fit them."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from orbiflow.arrays import Array
from orbiflow.density.models import Density, read_density
from orbiflow.density.pictures import MODEL
from orbiflow.density.spaces import Space
from orbiflow.density.tables import Table, TableError, TableSettings, column_names, listing
from orbiflow.errors import InputFileError, literal
from orbiflow.runtime import Note, Sink

FEW_ROWS = 10
"""Fewer may all be within 2 pi degrees without a word."""

DIRECTIONS = (2, 3)
"""Columns of directions: latitude and longitude, or a vector."""


def model_at(path: Path) -> tuple[Density, dict[str, Any]]:
    """Return the density in a file or in the folder of a fit, and what was saved with it."""
    file = path / MODEL if path.is_dir() else path
    if not file.exists():
        missing = f"there is no {MODEL} in it" if path.is_dir() else "there is no such folder"
        raise InputFileError(
            f"cannot read {path}: {missing}; give the folder that `orbiflow density fit` wrote"
        )
    return read_density(file)


def names_of(density: Density, extra: dict[str, Any]) -> list[str]:
    """Return what the columns of a density's data are called."""
    names = [str(name) for name in extra.get("columns") or ()]
    return names if len(names) == len(density.space.columns) else list(density.space.columns)


def with_columns_of(
    settings: TableSettings, data: Path, extra: dict[str, Any], tell: Sink
) -> TableSettings:
    """Return the settings with the columns of the fit, where none were chosen.

    A file that names its columns must have those of the fit; of one without names all are taken, which
    is told.
    """
    names: tuple[str, ...] = tuple(extra.get("columns") or ())
    unnamed = all(re.fullmatch(r"column\d+", name) for name in names)
    if settings.columns is not None or unnamed:
        return settings
    own = column_names(data, wanted=names, has_header=settings.header)
    if own is None:
        tell(Note(f"{data} has no header: its columns were taken for {', '.join(names)}"))
        return settings
    known = {name.casefold() for name in own}
    missing = [name for name in names if name.casefold() not in known]
    if missing:
        some = f"no {', '.join(missing)} among " if len(missing) < len(names) else ""
        raise TableError(
            literal(
                f"{data}: the model was fitted to {', '.join(names)}, and the file has {some}"
                f"{listing(own)}"
            )
            + ": say with {columns} which they are, in this order"
        )
    return settings.replace(columns=names)


def check_fits(data: Path, table: Table, space: Space, extra: dict[str, Any], tell: Sink) -> None:
    """Check that a table can be of a model, and warn of angles that seem to be in another unit."""
    wanted: list[str] = list(extra.get("columns") or space.columns)
    # directions are known by their number of columns
    widths = DIRECTIONS if space.is_round else (len(space.columns),)
    if len(table.columns) not in widths:
        count = len(table.columns)
        raise TableError(
            literal(
                f"{data}: {count} column{'s' * (count != 1)} ({', '.join(table.columns)}) cannot be "
                f"those of the model, which was fitted to {len(wanted)} ({', '.join(wanted)})"
            )
            + ": say with {columns} which they are, in this order"
        )
    warning = unit_warning(space, table.values, table.columns)
    if warning:
        tell(Note(f"WARNING: {data}: {warning}"))


def unit_warning(space: Space, values: Array, columns: Sequence[str]) -> str | None:
    """Return what makes one doubt that angles (N, k) are in the model's unit, or None."""
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
