"""A tile in its class's own frame: its vertices edge by edge, and edges that are identified."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import polar

from orbiflow.arrays import Array
from orbiflow.errors import OrbiflowError
from orbiflow.settings import as_instance
from orbiflow.symmetry import CrystallographicGroup
from orbiflow.tiles.tilings import (
    EdgeClass,
    EdgeImage,
    IsohedralClass,
    Tile,
    edge_classes,
    edges,
    free_subgroup,
    isohedral_class,
)

# How far corresponding vertices of identified edges may lie apart, in square roots of the area
TOLERANCE = 1e-6

NEAR_SHARE = 0.004  # of an edge: another tile's vertices so near to this one's are these


@dataclass(frozen=True, eq=False)
class OwnFrame:
    """A tile as an affine image of one whose group is its class's own.

    Of a symmetric tile, the group is one that takes each tile to each other in one way only, if there
    is one, so that inner points need no symmetry.
    """

    kind: IsohedralClass
    group: CrystallographicGroup  # in the own frame
    edge_classes: tuple[EdgeClass, ...]
    points: Array  # (N, 2) the polygon in the own frame, from corner 0 on
    starts: tuple[int, ...]  # indices of the corners in it, increasing from 0
    linear: Array  # with `offset`: a point p of the own frame lies at linear p + offset
    offset: Array

    @classmethod
    def of(cls, tile: Tile) -> OwnFrame:
        """Of a tile whose class and corners are known, as those of every search are."""
        as_instance(tile, Tile, "the tile", "read_result(folder) gives one")
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
        group, classes = kind.group(), kind.edge_classes
        if len(kind.stabiliser) > 1:
            group = free_subgroup(group, kind.stabiliser) or group
            classes = edge_classes(edges(Tile(kind.template(), group)))
        frame = cls(kind, group, classes, points, starts, linear, offset)
        frame.check()
        return frame

    def check(self) -> None:
        """Check that identified edges are images of each other, vertex by vertex."""
        size = np.sqrt(self.group.cell_volume / self.group.order)
        for first, image in relations(self.edge_classes):
            moved, second = image.isometry(self.edge(first)), self.edge(image.edge)
            moved = moved[::-1] if image.reversed else moved
            if len(moved) != len(second) or np.abs(moved - second).max() > TOLERANCE * size:
                raise OrbiflowError(
                    f"this tile's edges {first} and {image.edge} are not images of each other "
                    f"as class {self.kind.name} has them"
                )

    def edge(self, number: int) -> Array:
        """(M, 2) vertices of an edge, both ends included."""
        ends = [*self.starts, len(self.points)]
        return self.points[np.arange(ends[number], ends[number + 1] + 1) % len(self.points)]

    def straight(self) -> OwnFrame:
        """The template, its vertices spaced along edges as here, in a frame that does not stretch."""
        corners = self.kind.template()
        parts: list[Array] = []
        for k in range(len(corners)):
            edge = self.edge(k)
            share = _along(edge)[:-1]
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
        parts = [marks[bounds[k] : bounds[k + 1]] for k in range(len(self.starts))]
        for kind in self.edge_classes:
            steps = [
                (image.edge, -1 if image.reversed else 1) for image in (*kind.folds, *kind.images)
            ]
            every = parts[kind.edge]
            for edge, step in steps:
                every = every | parts[edge][::step]
            if kind.turn:
                every = every | every[::-1]
            for edge, step in ((kind.edge, 1), *steps):
                parts[edge] = every[::step]
        chosen = np.concatenate(parts)
        index = np.flatnonzero(chosen)
        middles = (self.points[index] + self.points[(index + 1) % len(self.points)]) / 2
        points = np.insert(self.points, index + 1, middles, axis=0)
        before = np.cumsum(chosen) - chosen
        starts = tuple(int(k + before[k]) for k in self.starts)
        return replace(self, points=points, starts=starts)

    def shares(self, other: OwnFrame) -> list[Array]:
        """Return for each edge the shares of its length, 0 to 1, at which this tile has vertices, and
        those of another of its class that are not near to them; the same for edges that are identified.
        """
        shares = [_along(self.edge(k)) for k in range(len(self.starts))]
        for edge_class in self.edge_classes:
            kept = shares[edge_class.edge]
            for share in _along(other.edge(edge_class.edge)).tolist():
                pair = [share] if edge_class.turn is None else [share, 1 - share]
                near = np.abs(np.subtract.outer(kept, pair)).min()
                if near > NEAR_SHARE and (len(pair) == 1 or abs(1 - 2 * share) > NEAR_SHARE):
                    kept = np.sort(np.append(kept, pair))
            for image in edge_class.images:
                shares[image.edge] = 1 - kept[::-1] if image.reversed else kept
            shares[edge_class.edge] = kept
        return shares

    def at_shares(self, shares: Sequence[Array]) -> OwnFrame:
        """Return the tile with its vertices at these shares of its edges, both ends among them."""
        parts = list[Array]()
        for k, wanted in enumerate(shares):
            edge = self.edge(k)
            along = _along(edge)
            parts.append(
                np.column_stack([np.interp(wanted[:-1], along, edge[:, j]) for j in (0, 1)])
            )
        ends = np.cumsum([0, *map(len, parts)])[:-1]
        return replace(self, points=np.concatenate(parts), starts=tuple(ends.tolist()))

    def tile(self) -> Tile:
        """The tile again, with this group."""
        group = self.group.conjugate(self.linear, self.offset)
        placed = self.points @ self.linear.T + self.offset
        return Tile(placed, group, self.kind.name, self.starts)


def _along(edge: Array) -> Array:
    """Return the shares of an edge's length (M,) at its vertices (M, 2)."""
    lengths = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(edge, axis=0), axis=1)))
    return lengths / lengths[-1]


def _offset(kind: IsohedralClass, placed: Array, starts: tuple[int, ...], linear: Array) -> Array:
    """Where the own frame's origin lies, by identified edges; by corners where these are silent."""
    rows: list[Array] = []
    values: list[Array] = []
    inverse = np.linalg.inv(linear)
    for first, image in relations(kind.edge_classes):
        element = image.isometry
        turned = linear @ element.linear @ inverse
        begin = placed[starts[first]]
        end = starts[(image.edge + image.reversed) % len(starts)]
        rows.append(np.eye(2) - turned)
        values.append(placed[end] - turned @ begin - linear @ element.translation)
    matrix = np.concatenate(rows)
    offset, *_ = np.linalg.lstsq(matrix, np.concatenate(values), rcond=1e-6)
    _, sizes, ways = np.linalg.svd(matrix)
    open_ways = ways[np.concatenate([sizes, np.zeros(2 - len(sizes))]) < 1e-6]
    away = placed[list(starts)].mean(axis=0) - kind.template().mean(axis=0) @ linear.T - offset
    return offset + open_ways.T @ (open_ways @ away)


def relations(classes: Iterable[EdgeClass]) -> Iterator[tuple[int, EdgeImage]]:
    """Yield each edge that others, or itself, are images of, with the image."""
    for edge_class in classes:
        for image in (*edge_class.folds, *edge_class.images):
            yield edge_class.edge, image
