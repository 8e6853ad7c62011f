"""A tile pulled by hand: the space in which it moves, and the certified tile that comes out."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import shapely

from orbiflow.arguments import as_array
from orbiflow.arrays import Array
from orbiflow.errors import CertificationError, OrbiflowError
from orbiflow.tiles import (
    Bending,
    EscherTile,
    Likeness,
    Rating,
    SearchFacts,
    TileMap,
    TileVariations,
    arc_lengths,
    border,
    carried_on,
    complex_points,
    divided_tile,
    fidelity,
    narrowest_neck,
    orient,
    points_along,
    ring_length,
    triangulate,
)

POINTS = 240
"""About how many points of the outline can be pulled: longer sides are divided."""

COMPARED_POINTS = 240  # points at which a pulled outline is compared with its silhouette
BODY_SPACING = 2.5  # distance of points inside the body, in mean sides of the outline
NEGLIGIBLE_ENTRY = 1e-12  # entry of the space's matrix that is nothing but rounding
AREA_BOUNDS = (0.05, 20.0)  # area of a pulled tile, and of its lattice's cell, in those of before
CROSSED = "the outline crosses itself there, so tiles would overlap: pull it less far"
OTHER_SIZE = "the tile has become much too small or too large: pull it less far"


def variations(tile: EscherTile) -> TileVariations:
    """Return the polygons that a tile can be pulled to, which tile as it does.

    The same tile gives the same space, so that parameters mean the same to whoever made it.
    """
    return TileVariations(divided_tile(tile.tile, POINTS))


def space_json(tile: EscherTile) -> dict[str, Any]:
    """Return what a browser needs to pull a tile.

    - `rows`, `cols`, `indptr`, `indices`, `values`: The sparse matrix, by rows, that takes parameters
      to the coordinates x, y of each vertex.
    - `start`: The parameters of the tile as it is. The last ones are those of `maps`, matrices whose
      sum M moves the group by p -> M p + b, and b.
    - `polygon`: The vertices of the tile as it is.
    - `body`: `points` and `triangles` that fill the tile. The first points are the vertices, then
      come points at `shares` of the `sides` from one vertex to the next, then those inside.
    """
    space = variations(tile)
    ring = space.first.polygon
    spacing = BODY_SPACING * ring_length(ring) / len(ring)
    body, count = triangulate(orient(ring, counter_clockwise=True), spacing), len(ring)
    number, sides, shares = np.arange(len(body.points)), body.sides, body.shares
    if space.first.signed_area < 0:  # the vertices are there in reverse, from the same first one
        number[:count] = -number[:count] % count
        sides, shares = count - 1 - sides, 1 - shares
    return {
        **_sparse(space.matrix),
        "start": space.start.tolist(),
        "maps": space.maps.tolist(),
        "polygon": ring.tolist(),
        "body": {
            "points": body.points[number].tolist(),
            "triangles": number[body.triangles].tolist(),
            "sides": sides.tolist(),
            "shares": shares.tolist(),
        },
    }


def _sparse(matrix: Array) -> dict[str, Any]:
    rows, columns = np.nonzero(abs(matrix) > NEGLIGIBLE_ENTRY)
    counts = np.bincount(rows, minlength=len(matrix))
    return {
        "rows": matrix.shape[0],
        "cols": matrix.shape[1],
        "indptr": [0, *np.cumsum(counts).tolist()],
        "indices": columns.tolist(),
        "values": matrix[rows, columns].tolist(),
    }


def pulled(tile: EscherTile, parameters: Any) -> EscherTile:
    """Return the certified tile for parameters of `variations`, with the tile's map carried on.

    Raises:
        OrbiflowError: for parameters that are not of this tile's space.
        CertificationError: if the outline crosses itself or has collapsed, in plain words.
    """
    space = variations(tile)
    if np.shape(parameters) != space.start.shape:
        raise OrbiflowError(
            "the parameters of a pulled tile are not of this one, which may have become better "
            "meanwhile; pull again"
        )
    given = as_array(parameters, "the parameters of a pulled tile", space.start.shape)
    _check(space, given)
    found = EscherTile(
        space.tile(given, same_area=False),
        name=tile.name,
        y_down=tile.y_down,
        silhouette=tile.silhouette,
        notes=("its outline was pulled by hand",),
        likeness=Likeness(min_neck=tile.likeness.min_neck),
    )
    if not found.certificate.valid:
        raise CertificationError("; ".join(found.certificate.reasons))
    thinnest = narrowest_neck(found.tile.polygon)
    before = tile
    if tile.bending is None:
        from orbiflow.tiles import with_map  # which needs torch

        before = with_map(tile)
    return _with_map(
        found.changed(likeness=replace(found.likeness, thinnest=thinnest)), before, space
    )


def _check(space: TileVariations, parameters: Array) -> None:
    """Refuse, in plain words, an outline that cannot be a tile's."""
    outline = shapely.Polygon(space.polygon(parameters))
    linear = np.tensordot(parameters[-2 - len(space.maps) : -2], space.maps, 1)
    areas = (outline.area / abs(space.first.signed_area), float(np.linalg.det(linear)))
    if not all(AREA_BOUNDS[0] < area < AREA_BOUNDS[1] for area in areas):
        raise CertificationError(OTHER_SIZE)
    if not outline.is_valid:
        raise CertificationError(CROSSED)


def _with_map(found: EscherTile, before: EscherTile, space: TileVariations) -> EscherTile:
    """Return a pulled tile with the map of the tile before carried on, and its likeness by that."""
    bending, frame = before.bending, before.frame
    if bending is None or frame is None:
        return found.changed(no_map=before.no_map or "its run left no map")
    ends = frame.to_normal(space.first.polygon), frame.to_normal(found.tile.polygon)
    try:
        bending = carried_on(bending, *ends)
    except OrbiflowError as error:
        return found.changed(map_source=TileMap(frame=frame), no_map=str(error))
    rest, images = _outlines(bending)
    cost = before.likeness.fidelity.cost if before.likeness.fidelity else 0.0
    kept = fidelity(complex_points(rest), complex_points(images), cost)
    found = found.changed(
        map_source=TileMap(frame=frame, bending=bending),
        search=SearchFacts(objective="likeness"),
        likeness=replace(
            found.likeness, fidelity=kept, rest=frame.to_input(rest), bent=frame.to_input(images)
        ),
    )
    return replace(found, rating=Rating.of_likeness(found.score))


def _outlines(bending: Bending) -> tuple[Array, Array]:
    """Return the silhouette's outline at evenly spaced points, and where they go."""
    ring = bending.rest[border(bending.triangles)]
    lengths = arc_lengths(ring)
    rest = points_along(ring, np.arange(COMPARED_POINTS) / COMPARED_POINTS * lengths[-1])
    return rest, bending.forward(rest)
