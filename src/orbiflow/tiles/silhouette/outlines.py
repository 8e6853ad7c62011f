"""Outlines of silhouettes: checking, simplifying and sampling them."""

import re
from typing import NamedTuple

import numpy as np
import shapely
import shapely.ops
from numpy.typing import ArrayLike
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from orbiflow.arrays import Array
from orbiflow.errors import OrbiflowError, SettingError
from orbiflow.settings import as_array
from orbiflow.tiles.geometry import (
    arc_lengths,
    kept_vertices,
    points_along,
    polygons_in,
    resampled,
    ring_length,
    signed_area,
)

MAX_VERTICES = 100_000
MAX_COORDINATE = 1e12
MAX_HALVINGS = 10  # of a tolerance that makes an outline cross itself
# Below these a shape has no digits left: relative to its distance from the origin, and absolute.
MIN_RELATIVE_SIZE = 1e-9
MIN_SIZE = 1e-100
MIN_RELATIVE_AREA = 1e-9  # Relative to the square of the longer side of the bounding box.
MAX_THREAD_WIDTH = 0.06  # greatest width, of the length; animals have at least 0.14
MIN_PART_SHARE = 1e-3  # of the largest part's area: what is smaller is a speck and no part
# Of the box's longer side: a polygon that is simple by less would cross itself when it is rescaled.
CLEARANCE_DIGITS = 12
DISC_OVERREACH = 1.005  # of the radius: without it, slivers are left along the outline
_POSITION = re.compile(r"\[(\S+) (\S+)\]")


