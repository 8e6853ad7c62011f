"""Which vertices of a tile are images of which, and which edges, for many placements at once.

Points are complex numbers x + iy throughout.
"""

from __future__ import annotations

from functools import lru_cache
from itertools import combinations_with_replacement, pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from orbiflow.arrays import Array, Integers
from orbiflow.symmetry import CrystallographicGroup, Isometry, Line, identity, reflection, rotation
from orbiflow.tiles.tilings import EdgeClass, EdgeImage, IsohedralClass


class Element(NamedTuple):
    """z -> factor z + shift, or factor conj(z) + shift."""

    factor: complex
    flips: bool
    shift: complex

    @classmethod
    def of(cls, isometry: Isometry) -> Element:
        linear = isometry.linear
        return cls(
            complex(linear[0, 0], linear[1, 0]),
            bool(np.linalg.det(linear) < 0),
            complex(*isometry.translation),
        )


class Relation(NamedTuple):
    """An isometry that takes an edge onto another, or onto itself."""

    first: int
    second: int
    factor: complex  # of its linear part, z -> factor z, or z -> factor conj(z) if it `flips`
    flips: bool
    reversed: bool  # whether the start of `first` goes to the end of `second`
    weight: float  # what half the agreement of all its edges counts


@lru_cache(maxsize=128)
def relations_of(kind: IsohedralClass) -> tuple[Relation, ...]:
    """Return all isometries between a class's edges; a tile's steps are means over those of each edge.

    What an outline agrees with its mean is its length, squared, of which half is left out.
    """
    relations: list[Relation] = []
    for edge_class in kind.edge_classes:
        start = EdgeImage(edge_class.edge, identity(2), reversed=False)
        members, folds = (start, *edge_class.images), (start, *edge_class.folds)
        share = 1 / (len(members) * len(folds))
        for x, y in combinations_with_replacement(range(len(members)), 2):
            for fold in folds:
                first, second = members[x], members[y]
                element = second.isometry @ fold.isometry @ first.isometry.inverse()
                back = (first.reversed != second.reversed) != fold.reversed
                still = x == y and fold is start
                weight = share - 0.5 if still else share if x == y else 2 * share
                if weight:
                    factor, flips, _ = Element.of(element)
                    relations.append(Relation(first.edge, second.edge, factor, flips, back, weight))
    return tuple(relations)


class _Corner(NamedTuple):
    """A corner of the template: image of the first of its orbit, and what holds that one."""

    first: int
    element: Element
    fixed: bool  # whether a rotation does
    mirror: Element | None  # the mirror that it lies on


@lru_cache(maxsize=128)
def _corners(kind: IsohedralClass) -> tuple[_Corner, ...]:
    group, vertices = kind.group(), kind.template()
    corners: list[_Corner] = []
    for k, vertex in enumerate(vertices):
        holding = [Element.of(g) for g in group.elements_near(vertex, 1e-6, source=vertex)]
        if sum(not element.flips for element in holding) > 1:
            corners.append(_Corner(k, Element(1, False, complex(*vertex)), True, None))
            continue
        mirror = next((element for element in holding if element.flips), None)
        for first in range(k + 1):
            images = list(group.elements_near(vertex, 1e-6, source=vertices[first]))
            if images:
                element = Element.of(max(images, key=lambda g: g.determinant))
                corners.append(_Corner(first, element, False, mirror))
                break
    return tuple(corners)


