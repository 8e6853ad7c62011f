"""How well people would recognise a target in a tile, limb by limb.

Areas reward blobs: a limb has little area, and a smooth body that fills the middle of the target
scores well without any. Here the target's outline is compared with the tile's, point by point and
one to one. Two points go together as far as they agree in place, in direction and in how thick the
shape is there, and each point can be used only once, so that two neighbouring legs are not both
found in a single one. A lost limb costs its share of the target's outline, a spurious one its share
of the tile's.

Place and direction as in oriented chamfer matching (Shotton, Blake, Cipolla, 2008), one to one as
in the boundary F-measure (Martin, Fowlkes, Malik, 2004); thickness is that of the medial axis
(Blum, 1967), found at a boundary point as by Ma, Bae, Choi (2012). Definition, evidence and limits:
docs/recognisability.md.
"""

from dataclasses import asdict, dataclass
from typing import NamedTuple

import numpy as np
import scipy
import shapely
from shapely.geometry.polygon import orient

from orbiflow.arrays import Array, Integers
from orbiflow.tiles.geometry import points_along, polygons_in, ring_length
from orbiflow.tiles.likeness.metrics import Region, Shape, as_region, share

POINTS = 256  # on the target's outline, and as dense on the tile's
MAX_POINTS = 4 * POINTS  # on a tile's outline, however long it is
MIN_POINTS = 8  # on each ring

# Lengths in units of the square root of the target's area. Two points that are this far from each
# other in one respect, and alike in the others, agree by 1/e.
PLACE_TOLERANCE = 0.35
DIRECTION_TOLERANCE = 0.85  # between unit vectors: 50 degrees
THICKNESS_TOLERANCE = float(np.log(1.5))
THICKNESS_OFFSET = 0.05  # added to a thickness: what is thinner than this differs little
DIRECTION_WINDOW = 0.05  # of arc length to either side, over which a direction is taken
MAX_THICKNESS = 1.0


@dataclass(frozen=True)
class Recognisability:
    """How much of the target is found in a tile. All values are from 0 to 1, larger is better.

    - `score`: The harmonic mean of `kept` and `clean`.
    - `kept`: The share of the target's outline that is found in the tile; lost limbs lower it.
    - `clean`: The share of the tile's outline that is found in the target; spurious limbs, slits and
      hairs lower it.
    - `limbs`: `kept` with each point weighted by how thin the target is there. It shows whether the
      limbs are kept and has no part in the score.
    """

    score: float
    kept: float
    clean: float
    limbs: float

    def as_dict(self) -> dict[str, float]:
        """Return the same values, ready for JSON."""
        return asdict(self)


class Recogniser:
    """A comparison of many tiles with one target, whose outline is prepared once.

    `target` is a ring (N, 2) or a shapely polygon or multipolygon. Tiles must be in the target's
    frame: they are not aligned.

    Raises `OrbiflowError` for a target, or a tile, that is not a valid polygon.

    >>> plus = [[1, 0], [2, 0], [2, 1], [3, 1], [3, 2], [2, 2], [2, 3], [1, 3], [1, 2], [0, 2],
    ...         [0, 1], [1, 1]]
    >>> recognise = Recogniser(plus)
    >>> without_arm = plus[:3] + plus[5:]
    >>> recognise(plus).score, round(recognise(without_arm).kept, 2)
    (1.0, 0.74)
    """

    def __init__(self, target: Shape) -> None:
        region = as_region(target, "target")
        self._unit = float(np.sqrt(region.area))
        self._origin = np.array(region.centroid.coords[0])
        rings = self._rings(region)
        corners = np.concatenate(rings)
        # sampling starts near this point, so that the same outline gives the same points
        self._start = corners[np.argmax((corners**2).sum(axis=1))]
        self._spacing = sum(ring_length(ring) for ring in rings) / POINTS
        self._target = _features(rings, self._spacing, self._start)
        weights = 1 / (self._target.thickness + THICKNESS_OFFSET)
        self._limb_weights = weights / weights.sum()

    def __call__(self, tile: Shape) -> Recognisability:
        """Compare `tile`, in the target's frame, with the target."""
        features = _features(self._rings(as_region(tile, "tile")), self._spacing, self._start)
        agreement = _agreement(self._target, features)
        goal_points, own_points = scipy.optimize.linear_sum_assignment(agreement, maximize=True)
        matched = agreement[goal_points, own_points]
        total = float(matched.sum())
        return Recognisability(
            score=share(2 * total / sum(agreement.shape)),
            kept=share(total / agreement.shape[0]),
            clean=share(total / agreement.shape[1]),
            limbs=share(float(self._limb_weights[goal_points] @ matched)),
        )

    def _rings(self, region: Region) -> list[Array]:
        """Return rings (M, 2) of `region` in units of the target, the inside on their left."""
        polygons = [orient(polygon) for polygon in polygons_in(region)]
        rings = [ring for part in polygons for ring in (part.exterior, *part.interiors)]
        return [(shapely.get_coordinates(r)[:-1] - self._origin) / self._unit for r in rings]


