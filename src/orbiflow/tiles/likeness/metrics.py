"""Exact measures of how far one polygon is from another: areas, their gradients, and distances.

Shapes are compared where they are: bring both into one frame first. A shape is a ring (N, 2) or a
shapely polygon or multipolygon.
"""

# pyright: reportUnknownMemberType=false
# shapely's stubs leave the keyword arguments of its functions of arrays without types.

from dataclasses import asdict, dataclass

import numpy as np
import scipy
import shapely
from numpy.typing import ArrayLike
from scipy.spatial import KDTree
from shapely.geometry import MultiPolygon, Polygon, box

from orbiflow.arrays import Array, Complex, Window
from orbiflow.errors import OrbiflowError
from orbiflow.settings import as_array
from orbiflow.tiles.geometry import complex_points, plane_points, signed_area

# the number of vertices beyond which a region of area 1 is simplified, and the tolerance
MAX_REGION_VERTICES, REGION_TOLERANCE = 1500, 2e-3


def prepared_region(ring: Array) -> shapely.Polygon:
    """Return the prepared region of a ring (N, 2) of area about 1, simplified if it is complex.

    Use it to choose among candidates, as intersections with thousands of vertices take seconds;
    final results are measured with the ring itself.
    """
    ring = as_array(ring, "the region's ring", ("N", 2))
    if len(ring) < 3:
        raise OrbiflowError(f"the region's ring needs at least 3 vertices, got {len(ring)}")
    region = shapely.Polygon(ring)
    if len(ring) > MAX_REGION_VERTICES:
        simpler = region.simplify(REGION_TOLERANCE)
        if isinstance(simpler, shapely.Polygon) and simpler.is_valid and not simpler.is_empty:
            region = simpler
    shapely.prepare(region)
    return region


def boundary_iou(goal: shapely.Polygon, boundaries: Array) -> Array:
    """Return the IoU (S,) of rings (S, N, 2) with a polygon; -1 for those that cross themselves."""
    polygons = np.asarray(shapely.polygons(boundaries))
    good = np.asarray(shapely.is_valid(polygons))
    scores = np.full(len(polygons), -1.0)
    common = shapely.area(shapely.intersection(polygons[good], goal))
    scores[good] = common / (shapely.area(polygons[good]) + goal.area - common)
    return scores


class Overlap:
    """The overlap of rings with one region, a simple ring (M, 2), see `prepared_region`.

    The common area of P and T changes at the rate of the normal speed integrated over the part of
    P's boundary inside T; along a side the speed is linear between its ends.
    """

    def __init__(self, target: Array) -> None:
        self.region = prepared_region(target)

    def iou(self, ring: Array) -> tuple[float, Array]:
        """Return the IoU of a simple ring (N, 2) with the region and its gradient (N, 2).

        >>> square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
        >>> value, gradient = Overlap(square).iou(0.5 * square + 0.25)
        >>> value, gradient[:, 0].round(12).tolist()
        (0.25, [-0.25, 0.25, 0.25, -0.25])
        """
        ring = as_array(ring, "the ring", ("N", 2))
        try:
            common = float(shapely.Polygon(ring).intersection(self.region).area)
        except (shapely.errors.GEOSException, ValueError) as error:
            raise OrbiflowError(f"ring or region is not a simple polygon: {error}") from error
        inside = self.area_gradient(ring)
        sign = 1.0 if signed_area(ring) > 0 else -1.0
        area = float(abs(signed_area(ring)))
        sides = np.roll(ring, -1, axis=0) - np.roll(ring, 1, axis=0)
        whole = sign * np.stack([sides[:, 1], -sides[:, 0]], axis=-1) / 2
        union = area + self.region.area - common
        return common / union, ((union + common) * inside - common * whole) / union**2

    def area_gradient(self, ring: Array) -> Array:
        """Return the gradient (N, 2) of the area of the ring's part inside the region."""
        ends = np.roll(ring, -1, axis=0)
        sides = ends - ring
        lines = np.asarray(shapely.linestrings(np.stack([ring, ends], axis=1)), dtype=np.object_)
        # cutting takes longer than looking what there is to cut
        whole = np.asarray(shapely.contains_properly(self.region, lines))
        cut = np.flatnonzero(~whole & np.asarray(shapely.intersects(self.region, lines)))
        pieces, owner = shapely.get_parts(
            shapely.intersection(lines[cut], self.region), return_index=True
        )
        lengths = shapely.length(pieces)
        pieces, owner = pieces[lengths > 0], cut[owner[lengths > 0]]  # not where they only touch
        first, last = (
            np.concatenate([end[whole], shapely.get_coordinates(shapely.get_point(pieces, index))])
            for end, index in ((ring, 0), (ends, -1))
        )
        owner = np.concatenate([np.flatnonzero(whole), owner])
        square = np.maximum((sides**2).sum(axis=1), 1e-300)[owner]
        start, stop = (
            ((p - ring[owner]) * sides[owner]).sum(axis=1) / square for p in (first, last)
        )
        low, high = np.minimum(start, stop), np.maximum(start, stop)
        late = np.bincount(owner, (high**2 - low**2) / 2, minlength=len(ring))
        early = np.bincount(owner, high - low, minlength=len(ring)) - late
        sign = 1.0 if signed_area(ring) > 0 else -1.0
        normal = sign * np.stack([sides[:, 1], -sides[:, 0]], axis=-1)
        return early[:, None] * normal + np.roll(late[:, None] * normal, 1, axis=0)


