"""A tile pulled by hand: the space in which it moves, and the certified tile that comes out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import shapely
from scipy.sparse import csr_matrix
from scipy.spatial import KDTree

from orbiflow.arrays import Array, Integers
from orbiflow.errors import CertificationError, OrbiflowError
from orbiflow.settings import as_array
from orbiflow.studio.share_link import NO_PICTURE
from orbiflow.tiles import (
    Bending,
    EscherTile,
    Frame,
    Likeness,
    Rating,
    SearchFacts,
    Tile,
    TileMap,
    TileVariations,
    arc_lengths,
    border,
    carried_anew,
    carried_on,
    complex_points,
    divided_tile,
    fidelity,
    narrowest_neck,
    orient,
    points_along,
    ring_length,
    signed_area,
    triangulate,
)

POINTS = 240
"""About how many points of the outline can be pulled: longer sides are divided."""

COMPARED_POINTS = 240  # points at which pulled outlines are compared with their silhouettes
BODY_SPACING = 2.5  # distance of points inside the body, in mean sides of the outline
NEGLIGIBLE_ENTRY = 1e-12  # entry of the space's matrix that is nothing but rounding
AREA_BOUNDS = (0.05, 20.0)  # area of a pulled tile, and of its lattice's cell, in those of before
SAME_POINT_DISTANCE = 1e-7  # in the tile's size: vertices of figures this near to others are these
QUICK_SHARPENINGS = 4  # tries to unfold the inside after one step of a pull
SHARPENINGS = 10  # where that fails, of other triangles
LAST_RESORT_SHARE = 0.5  # of the work, which is told when they are tried
MOST_STEPS = 4  # in which the inside follows a pull
Way = Callable[[float], Array]  # the polygon of a figure at a share of the way, 0 to 1
Move = Callable[[Array], Array]  # where points go
Report = Callable[[float], object]
PULLED = "its outline was pulled by hand"
CROSSED = "the outline crosses itself there, so tiles would overlap: pull it less far"
FOLDED = "the inside would be folded there: pull it less far"
OTHER_SIZE = "the tile has become much too small or too large: pull it less far"


class PullSpace:
    """The polygons that a tile can be pulled to, which tile as it does.

    They are those of its outline, and those of the path between two figures, whose vertices are free.
    The same tile gives the same space, so that parameters mean the same to whoever made it.

    - `outline`: The variations of the tile.
    - `points`: Its vertices (N, 2), then those of the path.
    - `rings`: The numbers of the vertices of each figure.
    - `kept`: The places among these of the vertices that the figure had.
    - `start`: The parameters of the tile as it is; `matrix` takes parameters to vertices.
    """

    def __init__(self, tile: EscherTile) -> None:
        self.outline = TileVariations(divided_tile(tile.tile, POINTS))
        ring, matrix = self.outline.first.polygon, self.outline.matrix
        self.points, self.rings, self.kept = ring, [np.arange(len(ring))], [np.arange(len(ring))]
        figures = [part.prototile.polygon for part in tile.figures]
        if len(figures) > 1:
            self.points, self.rings, self.kept = _divided_rings(ring, figures)
        free = matrix.shape[1] - len(self.outline.maps) - 2
        self._path = slice(free, free + 2 * (len(self.points) - len(ring)))
        self.start = np.insert(self.outline.start, free, self.points[len(ring) :].ravel())
        self.matrix = np.zeros((2 * len(self.points), len(self.start)))
        columns = np.delete(np.arange(len(self.start)), self._path)
        self.matrix[: len(matrix), columns] = matrix
        self.matrix[len(matrix) :, self._path] = np.eye(self._path.stop - free)

    @property
    def first(self) -> Tile:
        """The tile as it is, its longer sides divided."""
        return self.outline.first

    def polygon(self, parameters: Array) -> Array:
        """Return the vertices (N, 2) for parameters (P,)."""
        return (self.matrix @ parameters).reshape(-1, 2)

    def tile(self, parameters: Array) -> Tile:
        """Return the tile for parameters (P,)."""
        return self.outline.tile(np.delete(parameters, self._path), same_area=False)


def _divided_rings(
    outline: Array, figures: Sequence[Array]
) -> tuple[Array, list[Integers], list[Integers]]:
    """Return the points, rings and kept places of a `PullSpace` for the polygons of its figures."""
    points, near = outline, SAME_POINT_DISTANCE * float(np.ptp(outline, axis=0).max())
    rings, kept = list[Integers](), list[Integers]()
    for figure in figures:
        nearest: Any = KDTree(points).query(figure)
        inner, numbers = nearest[0] > near, nearest[1]
        numbers[inner] = len(points) + np.arange(inner.sum())
        points = np.concatenate([points, figure[inner]])
        ring, places = list[int](), list[int]()
        for start, end in zip(numbers.tolist(), np.roll(numbers, -1).tolist(), strict=True):
            places.append(len(ring))
            ring += [start, *_between(outline, start, end, near)]
        rings.append(np.array(ring))
        kept.append(np.array(places))
    return points, rings, kept


def _between(outline: Array, start: int, end: int, near: float) -> list[int]:
    """Return the vertices of an outline on the side of a figure from one of its vertices to another."""
    count = len(outline)
    if max(start, end) >= count:
        return []
    between = np.arange(start + 1, start + (end - start) % count) % count
    side = shapely.LineString(outline[[start, end]])
    on_side = shapely.distance(shapely.points(outline[between]), side) < near
    return between.tolist() if on_side.all() else []


def space_json(tile: EscherTile) -> dict[str, Any]:
    """Return what a browser needs to pull a tile.

    - `rows`, `cols`, `indptr`, `indices`, `values`: The sparse matrix, by rows, that takes parameters
      to the coordinates x, y of each vertex.
    - `start`: The parameters of the tile as it is. The last ones are those of `maps`, matrices whose
      sum M moves the group by p -> M p + b, and b.
    - `polygon`: The vertices as they are: of the outline, `outer` of them, then those between figures.
    - `rings`: The numbers of the vertices of each figure.
    - `body`: `points` and `triangles` that fill the tile. The first points are the vertices, then
      come points at `shares` of the `sides` from one vertex to another, then those inside.
    """
    space = PullSpace(tile)
    return {
        **_sparse(space.matrix),
        "start": space.start.tolist(),
        "maps": space.outline.maps.tolist(),
        "polygon": space.points.tolist(),
        "outer": len(space.first.polygon),
        "rings": [ring.tolist() for ring in space.rings],
        "body": _body(space),
    }


def _body(space: PullSpace) -> dict[str, Any]:
    """Return what fills the figures, as one body."""
    tied, free = list[Array](), list[Array]()
    triangles, sides, shares = list[Any](), list[Any](), list[Any]()
    for ring in space.rings:
        polygon = space.points[ring]
        spacing = BODY_SPACING * ring_length(polygon) / len(ring)
        mesh = triangulate(orient(polygon, counter_clockwise=True), spacing)
        # in one that is turned the vertices are in reverse, from the same first one
        sides_ring = ring if signed_area(polygon) > 0 else np.roll(ring[::-1], 1)
        on_sides, inside = np.split(mesh.points[mesh.size :], [len(mesh.sides)])
        # the numbers of these points among all that are tied, and among all that are free
        kinds = np.repeat([0, 1, 2], [mesh.size, len(on_sides), len(inside)])
        numbers = np.concatenate(
            [
                sides_ring,
                sum(map(len, tied)) + np.arange(len(on_sides)),
                sum(map(len, free)) + np.arange(len(inside)),
            ]
        )
        triangles.append(np.stack([kinds, numbers])[:, mesh.triangles])
        sides.append(np.stack([sides_ring, np.roll(sides_ring, -1)], axis=1)[mesh.sides])
        shares.append(mesh.shares)
        tied.append(on_sides)
        free.append(inside)
    points = np.concatenate([space.points, *tied, *free])
    first = np.cumsum([0, len(space.points), sum(map(len, tied))])
    kinds, numbers = np.concatenate(triangles, axis=1)
    return {
        "points": points.tolist(),
        "triangles": (first[kinds] + numbers).tolist(),
        "sides": np.concatenate(sides).tolist(),
        "shares": np.concatenate(shares).tolist(),
    }


def _sparse(matrix: Array) -> dict[str, Any]:
    rows = csr_matrix(np.where(abs(matrix) > NEGLIGIBLE_ENTRY, matrix, 0.0))
    return {
        "rows": matrix.shape[0],
        "cols": matrix.shape[1],
        "indptr": rows.indptr.tolist(),
        "indices": rows.indices.tolist(),
        "values": rows.data.tolist(),
    }


def pulled(
    tile: EscherTile, parameters: Any, report: Report = lambda _: None, inside: Sequence[float] = ()
) -> EscherTile:
    """Return the certified tile for parameters of its `PullSpace`, with the maps carried on.

    With `inside`, the coordinates x, y of each free point of the body of `space_json`, what lies on the
    tile follows these. `report` hears the share of the way on which the inside has followed; it may
    raise to end it.

    Raises:
        OrbiflowError: for parameters that are not of this tile's space.
        CertificationError: if an outline crosses itself or has collapsed, in plain words.
    """
    space = PullSpace(tile)
    if np.shape(parameters) != space.start.shape:
        raise OrbiflowError(
            "the parameters of a pulled tile are not of this one, which may have become better "
            "meanwhile; pull again"
        )
    values = as_array(parameters, "the parameters of a pulled tile", space.start.shape)
    _check(space, values)
    whole, points = space.tile(values), space.polygon(values)

    def on_the_way(share: float) -> Array:
        return space.polygon(space.start + share * (values - space.start))

    move = _inner_move(space, values, inside) if len(inside) else None

    if len(tile.figures) == 1:
        changed = moved_figure(tile, whole, on_the_way, COMPARED_POINTS, report, move)
    else:

        def moved_part(part: Any, ring: Integers, kept: Integers) -> Any:
            place, back, before = part.place, part.place.inverse, part.figure
            corners = tuple(kept[list(before.tile.corners)].tolist())
            piece = Tile(back(points[ring]), whole.group.conjugate(*back), corners=corners)
            figure = moved_figure(
                before,
                piece,
                lambda share: back(on_the_way(share)[ring]),
                COMPARED_POINTS // len(tile.figures),
                report,
                None if move is None else partial(_moved_in, place, move),
            )
            return part._replace(figure=figure)

        changed = EscherTile(
            whole,
            name=tile.name,
            y_down=tile.y_down,
            silhouette=tile.silhouette,
            no_map=tile.no_map,
            notes=(PULLED,),
            division=tuple(map(moved_part, tile.figures, space.rings, space.kept)),
        )
        if all(part.figure.rating for part in changed.figures):
            changed = replace(changed, rating=Rating.of_likeness(changed.score))
    if not changed.certificate.valid:
        raise CertificationError("; ".join(changed.certificate.reasons))
    return changed


def _check(space: PullSpace, parameters: Array) -> None:
    """Refuse, in plain words, an outline that cannot be a tile's."""
    points, count = space.polygon(parameters), len(space.first.polygon)
    outline, maps = shapely.Polygon(points[:count]), space.outline.maps
    linear = np.tensordot(parameters[-2 - len(maps) : -2], maps, 1)
    areas = (outline.area / abs(space.first.signed_area), float(np.linalg.det(linear)))
    if not all(AREA_BOUNDS[0] < area < AREA_BOUNDS[1] for area in areas):
        raise CertificationError(OTHER_SIZE)
    figures = (shapely.Polygon(points[ring]) for ring in space.rings)
    if not (outline.is_valid and all(figure.is_valid for figure in figures)):
        raise CertificationError(CROSSED)


