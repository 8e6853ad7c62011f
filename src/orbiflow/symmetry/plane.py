"""Isometries of the plane in the paper's terms (section 2.2): rotations and transflections."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from orbiflow.errors import GroupError
from orbiflow.symmetry.isometry import Array, Isometry


def _vector(value: ArrayLike, name: str) -> Array:
    array = np.asarray(value, dtype=np.float64)
    if array.shape != (2,) or not np.isfinite(array).all():
        raise GroupError(f"{name} must be two finite numbers, got {value!r}")
    return array


class Line:
    """The line through `point` along `direction`, both of shape (2,).

    The direction is kept at unit length.

    Raises:
        GroupError: if the direction is zero or a coordinate is not finite.
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
    """Counter-clockwise rotation by `angle` radians, exact at multiples of a quarter turn."""
    quarters = angle / (math.pi / 2)
    if abs(quarters - round(quarters)) < 1e-15 * max(1.0, abs(quarters)):
        c, s = ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[round(quarters) % 4]
    else:
        c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s], [s, c]])


def rotation(center: ArrayLike, order: int) -> Isometry:
    """The (c, K)-rotation: counter-clockwise by 2 pi / `order` about `center`.

    Raises:
        GroupError: if `order` is not a non-zero integer (negative turns clockwise).

    >>> rotation((1.0, 0.0), 2)(np.array([0.0, 0.0])).tolist()
    [2.0, 0.0]
    """
    if order == 0 or int(order) != order:
        raise GroupError(f"the order of a rotation must be a non-zero integer, got {order!r}")
    point = _vector(center, "the centre of a rotation")
    linear = rotation_matrix(2 * math.pi / order)
    return Isometry(linear, point - linear @ point)


def transflection(line: Line, mu: float) -> Isometry:
    """The (l, mu)-transflection: mirror in `line`, then move by `mu` along its direction.

    A glide reflection; `mu` is in the units of the points.

    >>> transflection(Line((0.5, 0.0), (0.0, 1.0)), 1.0)(np.array([0.25, 0.0])).tolist()
    [0.75, 1.0]
    """
    d = line.direction
    linear = 2.0 * np.outer(d, d) - np.eye(2)
    return Isometry(linear, line.point - linear @ line.point + mu * d)


def reflection(line: Line) -> Isometry:
    """Mirror in `line`: the transflection with mu = 0."""
    return transflection(line, 0.0)
