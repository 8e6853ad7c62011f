"""Candidates of one class: start tiles, what a fit gives, and polygons along a boundary."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from orbiflow.arrays import Array
from orbiflow.errors import CertificationError
from orbiflow.tiles.geometry import kept_vertices, plane_points, subdivided
from orbiflow.tiles.search.tile_space import NearestTiles
from orbiflow.tiles.tile_map import TileMap
from orbiflow.tiles.tilings import IsohedralClass, Tile

if TYPE_CHECKING:
    from orbiflow.tiles.search.bending import PlacedBent


@dataclass(frozen=True, eq=False)
class Prototiles:
    """S tiles of one class with as many vertices, any of which a flow can start from.

    - `corners`: (S, K) index of the vertex at each of the template's corners, increasing from 0.
    - `angle`, `log_scale`, `offset`, `stretch`, `mirrored`: the pose, as in `TileModel`; (S,), (S,),
      (S, 2), (S, stretch_dim) and (S,).
    """

    vertices: Array  # (S, N, 2), in the group's own frame; those of identified edges correspond
    corners: NDArray[np.int64]
    angle: Array
    log_scale: Array
    offset: Array
    stretch: Array
    mirrored: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.vertices)

    def take(self, indices: Sequence[int]) -> Prototiles:
        """Return those at `indices`."""
        return Prototiles(*(getattr(self, f.name)[list(indices)] for f in fields(self)))

    @staticmethod
    def joined(parts: Sequence[Prototiles]) -> Prototiles:
        """Return all of `parts` in one; they have as many vertices."""
        return Prototiles(
            *(np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(Prototiles))
        )

    @classmethod
    def of(
        cls, kind: IsohedralClass, tiles: NearestTiles, count: int, *, mirrored: bool
    ) -> Prototiles:
        """Turn placed polygons, whose `linear` keeps orientation, into start tiles of `count` vertices.

        That is a multiple of the polygons' own; those of the mirror image are placed on the target.
        """
        placed = plane_points(tiles.vertices)
        inverse = np.linalg.inv(tiles.linear)
        rings = (placed - tiles.offset[:, None]) @ np.swapaxes(inverse, 1, 2)
        pieces = count // placed.shape[1]
        angle, log_scale, stretch = _pose(kind, tiles.linear)
        return cls(
            subdivided(rings, pieces),
            tiles.corners * pieces,
            -angle if mirrored else angle,
            log_scale,
            tiles.offset * (1.0, -1.0) if mirrored else tiles.offset,
            stretch,
            np.full(len(rings), mirrored),
        )


def _pose(kind: IsohedralClass, linear: Array) -> tuple[Array, Array, Array]:
    """Return angle, log of the scale and stretch parameters: linear = scale rotation(angle) stretch."""
    log_scale = np.log(np.linalg.det(linear)) / 2
    unit = linear * np.exp(-log_scale)[:, None, None]
    u, _, v = np.linalg.svd(unit)  # the polar decomposition
    rotation = u @ v
    angle = np.arctan2(rotation[:, 1, 0], rotation[:, 0, 0])
    symmetric = np.swapaxes(rotation, 1, 2) @ unit
    values, vectors = np.linalg.eigh(symmetric)
    logarithm = np.einsum("cij,cj,ckj->cik", vectors, np.log(values), vectors)
    entries = logarithm[:, 0, :] if kind.stretch_dim == 2 else logarithm[:, 0, : kind.stretch_dim]
    return angle, log_scale, entries


# Least number of samples around the tile from which vertices are chosen; the second if need be
SAMPLE_COUNTS = (960, 4320)
# Largest deviation of the polygon from the sampled curve, in square roots of the tile's area
TOLERANCES = (5e-4, 1e-4, 2e-5, 0.0)


def simplest_tile(
    kind: IsohedralClass,
    vertices: Array,
    corners: Sequence[int],
    linear: Array,
    offset: Array,
    *,
    moved: Callable[[Array], Array],
    force: bool = False,
) -> Tile:
    """Return the coarsest polygon along a boundary that is simple, with its group.

    It is 5e-4 of the tile's size from the sampled curve, finer where parts of the boundary come close
    to each other. The prototile's `vertices` (N, 2) and points that `moved` carries lie in the
    group's own frame, from which `linear` (2, 2) and `offset` (2,) lead. A candidate that has folded
    is a `CertificationError`, unless `force` takes its finest polygon.
    """
    tile = None
    for count in SAMPLE_COUNTS:
        pieces = 2 * -(-count // (2 * len(vertices)))  # even: centres are sampled
        edges = _moved_edges(kind, vertices, corners, pieces, moved)
        placed = [edge @ linear.T + offset for edge in edges]
        for tolerance in TOLERANCES:
            chosen = _chosen_samples(kind, placed, tolerance)
            kept = [edge[:-1][mask[:-1]] for edge, mask in zip(placed, chosen, strict=True)]
            starts = np.cumsum([0] + [len(edge) for edge in kept[:-1]])
            polygon = np.concatenate(kept)
            # not before: a fit that ran away has no group, and says so above
            group = kind.group().conjugate(linear, offset)
            tile = Tile(polygon, group, kind.name, tuple(int(start) for start in starts))
            if shapely.Polygon(polygon).is_valid:
                return tile
    if force and tile is not None:
        return tile
    raise CertificationError(
        f"{kind.name}: the boundary crosses itself even with {SAMPLE_COUNTS[-1]} samples"
    )


def _moved_edges(
    kind: IsohedralClass,
    vertices: Array,
    corners: Sequence[int],
    pieces: int,
    moved: Callable[[Array], Array],
) -> list[Array]:
    """Return samples along each edge, both ends included: half are moved, the others their images."""
    before = subdivided(vertices, pieces)
    closed = np.concatenate([before, before[:1]])
    first = [*(int(corner) * pieces for corner in corners), len(before)]
    spans: list[slice[int, int, None]] = []
    for edge_class in kind.edge_classes:
        start, end = first[edge_class.edge], first[edge_class.edge + 1]
        spans.append(slice(start, (start + end) // 2 + 1 if edge_class.turn else end + 1))
    carried = moved(np.concatenate([closed[span] for span in spans]))
    ends = np.cumsum([span.stop - span.start for span in spans])
    edges: dict[int, Array] = {}
    for edge_class, half in zip(kind.edge_classes, np.split(carried, ends[:-1]), strict=True):
        turn = edge_class.turn
        edge = np.concatenate([half, turn.isometry(half)[-2::-1]]) if turn else half
        edges[edge_class.edge] = edge
        for image in edge_class.images:
            points = image.isometry(edge)
            edges[image.edge] = points[::-1] if image.reversed else points
    return [edges[i] for i in range(len(edges))]


def _chosen_samples(kind: IsohedralClass, closed: list[Array], tolerance: float) -> list[Array]:
    """Return which samples of each edge to keep, both ends included: matching on identified edges."""
    masks: dict[int, Array] = {}
    for edge_class in kind.edge_classes:
        curve = closed[edge_class.edge]
        if edge_class.straight:
            mask = np.isin(np.arange(len(curve)), (0, len(curve) - 1))
        elif edge_class.turn:
            half = _simplified(curve[: len(curve) // 2 + 1], tolerance)
            mask = np.concatenate([half, half[-2::-1]])
        else:
            mask = _simplified(curve, tolerance)
        masks[edge_class.edge] = mask
        for image in edge_class.images:
            masks[image.edge] = mask[::-1] if image.reversed else mask
    return [masks[i] for i in range(len(closed))]


def _simplified(curve: Array, tolerance: float) -> Array:
    """Return which points of a curve (M, 2) to keep."""
    mask = np.full(len(curve), tolerance == 0.0)
    mask[kept_vertices(curve, tolerance)] = True
    return mask


OnProgress = Callable[[float, float], None]
"""Called with the share of the work done and the best loss so far."""


def silent(_share: float, _loss: float) -> None:
    """Report no progress."""


class ClassCandidates(ABC):
    """Tiles of one class that are not certified yet."""

    @property
    @abstractmethod
    def size(self) -> int:
        """The number of candidates."""

    @abstractmethod
    def finished(self, index: int, *, force: bool = False) -> tuple[Tile, TileMap]:
        """Return the polygon of a candidate with its group, and the flow that made it, if one did.

        Raises:
            CertificationError: if it has folded, unless `force` is set.
        """

    def bent(self, index: int) -> PlacedBent | None:  # noqa: ARG002
        """Return the bent silhouette of a candidate, after a search for likeness."""
        return None


class ClassFinalists(NamedTuple):
    """Finalists of one class, not certified yet.

    - `candidates`: The finalists, best first.
    - `starts`: The number of candidates that the method began with.
    - `crossed`: The number of those that were dropped because their boundary crossed itself.
    - `enough`: Certified finalists after which the others need not be looked at.
    """

    candidates: ClassCandidates
    starts: int
    crossed: int
    enough: int


class StillTiles(ClassCandidates):
    """Start tiles as candidates: no flow moves them, and torch is not needed."""

    def __init__(self, kind: IsohedralClass, prototiles: Prototiles) -> None:
        self.kind, self._prototiles = kind, prototiles

    @property
    def prototiles(self) -> Prototiles:
        """All of them."""
        return self._prototiles

    @property
    def size(self) -> int:
        """The number of candidates."""
        return len(self._prototiles)

    def prototile(self, index: int) -> Prototiles:
        """Return the start tile of one."""
        return self._prototiles.take([index])

    def finished(self, index: int, *, force: bool = False) -> tuple[Tile, TileMap]:
        """Return the polygon of a candidate with its group, and a map without a flow."""
        start = self.prototile(index)
        c, s = np.cos(start.angle[0]), np.sin(start.angle[0])
        sign = -1.0 if start.mirrored[0] else 1.0
        turn = np.exp(start.log_scale[0]) * np.array([[c, -s * sign], [s, c * sign]])
        # einsum rounds each product, as torch does for a flow's tile; matmul does not
        linear = np.einsum("ij,jk->ik", turn, self.kind.stretch(start.stretch[0]))
        tile = simplest_tile(
            self.kind,
            start.vertices[0],
            start.corners[0].tolist(),
            linear,
            start.offset[0],
            moved=lambda points: points,
            force=force,
        )
        return tile, TileMap()
