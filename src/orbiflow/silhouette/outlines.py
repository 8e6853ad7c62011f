"""What a silhouette's outline must satisfy, and how one is taken from a shapely geometry."""

import re

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from orbiflow.arguments import numbers
from orbiflow.errors import OrbiflowError
from orbiflow.geometry import polygons_in, signed_area

MAX_VERTICES = 100_000
MAX_COORDINATE = 1e12
# Below these a shape has no digits left: relative to its distance from the origin, and absolute.
MIN_RELATIVE_SIZE = 1e-9
MIN_SIZE = 1e-100
# Relative to the square of the longer side of the bounding box.
MIN_RELATIVE_AREA = 1e-9
# Of the box's longer side: a polygon that is simple by less would cross itself when it is rescaled.
CLEARANCE_DIGITS = 12

_POSITION = re.compile(r"\[(\S+) (\S+)\]")


def clean_ring(
    points: ArrayLike, where: str, error: type[OrbiflowError] = OrbiflowError
) -> tuple[NDArray[np.float64], list[str]]:
    """Check that `points` (N, 2) bound a region, and drop repeated vertices.

    Returns the ring and a note, in plain words, of each thing that was dropped. `where` opens each
    message (a file name, say).

    Raises `error` when a coordinate is not a finite number, when fewer than 3 or more than 100,000
    vertices are given, when no area is enclosed, or when the polygon crosses or touches itself.

    >>> ring, notes = clean_ring([[0, 0], [1, 0], [1, 0], [0, 1], [0, 0]], "example")
    >>> ring.tolist(), notes
    ([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], ['dropped 1 repeated vertex'])
    """
    ring = _as_points(points, where, error)
    _check_coordinates(ring, where, error)
    if len(ring) > 1 and np.array_equal(ring[0], ring[-1]):
        ring = ring[:-1]
    kept = ring[(ring != np.roll(ring, 1, axis=0)).any(axis=1)]
    dropped = len(ring) - len(kept)
    notes = [f"dropped {dropped} repeated vert{'ex' if dropped == 1 else 'ices'}"] * (dropped > 0)
    if len(kept) < 3:
        raise error(
            f"{where}: a polygon needs at least 3 distinct vertices, this one has {len(kept)}"
        )
    _check_region(kept, where, error)
    return kept, notes


def _as_points(points: ArrayLike, where: str, error: type[OrbiflowError]) -> NDArray[np.float64]:
    try:
        ring: NDArray[np.float64] = np.zeros(0)
        if np.ndim(points):
            ring = numbers(points, where, (...,), finite=False)
    except (TypeError, ValueError) as exc:
        raise error(
            f"{where}: the vertices are not numbers in pairs; give them as [[x, y], ...]"
        ) from exc
    if ring.ndim != 2 or ring.shape[1] != 2:
        raise error(f"{where}: vertices must have shape (N, 2), got {ring.shape}")
    if len(ring) > MAX_VERTICES:
        raise error(
            f"{where}: {len(ring)} vertices, at most {MAX_VERTICES} are read; simplify the outline"
        )
    return ring


def _check_coordinates(ring: NDArray[np.float64], where: str, error: type[OrbiflowError]) -> None:
    bad = np.flatnonzero(~np.isfinite(ring).all(axis=1))
    if bad.size:
        raise error(
            f"{where}: vertex {bad[0]} (counted from 0) is {_pair(ring[bad[0]])}; "
            "every coordinate must be a finite number"
        )
    far = np.flatnonzero((np.abs(ring) > MAX_COORDINATE).any(axis=1))
    if far.size:
        raise error(
            f"{where}: vertex {far[0]} (counted from 0) is {_pair(ring[far[0]])}; coordinates "
            f"beyond {MAX_COORDINATE:g} are not read, rescale the outline"
        )


def _check_region(ring: NDArray[np.float64], where: str, error: type[OrbiflowError]) -> None:
    low, high = ring.min(axis=0), ring.max(axis=0)
    size = float((high - low).max())
    if size < max(MIN_RELATIVE_SIZE * float(np.abs(ring).max()), MIN_SIZE):
        raise error(
            f"{where}: the polygon has no size: its {len(ring)} vertices all lie within {size:.3g} "
            f"of {_pair(low)}; move it nearer the origin or enlarge it"
        )
    # In units of the box, so that neither a huge nor a tiny shape strains the predicates.
    local: NDArray[np.float64] = (ring - low) / size
    polygon = Polygon(np.round(local, CLEARANCE_DIGITS))
    if polygon.convex_hull.area < MIN_RELATIVE_AREA:
        raise error(f"{where}: the polygon encloses no area, its vertices all lie on one line")
    if not polygon.is_valid:
        position = _POSITION.search(shapely.is_valid_reason(polygon))
        at = low if position is None else low + size * np.array(position.groups(), dtype=float)
        raise error(
            f"{where}: the polygon crosses or touches itself near {_pair(at)}; "
            "an outline must be a simple closed curve"
        )
    if abs(signed_area(local)) < MIN_RELATIVE_AREA:
        raise error(f"{where}: the polygon encloses no area; check its vertices")


def _pair(point: NDArray[np.float64]) -> str:
    return f"({point[0]:.6g}, {point[1]:.6g})"


def percent(share: float) -> str:
    """`share` (0 to 1) in words, never rounded to none or all of it.

    >>> percent(0.9213), percent(0.0002), percent(0.9999)
    ('92.1%', 'under 0.1%', 'over 99.9%')
    """
    if 0 < share < 0.001:
        return "under 0.1%"
    return "over 99.9%" if 0.999 < share < 1 else f"{share:.1%}"


def filled(polygon: Polygon) -> Polygon:
    """`polygon` without its holes."""
    return Polygon(polygon.exterior)


def simplified(polygon: Polygon, tolerance: float) -> Polygon:
    """`polygon` with fewer vertices, its boundary moved by at most `tolerance`; may be invalid."""
    parts = polygons_in(polygon.simplify(tolerance))
    return max(parts, key=lambda part: part.area, default=Polygon())


def outer_ring(polygon: Polygon) -> NDArray[np.float64]:
    """The exterior of `polygon` as a ring (N, 2)."""
    return np.asarray(polygon.exterior.coords, dtype=np.float64)[:-1, :2].copy()


def outer_outline(geometry: BaseGeometry) -> tuple[Polygon, list[str]]:
    """The largest component of `geometry`, its holes filled, with notes of what was left out.

    Components are compared by their area with holes filled; a component that lies in another's
    hole goes with that hole. `geometry` must be valid and hold at least one polygon.

    >>> from shapely.geometry import MultiPolygon, box
    >>> shape, notes = outer_outline(MultiPolygon([box(0, 0, 3, 3), box(5, 5, 6, 6)]))
    >>> shape.area, notes
    (9.0, ['kept the largest of 2 components (90.0% of the filled area)'])
    """
    components = polygons_in(geometry)
    solid = polygons_in(shapely.unary_union([filled(part) for part in components]))
    shape = filled(max(solid, key=lambda part: part.area))
    notes: list[str] = []
    if len(solid) > 1:
        share = shape.area / sum(part.area for part in solid)
        notes.append(
            f"kept the largest of {len(solid)} components ({percent(share)} of the filled area)"
        )
    own = shapely.intersection(geometry, shape)
    n_holes = sum(len(part.interiors) for part in polygons_in(own))
    if n_holes:
        share = 1 - own.area / shape.area
        notes.append(f"filled {n_holes} hole{'s' * (n_holes > 1)} ({percent(share)} of the area)")
    return shape, notes
