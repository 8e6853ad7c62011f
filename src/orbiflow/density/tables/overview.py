"""What a page shows of a table before anything is fitted: its columns, and what they seem to be."""

from __future__ import annotations

from typing import Any

import numpy as np

from orbiflow.density.data import (
    DataTable,
    Role,
    TableError,
    chosen_arrangement,
    listing,
    proposed_role,
    words_of,
)
from orbiflow.errors import SettingError

AXES = frozenset(["pole", "poles", "axis", "axes", "axial"])
"""Words in names of columns that are lines without an arrow."""

MOST_ANGLES = 7
"""Angles that are chosen ahead: of more, a fit takes long."""


def table_overview(table: DataTable, most: int) -> dict[str, Any]:
    """Return what is seen of the first columns of numbers of a table, and where its rows may live.

    Each has a "name", the "role" that its name says, the number of "missing" values, and its least and
    largest value, "low" and "high". The "guess" says a "space", "columns" and "why".

    Raises `TableError` if there is no column of numbers.
    """
    numbers = [k for k in range(len(table.names)) if table.is_numeric(k)][:most]
    if not numbers:
        raise TableError(f"there is no column of numbers among {listing(table.names)}")
    columns: list[dict[str, Any]] = []
    for k in numbers:
        values = table.numbers(k)
        if (rows := np.flatnonzero(np.isinf(values))).size:
            raise TableError(f"{table.place(int(rows[0]))} of {table.names[k]!r} is infinite")
        finite = values[np.isfinite(values)]
        ends = (float(finite.min()), float(finite.max())) if len(finite) else (None, None)
        role = proposed_role(table.names[k], values, by_size=False)
        columns.append(
            {"name": table.names[k], "role": role, "missing": len(values) - len(finite)}
            | {"low": ends[0], "high": ends[1]}
        )
    return {"columns": columns, "guess": _guess(columns)}


def _guess(columns: list[dict[str, Any]]) -> dict[str, Any]:
    """Return where the rows may live."""
    names = [column["name"] for column in columns]
    angles = [c["name"] for c in columns if Role.of(c["role"]).is_round]
    for space, names_of_space, why in (
        ("sphere", names, "these columns say a direction"),
        ("klein-bottle", angles, "so small picture patches lie on the Klein bottle"),
    ):
        try:
            way = chosen_arrangement(space, names_of_space)
        except SettingError:  # several may be meant
            continue
        if way is None or (space == "klein-bottle" and len(names_of_space) > 2):
            continue
        taken = [names_of_space[k] for k in way.columns]
        if space == "sphere" and (way.is_axial or AXES & set(words_of(" ".join(taken)))):
            space, why = "projective-plane", "a line has two ends, which mean the same"
        return {"space": space, "columns": taken, "why": why}
    if angles:
        return {"space": "torus", "columns": angles[:MOST_ANGLES], "why": "angles, by their names"}
    return {
        "space": None,
        "columns": [],
        "why": "no column says that it is an angle or a direction",
    }
