"""Maps of a triangulated silhouette: the one to its tile, and how folds are taken out of a map."""

# pyright: reportUnknownMemberType=false
# shapely's stubs leave the keyword arguments of its functions of arrays without types.

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray

from orbiflow.arrays import Array
from orbiflow.errors import OrbiflowError
from orbiflow.settings import as_array, is_tensor
from orbiflow.tiles.geometry import best_similarity, complex_points, doubled_areas, triangle_sides
from orbiflow.tiles.silhouette.mesh import SilhouetteMesh, harmonic

MAX_POINTS, MAX_TRIANGLES = 100_000, 200_000
"""Beyond these a mesh is refused: real ones have some thousands."""

# twice the area of a triangle, in squares of the whole's extent, that rounding can turn over
MIN_DOUBLED_AREA = 1e-18

MAX_SHARPENINGS = 60  # the largest number of times that the penalty on folds is sharpened


@dataclass(frozen=True, eq=False)
class Bending:
    """A map of the plane that takes a triangulated silhouette to its tile, affine on each triangle.

    Both sides are in the target's normal form. The image's outline is the tile's polygon, vertex
    for vertex, and no triangle is turned over, so that inside the silhouette the map is a
    homeomorphism onto the tile. A point outside goes with the nearest point of the silhouette, and
    the rest of its way under the similarity nearest to the whole map: continuous across the
    outline, meant for what lies close to it.

    Args:
        rest: (N, 2) points of the silhouette.
        images: (N, 2) where they go.
        triangles: (M, 3) indices of the points, counter-clockwise in both.

    Raises `OrbiflowError` for arrays of other shapes, numbers that are not finite, indices out of
    range, too many points, and triangles that are flat or turned over.

    >>> corners = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]
    >>> bending = Bending(corners, [[0.0, 0.0], [2.0, 0.0], [0.0, 1.0]], [[0, 1, 2]])
    >>> bending.forward([0.25, 0.5]), bending.inverse([0.5, 0.5])
    (array([0.5, 0.5]), array([0.25, 0.5 ]))
    """

    rest: Array
    images: Array
    triangles: NDArray[np.int64]

    def __post_init__(self) -> None:
        rest = as_array(self.rest, "the bending's rest", ("N", 2))
        images = as_array(self.images, "the bending's images", (len(rest), 2))
        triangles = _indices(self.triangles, len(rest))
        for name, array in (("rest", rest), ("images", images)):
            with np.errstate(all="ignore"):  # an overflow counts as turned over
                sound = (
                    doubled_areas(array, triangles)
                    > MIN_DOUBLED_AREA * np.ptp(array, axis=0).max() ** 2
                )
            if not sound.all():
                raise OrbiflowError(
                    f"the bending's {name}: {int((~sound).sum())} triangles are flat or turned over"
                )
        for name, array in (("rest", rest), ("images", images), ("triangles", triangles)):
            array.setflags(write=False)
            object.__setattr__(self, name, array)

    def forward(self, points: Any) -> Any:
        """Return where points (..., 2) of the silhouette go, in the target's normal form.

        Arrays and lists give an array, tensors a tensor of their dtype and device, without a gradient;
        points that are not finite give NaN.
        """
        return self._forward(points)

    def inverse(self, points: Any) -> Any:
        """Return where points (..., 2) of the tile come from; as `forward`."""
        return self._backward(points)

    @cached_property
    def _forward(self) -> _PiecewiseAffine:
        return _PiecewiseAffine(self.rest, self.images, self.triangles)

    @cached_property
    def _backward(self) -> _PiecewiseAffine:
        return _PiecewiseAffine(self.images, self.rest, self.triangles)

    def __getstate__(self) -> dict[str, Any]:
        # the trees are made anew where they are needed
        return {name: self.__dict__[name] for name in ("rest", "images", "triangles")}