def best_overlay(
    ring: Complex, overlap: Overlap, factor: complex = 1.0, middle: complex = 0.0
) -> tuple[complex, complex, float]:
    """Find the similarity z -> factor z + middle of largest IoU with a region, by L-BFGS.

    The ring (n,) x + iy is about the origin. The result is near the first similarity: its factor and
    middle, and the IoU.
    """

    def loss(x: Array) -> tuple[float, Array]:
        scaled = factor * complex(np.exp(x[0] + 1j * x[1])) * ring
        place = scaled + middle + x[2] + 1j * x[3]
        value, slope = overlap.iou(plane_points(place))
        pull = complex_points(slope)
        turned = np.conj(scaled) * pull
        gradient = [turned.real.sum(), turned.imag.sum(), pull.real.sum(), pull.imag.sum()]
        return -value, -np.array(gradient)

    optimum = scipy.optimize.minimize(
        loss, np.zeros(4), jac=True, method="L-BFGS-B", options={"maxiter": 40}
    )
    best = complex(factor * np.exp(optimum.x[0] + 1j * optimum.x[1]))
    return best, complex(middle + optimum.x[2] + 1j * optimum.x[3]), -float(optimum.fun)


WINDOW_MARGIN = 0.10
STEPS_PER_DIAGONAL = 1000  # of points along a boundary, whose distances are measured

Shape = ArrayLike | Polygon | MultiPolygon
Region = Polygon | MultiPolygon


@dataclass(frozen=True)
class ShapeMetrics:
    """The agreement of a tile with its target. Areas are exact.

    - `iou`: The area of the intersection over the area of the union, 0 to 1.
    - `dice`: Twice the area of the intersection over the sum of the areas, 0 to 1.
    - `pixel_accuracy`: The share of `window` on which both agree.
    - `window`: The window (xmin, ymin, xmax, ymax), in the shapes' own units.
    - `hausdorff`: The distance between the two boundaries, in square roots of the target's area.
    """

    iou: float
    dice: float
    pixel_accuracy: float
    window: Window
    hausdorff: float

    def as_dict(self) -> dict[str, float | list[float]]:
        """Return the same values, ready for JSON."""
        return asdict(self) | {"window": list(self.window)}


def iou(a: Shape, b: Shape) -> float:
    """Return the intersection over union (the Jaccard index) of two shapes, 0 to 1.

    Raises `OrbiflowError` naming the argument that is not a valid polygon.

    >>> iou([[0, 0], [2, 0], [2, 2], [0, 2]], [[1, 0], [3, 0], [3, 2], [1, 2]])
    0.3333333333333333
    """
    first, other = as_region(a, "a"), as_region(b, "b")
    shared = first.intersection(other).area
    return share(shared / (first.area + other.area - shared))


def dice(a: Shape, b: Shape) -> float:
    """Return the Dice coefficient of two shapes, 0 to 1: twice the shared over the total area.

    Raises `OrbiflowError` naming the argument that is not a valid polygon.

    >>> dice([[0, 0], [2, 0], [2, 2], [0, 2]], [[1, 0], [3, 0], [3, 2], [1, 2]])
    0.5
    """
    first, other = as_region(a, "a"), as_region(b, "b")
    return share(2 * first.intersection(other).area / (first.area + other.area))


