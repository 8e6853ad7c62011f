"""The outline of the largest shape in a picture, to a fraction of a pixel.

In an outline drawing, a closed line around nothing, that is the middle of the line.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy
import shapely
from numpy.typing import NDArray
from scipy.spatial import KDTree
from shapely.affinity import scale as scaled
from shapely.geometry import MultiPoint, Polygon, box
from shapely.geometry.base import BaseGeometry

from orbiflow.arrays import Array, Integers
from orbiflow.drawing import level_curves
from orbiflow.errors import Advice, InputFileError, literal
from orbiflow.tiles.geometry import polygons_in, signed_area
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


MIN_BARE_SHARE = 0.5  # of what the line encloses
MIN_CONVEX_SHARE = 0.95  # of its convex hull: what a frame fills
MAX_INSIDE_SHARE = 0.1  # of what a frame encloses: more is a shape of its own
MIN_WIDTH_PIXELS = 0.7  # pixels: what is thinner is noise
MAX_WIDTH_SHARE = 0.07  # of the drawing's longer side: a wider line is a ring
# of the usual ink: an anti-aliased line of a pixel is no darker where it lies between two
MIN_INK_SHARE = 0.25
NOISE_FACTOR = 4.0  # times the usual deviation of the background
LIMB_DISTANCE_WIDTHS = 1.6  # farther from the inside than the line's outer half: a limb
MIN_LIMB_WIDTHS = 4.0  # widths: the least length of a limb that is drawn as a single line
MAX_STEP_PIXELS = 2.0  # pixels: points of one border that follow on each other are nearer


def middle_of_line(level: Level, *, is_given: bool) -> tuple[Level, float] | None:
    """Return the inside of the middle of a closed line, and the line's width; None without such a line.

    An anti-aliased line is fainter than its ink and breaks where it is cut at half of that. It is cut
    as close to the background as its noise allows, unless the cut `is_given`: its middle is the same.
    A frame around another shape is none either: what fills it is doubted.
    """
    cut = level.cut if is_given else _faint_cut(level)
    mask = level.values > cut
    labels, areas = _labelled(scipy.ndimage.binary_fill_holes(mask), _ACROSS_CORNERS)
    shape = labels == areas.argmax()
    line = _line_of(shape & mask)
    inside = scipy.ndimage.binary_fill_holes(line) & ~line
    if inside.sum() < MIN_BARE_SHARE * areas.max() or shape.all():
        return None
    drawn = _labelled(scipy.ndimage.binary_fill_holes(mask & inside), _ACROSS_CORNERS)[1].max()
    if drawn > MAX_INSIDE_SHARE * areas.max() and _is_frame(shape):
        return None
    outer, inner = _borders(level.values, cut)
    width = 2 * float(line.sum()) / (_length(outer) + _length(inner))
    if not MIN_WIDTH_PIXELS <= width <= MAX_WIDTH_SHARE * max(np.ptp(np.nonzero(shape), axis=1)):
        return None
    values = _from_middle(line, inside, (outer, inner), width)
    values[mask & ~shape] = width
    return Level(values, 0.0, width), width


def _is_frame(shape: _Mask) -> bool:
    """Whether a filled shape is all but convex, as frames are."""
    border = np.argwhere(shape & ~scipy.ndimage.binary_erosion(shape))
    return int(shape.sum()) > MIN_CONVEX_SHARE * MultiPoint(border).convex_hull.area


def _faint_cut(level: Level) -> float:
    """Return a cut near the background, which has the level of most pixels below the usual cut."""
    below = level.values[level.values <= level.cut]
    background = float(np.median(below))
    noise = NOISE_FACTOR * float(np.median(abs(below - background)))
    return background + max(MIN_INK_SHARE * (level.inside - background), noise)


def _line_of(drawn: _Mask) -> _Mask:
    """Return the longest connected part of a drawing: the line without what is drawn inside it."""
    labels = np.asarray(scipy.ndimage.label(drawn, structure=_ACROSS_CORNERS)[0])
    boxes = scipy.ndimage.find_objects(labels)
    spans = [max(part.stop - part.start for part in box) for box in boxes]
    return labels == 1 + int(np.argmax(spans))


def _borders(values: Array, cut: float) -> tuple[Array, Array]:
    """Return points (N, 2) a pixel apart, row and column: the largest outer border, and inner ones."""
    padded = np.pad(values, 1, constant_values=cut - 1)
    contours = level_curves(padded, cut, joined=True)
    areas = np.array([signed_area(contour) for contour in contours])
    largest = int(np.argmax(abs(areas)))
    inner = [contours[k] for k in np.flatnonzero(areas * areas[largest] < 0)]
    return contours[largest] - 1, np.concatenate(inner) - 1


def _length(border: Array) -> float:
    steps = np.linalg.norm(np.diff(border, axis=0), axis=1)
    return float(steps[steps < MAX_STEP_PIXELS].sum())


def _from_middle(line: _Mask, inside: _Mask, borders: tuple[Array, Array], width: float) -> Array:
    """Return how much nearer each pixel is to the inner border than to the outer, up to the width.

    What is farther from the inside than the line is wide, and long, is a limb, and inside.
    """
    values = np.where(inside, width, -width)
    near = scipy.ndimage.binary_dilation(line, iterations=2)
    at = np.argwhere(near)
    to_outer, to_inner = (np.full(line.shape, 2 * width) for _ in borders)
    for distances, border in zip((to_outer, to_inner), borders, strict=True):
        distances[near] = _distances(at, border)
    sign = np.where(inside, 1.0, -1.0)
    apart = np.where(line, to_outer - to_inner, sign * (to_outer + to_inner))
    values = np.where(near, apart, values)
    limbs = _limbs(line & (to_inner > LIMB_DISTANCE_WIDTHS * width), MIN_LIMB_WIDTHS * width)
    if limbs.any():
        limbs = scipy.ndimage.binary_dilation(
            limbs, _ACROSS_CORNERS, round(LIMB_DISTANCE_WIDTHS * width) + 2
        )
        outer = np.where(line, to_outer, -to_outer)
        values = np.where(limbs & near & ~inside, np.maximum(values, outer), values)
    return np.clip(values, -width, width)


def _distances(points: NDArray[np.integer[Any]], border: Array) -> Array:
    """Return distances from points to a border, whose own points are about a pixel apart."""
    halves = (border[1:] + border[:-1]) / 2
    neighbours = np.linalg.norm(np.diff(border, axis=0), axis=1) < MAX_STEP_PIXELS
    tree = KDTree(np.concatenate([border, halves[neighbours]]))
    return np.asarray(tree.query(points)[0])


def _limbs(candidates: _Mask, length: float) -> _Mask:
    """Return the components that are at least so long."""
    labels = np.asarray(scipy.ndimage.label(candidates, structure=_ACROSS_CORNERS)[0])
    boxes = scipy.ndimage.find_objects(labels)
    sizes = [0.0, *(np.hypot(*(part.stop - part.start for part in box)) for box in boxes)]
    return (np.array(sizes) >= length)[labels]