def recognisability(tile: Shape, target: Shape) -> Recognisability:
    """Return how much of `target` is recognised in `tile`, both in one frame.

    The result is invariant under a similarity of both shapes. To compare many tiles with one
    target, use a `Recogniser`. Raises `OrbiflowError` naming the argument that is not a valid
    polygon.

    >>> square = [[0, 0], [2, 0], [2, 2], [0, 2]]
    >>> recognisability(square, square).score
    1.0
    """
    return Recogniser(target)(tile)


class _Features(NamedTuple):
    """Points on an outline.

    `lifted` (P, 5) are position, direction and thickness, each divided by its tolerance, `thickness`
    (P,) the radius of the disk inscribed at each point, `before` and `after` its neighbours on its
    ring.
    """

    lifted: Array
    thickness: Array
    before: Integers
    after: Integers


def _agreement(goal: _Features, features: _Features) -> Array:
    """Return how far each point of the target (P,) agrees with each of the tile (Q,): (P, Q), 0 to 1.

    A point of the tile stands for its piece of the outline, a third of the way to its neighbours,
    so that it does not matter where on an outline the first point falls.
    """
    squared = scipy.spatial.distance.cdist(goal.lifted, features.lifted, "sqeuclidean")
    for neighbour in (features.before, features.after):
        third = features.lifted + (features.lifted[neighbour] - features.lifted) / 3
        np.minimum(
            squared, scipy.spatial.distance.cdist(goal.lifted, third, "sqeuclidean"), out=squared
        )
    # flat at the top, so that small displacements do not matter
    return np.exp(-squared * squared)


def _features(rings: list[Array], spacing: float, start: Array) -> _Features:
    spacing = max(spacing, sum(ring_length(ring) for ring in rings) / MAX_POINTS)
    samples = [_sample(ring, spacing, start) for ring in rings]
    points = np.concatenate([xy for xy, _ in samples])
    normals = np.concatenate([normal for _, normal in samples])
    ends = np.cumsum([len(xy) for xy, _ in samples])[:-1]
    by_ring = np.split(np.arange(len(points)), ends)
    before = np.concatenate([np.roll(ring, 1) for ring in by_ring])
    after = np.concatenate([np.roll(ring, -1) for ring in by_ring])
    thickness = _inscribed_radius(points, normals)
    level = np.log(thickness + THICKNESS_OFFSET)
    level = (level[before] + 2 * level + level[after]) / 4
    lifted = np.column_stack(
        [points / PLACE_TOLERANCE, normals / DIRECTION_TOLERANCE, level / THICKNESS_TOLERANCE]
    )
    return _Features(lifted, thickness, before, after)


def _sample(ring: Array, spacing: float, start: Array) -> tuple[Array, Array]:
    """Return evenly spaced points (P, 2) of a closed ring, and the outward normal around each.

    The normal is the mean of the unit normals within `DIRECTION_WINDOW`: shorter than 1 at a bend, so
    that a corner and its rounding are alike.
    """
    length = ring_length(ring)
    count = max(round(length / spacing), MIN_POINTS)
    first = shapely.LinearRing(ring).project(shapely.Point(start))
    at = np.linspace(first, first + length, count, endpoint=False) + 0.5 * length / count
    window = min(DIRECTION_WINDOW, length / 4)
    tangent = (points_along(ring, at + window) - points_along(ring, at - window)) / (2 * window)
    return points_along(ring, at), np.column_stack([tangent[:, 1], -tangent[:, 0]])


def _inscribed_radius(points: Array, normals: Array) -> Array:
    """Return the radius (P,) of the largest disk inside that touches the outline at each point.

    The disk through p, tangent there, and through q has curvature 2 n . (p - q) / |q - p|^2; the
    largest disk that holds no other point of the outline has the largest of these curvatures.
    """
    # The mean normal vanishes where the outline turns back on itself, at the tip of a hair.
    unit = normals / np.maximum(np.hypot(*normals.T), 1e-9)[:, None]
    planes = np.column_stack([-unit, (points * unit).sum(axis=1)])
    depth = planes @ np.vstack([points.T, np.ones(len(points))])
    squared = scipy.spatial.distance.cdist(points, points, "sqeuclidean")
    np.fill_diagonal(squared, np.inf)
    depth /= np.maximum(squared, 1e-18, out=squared)
    return 1 / np.maximum(2 * depth.max(axis=1), 1 / MAX_THICKNESS)