def pixel_accuracy(a: Shape, b: Shape) -> float:
    """Return the share of `default_window(b)` where both or neither of `a` and `b` are present.

    This is the limit, as pixels shrink, of the share of pixels classified alike. It depends on the
    window: more background brings it nearer to 1; `b` is the target.

    Raises `OrbiflowError` naming the argument that is not a valid polygon.

    >>> square = [[0, 0], [5, 0], [5, 5], [0, 5]]
    >>> round(pixel_accuracy([[0, 0], [5, 0], [5, 2], [0, 2]], square), 6)  # 15 of 36 differ
    0.583333
    """
    region, target = as_region(a, "a"), as_region(b, "b")
    view = default_window(target)
    return share(1 - region.symmetric_difference(target).intersection(view).area / view.area)


def default_window(target: Shape) -> Polygon:
    """Return the bounding box of `target`, enlarged by 10% of its width and height on every side.

    >>> default_window([[0, 0], [10, 0], [0, 20]]).bounds
    (-1.0, -2.0, 11.0, 22.0)
    """
    xmin, ymin, xmax, ymax = as_region(target, "target").bounds
    dx, dy = WINDOW_MARGIN * (xmax - xmin), WINDOW_MARGIN * (ymax - ymin)
    return box(xmin - dx, ymin - dy, xmax + dx, ymax + dy)


def hausdorff(a: Shape, b: Shape) -> float:
    """Return the Hausdorff distance between the boundaries of two shapes, in the shapes' own units.

    This is the greatest distance from any point of one boundary, not only a vertex, to the nearest
    point of the other, to 1/2000 of the diagonal of the box around both shapes.

    Raises `OrbiflowError` naming the argument that is not a valid polygon.

    >>> hausdorff([[0, 0], [4, 0], [4, 4], [0, 4]], [[0, 0], [4, 0], [4, 1], [0, 1]])
    3.0
    """
    first, other = as_region(a, "a"), as_region(b, "b")
    xmin, ymin, xmax, ymax = shapely.total_bounds([first, other])
    step = float(np.hypot(xmax - xmin, ymax - ymin)) / STEPS_PER_DIAGONAL
    lines = (shapely.segmentize(region.boundary, step) for region in (first, other))
    here, there = map(shapely.get_coordinates, lines)
    far = KDTree(there).query(here)[0], KDTree(here).query(there)[0]
    return float(np.max(np.concatenate(far)))


def compare(tile: Shape, target: Shape) -> ShapeMetrics:
    """Return all metrics of `tile` against `target`, both in one frame.

    `hausdorff` is in units of the square root of the target's area. Raises `OrbiflowError` naming
    the argument that is not a valid polygon.

    >>> square = [[0, 0], [4, 0], [4, 4], [0, 4]]
    >>> compare([[0, 0], [4, 0], [4, 1], [0, 1]], square).hausdorff
    0.75
    """
    region, goal = as_region(tile, "tile"), as_region(target, "target")
    return ShapeMetrics(
        iou=iou(region, goal),
        dice=dice(region, goal),
        pixel_accuracy=pixel_accuracy(region, goal),
        window=default_window(goal).bounds,
        hausdorff=hausdorff(region, goal) / float(np.sqrt(goal.area)),
    )


def share(value: float) -> float:
    """Return a share, 0 to 1."""
    # rounding in the overlay can exceed the bounds by an ulp
    return min(max(float(value), 0.0), 1.0)


def as_region(shape: Shape, name: str) -> Region:
    """Return `shape` as a valid polygon of positive area, or raise an error with its `name`."""
    if not isinstance(shape, Polygon | MultiPolygon):
        shape = _ring_polygon(shape, name)
    if not np.isfinite(shapely.get_coordinates(shape)).all():
        raise OrbiflowError(f"{name}: every coordinate must be a finite number")
    if not shape.is_valid:
        raise OrbiflowError(
            f"{name}: not a valid polygon: {shapely.is_valid_reason(shape)}; "
            "a shape must not cross or touch itself"
        )
    if not shape.area > 0:
        raise OrbiflowError(f"{name}: the shape encloses no area")
    return shape


def _ring_polygon(ring: ArrayLike, name: str) -> Polygon:
    try:
        points = as_array(ring, name, (...,), finite=False)
    except OrbiflowError as exc:
        raise OrbiflowError(f"{name}: not a polygon; give an array of shape (N, 2)") from exc
    if points.ndim != 2 or points.shape[1] != 2 or len(points) < 3:
        raise OrbiflowError(f"{name}: needs shape (N, 2) with N at least 3, got {points.shape}")
    if not np.isfinite(points).all():
        raise OrbiflowError(f"{name}: every coordinate must be a finite number")
    return Polygon(points)
