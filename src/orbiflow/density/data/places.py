"""What makes one doubt latitudes and longitudes: radians, hours, the south and the west."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from orbiflow.arrays import Array
from orbiflow.density.data.doubts import FEW_ROWS, Doubt
from orbiflow.density.data.names import words_of
from orbiflow.density.data.units import TURN_TOLERANCE
from orbiflow.errors import SettingError, literal

FAR_FROM_NULL = 1.0
"""Degrees from latitude 0, longitude 0 within which there are no other places where these are a gap."""

FULL_SHARE_OF_TURN = 0.75
"""Share of a turn of radians that values fill where they seem to be radians."""


def place_doubts(space: str, values: Array, names: Sequence[str], unit: str | None) -> list[Doubt]:
    """Return doubts about latitudes and longitudes (N, 2) in degrees; refuse radians."""
    known = values[np.isfinite(values).all(axis=1)]
    if len(known) < FEW_ROWS:
        return []
    lat, lon = known.T
    doubts = _null_island(known, names) if space == "sphere" else []
    small = unit is None and _is_small(lat, lon)
    if small and float(np.ptp(lon)) > FULL_SHARE_OF_TURN * 2 * math.pi:
        raise SettingError(
            literal(
                f"latitudes ({names[0]}) are within pi/2 and longitudes ({names[1]}) fill 2 pi: they "
                f"are radians, it seems, and the {space} takes degrees; convert them (numpy.degrees), "
            )
            + "or give {unit} degrees if they are degrees"
        )
    if small:
        text = (
            "all latitudes are within pi/2 and all longitudes within 2 pi, and they were read as "
            "degrees: if they are radians, convert them; if not, give the unit degrees"
        )
        doubts.append(Doubt(text, True))
    for name, column, word in ((names[0], lat, "south"), (names[1], lon, "west")):
        if {word, word[0]}.intersection(words_of(name)) and bool((column >= 0).all()):
            text = f"{name!r} seems to count to the {word}, by its name: if so, make it negative"
            doubts.append(Doubt(text, True))
    is_ascension = bool({"ra", "raj", "rektaszension"}.intersection(words_of(names[1])))
    hours = is_ascension and bool(((lon >= 0) & (lon < 24)).all())
    if hours and (np.ptp(lon) > 20 or (np.ptp(lon) > 12 and np.ptp(lat) > 40)):
        text = f"{names[1]!r} is between 0 and 24: if it is in hours, multiply it by 15"
        doubts.append(Doubt(text, True))
    return doubts


def _null_island(known: Array, names: Sequence[str]) -> list[Doubt]:
    """Return a doubt if places (N, 2) far from latitude 0, longitude 0 have it again and again."""
    here = (known == 0).all(axis=1)
    rows, others = int(here.sum()), known[~here]
    if rows < 2 or not len(others) or float(np.abs(others).max(axis=1).min()) < FAR_FROM_NULL:
        return []
    if rows <= int(np.unique(others, axis=0, return_counts=True)[1].max()):
        return []
    text = (
        f"{names[0]} and {names[1]} are both exactly 0 in {rows} rows, far from all others: if that "
        "stands for a missing place, leave these rows out"
    )
    return [Doubt(text, True)]


def _is_small(lat: Array, lon: Array) -> bool:
    """Return whether latitudes and longitudes (N,) may be radians."""
    low, high = float(lon.min()), float(lon.max())
    around = high - low <= 2 * math.pi + TURN_TOLERANCE and max(-low, high) <= 2 * math.pi
    return around and float(np.abs(lat).max()) <= math.pi / 2 + TURN_TOLERANCE
