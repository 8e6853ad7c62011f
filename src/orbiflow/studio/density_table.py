"""A table that somebody uploaded: its first rows, what its columns seem to be, where its rows live."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from orbiflow.arrays import Array
from orbiflow.density import Table, TableError, is_identifier, read_table
from orbiflow.errors import OrbiflowError
from orbiflow.studio.density_files import MAX_SHOWN

MAX_ROWS, FIRST = 200_000, 6
"""Rows that a table may have, and rows that are shown of it."""

MOST_ANGLES = 7
"""Angles that are chosen ahead: of more, a fit takes long."""

NORTH = frozenset(["lat", "latitude", "plunge", "inclination"])
EAST = frozenset(["lon", "long", "lng", "longitude", "trend", "azimuth", "declination"])
AXES = frozenset(["pole", "poles", "axis", "axes", "axial", "plunge", "trend"])
ANGLES = frozenset(
    ["phi", "psi", "chi", "omega", "theta", "alpha", "beta", "gamma", "delta", "epsilon", "zeta"]
)
ANGLES |= frozenset(["angle", "direction", "dir", "heading", "bearing", "aspect"])
"""Words in names of columns: angles towards the pole, around it, of lines without an arrow, others."""

MAX_NAME = 200
"""Letters of a column's name."""

Seems = Literal["number", "latitude", "longitude", "degrees", "radians", "count"]


@dataclass(frozen=True)
class Column:
    """A column of numbers: `seems` says what kind of number, `missing` how many rows have none."""

    name: str
    seems: Seems
    missing: int


@dataclass(frozen=True)
class Guess:
    """Where the rows of a table seem to live: the columns that say so, their unit, and why."""

    space: str | None
    columns: tuple[str, ...]
    unit: str | None
    why: str


def table_view(path: Path) -> dict[str, Any]:
    """Return what a page shows of a table before anything is fitted.

    Raises:
        OrbiflowError: If it is no table of numbers, or too large.
    """
    try:
        table = read_table(path, columns=None, width=None, max_rows=MAX_ROWS, keep_missing=True)
    except TableError:
        raise OrbiflowError(
            "this table has no column of numbers, or some are infinite; save it again as CSV, with a "
            "row for each thing and numbers in its columns"
        ) from None
    shown = table.columns[:MAX_SHOWN]
    if max(map(len, shown)) > MAX_NAME:
        raise OrbiflowError(f"the name of a column has over {MAX_NAME} letters; shorten it")
    columns = [seen_column(name, table.values[:, k]) for k, name in enumerate(shown)]
    first = table.values[:FIRST, : len(shown)].tolist()
    return {
        "rows": len(table.values),
        "columns": [asdict(column) for column in columns],
        "more": len(table.columns) - len(shown),
        "first": [[None if math.isnan(v) else float(f"{v:.6g}") for v in row] for row in first],
        "notes": list(table.notes),
        "guess": asdict(guess(columns, table)),
    }


def seen_column(name: str, values: Array) -> Column:
    """Return what a column (N,) seems to be.

    >>> seen_column("psi", np.array([-170.0, 12.5, 90.0])).seems
    'degrees'
    >>> seen_column("distance", np.array([0.1, 0.2, 0.15])).seems
    'number'
    """
    known = values[~np.isnan(values)]
    low, high = (float(known.min()), float(known.max())) if len(known) else (0.0, 0.0)
    words = _words(name)
    most, named = max(-low, high), bool(words & ANGLES)
    seems: Seems = "number"
    if len(known) and is_identifier(name, known):
        seems = "count"
    elif words & NORTH and most <= 90:
        seems = "latitude"
    elif words & EAST and most <= 360:
        seems = "longitude"
    elif most <= 2 * math.pi + 1e-9 and (named or high - low > math.pi):
        seems = "radians"
    elif 2 * math.pi < most <= 360 and (named or high - low > 90):
        seems = "degrees"
    return Column(name, seems, len(values) - len(known))


def guess(columns: Sequence[Column], table: Table) -> Guess:
    """Return where the rows of a table seem to live."""
    by_kind = {
        kind: [c.name for c in columns if c.seems == kind] for kind in ("latitude", "longitude")
    }
    if by_kind["latitude"] and by_kind["longitude"]:
        pair = (by_kind["latitude"][0], by_kind["longitude"][0])
        if _words(" ".join(pair)) & AXES:
            why = "a pole or an axis is a line: its other end means the same"
            return Guess("projective-plane", pair, None, why)
        return Guess("sphere", pair, None, "a latitude and a longitude say a direction")
    vectors = _unit_vectors(columns, table.values)
    if vectors:
        why = "each row of these three has length 1, as directions have"
        return Guess("sphere", vectors, None, why)
    angles = [c for c in columns if c.seems == "degrees"] or [
        c for c in columns if c.seems == "radians"
    ]
    named = {c.name.casefold(): c.name for c in angles}
    if set(named) == {"theta", "phi"}:
        pair = (named["theta"], named["phi"])
        why = "theta and phi are how small picture patches lie on the Klein bottle"
        return Guess("klein-bottle", pair, angles[0].seems, why)
    if angles:
        chosen = tuple(c.name for c in angles[:MOST_ANGLES])
        why = f"{len(chosen)} column{'s' * (len(chosen) > 1)} of angles, in {angles[0].seems}"
        return Guess("torus", chosen, angles[0].seems, why)
    return Guess(None, (), None, "no column looks like an angle or a direction; choose yourself")


def _words(name: str) -> set[str]:
    return {word.casefold() for word in re.findall(r"[^\W\d_]+", name)}


def _unit_vectors(columns: Sequence[Column], values: Array) -> tuple[str, ...]:
    """Return the first three neighbouring columns that are unit vectors, if there are any."""
    for k in range(min(len(columns), MAX_SHOWN) - 2):
        lengths = np.linalg.norm(values[:, k : k + 3], axis=1)
        if len(lengths) > 1 and bool((abs(lengths - 1) < 1e-3).all()):
            return tuple(c.name for c in columns[k : k + 3])
    return ()
