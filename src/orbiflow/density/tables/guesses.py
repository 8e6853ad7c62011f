"""What columns of a table seem to be, where its rows live, and what columns say of others."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from orbiflow.arrays import Array
from orbiflow.density.data import (
    LATITUDES,
    LONGITUDES,
    TURN_TOLERANCE,
    Pair,
    arrangements,
    codes_among,
    is_angle_named,
    is_count_named,
    is_identifier,
    is_other_quantity,
    pairs_of,
    unit_named,
    words_of,
)
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


MOST_ANGLES = 7
"""Angles that are chosen ahead: of more, a fit takes long."""

AXES = frozenset(["pole", "poles", "axis", "axes", "axial"])
"""Words in names of columns that are lines without an arrow."""

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


def seen_columns(table: Table, most: int) -> tuple[list[Column], Guess]:
    """Return what the first columns of a table seem to be, and where its rows seem to live."""
    shown = [(name, table.values[:, k]) for k, name in enumerate(table.columns[:most])]
    columns = [seen_column(name, values) for name, values in shown]
    guessed = guess(columns, table)
    if guessed.space in ("sphere", "projective-plane") and len(guessed.columns) == 2:
        kinds: dict[str, Seems] = dict(zip(guessed.columns, ("latitude", "longitude"), strict=True))
        columns = [replace(one, seems=kinds.get(one.name, one.seems)) for one in columns]
    return columns, guessed


def seen_column(name: str, values: Array) -> Column:
    """Return what a column (N,) seems to be; a unit in its name goes before its values.

    >>> seen_column("psi", np.array([-170.0, 12.5, 90.0])).seems
    'degrees'
    >>> seen_column("phi_deg", np.array([-5.0, 2.5, 6.0])).seems
    'degrees'
    >>> seen_column("distance", np.array([0.1, 0.2, 0.15])).seems
    'number'
    """
    known = values[~np.isnan(values)]
    low, high = (float(known.min()), float(known.max())) if len(known) else (0.0, 0.0)
    words, unit = set(words_of(name)), unit_named(name)
    most, named = max(-low, high), is_angle_named(name)
    seems: Seems = "number"
    if len(known) and is_identifier(name, known):
        seems = "count"
    elif is_count_named(name) or is_other_quantity(name):
        seems = "number"
    elif words & LATITUDES and most <= 90 * (1 + TURN_TOLERANCE):
        seems = "latitude"
    elif words & LONGITUDES and most <= 360 * (1 + TURN_TOLERANCE):
        seems = "longitude"
    elif len(known) and unit in ("degrees", "radians"):
        seems = "degrees" if unit == "degrees" else "radians"
    elif most <= 2 * math.pi * (1 + TURN_TOLERANCE) and (named or high - low > math.pi):
        seems = "radians"
    elif 2 * math.pi < most <= 360 * (1 + TURN_TOLERANCE) and (named or high - low > 90):
        seems = "degrees"
    return Column(name, seems, len(values) - len(known))


def guess(columns: Sequence[Column], table: Table) -> Guess:
    """Return where the rows of a table seem to live."""
    pair = _place(columns, table.values)
    if pair is not None:
        names = (columns[pair.north].name, columns[pair.east].name)
        if pair.family.is_axial or set(words_of(" ".join(names))) & AXES:
            why = "a pole or an axis is a line: its other end means the same"
            return Guess("projective-plane", names, None, why)
        return Guess("sphere", names, None, "a latitude and a longitude say a direction")
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


def _place(columns: Sequence[Column], values: Array) -> Pair | None:
    """Return the first two columns that are a latitude and a longitude by their names and values."""
    most = np.nanmax(np.abs(values[:, : len(columns)]), axis=0, initial=0) / (1 + TURN_TOLERANCE)
    pairs = pairs_of([column.name for column in columns])
    return next((p for p in pairs if most[p.north] <= 90 and most[p.east] <= 360), None)


def code_notes(table: Table) -> list[str]:
    """Return notes on columns of angles that seem to have codes for missing values."""
    found: list[str] = []
    for name, column in zip(table.columns, table.values.T, strict=True):
        if is_angle_named(name) and (codes := codes_among(column, 360.0)):
            listed = ", ".join(f"{code:.10g}" for code in codes)
            found.append(
                f"{name} has {listed}, which seems to stand for missing values: make these cells empty"
            )
    return found


def _unit_vectors(columns: Sequence[Column], values: Array) -> tuple[str, ...]:
    """Return the first three neighbouring columns that are unit vectors, if there are any."""
    for k in range(len(columns) - 2):
        lengths = np.linalg.norm(values[:, k : k + 3], axis=1)
        if len(lengths) > 1 and bool((abs(lengths - 1) < 1e-3).all()):
            names = tuple(c.name for c in columns[k : k + 3])
            named = arrangements("sphere", names)
            return tuple(names[i] for i in named[0].columns) if named else names
    return ()
