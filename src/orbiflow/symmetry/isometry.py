"""Isometries of R^d: p -> R p + t, with R orthogonal."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar, cast

import numpy as np
from numpy.typing import ArrayLike

from orbiflow.arrays import Array
from orbiflow.errors import GroupError, NotAnIsometryError
from orbiflow.settings import is_a, is_tensor

if TYPE_CHECKING:
    import torch

    Points = TypeVar("Points", Array, torch.Tensor)
else:  # torch is imported by those who have tensors
    Points = TypeVar("Points")

# the largest deviation from orthogonality, or from a lattice vector, that counts as rounding
TOLERANCE = 1e-9


def cast_like(array: Array, like: Points) -> Points:
    """Return a float64 array, or for a tensor `like` the same as a tensor of its dtype and device.

    Raises `GroupError` for an integer tensor, in which a rotation would be truncated.
    """
    if is_tensor(like):
        import torch

        if not like.is_floating_point():
            raise GroupError(f"expected points of a floating-point dtype, got {like.dtype}")
        return cast(Points, torch.tensor(array, dtype=like.dtype, device=like.device))
    return cast(Points, array)


def check_dimension(points: Points, dim: int) -> None:
    """Raise GroupError for points that are not of shape (..., dim)."""
    shape = tuple(np.shape(points))
    if not shape or shape[-1] != dim:
        raise GroupError(f"expected points of shape (..., {dim}), got {shape}")


@dataclass(frozen=True, eq=False)
class Isometry:
    """The map p -> linear @ p + translation.

    Args:
        linear: An orthogonal matrix (d, d).
        translation: A vector (d,), in the units of the points.

    Raises `NotAnIsometryError` if `linear` is not orthogonal within 1e-9 or the shapes disagree.

    >>> quarter = Isometry(np.array([[0.0, -1.0], [1.0, 0.0]]), np.zeros(2))
    >>> (quarter @ quarter)(np.array([1.0, 2.0])).tolist()
    [-1.0, -2.0]
    """

    linear: Array
    translation: Array

    def __post_init__(self) -> None:
        linear = np.array(self.linear, dtype=np.float64)
        translation = np.array(self.translation, dtype=np.float64)
        d = translation.size
        if translation.shape != (d,) or d == 0 or linear.shape != (d, d):
            raise NotAnIsometryError(
                f"expected a (d, d) matrix and a (d,) translation, got shapes {linear.shape} "
                f"and {translation.shape}"
            )
        if not (np.isfinite(linear).all() and np.isfinite(translation).all()):
            raise NotAnIsometryError("the matrix or the translation has NaN or infinite entries")
        deviation = np.abs(linear.T @ linear - np.eye(d)).max()
        if deviation > TOLERANCE:
            raise NotAnIsometryError(
                f"the linear part is not orthogonal: R^T R differs from the identity by "
                f"{deviation:.2e}; give a rotation or reflection matrix"
            )
        linear.setflags(write=False)
        translation.setflags(write=False)
        object.__setattr__(self, "linear", linear)
        object.__setattr__(self, "translation", translation)

    @property
    def dim(self) -> int:
        """Dimension d of the space."""
        return self.translation.size

    @property
    def determinant(self) -> int:
        """+1 for a direct isometry, -1 for one that reverses orientation."""
        return 1 if np.linalg.det(self.linear) > 0 else -1

    def __call__(self, points: Points) -> Points:
        """Return the image of points, shape (..., d), NumPy or torch.

        Raises `GroupError` for points of another dimension.
        """
        check_dimension(points, self.dim)
        linear, translation = (cast_like(a, points) for a in (self.linear, self.translation))
        return points @ linear.T + translation

    def push(self, vectors: Points) -> Points:
        """Return the push-forward of tangent vectors, shape (..., d): the linear part alone.

        Raises `GroupError` for vectors of another dimension.
        """
        check_dimension(vectors, self.dim)
        return vectors @ cast_like(self.linear, vectors).T

    def __matmul__(self, other: Isometry) -> Isometry:
        """Compose two isometries: `(g @ h)(p) == g(h(p))`."""
        if not is_a(other, Isometry):
            return NotImplemented
        if other.dim != self.dim:
            raise GroupError(f"cannot compose isometries of R^{self.dim} and R^{other.dim}")
        return Isometry(
            self.linear @ other.linear, self.linear @ other.translation + self.translation
        )

    def inverse(self) -> Isometry:
        """Return the isometry that undoes this one."""
        return Isometry(self.linear.T, -self.linear.T @ self.translation)

    def is_close(self, other: Isometry, tolerance: float = TOLERANCE) -> bool:
        """Return whether both parts agree within `tolerance`."""
        return (
            other.dim == self.dim
            and bool(np.abs(self.linear - other.linear).max() <= tolerance)
            and bool(np.abs(self.translation - other.translation).max() <= tolerance)
        )

    def __repr__(self) -> str:
        linear, translation = self.linear.round(6) + 0.0, self.translation.round(6) + 0.0
        return f"Isometry(linear={linear.tolist()}, translation={translation.tolist()})"


def identity(dim: int) -> Isometry:
    """Return the identity of R^dim."""
    return Isometry(np.eye(dim), np.zeros(dim))


def translation(vector: ArrayLike) -> Isometry:
    """Return the translation by `vector`, shape (d,)."""
    vector = np.asarray(vector, dtype=np.float64)
    return Isometry(np.eye(vector.size), vector)


def _vector(value: ArrayLike, name: str) -> Array:
    array = np.asarray(value, dtype=np.float64)
    if array.shape != (2,) or not np.isfinite(array).all():
        raise GroupError(f"{name} must be two finite numbers, got {value!r}")
    return array


class Line:
    """The line through `point` along `direction`, both of shape (2,).

    The direction is kept at unit length.

    Raises `GroupError` if the direction is zero or a coordinate is not finite.
    """

    def __init__(self, point: ArrayLike, direction: ArrayLike) -> None:
        self.point = _vector(point, "the point of a line")
        vector = _vector(direction, "the direction of a line")
        length = float(np.hypot(*vector))
        if length == 0.0:
            raise GroupError("the direction of a line must not be zero")
        self.direction = vector / length

    def __repr__(self) -> str:
        return f"Line(point={self.point.tolist()}, direction={self.direction.tolist()})"


def rotation_matrix(angle: float) -> Array:
    """Return the counter-clockwise rotation by `angle` radians, exact at quarter turns."""
    quarters = angle / (math.pi / 2)
    if abs(quarters - round(quarters)) < 1e-15 * max(1.0, abs(quarters)):
        c, s = ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[round(quarters) % 4]
    else:
        c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s], [s, c]])


def rotation(center: ArrayLike, order: int) -> Isometry:
    """Return the (c, K)-rotation: counter-clockwise by 2 pi / `order` about `center`.

    Raises `GroupError` if `order` is not a non-zero integer (negative turns clockwise).

    >>> rotation((1.0, 0.0), 2)(np.array([0.0, 0.0])).tolist()
    [2.0, 0.0]
    """
    if order == 0 or int(order) != order:
        raise GroupError(f"the order of a rotation must be a non-zero integer, got {order!r}")
    point = _vector(center, "the centre of a rotation")
    linear = rotation_matrix(2 * math.pi / order)
    return Isometry(linear, point - linear @ point)


def transflection(line: Line, mu: float) -> Isometry:
    """Return the (l, mu)-transflection: mirror in `line`, then move by `mu` along its direction.

    A glide reflection; `mu` is in the units of the points.

    >>> transflection(Line((0.5, 0.0), (0.0, 1.0)), 1.0)(np.array([0.25, 0.0])).tolist()
    [0.75, 1.0]
    """
    d = line.direction
    linear = 2.0 * np.outer(d, d) - np.eye(2)
    return Isometry(linear, line.point - linear @ line.point + mu * d)


def reflection(line: Line) -> Isometry:
    """Return the mirror in `line`: the transflection with mu = 0."""
    return transflection(line, 0.0)