def _inner_move(space: PullSpace, parameters: Array, inside: Sequence[float]) -> Move:
    """Return the map that moves points of the figures as the body with these free points moves."""
    body = _body(space)
    rest, sides = np.array(body["points"]), np.array(body["sides"], dtype=int).reshape(-1, 2)
    shares, polygon = np.array(body["shares"])[:, None], space.polygon(parameters)
    start, end = (polygon[sides[:, k]] for k in (0, 1))
    tied = np.concatenate([polygon, (1 - shares) * start + shares * end])
    free = as_array(inside, "the inside of a pulled tile", (2 * (len(rest) - len(tied)),))
    try:
        moved = np.concatenate([tied, free.reshape(-1, 2)])
        return Bending(rest, moved, np.array(body["triangles"])).forward
    except OrbiflowError:
        raise CertificationError(FOLDED) from None


def _moved_in(place: Any, move: Move, points: Array) -> Array:
    """Return points of a figure, in its own coordinates, as they are moved on the tile."""
    return place.inverse(move(place(points)))


def _carried(
    bending: Bending, frame: Frame, way: Way, report: Report, move: Move | None = None
) -> Bending:
    """Return the map to a polygon that moved on a way, in as few steps as it follows without folds.

    With `move` its inside goes where that says, at once.
    """
    if move is not None:
        report(0.0)
        before, after = (frame.to_normal(way(share)) for share in (0.0, 1.0))

        def inner(points: Array) -> Array:
            return frame.to_normal(move(frame.to_input(points)))

        return carried_on(bending, before, after, inner=inner)

    def follow(figure: Bending, start: float, end: float, steps: int) -> Bending:
        report(start)
        try:
            rings = (frame.to_normal(way(share)) for share in (start, end))
            return carried_on(figure, *rings, sharpenings=QUICK_SHARPENINGS)
        except OrbiflowError:
            if steps >= MOST_STEPS:
                raise
        middle = (start + end) / 2
        return follow(follow(figure, start, middle, 2 * steps), middle, end, 2 * steps)

    try:
        return follow(bending, 0.0, 1.0, 1)
    except OrbiflowError:
        report(LAST_RESORT_SHARE)
        before, after = (frame.to_normal(way(share)) for share in (0.0, 1.0))
        return carried_anew(bending, before, after, SHARPENINGS)