def clean_ring(
    points: ArrayLike, where: str, error: type[OrbiflowError] = OrbiflowError
) -> tuple[Array, list[str]]:
    """Return a ring (N, 2) without repeated vertices, which bounds a region, and what was dropped.

    Raises `error`, in messages that begin with `where`, for what is no simple polygon with an area.
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


def _as_points(points: ArrayLike, where: str, error: type[OrbiflowError]) -> Array:
    try:
        ring = as_array(points, where, ("N", 2), finite=False)
    except (TypeError, ValueError) as exc:
        what = "the vertices are not numbers in pairs, of shape (N, 2)"
        raise error(f"{where}: {what}; give them as [[x, y], ...]") from exc
    if len(ring) > MAX_VERTICES:
        raise error(
            f"{where}: {len(ring)} vertices, at most {MAX_VERTICES} can be read; simplify the outline"
        )
    return ring


def _check_coordinates(ring: Array, where: str, error: type[OrbiflowError]) -> None:
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
            f"beyond {MAX_COORDINATE:g} cannot be read, rescale the outline"
        )


def _check_region(ring: Array, where: str, error: type[OrbiflowError]) -> None:
    low, high = ring.min(axis=0), ring.max(axis=0)
    size = float((high - low).max())
    if size < max(MIN_RELATIVE_SIZE * float(np.abs(ring).max()), MIN_SIZE):
        raise error(
            f"{where}: the polygon has no size: its {len(ring)} vertices all lie within {size:.3g} "
            f"of {_pair(low)}; move it nearer the origin or enlarge it"
        )
    # in units of the box, because the predicates lose accuracy for huge and tiny shapes
    local: Array = (ring - low) / size
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


def _pair(point: Array) -> str:
    return f"({point[0]:.6g}, {point[1]:.6g})"


def percent(share: float) -> str:
    """Return `share` (0 to 1) as text, never rounded to 0% or 100%."""
    if 0 < share < 0.001:
        return "under 0.1%"
    return "over 99.9%" if 0.999 < share < 1 else f"{share:.1%}"


def outside(what: str, x: float, y: float, silhouette: Polygon) -> OrbiflowError:
    """Return the error that says that `what`, such as a pin, lies outside a silhouette."""
    left, top, right, bottom = silhouette.bounds
    well_inside = silhouette.buffer(-0.01 * max(right - left, bottom - top))
    where = silhouette.representative_point() if well_inside.is_empty else well_inside
    near = shapely.ops.nearest_points(where, shapely.Point(x, y))[0]
    return OrbiflowError(
        f"{what} at {x:g},{y:g} lies outside the silhouette, which spans x from {left:.4g} to "
        f"{right:.4g} and y from {top:.4g} to {bottom:.4g}; the nearest place inside is "
        f"{near.x:.4g},{near.y:.4g}"
    )


def filled(polygon: Polygon) -> Polygon:
    """Return `polygon` without its holes."""
    return Polygon(polygon.exterior)


def simplified(polygon: Polygon, tolerance: float) -> Polygon:
    """Return `polygon` with fewer vertices, moved by at most `tolerance`; may be invalid."""
    parts = polygons_in(polygon.simplify(tolerance))
    return max(parts, key=lambda part: part.area, default=Polygon())


def thinned(polygon: Polygon, tolerance: float, most: int = MAX_VERTICES) -> tuple[Polygon, float]:
    """Return a polygon with at most so many vertices, still simple, and how far it may have moved."""
    simple = simplified(polygon, tolerance)
    while len(simple.exterior.coords) > most:
        tolerance *= 1.5
        simple = simplified(polygon, tolerance)
    for _ in range(MAX_HALVINGS):
        if simple.is_valid and simple.area > 0:
            return simple, tolerance
        tolerance /= 2
        simple = simplified(polygon, tolerance)
    return polygon, 0.0


def is_thread(shape: Polygon, length: float) -> bool:
    """Return whether a shape is no more than a line, where what is drawn is so long."""
    return shape.buffer(-MAX_THREAD_WIDTH / 2 * length).is_empty


def rounded(shape: Polygon, seen: BaseGeometry, width: float) -> Polygon:
    """Return a shape, filled, without gaps and then without limbs narrower than `width`.

    Gaps between it and other parts of what was `seen`, which covers it, are closed, too.
    """

    def own(geometry: BaseGeometry) -> Polygon:
        parts = polygons_in(geometry)
        return max(parts, key=lambda part: part.intersection(shape).area, default=Polygon())

    solid = filled(own(_without_gaps(seen, width)))
    return simplified(own(opened(solid, width)), width / 50)


def closed(geometry: BaseGeometry, width: float) -> Polygon:
    """Return the largest part, filled, without gaps narrower than `width` (a morphological closing)."""
    parts = polygons_in(_without_gaps(geometry, width))
    return filled(max(parts, key=lambda part: filled(part).area, default=Polygon()))


def _without_gaps(geometry: BaseGeometry, width: float) -> BaseGeometry:
    return geometry.buffer(width / 2).buffer(-width / 2)


def opened(geometry: BaseGeometry, width: float, overreach: float = 1.0) -> BaseGeometry:
    """Return all that discs of diameter `width` inside a geometry cover (a morphological opening).

    Discs are polygons. An `overreach` of `DISC_OVERREACH` times their radius makes up for that, where
    what they leave is looked at.
    """
    return geometry.buffer(-width / 2).buffer(width / 2 * overreach)


def outer_ring(polygon: Polygon) -> Array:
    """Return the exterior of `polygon` as a ring (N, 2)."""
    return np.asarray(polygon.exterior.coords, dtype=np.float64)[:-1, :2].copy()


def outer_outline(geometry: BaseGeometry) -> tuple[Polygon, list[str]]:
    """Return the largest component of a valid geometry, filled, and notes of what was left out.

    Components are compared by their area with holes filled; one in another's hole goes with that
    hole.
    """
    solid = _solids(geometry)
    shape = filled(max(solid, key=lambda part: part.area))
    solid = [part for part in solid if part.area >= MIN_PART_SHARE * shape.area]
    visible = shapely.intersection(geometry, shape)
    holes = sum(len(part.interiors) for part in polygons_in(visible))
    kept = shape.area / sum(part.area for part in solid)
    return shape, left_out(len(solid), kept, holes, 1 - visible.area / shape.area)


def _solids(geometry: BaseGeometry) -> list[Polygon]:
    """Return the components of a geometry with their holes filled."""
    return polygons_in(shapely.unary_union([filled(part) for part in polygons_in(geometry)]))


def still_left_out(shape: Polygon, seen: BaseGeometry) -> list[str]:
    """Return the note on components of what was seen that lie apart from a shape, if any do."""
    areas = [part.area for part in _solids(seen) if not part.intersects(shape)]
    areas = [area for area in areas if area >= MIN_PART_SHARE * shape.area]
    return left_out(1 + len(areas), shape.area / (shape.area + sum(areas)), 0, 0.0)


LEFT_OUT = "kept the largest"  # how the note on components begins


def left_out(components: int, kept: float, holes: int, filled: float) -> list[str]:
    """Return notes that one of these components was kept, and its holes filled, with their shares."""
    notes: list[str] = []
    if components > 1:
        notes.append(f"{LEFT_OUT} of {components} components ({percent(kept)} of the filled area)")
    if holes:
        notes.append(f"filled {holes} hole{'s' * (holes > 1)} ({percent(filled)} of the area)")
    return notes


# the length of an outline of area 1 that is sampled with the fewest points; a disc has 3.5
SHORT_OUTLINE = 8.2
MIN_POINTS, MAX_POINTS = 60, 120
"""The least and the largest number of points for the search."""

# the least height of a corner over the line past it to be kept, in square roots of the area
CORNER_DEPTH = 0.004
# the numbers of points of the tile for each point of the search, in order of trial
FINE_MULTIPLES = (4, 6)
# the number of middle points for each point of the search, a divisor of `FINE_MULTIPLES`
MIDDLE_MULTIPLE = 2


class Samples(NamedTuple):
    """A counter-clockwise outline of area 1, sampled by (n, 2), (2 n, 2) and (k n, 2) points.

    `coarse` ones are evenly spaced, `middle` ones include most of the outline's corners (or are
    `fine` itself), `fine` ones all of them; every k-th of these is near one of `coarse`.
    """

    coarse: Array
    middle: Array
    fine: Array


def sampled(
    ring: Array, phase: float = 0.0, multiples: tuple[int, ...] = FINE_MULTIPLES, step: int = 6
) -> Samples:
    """Sample a counter-clockwise ring (M, 2) of area about 1, more densely if long or rich in corners.

    Points are shifted by `phase` coarse spacings; `multiples` are numbers of fine points for each
    coarse one, in order of trial. The number of coarse points is a multiple of `step`, a divisor of 12.
    Raises `OrbiflowError` if all cross themselves: there are hairs.
    """
    longer = ring_length(ring) / SHORT_OUTLINE
    count = int(np.clip(step * round(MIN_POINTS * longer / step), MIN_POINTS, MAX_POINTS))
    coarse = _simple_coarse(ring, count, phase, step)
    corners = important_vertices(ring, CORNER_DEPTH)
    fine = None
    for multiple in multiples:
        points = with_corners(ring, corners, multiple * len(coarse), phase * multiple)
        if shapely.Polygon(points).is_valid:
            fine = points
            if 2 * len(corners) <= len(points):
                break
    if fine is None:
        raise SettingError(
            "parts of the silhouette are too thin to be followed: draw them thicker, round them off "
            "with {smooth} 0.01, or, if a photograph was read badly, cut it out or try another "
            "{threshold}"
        )
    middle = with_corners(ring, corners, MIDDLE_MULTIPLE * len(coarse), phase * MIDDLE_MULTIPLE)
    if len(fine) % len(middle) or not shapely.Polygon(middle).is_valid:
        middle = fine
    return Samples(coarse, middle, fine)


def _simple_coarse(ring: Array, count: int, phase: float, step: int) -> Array:
    """Resample with as many points as a simple polygon takes; hairs are thickened."""
    polygon = shapely.Polygon(ring)
    for width in (0.0, 0.01, 0.02, 0.04):
        thick = ring
        if width:
            grown = shapely.Polygon(polygon.buffer(width, join_style="mitre").exterior)
            thick = shapely.get_coordinates(grown.exterior)[:-1]
            thick = thick[::-1] if not grown.exterior.is_ccw else thick
            start = int(np.argmin(np.linalg.norm(thick - ring[0], axis=1)))
            thick = np.roll(thick, -start, axis=0)
        more = 3 * count // (2 * step) * step
        for points in dict.fromkeys((count, min(MAX_POINTS, more), MAX_POINTS)):
            coarse = resampled(thick, points, phase)
            if shapely.Polygon(coarse).is_valid:
                return coarse
    raise OrbiflowError("the silhouette is too ragged to be sampled: simplify its outline")


def important_vertices(ring: Array, tolerance: float) -> list[int]:
    """Return indices of the vertices that Douglas and Peucker's simplification keeps."""
    first = int(np.argmax(np.linalg.norm(ring - ring.mean(axis=0), axis=1)))
    turned = np.roll(ring, -first, axis=0)
    half = int(np.argmax(np.linalg.norm(turned - turned[0], axis=1)))
    kept: list[int] = []
    for start, part in ((0, turned[: half + 1]), (half, np.vstack([turned[half:], turned[:1]]))):
        kept += [(start + at + first) % len(ring) for at in kept_vertices(part, tolerance)[:-1]]
    return sorted(kept)


def with_corners(ring: Array, corners: list[int], count: int, phase: float = 0.0) -> Array:
    """Return `count` points (count, 2), nearly evenly spaced, with the nearest one at each corner.

    Of corners that are nearest to the same point, the first is kept.
    """
    along = arc_lengths(ring)
    total = along[-1]
    at: Array = along[corners] / total * count - phase
    index = np.round(at).astype(int)
    order = np.argsort(index % count, kind="stable")
    slots, first = np.unique((index % count)[order], return_index=True)
    shifts = (at - index)[order][first]
    if not len(slots):
        return resampled(ring, count, phase)
    around = np.concatenate([slots - count, slots, slots + count])
    shift = np.interp(np.arange(count), around, np.tile(shifts, 3))
    return points_along(ring, (np.arange(count) + shift + phase) / count * total)
