"""Columns whose names say what they are: latitudes that come before longitudes."""

from __future__ import annotations

import re
from collections.abc import Sequence

from orbiflow.errors import OrbiflowError

NORTH = frozenset({"lat", "latitude", "plunge", "inclination"})
EAST = frozenset({"lon", "long", "lng", "longitude", "trend", "azimuth"})
"""First words of names of the angle towards the pole, and of that around it."""


def check_order(columns: Sequence[str], space: str) -> None:
    """
    Raises:
        OrbiflowError: for a longitude before its latitude: the other place would be taken for it.

    >>> check_order(["lat", "lon"], "sphere")
    >>> check_order(["Longitude (deg)", "Latitude (deg)"], "sphere")
    Traceback (most recent call last):
    ...
    orbiflow.errors.OrbiflowError: the columns are 'Longitude (deg)', 'Latitude (deg)', and the sphere \
takes latitude before longitude: say --columns 'Latitude (deg),Longitude (deg)'
    """
    if len(columns) != 2 or _word(columns[0]) not in EAST or _word(columns[1]) not in NORTH:
        return
    first, second = columns
    raise OrbiflowError(
        f"the columns are {first!r}, {second!r}, and the {space} takes latitude before longitude: "
        f"say --columns '{second},{first}'"
    )


def _word(name: str) -> str:
    found = re.search(r"[^\W\d_]+", name)
    return found[0].casefold() if found else ""
