"""Units of angles, and the spaces whose data have one; no numerical library is imported here."""

from __future__ import annotations

import math
from typing import Literal, get_args

from orbiflow.density.data.columns import ANGULAR, ROTATIONS, VECTORS
from orbiflow.errors import SettingError, literal

Unit = Literal["radians", "degrees", "turns"]
TURNS: dict[str, float] = {"radians": 2 * math.pi, "degrees": 360.0, "turns": 1.0}

TURN_TOLERANCE = 1e-4
"""Share by which rounding may take an angle beyond a turn: 6.2832 is 2 pi."""


def is_angular(space: str, columns: int, form: str | None = None) -> bool:
    """Return whether data of so many columns are angles, which have a unit.

    `form` says how rotations are written: Rodrigues' vectors are no angles.
    """
    return space in ANGULAR or (space in ROTATIONS and columns == 3 and form != "rodrigues")


def check_unit(space: str, unit: str | None) -> None:
    """Refuse a unit that there is not, and one of data that are not angles.

    >>> check_unit("sphere", "radians")
    Traceback (most recent call last):
    ...
    orbiflow.errors.SettingError: unit radians applies only to angles on the torus and the Klein \
bottle: latitude and longitude are degrees; convert them, or give unit vectors x,y,z
    """
    if unit is not None and unit not in get_args(Unit):
        raise SettingError(f"{{unit}} must be degrees, radians or turns, got {literal(repr(unit))}")
    if unit is not None and space not in (*ANGULAR, *ROTATIONS, *VECTORS):
        raise SettingError(
            "{unit} applies only to angles: points of a quotient are in the unit of its cell; leave it "
            "out"
        )
    if space in VECTORS and unit in ("radians", "turns"):
        raise SettingError(
            f"{{unit}} {unit} applies only to angles on the torus and the Klein bottle: latitude and "
            "longitude are degrees; convert them, or give unit vectors x,y,z"
        )
