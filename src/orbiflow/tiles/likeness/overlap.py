"""The exact overlap of polygons with a region, its exact gradient in the vertices, and ranking.

Tiles are ranked by their overlap and recognisability; a short list of the best is without repeats.
"""

# pyright: reportUnknownMemberType=false
# shapely's stubs leave the keyword arguments of its functions of arrays without types.

from collections.abc import Callable, Sequence
from functools import cache

import numpy as np
import scipy.optimize
import shapely
from numpy.typing import ArrayLike

from orbiflow.arguments import as_array, as_number, as_whole
from orbiflow.arrays import Array, Complex
from orbiflow.errors import OrbiflowError
from orbiflow.tiles.geometry import centroid, complex_points, orient, plane_points, signed_area

IOU_WEIGHT = 0.25
TWIN_SIMILARITY = 0.97
VARIETY_WEIGHT = 0.1

# A symmetric function of two candidates' indices: how alike they are, 0 to 1
Similarity = Callable[[int, int], float]
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
        lines = shapely.linestrings(np.stack([ring, ends], axis=1))
        pieces, owner = shapely.get_parts(
            shapely.intersection(lines, self.region), return_index=True
        )
        lengths = shapely.length(pieces)
        pieces, owner = pieces[lengths > 0], owner[lengths > 0]  # not where they only touch
        first, last = (
            shapely.get_coordinates(shapely.get_point(pieces, index)) for index in (0, -1)
        )
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
        own = factor * complex(np.exp(x[0] + 1j * x[1])) * ring
        place = own + middle + x[2] + 1j * x[3]
        value, slope = overlap.iou(plane_points(place))
        pull = complex_points(slope)
        turned = np.conj(own) * pull
        gradient = [turned.real.sum(), turned.imag.sum(), pull.real.sum(), pull.imag.sum()]
        return -value, -np.array(gradient)

    found = scipy.optimize.minimize(
        loss, np.zeros(4), jac=True, method="L-BFGS-B", options={"maxiter": 40}
    )
    best = complex(factor * np.exp(found.x[0] + 1j * found.x[1]))
    return best, complex(middle + found.x[2] + 1j * found.x[3]), -float(found.fun)


MAX_IOU_GAIN = 0.15  # the largest gain in IoU that is expected from a better overlay of two tiles


def mutual_iou(tiles: Sequence[Array], decisive: float = 0.9) -> Similarity:
    """Return the mutual IoU of tiles (N, 2) over one silhouette by their indices, for `diverse`.

    A better overlay is searched only where it can matter: for pairs whose IoU, with equal areas and
    centroids, is at most `MAX_IOU_GAIN` below `decisive`, with which it is compared.

    >>> square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    >>> turned = square @ [[0.98, 0.2], [-0.2, 0.98]] * 3 + 7
    >>> round(mutual_iou([square, turned])(0, 1), 3)
    1.0
    """
    rings: list[Array] = []
    for tile in tiles:
        ring = orient(np.asarray(tile, dtype=np.float64))
        rings.append((ring - centroid(ring)) / np.sqrt(signed_area(ring)))

    @cache
    def region(index: int) -> Overlap:
        return Overlap(rings[index])

    @cache
    def alike(i: int, j: int) -> float:
        shared = shapely.Polygon(rings[i]).intersection(shapely.Polygon(rings[j])).area
        plain = float(min(shared / (2 - shared), 1.0))
        if not decisive - MAX_IOU_GAIN <= plain < decisive:
            return plain
        return max(plain, best_overlay(complex_points(rings[i]), region(j))[2])

    return lambda i, j: alike(min(i, j), max(i, j))


def rank_score(iou: float, recognisability: float) -> float:
    """Return the score of a tile, 0 to 1: the geometric mean of both, IoU with weight 1/4.

    A geometric mean compares ratios, so it does not matter that IoU varies little between tiles (a
    blob without limbs has nine tenths of the best tile's) and recognisability much; and a tile needs
    some of both. With more weight on IoU blobs win; with none, a tile may lie beside its target.
    docs/recognisability.md has the numbers.

    Raises `OrbiflowError` for a value outside [0, 1].

    >>> rank_score(0.72, 0.55) < rank_score(0.65, 0.74)
    True
    """
    for name, value in (("iou", iou), ("recognisability", recognisability)):
        as_number(value, name, 0, 1)
    return float(iou**IOU_WEIGHT * recognisability ** (1 - IOU_WEIGHT))


def diverse(
    scores: ArrayLike,
    count: int,
    similarity: Similarity,
    *,
    twin: float = TWIN_SIMILARITY,
    variety: float = VARIETY_WEIGHT,
) -> list[int]:
    """Choose up to `count` good candidates that differ from each other, the best first.

    This is maximal marginal relevance (Carbonell, Goldstein, 1998): the first candidate has the
    largest score, each next one the largest score minus `variety` times its largest similarity to a
    chosen one. Candidates with a similarity above `twin` to a chosen one are left out, so there may be
    fewer than `count`.

    Args:
        scores: The scores (n,), larger is better; of equal ones the earlier comes first.
        count: The largest number of candidates, at least 1.
        similarity: The similarity of a candidate and a chosen one, called once for each pair.
        twin: The largest similarity, 0 to 1; with 1 nothing is left out.
        variety: The weight of similarity, at least 0, in the unit of the scores.

    Returns:
        Indices of `scores`, in the order of choice.

    Raises `OrbiflowError` for scores that are not finite numbers, and for arguments out of range.

    >>> position = [0.0, 0.01, 0.5, 1.0]
    >>> diverse([0.9, 0.89, 0.8, 0.81], 3, lambda i, j: 1 - abs(position[i] - position[j]))
    [0, 3, 2]
    """
    values = as_array(scores, "scores", ("n",))
    as_whole(count, "count", 1)
    as_number(twin, "twin", 0, 1)
    as_number(variety, "variety", 0)
    nearest = np.zeros(len(values))
    left = np.ones(len(values), dtype=bool)
    chosen: list[int] = []
    while left.any() and len(chosen) < count:
        best = int(np.argmax(np.where(left, values - variety * nearest, -np.inf)))
        chosen.append(best)
        left[best] = False
        for other in np.flatnonzero(left):
            nearest[other] = max(nearest[other], similarity(int(other), best))
        left &= nearest <= twin
    return chosen
