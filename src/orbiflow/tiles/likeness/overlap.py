"""The exact overlap of polygons with a region, and its exact gradient in the vertices."""

# pyright: reportUnknownMemberType=false
# shapely's stubs leave the keyword arguments of its functions of arrays without types.

import numpy as np
import scipy.optimize
import shapely

from orbiflow.arguments import as_array
from orbiflow.arrays import Array, Complex
from orbiflow.errors import OrbiflowError
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