class Orbits:
    """For each vertex: the free vertex that it is an image of, and by which element; or fixed.

    A free vertex may lie on a mirror z -> mirror conj(z) + 2 foot, which is 0 if there is none.
    """

    def __init__(self, kind: IsohedralClass, lengths: Integers) -> None:
        count, n = len(lengths), int(lengths[0].sum())
        self.corners = np.cumsum(lengths, axis=1) - lengths
        self.source = np.tile(np.arange(n), (count, 1))
        self.factor = np.ones((count, n), dtype=complex)
        self.flips = np.zeros((count, n), dtype=bool)
        self.shift = np.zeros((count, n), dtype=complex)
        self.fixed = np.zeros((count, n), dtype=bool)
        self.mirror = np.zeros((count, n), dtype=complex)
        self.foot = np.zeros((count, n), dtype=complex)
        vertices = kind.template() @ [1, 1j]
        for edge_class in kind.edge_classes:
            ends = vertices[edge_class.edge], vertices[(edge_class.edge + 1) % len(vertices)]
            self._edges(edge_class, lengths[:, [edge_class.edge]], sum(ends) / 2)
        for k, (first, element, fixed, mirror) in enumerate(_corners(kind)):
            if fixed:
                self._fix(np.arange(count), self.corners[:, k], element.shift)
            else:
                live = np.ones((count, 1), dtype=bool)
                self._map(live, self.corners[:, [k]], self.corners[:, [first]], element)
                if mirror and first == k:
                    self._hold(live, self.corners[:, [k]], mirror)
        self.has_lines = bool(self.mirror.any())
        for values in (self.mirror, self.foot):
            values[:] = np.take_along_axis(values, self.source, axis=1)

    def _edges(self, kind: EdgeClass, length: Integers, middle: complex) -> None:
        """Map the inner vertices of edges of one class from those of the first half of its first."""
        first = self.corners[:, [kind.edge]]
        straight = next((fold for fold in kind.folds if not fold.reversed), None)
        back = kind.turn
        j = np.arange(1, int(length.max(initial=1)))
        inner = j < length
        half = inner & (2 * j > length) if back else np.zeros_like(inner)
        for edge, isometry, reverse in (EdgeImage(kind.edge, identity(2), False), *kind.images):
            at = self.corners[:, [edge]] + (length - j if reverse else j)
            if edge != kind.edge:
                self._map(inner & ~half, at, first + j, Element.of(isometry))
            if back:
                turned = isometry @ back.isometry if edge != kind.edge else back.isometry
                self._map(half, at, first + length - j, Element.of(turned))
        if straight:
            self._hold(inner & ~half, first + j, Element.of(straight.isometry))
        elif back and _flips(back):
            self._hold(2 * j == length, first + j, Element.of(back.isometry))
        if back and not _flips(back):
            rows = np.flatnonzero(length[:, 0] % 2 == 0)
            for edge, isometry, _ in (EdgeImage(kind.edge, identity(2), False), *kind.images):
                at = (self.corners[:, [edge]] + length // 2)[rows, 0]
                self._fix(rows, at, complex(*isometry(np.array([middle.real, middle.imag]))))

    def _map(self, live: NDArray[np.bool_], vertex: Array, source: Array, by: Element) -> None:
        rows, columns = np.nonzero(live)
        at = rows, np.broadcast_to(vertex, live.shape)[rows, columns]
        self.source[at] = np.broadcast_to(source, live.shape)[rows, columns]
        self.factor[at], self.flips[at], self.shift[at] = by

    def _hold(self, live: NDArray[np.bool_], vertex: Array, mirror: Element) -> None:
        rows, columns = np.nonzero(live)
        at = rows, np.broadcast_to(vertex, live.shape)[rows, columns]
        self.mirror[at], self.foot[at] = mirror.factor, mirror.shift / 2

    def _fix(self, rows: Integers, vertex: Integers, where: complex) -> None:
        self.fixed[rows, vertex], self.mirror[rows, vertex] = True, 0
        self.shift[rows, vertex] = where


def _flips(fold: EdgeImage) -> bool:
    return fold.isometry.determinant < 0


@lru_cache(maxsize=16)
def template_symmetries(isohedral_class: IsohedralClass) -> tuple[int, bool]:
    """Return how many rotations of the template keep its group, and whether a mirror does.

    Two starts that differ by such a map give the same tiles: with a mirror, mirrored targets need
    none, for the mirror image of a tile of the class is one under another placement.
    """
    vertices = isohedral_class.template()
    group = isohedral_class.group()
    center = vertices.mean(axis=0)
    order = max(n for n in (1, 2, 3, 6) if _keeps(rotation(center, n), vertices, group))
    spokes = [*vertices, *((a + b) / 2 for a, b in pairwise(vertices))]
    mirrored = any(
        _keeps(reflection(Line(center, spoke - center)), vertices, group) for spoke in spokes
    )
    return order, mirrored


def _keeps(isometry: Isometry, vertices: Array, group: CrystallographicGroup) -> bool:
    distance = abs(isometry(vertices)[:, None] - vertices[None]).max(axis=-1)
    if distance.min(axis=1).max() > 1e-9:
        return False
    integral = group.inverse_lattice @ isometry.linear @ group.lattice
    undo = isometry.inverse()
    return bool(abs(integral - integral.round()).max() < 1e-9) and all(
        group.contains(isometry @ g @ undo) for g in group.cosets
    )
