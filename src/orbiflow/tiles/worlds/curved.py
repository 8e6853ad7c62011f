"""Points and motions of the sphere and of the hyperbolic plane.

Points of the sphere are unit vectors. Those of the hyperbolic plane are vectors (x, y, t) with
t^2 - x^2 - y^2 = 1, so that motions of both are matrices (3, 3). `sign` is 1 for the sphere and -1 for
the hyperbolic plane. A point may also be a spinor (y1, y2), of which only the quotient y1 / y2 counts:
its stereographic picture, or that in Poincaré's disc.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

import numpy as np

from orbiflow.arrays import Array, Complex

STEEP = 0.99  # of a direction: one that is nearer to the second axis has another one upwards


def curvature(orders: Sequence[int]) -> int:
    """Return 1 if cone points of these orders make a sphere, -1 the hyperbolic plane, 0 the flat one.

    >>> curvature((2, 3, 5)), curvature((2, 3, 7)), curvature((4, 4, 2)), curvature((2, 2, 2, 3))
    (1, -1, 0, -1)
    """
    excess = 2 - sum(1 - Fraction(1, order) for order in orders)
    return (excess > 0) - (excess < 0)


def form(sign: int) -> Array:
    """Return the diagonal (3,) of the form that motions keep: x^2 + y^2 + t^2, or - t^2."""
    return np.array([1.0, 1.0, float(sign)])


def undone(motions: Array, sign: int) -> Array:
    """Return the inverses of motions (..., 3, 3): their transposes, by the form."""
    diagonal = form(sign)
    return diagonal[:, None] * np.swapaxes(motions, -1, -2) * diagonal


def disc_of(vectors: Array) -> Complex:
    """Return the stereographic picture, or that in Poincaré's disc, of points (..., 3)."""
    return (vectors[..., 0] + 1j * vectors[..., 1]) / (1 + vectors[..., 2])


def norms(spinors: Complex, sign: int) -> Array:
    """Return |y2|^2 + sign |y1|^2 of spinors (..., 2), the form that their motions keep."""
    squares = (spinors * np.conj(spinors)).real
    return squares[..., 1] + sign * squares[..., 0]


def vectors_of(spinors: Complex, sign: int) -> Array:
    """Return the points (..., 3) of spinors (..., 2)."""
    squares = (spinors * np.conj(spinors)).real
    across = 2 * spinors[..., 0] * np.conj(spinors[..., 1])
    along = squares[..., 1] - sign * squares[..., 0]
    return np.stack([across.real, across.imag, along], -1) / norms(spinors, sign)[..., None]


def motions_of_spinors(matrices: Complex, sign: int, mirrored: bool = False) -> Array:
    """Return the motions (..., 3, 3) of matrices (..., 2, 2) that keep the form up to a factor.

    With `mirrored` they take the conjugates of spinors.
    """
    x = np.array([[0, 0.5], [0.5, 0]], dtype=np.complex128)
    y = np.array([[0, 0.5j], [-0.5j, 0]])
    t = np.array([[-0.5 * sign, 0], [0, 0.5]], dtype=np.complex128)
    basis = np.stack([x, np.conj(y) if mirrored else y, t])
    scale = np.abs(np.linalg.det(matrices))[..., None, None, None]
    back = np.conj(np.swapaxes(matrices, -1, -2))
    moved = matrices[..., None, :, :] @ basis @ back[..., None, :, :] / scale
    across, along = 2 * moved[..., 0, 1], moved[..., 1, 1] - sign * moved[..., 0, 0]
    return np.stack([across.real, across.imag, along.real], axis=-2)


def facing(ahead: Array) -> Array:
    """Return the rotation that takes a direction (3,) to (0, 0, 1)."""
    steepest = np.eye(3)[1 if abs(ahead[1]) < STEEP else 0]
    right = np.cross(steepest, ahead)
    right = right / np.linalg.norm(right)
    return np.stack([right, np.cross(ahead, right), ahead])


def turned(angle: float) -> Array:
    """Return the rotation (3, 3) about the third axis by an angle."""
    cos, sin = np.cos(angle), np.sin(angle)
    return np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
