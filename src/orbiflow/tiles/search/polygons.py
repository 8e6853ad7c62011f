"""From a boundary to a polygon: vertices where it bends, the same on identified edges."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np
import shapely

from orbiflow.arrays import Array
from orbiflow.errors import CertificationError
from orbiflow.tiles.geometry import subdivided
from orbiflow.tiles.tilings import (
    EdgeIdentification,
    IsohedralClass,
    Tile,
)

DENSE = (960, 4320)
"""Least number of samples around the tile from which vertices are chosen; the second if need be."""

TOLERANCES = (5e-4, 1e-4, 2e-5, 0.0)
"""Largest deviation of the polygon from the sampled curve, in square roots of the tile's area."""


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
    to each other.

    Args:
        kind: The class.
        vertices: (N, 2) the prototile, in the group's own frame.
        corners: Indices of the template's corners, increasing from 0.
        linear: (2, 2), with `offset` the map from the group's own frame.
        offset: (2,).
        moved: Takes points (M, 2) of that frame to where the flow carries them.
        force: Return the finest polygon even if it crosses itself.

    Raises:
        CertificationError: if no sampling gives a simple polygon: the candidate has folded. With
            `force`, only if coordinates are not finite.
    """
    tile = None
    for count in DENSE:
        pieces = 2 * -(-count // (2 * len(vertices)))  # even: centres are sampled
        edges = _moved_edges(kind, vertices, corners, pieces, moved)
        placed = [edge @ linear.T + offset for edge in edges]
        for polygon, starts in _polygons(kind, placed):
            # not before: a fit that ran away has no group, and says so above
            tile = Tile(polygon, kind.group().conjugate(linear, offset), kind.name, starts)
            if shapely.Polygon(polygon).is_valid:
                return tile
    if force and tile is not None:
        return tile
    raise CertificationError(
        f"{kind.name}: the boundary crosses itself even with {DENSE[-1]} samples"
    )


def _moved_edges(
    kind: IsohedralClass,
    vertices: Array,
    corners: Sequence[int],
    pieces: int,
    moved: Callable[[Array], Array],
) -> list[Array]:
    """Return samples along each edge of the tile, both ends included.

    Half of them are moved, the others are their images: what moves them commutes with the group.
    """
    before = subdivided(vertices, pieces)
    closed = np.concatenate([before, before[:1]])
    first = [*(int(corner) * pieces for corner in corners), len(before)]
    spans: dict[EdgeIdentification, slice[int, int, None]] = {}
    for pair in kind.identified_edges:
        start, end = first[pair.first], first[pair.first + 1]
        spans[pair] = slice(start, (start + end) // 2 + 1 if pair.folded else end + 1)
    carried = moved(np.concatenate([closed[span] for span in spans.values()]))
    ends = np.cumsum([span.stop - span.start for span in spans.values()])
    edges: dict[int, Array] = {}
    for pair, own in zip(spans, np.split(carried, ends[:-1]), strict=True):
        image = pair.isometry(own)
        if pair.folded:
            edges[pair.first] = np.concatenate([own, image[-2::-1]])
        else:
            edges[pair.first] = own
            edges[pair.second] = image[::-1] if pair.reversed else image
    return [edges[i] for i in range(len(edges))]


def _polygons(kind: IsohedralClass, edges: list[Array]) -> Iterator[tuple[Array, tuple[int, ...]]]:
    for tolerance in TOLERANCES:
        chosen = _chosen_samples(kind, edges, tolerance)
        kept = [edge[:-1][mask[:-1]] for edge, mask in zip(edges, chosen, strict=True)]
        starts = np.cumsum([0] + [len(edge) for edge in kept[:-1]])
        yield np.concatenate(kept), tuple(int(start) for start in starts)


def _chosen_samples(kind: IsohedralClass, closed: list[Array], tolerance: float) -> list[Array]:
    """For each edge, which of its samples to keep, both ends included: matching on identified edges."""
    masks: dict[int, Array] = {}
    for pair in kind.identified_edges:
        curve = closed[pair.first]
        if pair.folded:
            half = _simplified(curve[: len(curve) // 2 + 1], tolerance)
            masks[pair.first] = np.concatenate([half, half[-2::-1]])
            continue
        mask = _simplified(curve, tolerance)
        masks[pair.first] = mask
        masks[pair.second] = mask[::-1] if pair.reversed else mask
    return [masks[i] for i in range(len(closed))]


def _simplified(curve: Array, tolerance: float) -> Array:
    """Douglas-Peucker: which points of the curve (M, 2) to keep, the ends always."""
    if tolerance == 0.0:
        return np.ones(len(curve), dtype=bool)
    kept = shapely.get_coordinates(
        shapely.simplify(shapely.LineString(curve), tolerance, preserve_topology=False)
    )
    mask = np.zeros(len(curve), dtype=bool)
    position = 0
    for point in kept:  # vertices are kept bit for bit and in order
        position += int(np.flatnonzero((curve[position:] == point).all(axis=1))[0])
        mask[position] = True
    return mask
