"""A ball of cells that grows, and stays a ball, until it has a cell of each orbit."""

from __future__ import annotations

import heapq
from array import array
from collections.abc import Iterable
from functools import cached_property

import numpy as np

from orbiflow.arrays import Array, Integers
from orbiflow.solids.complexes import Complex


class CellBox:
    """The cells of a complex in a box of blocks, numbered for the growth of a ball.

    A cell's number is K (block's number) + kind. The outermost blocks are a margin without cells.

    - `complex`: The complex.
    - `lower`, `size`: The first block (3,) and the number of blocks (3,) along each axis.
    """

    def __init__(self, complex: Complex, lower: Integers, size: Integers) -> None:
        self.complex, self.lower, self.size = complex, np.asarray(lower), np.asarray(size)
        self.kinds = complex.shape.kinds
        self.strides = np.array([self.size[1] * self.size[2], self.size[2], 1])
        self.neighbor_steps = [
            [self.kinds * self._step(neighbor.offset) + neighbor.kind - kind for neighbor in row]
            for kind, row in enumerate(complex.shape.neighbors)
        ]

    @cached_property
    def areas(self) -> Array:
        """The areas (K, faces) of the faces of each kind of cell, in squared spacings."""
        shape = self.complex.shape
        most = max(map(len, shape.faces))
        areas = np.zeros((self.kinds, most))
        for kind, faces in enumerate(shape.faces):
            for k, face in enumerate(faces):
                corners = self.complex.places(shape.corners[kind][list(face)])
                offsets = corners[1:] - corners[0]
                vectors = np.cross(offsets[:-1], offsets[1:])
                areas[kind, k] = np.linalg.norm(vectors.sum(axis=0)) / 2
        return areas / self.complex.spacing**2

    @property
    def number_of_cells(self) -> int:
        """How many cells have a number."""
        return int(np.prod(self.size)) * self.kinds

    def cells(self, numbers: Integers) -> Integers:
        """Return the cells (n, 4) with these numbers (n,)."""
        block, kind = np.divmod(numbers, self.kinds)
        x, rest = np.divmod(block, self.strides[0])
        y, z = np.divmod(rest, self.strides[1])
        return np.stack([x, y, z, kind], axis=1) + np.append(self.lower, 0)

    def numbers(self, cells: Integers) -> Integers:
        """Return the numbers (n,) of cells (n, 4), all in the box."""
        return (cells[:, :3] - self.lower) @ self.strides * self.kinds + cells[:, 3]

    def is_inner(self) -> Array:
        """Return for each cell whether it is off the margin."""
        blocks = np.zeros(tuple(self.size), bool)
        blocks[1:-1, 1:-1, 1:-1] = True
        return np.repeat(blocks.ravel(), self.kinds)

    def neighbors(self, numbers: Integers) -> Integers:
        """Return the cells (n, faces) behind the faces of inner cells; -1 where there is no face."""
        faces = max(map(len, self.neighbor_steps))
        steps = np.array([row + [0] * (faces - len(row)) for row in self.neighbor_steps])
        offsets = steps[numbers % self.kinds]
        return np.where(offsets, numbers[:, None] + offsets, -1)

    def centers(self, numbers: Integers) -> Array:
        """Return the centres (n, 3) in space of cells with these numbers (n,)."""
        return self.complex.centers(self.cells(numbers))

    def _step(self, offset: Iterable[int]) -> int:
        return int(np.dot(list(offset), self.strides))


