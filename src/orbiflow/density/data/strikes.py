"""Strikes of planes as the directions in which they dip, by the right-hand rule."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from orbiflow.arrays import Array
from orbiflow.density.data.rows import TableRows
from orbiflow.density.data.strike_names import strike_beside_dip

DIP_DIRECTION = "dip_direction"
"""What the column of a strike is called once it holds directions of dip."""

TURN_DEGREES = 360.0


def dip_directions(strikes: Array) -> Array:
    """Return directions of dip (N,) in degrees; what is beyond a turn stays and can be refused.

    >>> dip_directions(np.array([0.0, 300.0, 999.0])).tolist()
    [90.0, 30.0, 999.0]
    """
    return np.where(
        abs(strikes) > TURN_DEGREES, strikes, (strikes + TURN_DEGREES / 4) % TURN_DEGREES
    )


def with_dip_directions(rows: TableRows) -> tuple[TableRows, str | None]:
    """Return rows whose strike beside a dip became the direction of dip, and a note if so."""
    strike = strike_beside_dip(rows.own_names)
    if strike is None:
        return rows, None
    column = rows.own[strike]
    values = rows.values.copy()
    values[:, column] = dip_directions(values[:, column])
    columns = (*rows.columns[:column], DIP_DIRECTION, *rows.columns[column + 1 :])
    note = (
        f"took {rows.columns[column]} by the right-hand rule, as the strike of planes that dip to its "
        "right: the direction of dip is the strike + 90"
    )
    return replace(rows, values=values, columns=columns), note
