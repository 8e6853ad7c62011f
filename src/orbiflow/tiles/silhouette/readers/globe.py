"""Outlines on the globe, in degrees: longitudes for x and latitudes for y."""

import numpy as np
from shapely import Polygon

from orbiflow.arrays import Array
from orbiflow.errors import InputFileError
from orbiflow.tiles.silhouette.readers.reading import Source

MAX_STEP = 90.0  # degrees of longitude: what crosses the date line has no longer step across it
STRETCHED = 1.1  # more than so much wider than on the ground, longitudes are said to be as they are
MERIDIAN = "joined the shape where its longitudes jump by 360 degrees"
_EXCHANGED = (
    "exchanged latitudes and longitudes: all that should be latitudes lie beyond 90 degrees"
)
_BEYOND = (
    "took the numbers for x and y as they are, although some beyond 90 are no latitudes; if the first "
    "of each two is one, exchange them"
)
_MAY_CROSS = (
    "took the numbers for x and y as they are; if they are longitudes and latitudes of a shape across "
    "the date line, save it as GeoJSON, or name the columns lon and lat"
)


def on_map(path: Source, points: Array) -> tuple[Array, list[str]]:
    """Return a ring (N, 2) of longitudes and latitudes in that order, without jumps at the date line.

    And notes of what was done. Raises `InputFileError` for a ring around a pole.
    """
    notes: list[str] = []
    first, second = abs(points).T
    if first.max(initial=0) <= 90 < second.max(initial=0) <= 180:
        are_exchanged = second.min() > 90
        points = points[:, ::-1] if are_exchanged else points
        notes = [_EXCHANGED if are_exchanged else _BEYOND]
    unwrapped, joined = _unwrapped(path, points)
    return unwrapped, [*notes, *joined]


def may_be_joined(points: Array) -> list[str]:
    """Return a note where numbers that nobody calls degrees jump as they would at the date line."""
    if not len(points) or not is_on_globe(points) or abs(points[:, 0]).max() > 180:
        return []
    steps = abs(np.diff(np.append(points[:, 0], points[0, 0])))
    return [_MAY_CROSS] if _are_short(steps[steps > 180]) and (steps > 180).any() else []


def is_on_globe(points: Array) -> bool:
    """Whether all points (N, 2) may be longitudes and latitudes."""
    return bool((abs(points[:, 0]) <= 360).all() and (abs(points[:, 1]) <= 90).all())


def _are_short(jumps: Array) -> bool:
    """Whether jumps of longitude are short steps across the date line."""
    return bool((360 - jumps < MAX_STEP).all())


def _unwrapped(path: Source, points: Array) -> tuple[Array, list[str]]:
    """Return a ring with longitudes that do not jump at the date line, and a note if they did."""
    steps = np.diff(np.append(points[:, 0], points[0, 0]))
    jumps = abs(steps) > 180
    if not jumps.any() or not is_on_globe(points):
        return points, []
    if not _are_short(abs(steps[jumps])) and Polygon(points).is_valid:
        return points, []  # a large shape whose sides are that long
    if np.sum(np.round(steps / 360)):
        raise InputFileError(
            f"{path}: the ring goes around a pole or all around the globe: project it to a map first"
        )
    unwrapped = points.copy()
    unwrapped[:, 0] = np.unwrap(points[:, 0], period=360.0)
    return unwrapped, [MERIDIAN]


def stretched(ring: Array) -> tuple[str, ...]:
    """Return a note where degrees of longitude are much shorter than those of latitude."""
    if not is_on_globe(ring) or np.ptp(ring[:, 0]) > 180:
        return ()
    latitude = float(ring[:, 1].min() + ring[:, 1].max()) / 2
    wide = 1 / max(np.cos(np.radians(latitude)), 1e-3)
    if wide < STRETCHED:
        return ()
    return (
        f"took longitudes and latitudes for x and y as they are: at latitude {latitude:.0f} the shape "
        f"is {wide:.2g} times as wide as on the ground; project it first if that matters",
    )


def at_date_line(rings: list[Array]) -> tuple[list[Array], list[str]]:
    """Return rings put together that were cut along the date line, as GeoJSON wants it, and a note."""
    if not all(is_on_globe(ring) for ring in rings):
        return rings, []
    east = any(np.isclose(ring[:, 0].max(), 180, atol=1e-6) for ring in rings)
    west = [np.isclose(ring[:, 0].min(), -180, atol=1e-6) for ring in rings]
    if not east or not any(west):
        return rings, []
    shifts = [np.array([360.0 * is_west, 0.0]) for is_west in west]
    return [ring + shift for ring, shift in zip(rings, shifts, strict=True)], [MERIDIAN]
