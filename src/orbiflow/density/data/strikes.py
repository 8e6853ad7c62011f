"""Strikes of planes as the directions in which they dip, by the right-hand rule."""

from __future__ import annotations

import warnings
from collections.abc import Collection, Sequence
from typing import Any

import numpy as np

from orbiflow.arrays import Array
from orbiflow.density.data.column_names import words_of
from orbiflow.density.data.columns import DIRECTIONS, arrangements
from orbiflow.density.data.frames import Data, as_data
from orbiflow.errors import DataWarning

DIP_DIRECTION = "dip_direction"
"""What the column of a strike is called once it holds directions of dip."""

TURN_DEGREES = 360.0


def strike_beside_dip(names: Sequence[str]) -> int | None:
    """Return the column, from 0, of a strike if the columns are a dip and a strike.

    >>> strike_beside_dip(["dip", "strike (deg)"]), strike_beside_dip(["dip", "dipdir"])
    (1, None)
    """
    split = [{"dip", "strike"}.intersection(words_of(name)) for name in names]
    strike = {"strike"}
    return split.index(strike) if split in ([{"dip"}, strike], [strike, {"dip"}]) else None


def dip_direction_among(wanted: str, names: Sequence[str]) -> str | None:
    """Return the column that has the direction of dip, or else the strike, if that is `wanted`.

    >>> dip_direction_among("dip_direction", ["dip", "DipDir"])
    'DipDir'
    >>> dip_direction_among("dipdir", ["strike", "dip"]), dip_direction_among("lat", ["strike", "dip"])
    ('strike', None)
    """
    lower = {name.casefold() for name in names}
    if words_of(wanted) != ["dipdir"] or wanted.casefold() in lower:
        return None
    for word in ("dipdir", "strike"):
        found = [name for name in names if word in words_of(name)]
        if found:
            return found[0] if len(found) == 1 else None
    return None


def dip_directions(strikes: Array) -> Array:
    """Return directions of dip (N,) in degrees; what is beyond a turn stays and can be refused.

    >>> dip_directions(np.array([0.0, 300.0, 999.0])).tolist()
    [90.0, 30.0, 999.0]
    """
    return np.where(
        abs(strikes) > TURN_DEGREES, strikes, (strikes + TURN_DEGREES / 4) % TURN_DEGREES
    )


def strike_note(name: str) -> str:
    """Return what was done with a column of strikes, in words."""
    return (
        f"took {name} by the right-hand rule, as the strike of planes that dip to its right: the "
        "direction of dip is the strike + 90"
    )


def data_of(
    space: str, data: Any, what: str = "data", *, in_order: bool = True, stacklevel: int = 3
) -> Data:
    """Return the data of a space and the names of their columns, strikes as directions of dip.

    Columns are put `in_order` as `in_space_order` does.

    Warns:
        DataWarning: Of strikes and another order, at so many calls from here.
    """
    found = as_data(data, what)
    strike = strike_beside_dip(found.names or ()) if space in DIRECTIONS else None
    if strike is not None and found.names is not None:
        warnings.warn(strike_note(found.names[strike]), DataWarning, stacklevel=stacklevel)
        values = found.values.copy()
        values[:, strike] = dip_directions(values[:, strike])
        names = (*found.names[:strike], DIP_DIRECTION, *found.names[strike + 1 :])
        found = Data(values, names)
    return in_space_order(space, found, stacklevel=stacklevel + 1) if in_order else found


def in_space_order(
    space: str, data: Data, beside: Collection[str | int] = (), *, stacklevel: int = 3
) -> Data:
    """Return a frame's data with the columns in a space's order, if names say which they are.

    Columns `beside` those of the space, by names or numbers from 0, stay in their places.

    Warns:
        DataWarning: Of another order than the frame's, at so many calls from here.
    """
    if data.names is None:
        return data
    others = {one.casefold() if isinstance(one, str) else one for one in beside}
    own = [k for k, name in enumerate(data.names) if not {k, name.casefold()} & others]
    ways = [
        one
        for one in arrangements(space, [data.names[k] for k in own])
        if len(one.columns) == len(own)
    ]
    order = list(range(len(data.names)))
    for place, k in zip(own, ways[0].columns if ways else range(len(own)), strict=True):
        order[place] = own[k]
    if order == sorted(order):
        return data
    names = tuple(data.names[k] for k in order)
    text = f"took {', '.join(names)} as {ways[0].words}: results have this order, too"
    warnings.warn(text, DataWarning, stacklevel=stacklevel)
    return Data(data.values[:, order], names)
