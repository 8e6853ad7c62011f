"""The map from a silhouette to its tile, triangle by triangle."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from orbiflow.arguments import is_tensor, numbers
from orbiflow.arrays import Array
from orbiflow.errors import OrbiflowError
from orbiflow.tiles.geometry import best_similarity, complex_points
from orbiflow.tiles.silhouette.mesh import Locator

if TYPE_CHECKING:
    import torch

MAX_POINTS, MAX_TRIANGLES = 100_000, 200_000
"""Beyond these a mesh is refused: real ones have some thousands."""

FLAT = 1e-18
"""Twice the area of a triangle, in squares of the whole's extent, that rounding can turn over."""


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

    Raises:
        OrbiflowError: for arrays of other shapes, numbers that are not finite, indices out of range,
            too many points, and triangles that are flat or turned over.

    >>> corners = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]
    >>> bending = Bending(corners, [[0.0, 0.0], [2.0, 0.0], [0.0, 1.0]], [[0, 1, 2]])
    >>> bending.forward([0.25, 0.5]), bending.inverse([0.5, 0.5])
    (array([0.5, 0.5]), array([0.25, 0.5 ]))
    """

    rest: Array
    images: Array
    triangles: NDArray[np.int64]

    def __post_init__(self) -> None:
        rest = numbers(self.rest, "the bending's rest", ("N", 2))
        images = numbers(self.images, "the bending's images", (len(rest), 2))
        triangles = _indices(self.triangles, len(rest))
        for name, array in (("rest", rest), ("images", images)):
            with np.errstate(all="ignore"):  # an overflow counts as turned over
                sound = _determinants(array, triangles) > FLAT * np.ptp(array, axis=0).max() ** 2
            if not sound.all():
                raise OrbiflowError(
                    f"the bending's {name}: {int((~sound).sum())} triangles are flat or turned over"
                )
        for name, array in (("rest", rest), ("images", images), ("triangles", triangles)):
            array.setflags(write=False)
            object.__setattr__(self, name, array)

    @overload
    def forward(self, points: torch.Tensor) -> torch.Tensor: ...
    @overload
    def forward(self, points: ArrayLike) -> Array: ...
    def forward(self, points: torch.Tensor | ArrayLike) -> torch.Tensor | Array:
        """Where points (..., 2) of the silhouette go.

        Args:
            points: an array, lists or a tensor, in the target's normal form; those that are not
                finite give NaN.

        Returns:
            (..., 2): for a tensor, one of its dtype and device, without a gradient.
        """
        return _kind_of(points, self._forward(_checked(points)))

    @overload
    def inverse(self, points: torch.Tensor) -> torch.Tensor: ...
    @overload
    def inverse(self, points: ArrayLike) -> Array: ...
    def inverse(self, points: torch.Tensor | ArrayLike) -> torch.Tensor | Array:
        """Where points (..., 2) of the tile come from; as `forward`."""
        return _kind_of(points, self._backward(_checked(points)))

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
        self.locator = Locator(start, triangles)
        before, after = start[triangles], end[triangles]
        sides, images = (
            np.stack([c[:, 1] - c[:, 0], c[:, 2] - c[:, 0]], axis=2) for c in (before, after)
        )
        self.origin, self.image = before[:, 0], after[:, 0]
        self.linear = images @ np.linalg.inv(sides)
        self.similarity = _similarity(start, end)

    def __call__(self, points: Array) -> Array:
        flat = points.reshape(-1, 2)
        result = np.full_like(flat, np.nan)
        finite = np.isfinite(flat).all(axis=1)
        own = flat[finite]
        triangle, nearest = self.locator.locate(own)
        inside = np.einsum("pij,pj->pi", self.linear[triangle], nearest - self.origin[triangle])
        result[finite] = self.image[triangle] + inside + (own - nearest) @ self.similarity.T
        return result.reshape(points.shape)


def _similarity(start: Array, end: Array) -> Array:
    """Linear part (2, 2) of the similarity that takes points nearest to their images."""
    factor = complex(best_similarity(complex_points(start), complex_points(end)))
    return np.array([[factor.real, -factor.imag], [factor.imag, factor.real]])


def _determinants(points: Array, triangles: NDArray[np.int64]) -> Array:
    corners = points[triangles]
    u, v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    return u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]


def _indices(values: ArrayLike, count: int) -> NDArray[np.int64]:
    triangles = np.array(values)
    if triangles.ndim != 2 or triangles.shape[1] != 3 or triangles.dtype.kind not in "iu":
        raise OrbiflowError(
            "the bending's triangles must be whole numbers of shape (M, 3), got "
            f"{triangles.dtype} of shape {triangles.shape}"
        )
    if not 3 <= count <= MAX_POINTS or not 1 <= len(triangles) <= MAX_TRIANGLES:
        raise OrbiflowError(
            f"a bending has 3 to {MAX_POINTS} points and 1 to {MAX_TRIANGLES} triangles, got "
            f"{count} and {len(triangles)}"
        )
    if triangles.min() < 0 or triangles.max() >= count:
        raise OrbiflowError(f"the bending's triangles must be indices of its {count} points")
    return triangles.astype(np.int64)


def _checked(points: Any) -> Array:
    return numbers(points, "points", (..., 2), finite=False)


def _kind_of(given: Any, result: Array) -> Any:
    if not is_tensor(given):
        return result
    import torch

    dtype = given.dtype if given.is_floating_point() else torch.float64
    return torch.as_tensor(result, dtype=dtype, device=given.device)
