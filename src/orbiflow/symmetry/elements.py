"""Rotation centres and mirror and glide lines of a plane group, found from the group itself."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from orbiflow.arrays import Array
from orbiflow.errors import GroupError
from orbiflow.symmetry.group import CrystallographicGroup
from orbiflow.symmetry.isometry import Isometry, Line


class RotationCenter(NamedTuple):
    """A point (2,) about which 2 pi / order is the group's smallest angle of rotation."""

    point: Array
    order: int


class GlideLine(NamedTuple):
    """A line along which `shift` is the group's smallest glide; a mirror if it is zero."""

    line: Line
    shift: float

    @property
    def is_mirror(self) -> bool:
        """Whether the line is a mirror."""
        return self.shift == 0.0


class SymmetryElements(NamedTuple):
    """The rotation centres and the mirror and glide lines that `symmetry_elements` finds."""

    centers: tuple[RotationCenter, ...]
    lines: tuple[GlideLine, ...]


def symmetry_elements(
    group: CrystallographicGroup, center: Array | None = None, radius: float | None = None
) -> SymmetryElements:
    """Return the rotation centres in a disc, and the mirror and glide lines that cross it.

    Args:
        group: A group of the plane.
        center: The centre (2,) of the disc. Default: the middle of the cell B [0, 1)^2.
        radius: The radius of the disc. Default: the cell's, so that every orbit is represented.

    Raises:
        GroupError: if the group is not one of the plane.

    >>> from orbiflow.symmetry import wallpaper_group
    >>> found = symmetry_elements(wallpaper_group("p4"), np.zeros(2), 0.1)
    >>> [(c.order, c.point.tolist()) for c in found.centers], found.lines
    ([(4, [0.0, 0.0])], ())
    """
    if group.dim != 2:
        raise GroupError(
            f"rotation centres and lines need a plane group, got dimension {group.dim}"
        )
    cell = np.abs(group.lattice).sum(axis=1)
    middle = group.lattice.sum(axis=1) / 2 if center is None else np.asarray(center, dtype=float)
    reach = float(np.linalg.norm(cell)) / 2 if radius is None else radius
    # a rotation about a point of the disc moves the middle by at most twice the radius; the least
    # glide along a line adds less than a cell
    elements = group.elements_near(middle, 2 * reach + float(np.linalg.norm(cell)))
    centers = _centers([g for g in elements if g.determinant > 0], middle, reach)
    lines = _lines([g for g in elements if g.determinant < 0], middle, reach)
    return SymmetryElements(tuple(centers), tuple(lines))


def _centers(elements: list[Isometry], middle: Array, reach: float) -> list[RotationCenter]:
    found: list[RotationCenter] = []
    for g in sorted(elements, key=_angle):
        if _angle(g) < 1e-6:
            continue
        point = np.linalg.solve(np.eye(2) - g.linear, g.translation)
        if np.linalg.norm(point - middle) > reach * (1 + 1e-9):
            continue
        if all(np.linalg.norm(point - other.point) > 1e-6 * reach for other in found):
            found.append(RotationCenter(point, round(2 * np.pi / _angle(g))))
    return found


def _angle(g: Isometry) -> float:
    return abs(float(np.arctan2(g.linear[1, 0], g.linear[0, 0])))


def _lines(elements: list[Isometry], middle: Array, reach: float) -> list[GlideLine]:
    found: list[GlideLine] = []
    for line in sorted((_axis(g, middle, reach) for g in elements), key=lambda item: item.shift):
        distance = float(np.linalg.norm(line.line.point - middle))
        if distance <= reach * (1 + 1e-9) and not any(_same(line, other, reach) for other in found):
            found.append(line)
    return found


def _axis(g: Isometry, middle: Array, reach: float) -> GlideLine:
    """Return the line (its point nearest to `middle`) and glide of a reversing isometry."""
    angle = np.arctan2(g.linear[1, 0], g.linear[0, 0]) / 2
    direction = np.array([np.cos(angle), np.sin(angle)])
    moved = g(middle) - middle
    shift = float(moved @ direction)
    point = middle + (moved - shift * direction) / 2
    return GlideLine(Line(point, direction), abs(shift) if abs(shift) > 1e-9 * reach else 0.0)


def _same(first: GlideLine, second: GlideLine, reach: float) -> bool:
    # the points are feet of perpendiculars from one point, so equal lines have equal points
    parallel = (
        abs(float(np.linalg.det(np.stack([first.line.direction, second.line.direction])))) < 1e-6
    )
    return parallel and bool(np.linalg.norm(first.line.point - second.line.point) < 1e-6 * reach)
