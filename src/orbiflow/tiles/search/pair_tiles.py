"""Finished tiles of two figures: from a carved pair to polygons, maps and measures of both."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import PurePath

import numpy as np

from orbiflow.arrays import Integers
from orbiflow.tiles.geometry import Place, plane_points, reverse
from orbiflow.tiles.likeness import Elastic, Overlap, Stiffness, kept_of
from orbiflow.tiles.search.bending import Bent, PlacedBent, placed_best
from orbiflow.tiles.search.carving import Carved, cornered
from orbiflow.tiles.search.co_deformation import Orientation, following
from orbiflow.tiles.search.finished_tiles import measured_tile, with_bent
from orbiflow.tiles.search.pairs import BentPair
from orbiflow.tiles.silhouette import Samples, Target
from orbiflow.tiles.tile import NO_MAP, EscherTile, Part
from orbiflow.tiles.tile_map import TileMap
from orbiflow.tiles.tilings import Tile

FLIP = np.array([1.0, -1.0])


def finished_pair(
    targets: Sequence[Target],
    pair: BentPair,
    originals: Sequence[Target] | None = None,
    smoothed: float = 0.0,
) -> EscherTile:
    """Return a carved pair as a finished tile, in the coordinates of the first silhouette.

    The first figure lies over its silhouette. Both are rated by how much they are like the `originals`,
    if the targets are these with what is narrower than the share `smoothed` of their lengths rounded
    off.
    """
    originals = originals or targets
    placed = [_placed(target, pair, k) for k, target in enumerate(targets)]
    frames = [Place(target.frame.linear, target.frame.offset) for target in targets]
    ways = [_place(bent, pair, k) for k, bent in enumerate(placed)]
    whole = frames[0].after(ways[0])
    parts: list[Part] = []
    for k, (target, bent, original) in enumerate(zip(targets, placed, originals, strict=True)):
        polygon = pair.polygons[k]
        if k == 1 and pair.couple.background:
            left = Tile(whole(polygon), parts[0].figure.tile.group)
            parts.append(Part.background(left, y_down=targets[0].y_down))
            break
        tile = Tile(polygon, pair.tiling.group, corners=tuple(_corners(pair, k).tolist()))
        figure = measured_tile(target, tile.transformed(*ways[k]), TileMap(), original)
        likeness = replace(figure.likeness, smoothed=smoothed, min_neck=pair.couple.min_neck)
        figure = with_bent(target, figure.changed(likeness=likeness), bent, original)
        figure = figure.changed(name=PurePath(original.source).stem)
        parts.append(Part(figure, whole.after(frames[k].after(ways[k]).inverse)))
    union = _union(pair)
    return EscherTile(
        union.transformed(*whole),
        y_down=targets[0].y_down,
        silhouette=originals[0].report(),
        no_map=NO_MAP,
        normal=union.transformed(*ways[0]),
        division=tuple(parts),
    )


def _union(pair: BentPair) -> Tile:
    """Return both figures together as a tile of the pair's class, in the pair's own coordinates."""
    lengths, start = pair.placement.lengths[0], int(pair.placement.starts[0])
    ring = np.roll(plane_points(pair.points[: pair.body.size]), -start, axis=0)
    corners = np.cumsum(lengths) - lengths
    return Tile(ring, pair.tiling.group, pair.kind.name, tuple(corners.tolist()))


def _place(placed: PlacedBent, pair: BentPair, k: int) -> Place:
    """Return the map from the pair's coordinates to the normal form of a silhouette."""
    a, b = placed.factor / pair.couple.sizes[k], placed.shift
    place = Place(np.array([[a.real, -a.imag], [a.imag, a.real]]), np.array([b.real, b.imag]))
    if placed.bent.orientation.mirrored:
        place = Place(np.diag(FLIP), np.zeros(2)).after(place)
    return place


def _placed(target: Target, pair: BentPair, k: int) -> PlacedBent:
    """Return a figure of a pair as a bent silhouette that is a tile, over its silhouette."""
    mirrored, scale = bool(k) and pair.couple.mirrored, pair.couple.sizes[k]
    part, places = pair.body.figures[k], pair.body.places[k]
    normal = np.asarray(target.normal)
    ring = part.mesh.points[: part.size] / scale
    body = Elastic(ring, Stiffness())
    side = Orientation(
        mirrored,
        reverse(normal) * FLIP if mirrored else normal,
        Samples(ring, ring, ring),
        lambda _level, _stiffness: body,
        plain=True,
    )
    carved = pair.tiles[k]
    along, corners = cornered(carved.places, _corners(pair, k))
    vertices, group = pair.points[places] / scale, (carved.linear / scale, carved.offset / scale)
    tile = Carved(vertices[: part.size], along, corners, *group)
    points, kept = (
        following(body, tile.outline, vertices),
        kept_of(body.measures, tile.outline, 0.0),
    )
    bent = Bent(side, body, tile, points, pair.placement, kept, pair.factor)
    return placed_best(bent, Overlap(normal * FLIP if mirrored else normal))


def _corners(pair: BentPair, k: int) -> Integers:
    """Return which vertices of a figure are corners of the union or ends of the path."""
    ring = pair.body.places[k][: pair.body.figures[k].size]
    lengths, start = pair.placement.lengths[0], pair.placement.starts[0]
    corners = (np.cumsum(lengths) - lengths + start) % pair.body.size
    glue, size = pair.glue, len(ring)
    first = glue.second if k else glue.first
    ends = [first % size, (first + glue.length) % size]
    return np.union1d(np.flatnonzero(np.isin(ring, corners)), ends)
