"""The outline of the largest shape in a picture, to a fraction of a pixel."""

from dataclasses import dataclass

import numpy as np
import scipy
import shapely
from numpy.typing import NDArray
from shapely.affinity import scale as scaled
from shapely.geometry import Polygon, box
from shapely.geometry.base import BaseGeometry

from orbiflow.arrays import Array, Integers
from orbiflow.drawing import level_curves
from orbiflow.errors import Advice, InputFileError, literal
from orbiflow.tiles.geometry import polygons_in
from orbiflow.tiles.silhouette.outlines import MIN_PART_SHARE, left_out, outer_ring, thinned
from orbiflow.tiles.silhouette.readers.reading import Source

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
# for `scipy.ndimage`: background holds together across corners where the shape does not, and lines do
# where their background does not
_ACROSS_CORNERS = np.ones((3, 3), dtype=int)
_Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Level:
    """A picture (H, W) whose shape is where `values` exceed `cut`; `inside` is its usual level."""

    values: Array
    cut: float
    inside: float


def trace(
    path: Source, level: Level, *, scale: int, size: tuple[int, int]
) -> tuple[Array, BaseGeometry, list[str]]:
    """Return the outline (N, 2) of the largest shape in image pixels, all that was seen, and notes.

    A pixel of `level` is `scale` pixels of the image wide, and the image is `size` (width, height).
    Pixels of a shape hold together along their sides, not their corners.
    """
    mask, notes = _without_dust(level.values > level.cut)
    shape, parts = _largest(mask)
    if shape.all() and (inner := _within_border(mask)).any():
        mask, notes = (
            inner,
            [*notes, "left out what reaches around the shape at the image's border"],
        )
        shape, parts = _largest(mask)
    notes += parts
    if shape.all():
        raise InputFileError(
            Advice(
                literal(f"{path}: the shape fills the whole image ({size[0]} x {size[1]} pixels)")
                + "; leave a margin around it, or try another {invert} to take the other part"
            )
        )
    if _is_cut_off(shape):
        notes.append("the shape touches the image's border and may be cut off there")
    polygon, stepped = _polygon(level, shape)
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
    rings = [shapely.LinearRing(contour) for contour in _contours(level, mask)]
    seen = shapely.build_area(shapely.GeometryCollection(rings)).simplify(tolerance)
    return ring, scaled(seen, scale, scale, origin=(0, 0)), notes


def _within_border(mask: _Mask) -> _Mask:
    """Return the mask without what touches the image's border."""
    border = np.ones_like(mask)
    border[1:-1, 1:-1] = False
    return mask & ~scipy.ndimage.binary_propagation(border & mask, mask=mask)


def _is_cut_off(shape: _Mask) -> bool:
    inner = min(round(INNER_SHARE * max(shape.shape)) + 1, *(side - 1 for side in shape.shape))
    sides = (shape, shape[::-1], shape.T, shape.T[::-1])
    return any(side[0].sum() > CUT_OFF_RATIO * side[inner].sum() for side in sides)


def _labelled(mask: _Mask, structure: NDArray[np.int_] | None = None) -> tuple[Integers, Integers]:
    """Return the number of each pixel's component (H, W), and the sizes of these, 0 for none."""
    labels = np.asarray(scipy.ndimage.label(mask, structure)[0], dtype=np.int64)
    sizes = np.bincount(labels.ravel())
    sizes[0] = 0
    return labels, sizes


def _without_dust(mask: _Mask) -> tuple[_Mask, list[str]]:
    """Return the mask without specks and pinholes, and a note if there were any."""
    most = _labelled(mask)[1].max()
    limit = min(max(DUST_PIXELS, DUST_SHARE * most), most - 1)

    def small(part: _Mask, structure: NDArray[np.int_] | None = None) -> _Mask:
        labels, sizes = _labelled(part, structure)
        return ((sizes > 0) & (sizes <= limit))[labels]

    filled = scipy.ndimage.binary_fill_holes(mask, structure=_ACROSS_CORNERS)
    specks, pinholes = small(mask), small(filled & ~mask, _ACROSS_CORNERS)
    note = ["left out specks of dust"] * bool(specks.any() or pinholes.any())
    return (mask & ~specks) | pinholes, note


def _largest(mask: _Mask) -> tuple[_Mask, list[str]]:
    """Return the component that is largest with its holes filled."""
    labels, areas = _labelled(scipy.ndimage.binary_fill_holes(mask, structure=_ACROSS_CORNERS))
    shape = labels == areas.argmax()
    areas = areas[areas >= max(1, MIN_PART_SHARE * areas.max())]
    holes = shape & ~mask
    n_holes = scipy.ndimage.label(holes, structure=_ACROSS_CORNERS)[1]
    kept, bare = areas.max() / max(areas.sum(), 1), holes.sum() / max(shape.sum(), 1)
    return shape, left_out(len(areas), kept, n_holes, bare)


def _contours(level: Level, mask: _Mask) -> list[Array]:
    """Return the borders (N, 2) of the pixels in `mask`, pixel (0, 0) spanning [0, 1] x [0, 1]."""
    above, outside = level.values > level.cut, 2 * level.cut - level.inside
    values = np.where(above & ~mask, outside, np.where(mask & ~above, level.inside, level.values))
    # The margin mirrors the shape's level in the cut, so that a shape which runs off the image is
    # closed along the image's very edge.
    values = np.pad(values, 1, constant_values=outside)
    contours = level_curves(values, level.cut)
    return [contour[:, ::-1] - 0.5 for contour in contours if len(contour) > 3]


def _polygon(level: Level, shape: _Mask) -> tuple[Polygon, bool]:
    """Return the region of a shape, and whether its outline is stepped: drawn in two levels."""
    regions = [Polygon(contour) for contour in _contours(level, shape)]
    largest = max(regions, key=lambda polygon: polygon.area)
    height, width = shape.shape
    parts = polygons_in(largest.intersection(box(0, 0, width, height)))
    # Each vertex lies on one line of pixel centres and anywhere between two of them: stepped if
    # nearly all cut their line at the same fraction.
    fraction: Array = np.mod(outer_ring(largest) - 0.5, 1.0).sum(axis=1)
    usual: float = np.median(fraction)
    stepped = float(np.mean(abs(fraction - usual) < 0.05)) > 0.95
    return max(parts, key=lambda part: part.area), stepped
