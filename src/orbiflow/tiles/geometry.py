"""Closed rings of the plane: area, centroid, orientation, similarity and even sampling.

A ring is a float64 array (..., N, 2) whose last vertex does not repeat the first; leading axes are
a stack of rings. Functions with `AnyRing` take tensors as well and are differentiable.
"""

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, NamedTuple, TypeVar

import numpy as np
from numpy.typing import ArrayLike
from shapely.geometry import LineString, Polygon
from shapely.geometry.base import BaseGeometry

from orbiflow.arrays import Array, Complex, Integers, Window
from orbiflow.errors import OrbiflowError
from orbiflow.settings import as_array

if TYPE_CHECKING:
    import torch

    AnyRing = TypeVar("AnyRing", Array, torch.Tensor)
else:  # torch is imported by those who have tensors
    AnyRing = TypeVar("AnyRing")


def signed_area(ring: AnyRing) -> AnyRing:
    """Return the area (...) that each ring (..., N, 2) encloses, positive if counter-clockwise, y up.

    Uses the shoelace formula about the first vertex: about the origin it would lose all digits of a
    distant ring's area to cancellation. Takes NumPy or torch.

    >>> square = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]])
    >>> float(signed_area(square)), float(signed_area(square + 1e8))
    (2.0, 2.0)
    """
    return 0.5 * _crosses(ring - ring[..., :1, :]).sum(-1)  # pyright: ignore[reportReturnType]


def centroid(ring: Array) -> Array:
    """Return the centre of mass (..., 2) of the region that each ring (..., N, 2) encloses.

    >>> centroid(np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]]))
    array([1. , 0.5])
    """
    first = ring[..., :1, :]
    local = ring - first
    cross = _crosses(local)
    moment = ((local + np.roll(local, -1, axis=-2)) * cross[..., None]).sum(axis=-2)
    return first[..., 0, :] + moment / (3 * cross.sum(axis=-1)[..., None])


def reverse(ring: Array) -> Array:
    """Return the ring (N, 2) in the opposite order, from the same first vertex."""
    return np.roll(ring[::-1], 1, axis=0)


def orient(ring: Array, *, counter_clockwise: bool = True) -> Array:
    """Return `ring` (N, 2), reversed if needed to run counter-clockwise (with y up), or clockwise."""
    return ring if bool(signed_area(ring) > 0) == counter_clockwise else reverse(ring)


def subdivided(ring: Array, pieces: int) -> Array:
    """Return points (..., N pieces, 2) of rings (..., N, 2): each side divided evenly into `pieces`.

    Sides that are isometric images of each other are divided alike, to the last digit.

    >>> subdivided(np.array([[0.0, 0.0], [2.0, 0.0], [0.0, 2.0]]), 2)[:3].tolist()
    [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]]
    """
    sides = np.roll(ring, -1, axis=-2) - ring
    shares = (np.arange(pieces) / pieces)[:, None]
    points = ring[..., :, None, :] + shares * sides[..., :, None, :]
    return points.reshape(*ring.shape[:-2], ring.shape[-2] * pieces, 2)


def _crosses(local: AnyRing) -> AnyRing:
    """Return twice the area (..., N) of the triangle of each side and the origin."""
    ahead = local[..., [*range(1, local.shape[-2]), 0], :]
    return local[..., 0] * ahead[..., 1] - ahead[..., 0] * local[..., 1]


class Place(NamedTuple):
    """Where things lie in other coordinates: the similarity p -> linear p + offset.

    >>> half = Place(np.eye(2) / 2, np.array([1.0, 0.0]))
    >>> half(np.array([2.0, 2.0])), half.after(half).scale
    (array([2., 1.]), 0.25)
    """

    linear: Array  # (2, 2)
    offset: Array  # (2,)

    def __call__(self, points: Array) -> Array:
        return points @ self.linear.T + self.offset

    @property
    def scale(self) -> float:
        """By how much lengths grow."""
        return float(np.sqrt(abs(np.linalg.det(self.linear))))

    @property
    def inverse(self) -> "Place":
        """The way back."""
        linear = np.linalg.inv(self.linear)
        return Place(linear, -linear @ self.offset)

    def after(self, first: "Place") -> "Place":
        """Return this after another one."""
        return Place(self.linear @ first.linear, self(first.offset))


def complex_points(points: ArrayLike) -> Complex:
    """Return points (..., 2) as complex numbers x + iy (...).

    >>> complex_points([[1.0, 2.0]])
    array([1.+2.j])
    """
    array = np.asarray(points, dtype=np.float64)
    return array[..., 0] + 1j * array[..., 1]


def plane_points(z: Complex) -> Array:
    """Return complex numbers (...) as points (..., 2): the inverse of `complex_points`."""
    return np.stack([z.real, z.imag], axis=-1)


