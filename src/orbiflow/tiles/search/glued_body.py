"""Two silhouettes that share a path of their outlines, as one elastic body (design point 21)."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

import numpy as np

from orbiflow.arrays import Array, Complex, Integers
from orbiflow.tiles.geometry import reverse, ring_length
from orbiflow.tiles.likeness import Elastic, ElasticBody, Stiffness
from orbiflow.tiles.search.co_deformation import BODIES
from orbiflow.tiles.silhouette import CORNER_DEPTH, important_vertices, triangulate, with_corners

MULTIPLES = (1, 2, 8)  # points of each level for each point of the first
BACKGROUND = Stiffness(salience=0.0, pose=0.0)  # of a figure that may have any shape
BACKGROUND_STIFFNESS = 0.03  # of it, relative to others


class Glue(NamedTuple):
    """Which path two outlines share.

    From its point `first` on, the first outline runs along it for `length` steps; the second one
    runs back along it, from its point `second` on.
    """

    first: int
    second: int
    length: int

    def times(self, multiple: int) -> Glue:
        """Return the same for outlines with so many times as many points."""
        return Glue(*(multiple * number for number in self))


class GluedBody(ElasticBody):
    """Two elastic bodies with the points of a path in common; each keeps its own rotations and pose.

    Its first n points are the outline of both together, counter-clockwise: the first figure's from the
    path's end around to its start, then the second one's. Then come the points within the path, then
    those inside of the figures.

    >>> square = np.array([[0.0, 0.0], [0.5, 0.0], [1.0, 0.0], [1.0, 0.5], [1.0, 1.0], [0.0, 1.0]])
    >>> body = GluedBody((Elastic(square), Elastic(square)), Glue(0, 0, 2))
    >>> body.size, [len(ring) for ring in body.rings(body.rest)]
    (8, [6, 6])
    """

    def __init__(self, parts: tuple[Elastic, Elastic], glue: Glue) -> None:
        super().__init__()
        left, right = parts
        self.glue, self._figures = glue, parts
        first, second, length = glue
        free = left.size - length  # the steps of the first figure that are not on the path
        self.size = free + right.size - length
        self.outer = count = self.size + length - 1
        within = np.arange(1, length)
        at_left, at_right = (
            np.empty(len(left), dtype=np.int64),
            np.empty(len(right), dtype=np.int64),
        )
        at_left[(first + length + np.arange(free)) % left.size] = np.arange(free)
        rest = np.arange(right.size - length)
        at_right[(second + length + rest) % right.size] = free + rest
        at_left[first % left.size], at_right[second % right.size] = free, 0
        on_path = self.size + within - 1
        at_left[(first + within) % left.size] = on_path
        at_right[(second + length - within) % right.size] = on_path
        at_left[left.size :] = count + np.arange(len(left) - left.size)
        at_right[right.size :] = count + len(left) - left.size + np.arange(len(right) - right.size)
        self._places: tuple[Integers, Integers] = (at_left, at_right)
        self._count = count + len(left) - left.size + len(right) - right.size
        paths = self.path(left.rest, right.rest)
        turn = np.vdot(np.diff(paths[1]), np.diff(paths[0]))
        moved = turn / abs(turn) * (right.rest - paths[1].mean()) + paths[0].mean()
        self.rest = self.joined((left.rest[:, None], moved[:, None]))[:, 0]

    @property
    def figures(self) -> tuple[Elastic, Elastic]:
        return self._figures

    @property
    def places(self) -> tuple[Integers, Integers]:
        return self._places

    def path(self, left: Complex, right: Complex) -> tuple[Complex, Complex]:
        """Return the path's points (length + 1,) as each figure's own points have them."""
        first, second, length = self.glue
        along = np.arange(length + 1)
        sizes = [part.size for part in self.figures]
        return left[(first + along) % sizes[0]], right[(second + length - along) % sizes[1]]

    def joined(self, shapes: Sequence[Complex]) -> Complex:
        """Return shapes (N, C) of both from those of the figures, which meet in the middle."""
        total = np.zeros((self._count, shapes[0].shape[1]), dtype=complex)
        count = np.zeros((self._count, 1))
        for places, z in zip(self.places, shapes, strict=True):
            total[places] += z
            count[places] += 1
        return np.divide(total, count, dtype=np.complex128)

    def forces(self, z: Complex) -> Complex:
        total = np.zeros_like(z, dtype=complex)
        for places, part in zip(self.places, self.figures, strict=True):
            total[places] += part.forces(z[places])
        return total

    @cached_property
    def matrix(self) -> Array:
        total = np.zeros((len(self), len(self)))
        for places, part in zip(self.places, self.figures, strict=True):
            total[np.ix_(places, places)] += part.matrix
        return total


Stiff = Callable[[Array], Array]
"""How much stiffer than usual a silhouette is at points (N, 2) of its normal form."""


@dataclass(frozen=True)
class Couple:
    """Two silhouettes that are to share a tiling, with a mean area of 1, at three levels of points."""

    rings: tuple[bytes, bytes]  # (M, 2) each, float64, counter-clockwise, of area 1
    ratio: float = 1.0  # the area of the second one over that of the first
    mirrored: bool = False  # whether the second one is mirrored
    count: int = 64  # of points of both on the first level, in proportion to their lengths
    phase: float = 0.0  # by how many of the finest points' distances these are shifted
    # the width of necks, in square roots of the mean area, below which scores fall
    min_neck: float = 0.01
    background: bool = False  # whether the second one may have any shape
    # how much stiffer the silhouettes are at points (N, 2) of their normal forms
    stiff: tuple[Stiff | None, Stiff | None] = field(default=(None, None), compare=False)

    @classmethod
    def of(cls, left: Array, right: Array, **others: Any) -> Couple:
        """Return those of two rings (M, 2), with other fields by name."""
        rings = np.ascontiguousarray(left, np.float64), np.ascontiguousarray(right, np.float64)
        return cls((rings[0].tobytes(), rings[1].tobytes()), **others)

    @property
    def plain(self) -> bool:
        """Whether no part of a silhouette is stiffer than others."""
        return self.stiff == (None, None)

    @property
    def sizes(self) -> tuple[float, float]:
        """How large both are, in lengths of their normal forms."""
        first = math.sqrt(2 / (1 + self.ratio))
        return first, first * math.sqrt(self.ratio)

    def bodies(self, level: int) -> tuple[Elastic, Elastic]:
        """Return the bodies of both, with the points of a level."""
        return _bodies(self, level)


@lru_cache(maxsize=64)
def _bodies(couple: Couple, level: int) -> tuple[Elastic, Elastic]:
    rings = [np.frombuffer(ring).reshape(-1, 2) for ring in couple.rings]
    lengths = [ring_length(ring) * size for ring, size in zip(rings, couple.sizes, strict=True)]
    first = round(couple.count * lengths[0] / sum(lengths))
    multiple, step = MULTIPLES[-1], MULTIPLES[-1] // MULTIPLES[level]

    def body(k: int, count: int, mirrored: bool) -> Elastic:
        corners = important_vertices(rings[k], CORNER_DEPTH)
        fine = with_corners(rings[k], corners, multiple * count, couple.phase)
        flip = (1.0, -1.0) if mirrored else (1.0, 1.0)
        fine = (reverse(fine) if mirrored else fine) * flip
        mesh, factor = triangulate(fine[::step] * couple.sizes[k]), couple.stiff[k]
        if k == 1 and couple.background:
            weak = np.full(len(mesh.points), BACKGROUND_STIFFNESS)
            return Elastic(mesh.points[: mesh.size], BACKGROUND, stiff=weak, mesh=mesh)
        stiff = None if factor is None else factor(mesh.points / couple.sizes[k] * flip)
        return Elastic(mesh.points[: mesh.size], BODIES["firm"], stiff=stiff, mesh=mesh)

    return body(0, first, False), body(1, couple.count - first, couple.mirrored)


@lru_cache(maxsize=256)
def glued_body(couple: Couple, level: int, glue: Glue) -> GluedBody:
    """Return both figures, glued, with the points of a level."""
    return GluedBody(couple.bodies(level), glue)