def moved_figure(
    before: EscherTile,
    tile: Tile,
    way: Way,
    count: int,
    report: Report,
    move: Move | None = None,
    note: str = PULLED,
) -> EscherTile:
    """Return a figure that moved to `tile` on a way, with its map and likeness carried on.

    It is compared with its silhouette at so many points; `note` says what was done by hand.
    """
    likeness = Likeness(min_neck=before.likeness.min_neck, thinnest=narrowest_neck(tile.polygon))
    moved = EscherTile(
        tile,
        name=before.name,
        y_down=before.y_down,
        silhouette=before.silhouette,
        notes=(note,),
        likeness=likeness,
    )
    source = (before.silhouette or {}).get("source", NO_PICTURE)
    if before.bending is None and source == NO_PICTURE:
        return moved  # nothing lies on it
    if before.bending is None:
        from orbiflow.tiles import with_map  # which needs torch

        before = with_map(before)
    bending, frame = before.bending, before.frame
    if bending is None or frame is None:
        return moved.changed(no_map=before.no_map or "its run left no map")
    try:
        bending = _carried(bending, frame, way, report, move)
    except OrbiflowError as error:
        return moved.changed(map_source=TileMap(frame=frame), no_map=str(error))
    rest, images = _outlines(bending, count)
    cost = before.likeness.fidelity.cost if before.likeness.fidelity else 0.0
    kept = fidelity(complex_points(rest), complex_points(images), cost)
    moved = moved.changed(
        map_source=TileMap(frame=frame, bending=bending),
        search=SearchFacts(objective="likeness"),
        likeness=replace(
            likeness, fidelity=kept, rest=frame.to_input(rest), bent=frame.to_input(images)
        ),
    )
    return replace(moved, rating=Rating.of_likeness(moved.score))


def _outlines(bending: Bending, count: int) -> tuple[Array, Array]:
    """Return the silhouette's outline at evenly spaced points, and where they go."""
    ring = bending.rest[border(bending.triangles)]
    lengths = arc_lengths(ring)
    rest = points_along(ring, np.arange(count) / count * lengths[-1])
    return rest, bending.forward(rest)
