"""Closed rings: area, centroid, sense, evenly divided sides.

A ring is an array (..., N, 2), float64 in NumPy, whose last vertex is not a repeat of the first;
leading axes are a stack of rings. What torch needs as well takes tensors and is differentiable.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from orbiflow.arguments import is_tensor
from orbiflow.errors import OrbiflowError

Ring = NDArray[Any]
if TYPE_CHECKING:
    import torch

    AnyRing = TypeVar("AnyRing", NDArray[Any], torch.Tensor)
else:  # torch is imported by those who have tensors
    AnyRing = TypeVar("AnyRing")


def signed_area(ring: AnyRing) -> AnyRing:
    """Area that each ring encloses, positive where it is counter-clockwise with y up.

    The shoelace formula about the first vertex: far from the origin the plain formula takes the
    difference of products as large as the squared distance, and none of the area's digits is left.

    Args:
        ring: (..., N, 2), NumPy or torch.

    Returns:
        (...), a NumPy scalar for a single ring; in square units of the ring.

    >>> square = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]])
    >>> float(signed_area(square)), float(signed_area(square + 1e8))
    (2.0, 2.0)
    """
    return 0.5 * _crosses(ring - ring[..., :1, :]).sum(-1)  # pyright: ignore[reportReturnType]


def centroid(ring: Ring) -> Ring:
    """Centre of mass (..., 2) of the region that each ring (..., N, 2) encloses.

    >>> centroid(np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]]))
    array([1. , 0.5])
    """
    first = ring[..., :1, :]
    local = ring - first
    cross = _crosses(local)
    moment = ((local + np.roll(local, -1, axis=-2)) * cross[..., None]).sum(axis=-2)
    return first[..., 0, :] + moment / (3 * cross.sum(axis=-1)[..., None])


def reverse(ring: Ring) -> Ring:
    """The same ring (N, 2) run through the other way, from the same first vertex."""
    return np.roll(ring[::-1], 1, axis=0)


def orient(ring: Ring, *, counter_clockwise: bool = True) -> Ring:
    """`ring` (N, 2), reversed if need be so that it runs as asked (as seen with y up)."""
    return ring if bool(signed_area(ring) > 0) == counter_clockwise else reverse(ring)


def subdivided(ring: AnyRing, pieces: int, phase: float = 0.0) -> AnyRing:
    """Points (..., N pieces, 2) of rings (..., N, 2): each side divided evenly into `pieces`.

    With phase 0 every vertex is among them; `phase` moves them along by that share of a piece. Sides
    that are images of each other under an isometry are divided alike, which arc length does not
    promise to the last digit.

    >>> subdivided(np.array([[0.0, 0.0], [2.0, 0.0], [0.0, 2.0]]), 2)[:3].tolist()
    [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]]
    """
    shape = (*ring.shape[:-2], ring.shape[-2] * pieces, 2)
    if is_tensor(ring):
        import torch

        steps = torch.arange(pieces, dtype=ring.dtype, device=ring.device)
        sides = ring.roll(-1, dims=-2) - ring
    else:
        steps = np.arange(pieces, dtype=np.float64)
        sides = np.roll(ring, -1, axis=-2) - ring
    shares = ((steps + phase) / pieces)[:, None]
    points = ring[..., :, None, :] + shares * sides[..., :, None, :]
    return points.reshape(shape)  # pyright: ignore[reportReturnType]


def _crosses(local: AnyRing) -> AnyRing:
    """Twice the area (..., N) of the triangle of each side and the origin."""
    ahead = local[..., [*range(1, local.shape[-2]), 0], :]
    return local[..., 0] * ahead[..., 1] - ahead[..., 0] * local[..., 1]


def complex_points(points: ArrayLike) -> NDArray[np.complex128]:
    """Points (..., 2) as complex numbers x + iy (...).

    >>> complex_points([[1.0, 2.0]])
    array([1.+2.j])
    """
    array = np.asarray(points, dtype=np.float64)
    return array[..., 0] + 1j * array[..., 1]


def plane_points(z: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Complex numbers (...) as points (..., 2): the inverse of `complex_points`."""
    return np.stack([z.real, z.imag], axis=-1)


def best_similarity(
    points: NDArray[np.complex128], images: NDArray[np.complex128]
) -> NDArray[np.complex128]:
    """Factors of the similarities z -> factor (z - mean) + mean' nearest to given images.

    Least squares over the first axis (Procrustes): a turn and a scale, without mirror images.

    Args:
        points: (N,) x + iy.
        images: (N,) or (N, C), where each point goes, C times.

    Returns:
        () or (C,), in the images' units over the points'.

    >>> triangle = np.array([0, 1, 1j])
    >>> complex(best_similarity(triangle, 2j * triangle + 5))
    2j
    """
    own = points - points.mean(axis=0)
    return np.conj(own) @ (images - images.mean(axis=0)) / (abs(own) ** 2).sum()