class BallOfCells:
    """A set of cells, at most one of each orbit, that is always a ball, with a ball's boundary.

    A cell may be attached if what it shares with the ball, faces, edges and corners together, is a
    disc: two balls that share a disc make a ball. A cell may be detached if what it shares with the
    others is a disc, and what it shares with the outside too. So no piece, handle, cavity, nor an edge
    or corner where the boundary touches itself, ever comes about.

    - `box`: The cells.
    - `orbit_of`, `orbits`: The orbit of each cell, -1 for cells that must not be used.
    - `holder`: For each orbit the cell in the ball, -1 if there is none.
    """

    def __init__(self, box: CellBox, orbits: Integers, number_of_orbits: int) -> None:
        self.box = box
        self.orbit_of = orbits
        self.orbits = array("i", orbits.astype(np.intc).tobytes())  # quicker one by one
        self.holder = [-1] * number_of_orbits
        self.inside = bytearray(box.number_of_cells)
        shape = box.complex.shape
        self._parts_in_block = shape.parts_in_block
        # margins have blocks on all sides, so that edges and corners beyond have room for counts
        self._shares = bytearray((int(np.prod(box.size)) + 1) * self._parts_in_block)
        self._parts = [
            [shape.parts_in_block * box._step(p.offset) + p.number for p in row]
            for row in shape.parts
        ]
        cells_around = np.bincount([part.number for row in shape.parts for part in row]).tolist()
        self._must_be_full = [
            [
                [
                    (step, cells_around[p.number] - 1)
                    for step, p in zip(steps, row, strict=True)
                    if p.faces & bits == p.faces
                ]
                for bits in range(1 << len(shape.faces[kind]))
            ]
            for kind, (row, steps) in enumerate(zip(shape.parts, self._parts, strict=True))
        ]
        sizes = [shape.corners.shape[1]] * shape.kinds
        self._face_corners, self._face_edges = (
            [
                [
                    [
                        k
                        for k, p in enumerate(row)
                        if p.faces >> face & 1 and (k < size) == of_corners
                    ]
                    for face in range(len(shape.faces[kind]))
                ]
                for kind, (row, size) in enumerate(zip(shape.parts, sizes, strict=True))
            ]
            for of_corners in (True, False)
        )
        self._must_be_clear = [
            [
                [step for step, p in zip(steps, row, strict=True) if not p.faces & bits]
                if is_disc
                else None
                for bits, is_disc in enumerate(shape.attachable_faces(kind))
            ]
            for kind, (row, steps) in enumerate(zip(shape.parts, self._parts, strict=True))
        ]

    @property
    def is_complete(self) -> bool:
        """Whether the ball has a cell of each orbit."""
        return -1 not in self.holder

    def members(self) -> Integers:
        """Return the numbers of the cells in the ball, in the order of their orbits."""
        held = np.array(self.holder)
        return held[held >= 0]

    def shared_areas(self, cells: Integers) -> Array:
        """Return the area (n,) of the faces that cells share with the ball, in squared spacings."""
        behind = self.box.neighbors(cells)
        inside = np.frombuffer(self.inside, np.uint8)
        return np.where(
            behind >= 0, inside[behind] * self.box.areas[cells % self.box.kinds], 0
        ).sum(1)

    def can_attach(self, cell: int) -> bool:
        """Return whether a cell outside shares a disc with the ball."""
        block, kind = divmod(cell, self.box.kinds)
        clear = self._must_be_clear[kind][self._shared_bits(cell)]
        if clear is None:
            return False
        base, shares = block * self._parts_in_block, self._shares
        return not any(shares[base + step] for step in clear)

    def attach(self, cell: int) -> None:
        """Add a cell, which must be attachable unless it is the first."""
        block, kind = divmod(cell, self.box.kinds)
        base, shares = block * self._parts_in_block, self._shares
        for step in self._parts[kind]:
            shares[base + step] += 1
        self.inside[cell] = 1
        self.holder[self.orbits[cell]] = cell

    def detach(self, cell: int) -> bool:
        """Take a cell away if the others remain a ball; return whether it was taken."""
        self._remove(cell)
        if self.can_attach(cell):
            block, kind = divmod(cell, self.box.kinds)
            base, shares = block * self._parts_in_block, self._shares
            full = self._must_be_full[kind][self._shared_bits(cell)]
            # else the outside would touch the hole in an edge or a corner
            if all(shares[base + step] == number for step, number in full):
                return True
        self.attach(cell)
        return False

    def detach_all(self, cells: Iterable[int]) -> None:
        """Take away all of some cells that can be, one after another, until none can be."""
        left = list(cells)
        while left:
            kept = [cell for cell in left if not self.detach(cell)]
            if len(kept) == len(left):
                return
            left = kept

    def restore(self, holder: list[int]) -> None:
        """Take the ball back to what it was when `holder` was copied."""
        changed = [k for k, (a, b) in enumerate(zip(self.holder, holder, strict=True)) if a != b]
        for orbit in changed:
            if self.holder[orbit] >= 0:
                self._remove(self.holder[orbit])
        for orbit in changed:
            if holder[orbit] >= 0:
                self.attach(holder[orbit])

    def move(self, source: int, target: int) -> bool:
        """Replace a cell by another of its orbit if all remains a ball; return whether it was done."""
        if not self.detach(source):
            return False
        if self.can_attach(target):
            self.attach(target)
            return True
        self.attach(source)
        return False

    def grow(self, cells: Integers) -> None:
        """Attach what can be of some cells, always the first in their order that can be.

        Cells whose orbits are in the ball are left out. Where no single cell can be attached, two
        neighbours are, together: an edge between two prisms keeps each of them out, but not both.
        """
        order: list[int] = cells.tolist()
        rank = dict(zip(order, range(len(order)), strict=True))
        behind = self.box.neighbors(cells)
        touches = np.where(behind >= 0, np.frombuffer(self.inside, np.uint8)[behind], 0).any(axis=1)
        waiting: list[int] = np.flatnonzero(touches).tolist()  # in order, so that it is a heap
        blocked: list[int] = []
        orbits, holder, kinds, steps = (
            self.orbits,
            self.holder,
            self.box.kinds,
            self.box.neighbor_steps,
        )
        while waiting or blocked:
            cell = order[heapq.heappop(waiting or blocked)]
            if holder[orbits[cell]] >= 0:
                continue
            if self.can_attach(cell):
                added = [cell]
            elif self._waits_for_clearance(cell):
                if waiting:  # what is attached meanwhile may let it in
                    heapq.heappush(blocked, rank[cell])
                    continue
                added = self._pair_with(cell, rank)
            else:
                continue  # it comes back as soon as another of its neighbours is attached
            for attached in added:
                self.attach(attached)
            for attached in added:
                for step in steps[attached % kinds]:
                    other = attached + step
                    if other in rank and holder[orbits[other]] < 0:
                        heapq.heappush(waiting, rank[other])

    def _waits_for_clearance(self, cell: int) -> bool:
        """Return whether a cell's faces in the ball are a disc, so that edges or corners forbid it."""
        return self._must_be_clear[cell % self.box.kinds][self._shared_bits(cell)] is not None

    def _pair_with(self, cell: int, rank: dict[int, int]) -> list[int]:
        """Return a cell and a neighbour that can be attached together; nothing if there is none."""
        cell_orbit = self.orbits[cell]
        others = [cell + step for step in self.box.neighbor_steps[cell % self.box.kinds]]
        for other in sorted((c for c in others if c in rank), key=rank.__getitem__):
            orbit = self.orbits[other]
            if self.holder[orbit] < 0 and orbit != cell_orbit and self._shares_disc({cell, other}):
                return [cell, other]
        return []

    def _shares_disc(self, cells: set[int]) -> bool:
        """Return whether what some cells, together a ball, share with the ball is a disc."""
        corners: set[int] = set()
        edges: dict[int, list[int]] = {}
        touched: set[int] = set()
        faces = 0
        for cell in cells:
            block, kind = divmod(cell, self.box.kinds)
            base = block * self._parts_in_block
            parts = [base + step for step in self._parts[kind]]
            touched.update(part for part in parts if self._shares[part])
            for face, step in enumerate(self.box.neighbor_steps[kind]):
                if not self.inside[cell + step]:
                    continue
                for k in self._face_corners[kind][face]:
                    corners.add(parts[k])
                for k in self._face_edges[kind][face]:
                    edges.setdefault(parts[k], []).append(faces)
                faces += 1
        # an edge-connected part of a sphere is a disc if, and only if, its Euler number is 1
        if not faces or touched != corners | edges.keys():
            return False
        return len(corners) - len(edges) + faces == 1 and _hangs_together(faces, edges.values())

    def _shared_bits(self, cell: int) -> int:
        """Return the faces that a cell shares with the ball, as bits."""
        inside, bits, bit = self.inside, 0, 1
        for step in self.box.neighbor_steps[cell % self.box.kinds]:
            if inside[cell + step]:
                bits |= bit
            bit += bit
        return bits

    def _remove(self, cell: int) -> None:
        block, kind = divmod(cell, self.box.kinds)
        base, shares = block * self._parts_in_block, self._shares
        for step in self._parts[kind]:
            shares[base + step] -= 1
        self.inside[cell] = 0
        self.holder[self.orbits[cell]] = -1


def _hangs_together(number: int, links: Iterable[list[int]]) -> bool:
    """Return whether things from 0 to a number are connected by links of one or two of them."""
    group = list(range(number))

    def root(k: int) -> int:
        while group[k] != k:
            k = group[k]
        return k

    for link in links:
        group[root(link[0])] = root(link[-1])
    return len({root(k) for k in range(number)}) == 1