def best_similarity(points: Complex, images: Complex) -> Complex:
    """Return the factors of the similarities z -> factor (z - mean) + mean' nearest to given images.

    These are rotations and scalings, without mirror images, by least squares (Procrustes): () or (C,)
    for `points` (N,) x + iy and their `images` (N,), or C sets of images (N, C).

    >>> triangle = np.array([0, 1, 1j])
    >>> complex(best_similarity(triangle, 2j * triangle + 5))
    2j
    """
    centered = points - points.mean(axis=0)
    return np.conj(centered) @ (images - images.mean(axis=0)) / (abs(centered) ** 2).sum()


def apart(points: Complex, images: Complex) -> float:
    """Return the mean square distance of points (N,) from their images after the best similarity.

    >>> triangle = np.array([0, 1, 1j])
    >>> round(apart(triangle, 2j * triangle + 5), 12)
    0.0
    """
    factor = complex(best_similarity(points, images))
    return float((abs(factor * (points - points.mean()) - (images - images.mean())) ** 2).mean())


def ring_length(ring: Array) -> float:
    """Return the length of the closed `ring` (N, 2), including the side that closes it.

    >>> ring_length(np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 4.0]]))
    12.0
    """
    return float(arc_lengths(ring)[-1])


def points_along(ring: Array, at: ArrayLike) -> Array:
    """Return the points (P, 2) of the closed `ring` (N, 2) at the arc lengths `at` (P,).

    Lengths are measured from the first vertex, modulo the ring's length.

    >>> points_along(np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]), [0.5, 4.5]).tolist()
    [[0.5, 0.0], [0.5, 0.0]]
    """
    knots = arc_lengths(ring)
    place = np.asarray(at, dtype=np.float64) % knots[-1]
    closed = np.concatenate([ring, ring[:1]])
    coordinates: list[Array] = [np.interp(place, knots, closed[:, k]) for k in (0, 1)]
    return np.stack(coordinates, axis=-1)


def resampled(ring: Array, count: int, phase: float = 0.0) -> Array:
    """Return `count` points (count, 2) evenly spaced along the closed `ring` (N, 2).

    `phase`, from 0 to 1, moves them along by that share of their spacing.

    >>> square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    >>> resampled(square, 4, phase=0.5).tolist()
    [[0.5, 0.0], [1.0, 0.5], [0.5, 1.0], [0.0, 0.5]]
    """
    return points_along(ring, (np.arange(count) + phase) / count * arc_lengths(ring)[-1])


def arc_lengths(ring: Array) -> Array:
    """Return arc lengths (N + 1,) at each vertex of the closed `ring` (N, 2), and at the first again.

    >>> arc_lengths(np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 4.0]])).tolist()
    [0.0, 3.0, 7.0, 12.0]
    """
    sides = np.roll(ring, -1, axis=0) - ring
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(sides, axis=1))])


def kept_vertices(line: Array, tolerance: float) -> list[int]:
    """Return the points that Douglas and Peucker's simplification of a line (N, 2) keeps."""
    simple = LineString(line).simplify(tolerance, preserve_topology=False)
    kept: list[int] = [0]
    for point in np.asarray(simple.coords)[1:]:  # bit for bit those of the line, and in order
        kept.append(kept[-1] + int(np.flatnonzero((line[kept[-1] :] == point).all(axis=1))[0]))
    return kept


def border(triangles: Integers) -> Integers:
    """Return the points, in order, of the sides that belong to one of the triangles (M, 3) alone."""
    sides = {(int(t[k - 1]), int(t[k])) for t in triangles for k in range(3)}
    after = {a: b for a, b in sides if (b, a) not in sides}
    ring = [min(after)]
    while len(ring) <= len(after) and (follower := after[ring[-1]]) != ring[0]:
        ring.append(follower)
    if len(ring) != len(after):
        raise OrbiflowError("the bending's triangles do not fill one outline")
    return np.array(ring)


def triangle_sides(points: Array, triangles: Integers) -> Array:
    """Return matrices (M, 2, 2) whose columns lead from each triangle's first point to the others."""
    corners = points[triangles]
    return np.stack([corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]], axis=2)


def doubled_areas(points: Array, triangles: Integers) -> Array:
    """Return twice the area (M,) of triangles, negative where they are clockwise."""
    (a, b), (c, d) = triangle_sides(points, triangles).transpose(1, 2, 0)
    return a * d - c * b


def polygons_in(geometry: BaseGeometry) -> list[Polygon]:
    """Return the polygons in `geometry`, without its lines and points."""
    if isinstance(geometry, Polygon):
        return [] if geometry.is_empty else [geometry]
    parts: Iterable[BaseGeometry] = getattr(geometry, "geoms", ())
    return [polygon for part in parts for polygon in polygons_in(part)]


def checked_window(window: Sequence[float]) -> Window:
    """Return `window` as four numbers xmin < xmax and ymin < ymax.

    Raises `OrbiflowError` for anything else.
    """
    try:
        values = as_array(window, "window", (4,)).tolist()
    except OrbiflowError:
        values = [0.0] * 4
    if not (values[0] < values[2] and values[1] < values[3]):
        raise OrbiflowError(
            f"a window is (xmin, ymin, xmax, ymax) with xmin < xmax and ymin < ymax, got {window!r}"
        )
    return values[0], values[1], values[2], values[3]