class _PiecewiseAffine:
    """One direction of the map."""

    def __init__(self, start: Array, end: Array, triangles: NDArray[np.int64]) -> None:
        self.tree = shapely.STRtree(np.asarray(shapely.polygons(start[triangles])))
        self.origin, self.image = start[triangles[:, 0]], end[triangles[:, 0]]
        sides = triangle_sides(start, triangles)
        self.linear = triangle_sides(end, triangles) @ np.linalg.inv(sides)
        # the linear part of the similarity that takes points nearest to their images
        factor = complex(best_similarity(complex_points(start), complex_points(end)))
        self.similarity = np.array([[factor.real, -factor.imag], [factor.imag, factor.real]])

    def __call__(self, given: Any) -> Any:
        """Return the images of an array or a tensor (..., 2) as the same."""
        points = as_array(given, "points", (..., 2), finite=False)
        flat = points.reshape(-1, 2)
        result = np.full_like(flat, np.nan)
        finite = np.isfinite(flat).all(axis=1)
        places = flat[finite]
        triangle, nearest = self._located(places)
        inside = np.einsum("pij,pj->pi", self.linear[triangle], nearest - self.origin[triangle])
        result[finite] = self.image[triangle] + inside + (places - nearest) @ self.similarity.T
        result = result.reshape(points.shape)
        if not is_tensor(given):
            return result
        import torch

        dtype = given.dtype if given.is_floating_point() else torch.float64
        return torch.as_tensor(result, dtype=dtype, device=given.device)

    def _located(self, points: Array) -> tuple[NDArray[np.int64], Array]:
        """Return the triangle (P,) in or nearest to which points (P, 2) lie, and its nearest points."""
        located, where = np.full(len(points), -1), np.asarray(shapely.points(points))
        index, triangle = self.tree.query(where, predicate="intersects")
        located[index] = triangle
        nearest = points.copy()
        outside = np.flatnonzero(located < 0)
        if len(outside):
            located[outside] = self.tree.nearest(where[outside])
            lines = shapely.shortest_line(self.tree.geometries[located[outside]], where[outside])
            nearest[outside] = shapely.get_coordinates(lines)[::2]
        return located, nearest


def _indices(values: ArrayLike, count: int) -> NDArray[np.int64]:
    triangles = np.array(values)
    if triangles.ndim != 2 or triangles.shape[1] != 3 or triangles.dtype.kind not in "iu":
        what = f"{triangles.dtype} of shape {triangles.shape}"
        raise OrbiflowError(
            f"the bending's triangles must be whole numbers of shape (M, 3), got {what}"
        )
    if not 3 <= count <= MAX_POINTS or not 1 <= len(triangles) <= MAX_TRIANGLES:
        raise OrbiflowError(
            f"a bending has 3 to {MAX_POINTS} points and 1 to {MAX_TRIANGLES} triangles, got "
            f"{count} and {len(triangles)}"
        )
    if triangles.min() < 0 or triangles.max() >= count:
        raise OrbiflowError(f"the bending's triangles must be indices of its {count} points")
    return triangles.astype(np.int64)


def unfolded(mesh: SilhouetteMesh, points: Array, sharpenings: int | None = None) -> Array:
    """Move the inner points of a map (N, 2) until no triangle is turned over.

    Foldover-free maps in few steps (Garanzha, Kaporin, Kudryavtseva, Protais, Ray and Sokolov,
    SIGGRAPH 2021): L-BFGS minimises the distortion |J|^2 / det J of each triangle, with det J bounded
    away from 0 by a shrinking parameter; if that fails, again from points each in the middle of its
    neighbours. Points on the outline, which bound a simple polygon, stay in place; and all do if
    nothing was turned over. With `sharpenings` it tries no longer than that, and from `points` alone.
    Raises `OrbiflowError` if triangles stay turned over.
    """
    if (doubled_areas(points, mesh.triangles) > 0).all():
        return points
    outline = points[: mesh.size + len(mesh.sides)]
    # the second is a start for tangled points
    for start in (points, harmonic(mesh, outline))[: None if sharpenings is None else 1]:
        untangled = _untangled(_Distortion(mesh, start), sharpenings or MAX_SHARPENINGS)
        if untangled is not None:
            return untangled
    raise OrbiflowError(
        "the silhouette cannot be carried to this tile without folds: parts of it are too thin"
    )


