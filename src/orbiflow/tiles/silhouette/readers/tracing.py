"""The outline of the largest shape in a picture, to a fraction of a pixel."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from shapely.affinity import scale as scaled
from shapely.geometry import LineString, Polygon, box
from shapely.geometry.base import BaseGeometry

from orbiflow.arrays import Array
from orbiflow.drawing import level_curves
from orbiflow.errors import Advice, InputFileError, literal
from orbiflow.tiles.geometry import polygons_in, signed_area
from orbiflow.tiles.silhouette.outlines import filled, outer_outline, outer_ring, thinned
from orbiflow.tiles.silhouette.readers.reading import FileContent

MIN_AREA = 30.0  # square pixels
MAX_OUTLINE_VERTICES = 4000
SIMPLIFY_TOLERANCE = 0.15  # pixels
# The steps in a picture of two levels are within this distance of the line that they represent, so they
# are not details of the shape. Small shapes have the finer tolerance for their size.
STEP_TOLERANCE = 0.7  # pixels
STEP_TOLERANCE_OF_SIZE = 0.005  # of the square root of the area
# A shape that is cut off is as wide at the image's border as further in; one that touches it is not.
CUT_OFF_RATIO = 0.8
INNER_SHARE = 0.015  # of the image's longer side
# Components and holes of at most so many pixels, or this share of the shape, are no parts of a drawing.
DUST_PIXELS = 4
DUST_SHARE = 1e-4


@dataclass(frozen=True)
class Level:
    """A picture (H, W) whose shape is where `values` exceed `cut`; `inside` is its usual level."""

    values: Array
    cut: float
    inside: float


def trace(
    path: FileContent, level: Level, *, scale: int, size: tuple[int, int]
) -> tuple[Array, BaseGeometry, list[str]]:
    """Return the outline (N, 2) of the largest shape in image pixels, all that was seen, and notes.

    A pixel of `level` is `scale` pixels of the image wide, and the image is `size` (width, height).
    Pixels of a shape hold together along their sides, not their corners.
    """
    rings, notes = _without_dust(_contours(level))
    largest = max(rings, key=_area)
    height, width = level.values.shape
    page, seen = box(0, 0, width, height), region(rings)
    middles = box(0.5, 0.5, width - 0.5, height - 0.5)  # of all pixels
    if fills_page := Polygon(largest).covers(middles):
        parts = [part for part in polygons_in(seen) if page.boundary.distance(part) > 1]
        if parts:
            notes.append("left out what reaches around the shape at the image's border")
            largest = outer_ring(max(map(filled, parts), key=lambda part: part.area))
            seen, fills_page = shapely.union_all(parts), False
    if fills_page:
        raise InputFileError(
            Advice(
                literal(f"{path}: the shape fills the whole image ({size[0]} x {size[1]} pixels)")
                + "; leave a margin around it, or try another {invert} to take the other part"
            )
        )
    notes += outer_outline(seen)[1]
    polygon, stepped = _polygon(largest, page)
    if _is_cut_off(polygon, width, height):
        notes.append("the shape touches the image's border and may be cut off there")
    area = polygon.area * scale**2
    if area < MIN_AREA:
        raise InputFileError(
            Advice(
                literal(f"{path}: the largest shape covers only {area:.1f} pixels")
                + f", at least {MIN_AREA:.0f} are needed; give a larger image, or try another "
                "{threshold} or {invert}"
            )
        )
    tolerance = SIMPLIFY_TOLERANCE
    if stepped:
        step = min(STEP_TOLERANCE, STEP_TOLERANCE_OF_SIZE * float(np.sqrt(polygon.area)))
        tolerance = max(tolerance, step)
    polygon, moved = thinned(polygon, tolerance, MAX_OUTLINE_VERTICES)
    if moved > STEP_TOLERANCE:
        notes.append(f"simplified the outline to within {moved:.2f} traced pixels")
    ring = np.clip(outer_ring(polygon) * scale, 0, size)
    return ring, scaled(seen.simplify(tolerance), scale, scale, origin=(0, 0)), notes


def region(rings: Sequence[Array]) -> BaseGeometry:
    """Return what lies within an odd number of rings (N, 2), none of which crosses another."""
    return shapely.build_area(shapely.GeometryCollection(list(map(shapely.LinearRing, rings))))


def _area(ring: Array) -> float:
    return abs(float(signed_area(ring)))


def _is_cut_off(shape: Polygon, width: int, height: int) -> bool:
    """Return whether a shape is nearly as wide at a border of the image as further in."""
    deep = min(round(INNER_SHARE * max(width, height)) + 1, width - 1, height - 1)
    inside = np.array([[0.5, deep + 0.5]])
    rows, columns = (np.concatenate([inside, side - inside]).ravel() for side in (height, width))
    lines = [LineString([(0, y), (width, y)]) for y in rows]
    lines += [LineString([(x, 0), (x, height)]) for x in columns]
    lengths = [line.intersection(shape).length for line in lines]
    pairs = zip(lengths[::2], lengths[1::2], strict=True)
    return any(at_border > CUT_OFF_RATIO * further_in for at_border, further_in in pairs)


def _without_dust(rings: list[Array]) -> tuple[list[Array], list[str]]:
    """Return rings without those around specks and pinholes, and a note if there were any."""
    areas = np.array(list(map(_area, rings)))
    limit = min(max(DUST_PIXELS, DUST_SHARE * areas.max()), areas.max() / 2)
    kept = [ring for ring, area in zip(rings, areas, strict=True) if area > limit]
    return kept, ["left out specks of dust"] * (len(kept) < len(rings))


def _contours(level: Level) -> list[Array]:
    """Return the borders (N, 2) of shapes and holes, pixel (0, 0) spanning [0, 1] x [0, 1]."""
    outside = 2 * level.cut - level.inside
    # The margin mirrors the shape's level in the cut, so that a shape which runs off the image is
    # closed along the image's very edge.
    values = np.pad(level.values, 1, constant_values=outside)
    contours = level_curves(values, level.cut)
    return [contour[:, ::-1] - 0.5 for contour in contours if len(contour) > 3]


def _polygon(contour: Array, page: Polygon) -> tuple[Polygon, bool]:
    """Return the region of a contour, and whether it is stepped: drawn in two levels."""
    largest = Polygon(contour)
    parts = polygons_in(largest.intersection(page))
    # Each vertex lies on one line of pixel centres and anywhere between two of them: stepped if
    # nearly all cut their line at the same fraction.
    fraction: Array = np.mod(outer_ring(largest) - 0.5, 1.0).sum(axis=1)
    usual: float = np.median(fraction)
    stepped = float(np.mean(abs(fraction - usual) < 0.05)) > 0.95
    return max(parts, key=lambda part: part.area), stepped
