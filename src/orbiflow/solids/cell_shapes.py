"""The shapes of the small cells that a grid is cut into: cubes, prisms, tetrahedra."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from functools import cache, cached_property
from typing import NamedTuple

import numpy as np

from orbiflow.arrays import Array, Integers

Offset = tuple[int, int, int]

BLOCK_CORNERS = np.array(list(itertools.product((0, 1), repeat=3)))


class Neighbor(NamedTuple):
    """The cell behind a face: the offset of its block, and its kind."""

    offset: Offset
    kind: int


class CellPart(NamedTuple):
    """An edge or a corner of a cell.

    - `offset`: The block, from the cell's own, to which the edge or corner belongs.
    - `number`: Its number in that block.
    - `faces`: The cell's own faces that it lies on, as bits.
    """

    offset: Offset
    number: int
    faces: int


@dataclass(frozen=True, eq=False)
class CellShape:
    """How each block of a grid is cut into convex cells; all blocks are cut alike.

    - `name`: What the cells are.
    - `denominator`: Corners and centres are integers on a grid that is so many times finer.
    - `cells_for_a_cube`: How many cells make a partition as fine as cubes would.
    - `corners`: The corners (K, n, 3) of the K kinds of cell in the block [0, 1)^3, on the finer grid.
    """

    name: str
    denominator: int
    cells_for_a_cube: float
    corners: Integers

    @property
    def kinds(self) -> int:
        """The number K of cells in a block."""
        return len(self.corners)

    @cached_property
    def centers(self) -> Integers:
        """The centres (K, 3) of the cells on the finer grid."""
        return self.corners.sum(axis=1) // self.corners.shape[1]

    @cached_property
    def faces(self) -> tuple[tuple[tuple[int, ...], ...], ...]:
        """For each kind its faces: cycles of corners, counter-clockwise from outside."""
        return tuple(_convex_faces(corners) for corners in self.corners)

    @cached_property
    def face_corners(self) -> Integers:
        """The corners (K, faces, 4, 3) of each face on the finer grid; a triangle repeats its last."""
        rows = [
            [corners[[*face, face[-1]][:4]] for face in faces]
            for corners, faces in zip(self.corners, self.faces, strict=True)
        ]
        return np.array(rows)

    @cached_property
    def neighbors(self) -> tuple[tuple[Neighbor, ...], ...]:
        """For each kind the cells behind its faces."""
        owners: dict[frozenset[tuple[int, ...]], list[tuple[Offset, int]]] = {}
        near = (-1, 0, 1)
        for offset in itertools.product(near, near, near):
            for kind, faces in enumerate(self.faces):
                for face in faces:
                    key = self._points(kind, face, offset)
                    owners.setdefault(key, []).append((offset, kind))
        neighbors: list[tuple[Neighbor, ...]] = []
        for kind, faces in enumerate(self.faces):
            rows = [owners[self._points(kind, face, (0, 0, 0))] for face in faces]
            cell = ((0, 0, 0), kind)
            neighbors.append(tuple(Neighbor(*next(r for r in row if r != cell)) for row in rows))
        return tuple(neighbors)

    @cached_property
    def parts(self) -> tuple[tuple[CellPart, ...], ...]:
        """For each kind its edges and corners."""
        numbers: dict[tuple[tuple[int, ...], ...], int] = {}
        return tuple(self._parts_of(kind, numbers) for kind in range(self.kinds))

    @cached_property
    def parts_in_block(self) -> int:
        """How many edges and corners belong to a block."""
        return 1 + max(part.number for row in self.parts for part in row)

    def attachable_faces(self, kind: int) -> list[bool]:
        """Return for each set of the faces of a kind, as bits, whether they make a disc."""
        faces = [set(face) for face in self.faces[kind]]
        # of convex cells with three faces at a corner: two faces that meet share an edge
        meet = [[len(a & b) >= 2 for b in faces] for a in faces]
        whole = (1 << len(faces)) - 1
        return [
            _is_connected(bits, meet) and _is_connected(whole & ~bits, meet)
            for bits in range(whole + 1)
        ]

    def _points(
        self, kind: int, face: tuple[int, ...], offset: Offset
    ) -> frozenset[tuple[int, ...]]:
        moved = self.corners[kind][list(face)] + self.denominator * np.array(offset)
        return frozenset(map(tuple, moved.tolist()))

    def _parts_of(
        self, kind: int, numbers: dict[tuple[tuple[int, ...], ...], int]
    ) -> tuple[CellPart, ...]:
        faces = self.faces[kind]
        edges = {
            frozenset(e) for face in faces for e in zip(face, face[1:] + face[:1], strict=True)
        }
        ones = [frozenset([corner]) for corner in range(self.corners.shape[1])]
        parts: list[CellPart] = []
        for members in [*ones, *sorted(edges, key=sorted)]:
            points = sorted(self.corners[kind][sorted(members)].tolist())
            offset = np.array(points[0]) // self.denominator
            local = tuple(map(tuple, (np.array(points) - self.denominator * offset).tolist()))
            number = numbers.setdefault(local, len(numbers))
            bits = sum(1 << bit for bit, face in enumerate(faces) if members <= set(face))
            x, y, z = offset.tolist()
            parts.append(CellPart((x, y, z), number, bits))
        return tuple(parts)


def _is_connected(bits: int, meet: list[list[bool]]) -> bool:
    """Return whether some faces, as bits, are at least one and hang together."""
    members = [k for k in range(len(meet)) if bits >> k & 1]
    reached, waiting = set(members[:1]), members[:1]
    while waiting:
        face = waiting.pop()
        more = [k for k in members if meet[face][k] and k not in reached]
        reached.update(more)
        waiting.extend(more)
    return bool(members) and len(reached) == len(members)


def _convex_faces(corners: Integers) -> tuple[tuple[int, ...], ...]:
    """Return the faces of the convex hull as cycles of corners, counter-clockwise from outside."""
    faces: dict[frozenset[int], tuple[int, ...]] = {}
    for triple in itertools.permutations(range(len(corners)), 3):
        a, b, c = corners[list(triple)]
        normal = np.cross(b - a, c - a)
        heights = (corners - a) @ normal
        if not normal.any() or heights.max() > 0:
            continue
        on = np.flatnonzero(heights == 0)
        offsets = corners[on] - corners[on].mean(axis=0)
        across = np.cross(normal, offsets[0])
        angles = np.arctan2(
            offsets @ across / np.linalg.norm(across),
            offsets @ offsets[0] / np.linalg.norm(offsets[0]),
        )
        faces.setdefault(frozenset(on.tolist()), tuple(on[np.argsort(angles)].tolist()))
    return tuple(faces.values())


@cache
def cubes() -> CellShape:
    """Return blocks that are one cell each."""
    return CellShape("cubes", 2, 1.0, 2 * BLOCK_CORNERS[None])


@cache
def triangular_prisms() -> CellShape:
    """Return blocks of two prisms, for axes at 120 degrees: a, b and a + b are then as long."""
    triangles = np.array([[(0, 0), (1, 0), (1, 1)], [(0, 0), (1, 1), (0, 1)]])
    layers = [np.insert(triangles, 2, height, axis=2) for height in (0, 1)]
    return CellShape("triangular prisms", 6, 1.5, 6 * np.concatenate(layers, axis=1))


@cache
def tetrahedra() -> CellShape:
    """Return blocks of 24 tetrahedra: of the centre, the centre of a face, and one of its edges."""
    rows: list[Array] = []
    center = np.full(3, 4)
    for axis, side in itertools.product(range(3), (0, 1)):
        first, second = np.delete(np.arange(3), axis)
        square = np.full((4, 3), 8 * side)
        square[:, first], square[:, second] = (0, 8, 8, 0), (0, 0, 8, 8)
        middle = square.sum(axis=0) // 4
        rows += [np.stack([center, middle, square[k], square[(k + 1) % 4]]) for k in range(4)]
    return CellShape("tetrahedra", 8, 4.0, np.stack(rows))