def ring_length(ring: Ring) -> float:
    """Length of the closed `ring` (N, 2), the side from its last vertex to its first included.

    >>> ring_length(np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 4.0]]))
    12.0
    """
    return float(arc_lengths(ring)[-1])


def points_along(ring: Ring, at: ArrayLike) -> Ring:
    """Points (P, 2) of the closed `ring` (N, 2) at the arc lengths `at` (P,) from its first vertex.

    Lengths beyond the ring's own, and negative ones, go round.

    >>> points_along(np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]), [0.5, 4.5]).tolist()
    [[0.5, 0.0], [0.5, 0.0]]
    """
    knots = arc_lengths(ring)
    return _interpolated(ring, knots, np.asarray(at, dtype=np.float64) % knots[-1])


def resampled(ring: Ring, count: int, phase: float = 0.0) -> Ring:
    """`count` points (count, 2) evenly spaced along the closed `ring` (N, 2).

    `phase`, from 0 to 1, moves them along by that share of their spacing.

    >>> square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    >>> resampled(square, 4, phase=0.5).tolist()
    [[0.5, 0.0], [1.0, 0.5], [0.5, 1.0], [0.0, 0.5]]
    """
    knots = arc_lengths(ring)
    return _interpolated(ring, knots, (np.arange(count) + phase) / count * knots[-1])


def resampled_with_corners(
    ring: Ring, corners: Sequence[int], count: int
) -> tuple[Ring, list[int]]:
    """As `resampled`, with some vertices of the ring kept as they are.

    Between one corner and the next the points are evenly spaced; how many there are follows the
    length between them (largest remainders), at least the corner itself.

    Args:
        ring: (N, 2).
        corners: indices of the vertices to keep, increasing; the first point is the first of them.
        count: points in all, at least as many as there are corners.

    Returns:
        The points (count, 2), and the index of each corner among them.

    Raises:
        OrbiflowError: for corners that do not increase or are not vertices, and for too few points.

    >>> square = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]])
    >>> points, at = resampled_with_corners(square, [1, 3], 4)
    >>> points.tolist(), at
    ([[2.0, 0.0], [1.5, 1.0], [0.0, 1.0], [0.5, 0.0]], [0, 2])
    """
    kept = [int(k) for k in corners]
    if not kept or kept[0] < 0 or kept[-1] >= len(ring) or (np.diff(kept) < 1).any():
        raise OrbiflowError(
            f"corners must be increasing indices of the {len(ring)} vertices, got {kept}"
        )
    if count < len(kept):
        raise OrbiflowError(f"{len(kept)} corners need at least as many points, got {count}")
    knots = arc_lengths(ring)
    starts = knots[kept]
    lengths = np.diff(starts, append=starts[0] + knots[-1])
    shares = _shared_out(lengths, count)
    at: list[Ring] = [
        start + length * np.arange(share) / share
        for start, length, share in zip(starts, lengths, shares, strict=True)
    ]
    points = _interpolated(ring, knots, np.concatenate(at) % knots[-1])
    indices = (np.cumsum(shares) - shares).tolist()
    points[indices] = ring[kept]  # bit for bit
    return points, indices


def arc_lengths(ring: Ring) -> Ring:
    """Arc lengths (N + 1,) at each vertex of the closed `ring` (N, 2), and at the first again.

    >>> arc_lengths(np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 4.0]])).tolist()
    [0.0, 3.0, 7.0, 12.0]
    """
    sides = np.roll(ring, -1, axis=0) - ring
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(sides, axis=1))])


def _interpolated(ring: Ring, knots: Ring, at: Ring) -> Ring:
    closed = np.concatenate([ring, ring[:1]])
    return np.stack([np.interp(at, knots, closed[:, k]) for k in (0, 1)], axis=-1)


def _shared_out(lengths: Ring, count: int) -> np.ndarray:
    """Whole numbers of at least 1 with sum `count`, in proportion to `lengths`."""
    spare = count - len(lengths)
    exact = spare * lengths / lengths.sum()
    whole = np.floor(exact).astype(int)
    largest = np.argsort(whole - exact, kind="stable")[: spare - whole.sum()]
    whole[largest] += 1
    return whole + 1


def polygons_in(geometry: BaseGeometry) -> list[Polygon]:
    """The polygons that `geometry` is made of, lines and points left out."""
    if isinstance(geometry, Polygon):
        return [] if geometry.is_empty else [geometry]
    parts: Iterable[BaseGeometry] = getattr(geometry, "geoms", ())
    return [polygon for part in parts for polygon in polygons_in(part)]
