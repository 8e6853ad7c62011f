"""Closed rings: area, centroid, sense, evenly divided sides.

A ring is an array (..., N, 2), float64 in NumPy, whose last vertex is not a repeat of the first;
leading axes are a stack of rings. What torch needs as well takes tensors and is differentiable.
"""

from __future__ import annotations

from typing import Any, TypeVar

import numpy as np
import torch
from numpy.typing import ArrayLike, NDArray

Ring = NDArray[Any]
AnyRing = TypeVar("AnyRing", NDArray[Any], torch.Tensor)


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
    if isinstance(ring, torch.Tensor):
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
