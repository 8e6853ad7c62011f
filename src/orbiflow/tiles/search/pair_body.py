"""Two silhouettes that share a path of their outlines, as one elastic body (design point 21)."""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

import numpy as np

from orbiflow.arrays import Array, Complex, Integers
from orbiflow.tiles.likeness import Elastic, ElasticBody


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
        return Glue(*(multiple * own for own in self))


class PairBody(ElasticBody):
    """Two elastic bodies with the points of a path in common; each keeps its own rotations and pose.

    Its first n points are the outline of both together, counter-clockwise: the first figure's from the
    path's end around to its start, then the second one's. Then come the points within the path, then
    those inside of the figures.

    >>> square = np.array([[0.0, 0.0], [0.5, 0.0], [1.0, 0.0], [1.0, 0.5], [1.0, 1.0], [0.0, 1.0]])
    >>> body = PairBody((Elastic(square), Elastic(square)), Glue(0, 0, 2))
    >>> body.size, [len(ring) for ring in body.rings(body.rest)]
    (8, [6, 6])
    """

    def __init__(self, parts: tuple[Elastic, Elastic], glue: Glue) -> None:
        super().__init__()
        one, two = parts
        self.glue, self._figures = glue, parts
        first, second, length = glue
        free = one.size - length  # the steps of the first figure that are not on the path
        self.size = free + two.size - length
        self.outer = count = self.size + length - 1
        within = np.arange(1, length)
        own, other = np.empty(len(one), dtype=np.int64), np.empty(len(two), dtype=np.int64)
        own[(first + length + np.arange(free)) % one.size] = np.arange(free)
        rest = np.arange(two.size - length)
        other[(second + length + rest) % two.size] = free + rest
        own[first % one.size], other[second % two.size] = free, 0
        on_path = self.size + within - 1
        own[(first + within) % one.size] = on_path
        other[(second + length - within) % two.size] = on_path
        own[one.size :] = count + np.arange(len(one) - one.size)
        other[two.size :] = count + len(one) - one.size + np.arange(len(two) - two.size)
        self._places: tuple[Integers, Integers] = (own, other)
        self._count = count + len(one) - one.size + len(two) - two.size
        paths = self.path(one.rest, two.rest)
        turn = np.vdot(np.diff(paths[1]), np.diff(paths[0]))
        moved = turn / abs(turn) * (two.rest - paths[1].mean()) + paths[0].mean()
        self.rest = self.joined((one.rest[:, None], moved[:, None]))[:, 0]

    @property
    def figures(self) -> tuple[Elastic, Elastic]:
        return self._figures

    @property
    def places(self) -> tuple[Integers, Integers]:
        return self._places

    def path(self, one: Complex, two: Complex) -> tuple[Complex, Complex]:
        """Return the path's points (length + 1,) as each figure's own points have them."""
        first, second, length = self.glue
        along = np.arange(length + 1)
        sizes = [part.size for part in self.figures]
        return one[(first + along) % sizes[0]], two[(second + length - along) % sizes[1]]

    def joined(self, shapes: tuple[Complex, Complex]) -> Complex:
        """Return shapes (N, C) of the pair from those of the figures, which meet in the middle."""
        total = np.zeros((self._count, shapes[0].shape[1]), dtype=complex)
        count = np.zeros((self._count, 1))
        for places, z in zip(self.places, shapes, strict=True):
            total[places] += z
            count[places] += 1
        return np.divide(total, count, dtype=np.complex128)

    def forces(self, z: Complex) -> Complex:
        found = np.zeros_like(z, dtype=complex)
        for places, part in zip(self.places, self.figures, strict=True):
            found[places] += part.forces(z[places])
        return found

    @cached_property
    def matrix(self) -> Array:
        found = np.zeros((len(self), len(self)))
        for places, part in zip(self.places, self.figures, strict=True):
            found[np.ix_(places, places)] += part.matrix
        return found
