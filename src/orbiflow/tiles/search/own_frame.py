"""A tile in the own frame of its class: where its group is the table's, and its edges correspond."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from orbiflow.arguments import instance
from orbiflow.arrays import Array
from orbiflow.errors import OrbiflowError
from orbiflow.tiles.tilings import IsohedralClass, Tile, isohedral_class

TOLERANCE = 1e-6
"""How far corresponding vertices of identified edges may lie apart, in square roots of the area."""


@dataclass(frozen=True, eq=False)
class OwnFrame:
    """A tile as an affine image of one whose group is its class's own.

    - `kind`: the class.
    - `points`: (N, 2) the polygon in the own frame, from corner 0 on.
    - `starts`: indices of the corners in it, increasing from 0.
    - `linear`, `offset`: (2, 2) and (2,): a point p of the own frame lies at linear p + offset.
    """

    kind: IsohedralClass
    points: Array
    starts: tuple[int, ...]
    linear: Array
    offset: Array

    @property
    def counts(self) -> tuple[int, ...]:
        """Sides of the polygon along each edge of the class."""
        return tuple(np.diff([*self.starts, len(self.points)]).tolist())

    @classmethod
    def of(cls, tile: Tile) -> OwnFrame:
        """Of a tile whose class and corners are known, as those of every search are.

        Raises:
            OrbiflowError: if they are not, or polygon and group are not of the class.
        """
        instance(tile, Tile, "the tile", "read_result(folder) gives one")
        if not tile.isohedral_class:
            raise OrbiflowError("this tile's class is not known, so neither is what it comes from")
        kind = isohedral_class(tile.isohedral_class)
        if len(tile.corners) != len(kind.template()) or tile.group.order != kind.group().order:
            raise OrbiflowError(f"this tile's corners or group are not those of class {kind.name}")
        first = tile.corners[0]
        placed = np.roll(tile.polygon, -first, axis=0)
        starts = tuple((k - first) % len(placed) for k in tile.corners)
        if list(starts) != sorted(set(starts)):
            raise OrbiflowError("this tile's corners are not in the order of its polygon")
        linear = tile.group.lattice @ kind.group().inverse_lattice
        offset = _offset(kind, placed, starts, linear)
        points = (placed - offset) @ np.linalg.inv(linear).T
        own = cls(kind, points, starts, linear, offset)
        own.check()
        return own

    def check(self) -> None:
        """Nothing, if identified edges are images of each other, vertex by vertex.

        Raises:
            OrbiflowError: if they are not.
        """
        size = np.sqrt(self.kind.group().cell_volume / self.kind.group().order)
        for pair in self.kind.identified_edges:
            first, second = self.edge(pair.first), self.edge(pair.second)
            image = pair.isometry(first)
            image = image[::-1] if pair.reversed else image
            if len(image) != len(second) or np.abs(image - second).max() > TOLERANCE * size:
                raise OrbiflowError(
                    f"this tile's edges {pair.first} and {pair.second} are not images of each other "
                    f"as class {self.kind.name} has them"
                )

    def edge(self, number: int) -> Array:
        """(M, 2) vertices of an edge, both ends included."""
        ends = [*self.starts, len(self.points)]
        return self.points[np.arange(ends[number], ends[number + 1] + 1) % len(self.points)]

    def straight(self) -> OwnFrame:
        """The class's template with as many vertices: each where, along its edge, this one's are.

        Its frame has the turn and the scale of this one, and no stretch.
        """
        corners = self.kind.template()
        parts: list[Array] = []
        for k in range(len(corners)):
            edge = self.edge(k)
            steps = np.linalg.norm(np.diff(edge, axis=0), axis=1)
            share = np.concatenate([[0], np.cumsum(steps)[:-1]]) / steps.sum()
            start, end = corners[k], corners[(k + 1) % len(corners)]
            parts.append(start + share[:, None] * (end - start))
        turn, stretch = polar(self.linear)
        scale = np.sqrt(abs(np.linalg.det(stretch)))
        return replace(self, points=np.concatenate(parts), linear=scale * turn)

    def refined(self, sides: Iterable[int]) -> OwnFrame:
        """With a vertex in the middle of each of these sides, and of the sides identified with them."""
        bounds = [*self.starts, len(self.points)]
        marks = np.zeros(len(self.points), dtype=bool)
        marks[list(sides)] = True
        edges = [marks[bounds[k] : bounds[k + 1]] for k in range(len(self.starts))]
        for pair in self.kind.identified_edges:
            step = -1 if pair.reversed else 1
            both = edges[pair.first] | edges[pair.second][::step]
            edges[pair.first], edges[pair.second] = both, both[::step]
        chosen = np.concatenate(edges)
        index = np.flatnonzero(chosen)
        middles = (self.points[index] + self.points[(index + 1) % len(self.points)]) / 2
        points = np.insert(self.points, index + 1, middles, axis=0)
        before = np.cumsum(chosen) - chosen
        starts = tuple(int(k + before[k]) for k in self.starts)
        return replace(self, points=points, starts=starts)

    def tile(self) -> Tile:
        """The tile again."""
        group = self.kind.group().conjugate(self.linear, self.offset)
        placed = self.points @ self.linear.T + self.offset
        return Tile(placed, group, self.kind.name, self.starts)


def polar(linear: Array) -> tuple[Array, Array]:
    """An orthogonal and a positive symmetric matrix whose product `linear` (2, 2) is."""
    u, values, v = np.linalg.svd(linear)
    return u @ v, v.T @ np.diag(values) @ v


def _offset(kind: IsohedralClass, placed: Array, starts: tuple[int, ...], linear: Array) -> Array:
    """Where the own frame's origin lies, from the edges that the group identifies.

    Where the group leaves a direction open, the corners come as near to the template's as can be.
    """
    rows: list[Array] = []
    values: list[Array] = []
    inverse = np.linalg.inv(linear)
    for pair in kind.identified_edges:
        element = pair.isometry
        turned = linear @ element.linear @ inverse
        begin = placed[starts[pair.first]]
        end = starts[pair.second] if not pair.reversed else _next(starts, pair.second)
        rows.append(np.eye(2) - turned)
        values.append(placed[end] - turned @ begin - linear @ element.translation)
    matrix = np.concatenate(rows)
    offset, *_ = np.linalg.lstsq(matrix, np.concatenate(values), rcond=1e-6)
    _, sizes, ways = np.linalg.svd(matrix)
    open_ways = ways[np.concatenate([sizes, np.zeros(2 - len(sizes))]) < 1e-6]
    away = placed[list(starts)].mean(axis=0) - kind.template().mean(axis=0) @ linear.T - offset
    return offset + open_ways.T @ (open_ways @ away)


def _next(starts: tuple[int, ...], edge: int) -> int:
    return starts[(edge + 1) % len(starts)]