def _untangled(work: _Distortion, sharpenings: int) -> Array | None:
    import scipy.optimize

    x = work.start
    for _ in range(sharpenings):
        optimum = scipy.optimize.minimize(
            work.value, x, jac=True, method="L-BFGS-B", options={"maxiter": 30, "maxcor": 20}
        )
        x = optimum.x
        smallest = work.smallest(x)
        if smallest > 0:
            return work.points(x)
        work.sharpen(smallest)
    return None


class _Distortion:
    """The distortion as a function of the inner points, with its gradient."""

    def __init__(self, mesh: SilhouetteMesh, points: Array) -> None:
        self.mesh, self.images = mesh, points.copy()
        self.fixed = mesh.size + len(mesh.sides)
        edges = triangle_sides(mesh.points, mesh.triangles)
        self.area = np.linalg.det(edges) / 2
        self.area /= self.area.sum()
        self.slopes = _slopes(mesh, np.linalg.inv(edges))
        self.back = self.slopes.T.tocsr()
        self.start = points[self.fixed :].ravel()
        self.epsilon = 1.0
        self.sharpen(self.smallest(self.start))

    def points(self, x: Array) -> Array:
        images = self.images.copy()
        images[self.fixed :] = x.reshape(-1, 2)
        return images

    def smallest(self, x: Array) -> float:
        (a, c), (b, d) = self._jacobians(x)
        return float((a * d - b * c).min())

    def sharpen(self, smallest: float) -> None:
        """Bound the determinants less far from 0, so that the smallest still has an effect."""
        self.epsilon = min(0.5 * self.epsilon, 0.1 * abs(min(smallest, 0.0)) + 1e-6)

    def _jacobians(self, x: Array) -> Array:
        """Return the derivatives (2, 2, M) of the map's x and y, first those along x."""
        return (self.slopes @ self.points(x)).reshape(2, -1, 2).swapaxes(1, 2)

    def value(self, x: Array) -> tuple[float, Array]:
        jacobians: list[list[Array]] = list(map(list, self._jacobians(x)))
        (a, c), (b, d) = jacobians
        det: Array = a * d - b * c
        root: Array = np.sqrt(det**2 + self.epsilon**2)
        # (det + root) / 2 without cancellation
        bounded: Array = np.where(det > 0, det + root, self.epsilon**2 / (root + abs(det))) / 2
        energy: Array = self.area * (a**2 + b**2 + c**2 + d**2) / bounded
        larger: Array = 2 * self.area / bounded
        slope: Array = -energy / root
        by_j = [
            [larger * a + slope * d, larger * c - slope * b],
            [larger * b - slope * c, larger * d + slope * a],
        ]
        gradient: Array = self.back @ np.array(by_j).swapaxes(1, 2).reshape(-1, 2)
        return float(energy.sum()), gradient[self.fixed :].ravel()


def _slopes(mesh: SilhouetteMesh, inverse: Array) -> Any:
    """Return the matrix (2 M, N) of the derivatives along x, then y, of what is linear on triangles.

    `inverse` (M, 2, 2) is of the triangles' sides.
    """
    import scipy.sparse

    count = len(mesh.triangles)
    # of the corners (3, M, 2)
    weights = np.stack([-inverse.sum(axis=1), inverse[:, 0], inverse[:, 1]])
    rows = np.broadcast_to(np.arange(2 * count).reshape(2, -1), (3, 2, count))
    columns = np.broadcast_to(mesh.triangles.T[:, None], (3, 2, count))
    entries = weights.swapaxes(1, 2).ravel(), (rows.ravel(), columns.ravel())
    made: Any = scipy.sparse.csr_matrix
    return made(entries, shape=(2 * count, len(mesh.points)))
