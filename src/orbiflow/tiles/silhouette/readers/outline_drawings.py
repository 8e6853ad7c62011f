"""Outline drawings: a closed line around nothing, whose middle is the silhouette's outline."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial import KDTree
from shapely import MultiPoint

from orbiflow.arrays import Array
from orbiflow.contours import level_curves
from orbiflow.tiles.geometry import signed_area
from orbiflow.tiles.silhouette.readers.tracing import Level

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
# a line holds together across corners where its background does not
_ACROSS_CORNERS = np.ones((3, 3), dtype=int)
_Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class OutlineDrawing:
    """The inside of a line's middle, as a level to be traced, and the line's width in its pixels."""

    level: Level
    width: float


def outline_drawing(level: Level, *, is_given: bool = False) -> OutlineDrawing | None:
    """Return the inside of the middle of a closed line, or None where the picture shows no such line.

    An anti-aliased line is fainter than its ink and breaks where it is cut at half of that. It is cut
    as close to the background as its noise allows, unless the cut `is_given`: its middle is the same.
    A frame around another shape is none either: what fills it is doubted.
    """
    cut = level.cut if is_given else _faint_cut(level)
    mask = level.values > cut
    labels = np.asarray(ndimage.label(ndimage.binary_fill_holes(mask), _ACROSS_CORNERS)[0])
    areas = np.bincount(labels.ravel())
    areas[0] = 0
    shape = labels == areas.argmax()
    line = _line_of(shape & mask)
    inside = ndimage.binary_fill_holes(line) & ~line
    enclosed = int(inside.sum())
    if enclosed < MIN_BARE_SHARE * areas.max() or shape.all():
        return None
    if _largest_area(mask & inside) > MAX_INSIDE_SHARE * areas.max() and _is_frame(shape):
        return None
    outer, inner = _borders(level.values, cut)
    width = 2 * float(line.sum()) / (_length(outer) + _length(inner))
    if not MIN_WIDTH_PIXELS <= width <= MAX_WIDTH_SHARE * max(np.ptp(np.nonzero(shape), axis=1)):
        return None
    values = _from_middle(line, inside, (outer, inner), width)
    values[mask & ~shape] = width
    return OutlineDrawing(Level(values, 0.0, width), width)


def _largest_area(drawn: _Mask) -> int:
    """Return the pixels of the largest part, with its holes filled."""
    labels = np.asarray(ndimage.label(ndimage.binary_fill_holes(drawn), _ACROSS_CORNERS)[0])
    return int(np.bincount(labels.ravel())[1:].max(initial=0))


def _is_frame(shape: _Mask) -> bool:
    """Whether a filled shape is all but convex, as frames are."""
    border = np.argwhere(shape & ~ndimage.binary_erosion(shape))
    return int(shape.sum()) > MIN_CONVEX_SHARE * MultiPoint(border).convex_hull.area


def _faint_cut(level: Level) -> float:
    """Return a cut near the background, which has the level of most pixels below the usual cut."""
    below = level.values[level.values <= level.cut]
    background = float(np.median(below))
    noise = NOISE_FACTOR * float(np.median(abs(below - background)))
    return background + max(MIN_INK_SHARE * (level.inside - background), noise)


def _line_of(drawn: _Mask) -> _Mask:
    """Return the longest connected part of a drawing: the line without what is drawn inside it."""
    labels = np.asarray(ndimage.label(drawn, structure=_ACROSS_CORNERS)[0])
    boxes = ndimage.find_objects(labels)
    spans = [max(part.stop - part.start for part in box) for box in boxes]
    return labels == 1 + int(np.argmax(spans))


def _borders(values: Array, cut: float) -> tuple[Array, Array]:
    """Return points (N, 2) a pixel apart, row and column: the largest outer border, and inner ones."""
    padded = np.pad(values, 1, constant_values=cut - 1)
    contours = level_curves(padded, cut, joined=True)
    areas = np.array([signed_area(contour) for contour in contours])
    outer = contours[int(np.argmax(abs(areas)))]
    sign = np.sign(signed_area(outer))
    inner = [contour for contour, area in zip(contours, areas, strict=True) if area * sign < 0]
    return outer - 1, np.concatenate(inner) - 1


def _length(border: Array) -> float:
    steps = np.linalg.norm(np.diff(border, axis=0), axis=1)
    return float(steps[steps < MAX_STEP_PIXELS].sum())


def _from_middle(line: _Mask, inside: _Mask, borders: tuple[Array, Array], width: float) -> Array:
    """Return how much nearer each pixel is to the inner border than to the outer, up to the width.

    What is farther from the inside than the line is wide, and long, is a limb, and inside.
    """
    values = np.where(inside, width, -width)
    near = ndimage.binary_dilation(line, iterations=2)
    at = np.argwhere(near)
    to_outer, to_inner = (np.full(line.shape, 2 * width) for _ in borders)
    for distances, border in zip((to_outer, to_inner), borders, strict=True):
        distances[near] = _distances(at, border)
    sign = np.where(inside, 1.0, -1.0)
    apart = np.where(line, to_outer - to_inner, sign * (to_outer + to_inner))
    values = np.where(near, apart, values)
    limbs = _limbs(line & (to_inner > LIMB_DISTANCE_WIDTHS * width), MIN_LIMB_WIDTHS * width)
    if limbs.any():
        limbs = ndimage.binary_dilation(
            limbs, _ACROSS_CORNERS, round(LIMB_DISTANCE_WIDTHS * width) + 2
        )
        own = np.where(line, to_outer, -to_outer)
        values = np.where(limbs & near & ~inside, np.maximum(values, own), values)
    return np.clip(values, -width, width)


def _distances(points: NDArray[np.integer[Any]], border: Array) -> Array:
    """Return distances from points to a border, whose own points are about a pixel apart."""
    halves = (border[1:] + border[:-1]) / 2
    neighbours = np.linalg.norm(np.diff(border, axis=0), axis=1) < MAX_STEP_PIXELS
    tree = KDTree(np.concatenate([border, halves[neighbours]]))
    return np.asarray(tree.query(points)[0])


def _limbs(candidates: _Mask, length: float) -> _Mask:
    """Return the components that are at least so long."""
    labels = np.asarray(ndimage.label(candidates, structure=_ACROSS_CORNERS)[0])
    boxes = ndimage.find_objects(labels)
    sizes = [0.0, *(np.hypot(*(part.stop - part.start for part in box)) for box in boxes)]
    return (np.array(sizes) >= length)[labels]
