"""Rings of points as silhouettes: the largest of several, and degrees on the globe without jumps.

On the globe x is the longitude and y the latitude.
"""

# pyright: reportUnknownMemberType=false
# shapely's stubs leave the keyword arguments of its functions of arrays without types.

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import shapely
from shapely import Polygon

from orbiflow.arrays import Array
from orbiflow.errors import InputFileError
from orbiflow.tiles.geometry import polygons_in
from orbiflow.tiles.silhouette.outlines import clean_ring, outer_outline, outer_ring
from orbiflow.tiles.silhouette.readers.reading import Reading, Source

MAX_STEP = 90.0  # degrees of longitude: what crosses the date line has no longer step across it
MAX_WIDENING = 1.1  # more than so much wider than on the ground, a shape gets a note
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


def read_rings(
    path: Source,
    rings: Sequence[Any],
    kind: str,
    *,
    y_down: bool = False,
    degrees: bool | None = None,
    notes: Iterable[str] = (),
) -> Reading:
    """Return the largest part of what rings of pairs make together, with notes.

    Rings that touch or overlap are joined, and one inside another, such as a hole's, goes with it.
    `degrees` says whether the pairs are longitudes and latitudes; None if nobody says what they are.
    Raises `InputFileError` for what is no ring, and for one around a pole.
    """
    every_note, cleaned = [*notes], list[Array]()
    for ring in rings:
        points, more = _placed(path, ring, degrees)
        outline, dropped = clean_ring(points, str(path), InputFileError)
        cleaned.append(outline)
        every_note += [*more, *dropped]
    outline, seen = cleaned[0], None
    if len(cleaned) > 1:
        cleaned, joined = _at_date_line(cleaned) if degrees else (cleaned, [])
        parts = polygons_in(shapely.union_all([Polygon(ring) for ring in cleaned]))
        seen = shapely.MultiPolygon(parts)
        shape, kept = outer_outline(seen)
        outline = outer_ring(shape)
        every_note += [*joined, *kept]
    every_note += _widened(outline) if degrees else []
    return Reading(outline, y_down, kind, None, tuple(dict.fromkeys(every_note)), seen=seen)


def _placed(path: Source, ring: Any, degrees: bool | None) -> tuple[Any, list[str]]:
    """Return a ring (N, 2) without jumps of longitude, and notes of what was done or may be wrong."""
    try:
        points = np.array(ring, dtype=float).reshape(-1, 2)
    except OverflowError:  # a whole number of hundreds of digits
        return ring, []
    if degrees is False or not len(points):
        return points, []
    if degrees:
        points, notes = _in_order(points)
        unwrapped, joined = _unwrapped(path, points)
        return unwrapped, [*notes, *joined]
    jumps = abs(np.diff(points[:, 0], append=points[0, 0]))
    jumps = jumps[jumps > 180]
    may_cross = len(jumps) and _are_short(jumps) and abs(points[:, 0]).max() <= 180
    return points, [_MAY_CROSS] if may_cross and _is_on_globe(points) else []


def _in_order(points: Array) -> tuple[Array, list[str]]:
    """Return points (N, 2) with longitudes first, and a note where they come second."""
    first, second = abs(points).T
    if not first.max() <= 90 < second.max() <= 180:
        return points, []
    return (points[:, ::-1], [_EXCHANGED]) if second.min() > 90 else (points, [_BEYOND])


def _is_on_globe(points: Array) -> bool:
    """Return whether all points (N, 2) may be longitudes and latitudes."""
    return bool((abs(points[:, 0]) <= 360).all() and (abs(points[:, 1]) <= 90).all())


def _are_short(jumps: Array) -> bool:
    """Return whether jumps of longitude are short steps across the date line."""
    return bool((360 - jumps < MAX_STEP).all())


def _unwrapped(path: Source, points: Array) -> tuple[Array, list[str]]:
    """Return a ring with longitudes that do not jump at the date line, and a note if they did."""
    steps = np.diff(points[:, 0], append=points[0, 0])
    jumps = abs(steps) > 180
    if not jumps.any() or not _is_on_globe(points):
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


def _widened(ring: Array) -> list[str]:
    """Return a note where degrees of longitude are much shorter than those of latitude."""
    if not _is_on_globe(ring) or np.ptp(ring[:, 0]) > 180:
        return []
    latitude = float(ring[:, 1].min() + ring[:, 1].max()) / 2
    wide = 1 / max(np.cos(np.radians(latitude)), 1e-3)
    if wide < MAX_WIDENING:
        return []
    return [
        f"took longitudes and latitudes for x and y as they are: at latitude {latitude:.0f} the shape "
        f"is {wide:.2g} times as wide as on the ground; project it first if that matters"
    ]


def _at_date_line(rings: list[Array]) -> tuple[list[Array], list[str]]:
    """Return rings put together that were cut along the date line, as GeoJSON wants it, and a note."""
    if not all(map(_is_on_globe, rings)):
        return rings, []
    east = any(np.isclose(ring[:, 0].max(), 180, atol=1e-6) for ring in rings)
    west = [np.isclose(ring[:, 0].min(), -180, atol=1e-6) for ring in rings]
    if not east or not any(west):
        return rings, []
    shifts = [np.array([360.0 * is_west, 0.0]) for is_west in west]
    return [ring + shift for ring, shift in zip(rings, shifts, strict=True)], [MERIDIAN]
