"""A tiling on a sphere to hold: a ball in relief, one of pieces, an openwork lamp; lengths in mm."""

from __future__ import annotations

from typing import Any

import numpy as np
import shapely
from manifold3d import Manifold, Mesh
from scipy.spatial import KDTree

from orbiflow.arrays import Array, Integers
from orbiflow.errors import OrbiflowError, SettingError
from orbiflow.tiles.geometry import border, orient, polygons_in, ring_length
from orbiflow.tiles.silhouette import triangulate
from orbiflow.tiles.solids.settings import SolidSettings
from orbiflow.tiles.solids.shapes import ClosedBody
from orbiflow.tiles.tile import EscherTile
from orbiflow.tiles.worlds import Unfolding, copies, facing, in_world, joints

GROOVE = 2.0  # mm from the bottom of a groove between tiles to its edge
FOOT = 0.03  # of the radius: what is cut off so that a ball stands
SAME = 1e-5  # mm: vertices of neighbours this near are one
STEP = 1.0  # mm of the sides of triangles on a ball, about
FINE, ROWS = 0.5, 5  # mm of those beside its grooves, and rows of them across half a groove
ROUNDS = 6  # number of times that all sides may be halved for the triangulation


def ball_of(
    tile: EscherTile, settings: SolidSettings
) -> tuple[dict[str, ClosedBody], tuple[str, ...]]:
    """Return the bodies of a ball, a ball's piece, or a lamp, and what the user should know.

    Raises:
        OrbiflowError: If the tile has no pattern on the sphere, or nothing is left of it.
    """
    if len(tile.figures) > 1:
        raise OrbiflowError("a ball is made of a tile of one figure")
    unfolding, seen = in_world(tile, settings.order, 1)
    motions = copies(unfolding, lambda moved: np.ones(len(moved), dtype=bool), 500)
    radius = settings.diameter / 2
    # mm in a unit of the plane, in the mean
    scale = radius * float(np.sqrt(4 * np.pi / len(motions) / unfolding.tiling.tile_area))
    if settings.kind == "ball":
        bodies = {"ball": ClosedBody(_relief(unfolding, motions, radius, scale, settings.relief))}
        return bodies, seen
    if settings.kind == "lamp":
        return {"lamp": ClosedBody(_openwork(unfolding, motions, radius, scale, settings))}, seen
    piece = _piece(unfolding, radius, scale, settings)
    note = f"a ball of {settings.diameter:g} mm has {len(motions)} of these pieces, all alike"
    notes = [note, *seen]
    if settings.magnet is not None:
        count = len(joints(unfolding.tiling, unfolding.ring))
        notes.append(
            f"{2 * count} holes for magnets of {settings.magnet:g} x {settings.magnet_depth:g} mm in "
            "each piece; where two holes meet, the magnets' poles must be unlike, in all pieces alike"
        )
    return {"piece": ClosedBody(piece)}, tuple(notes)


def _closed(points: Array, triangles: Integers) -> Manifold:
    made = Manifold(Mesh(points.astype(np.float32), triangles.astype(np.uint32)))
    if made.status().name != "NoError" or made.is_empty():
        raise OrbiflowError("the surface does not close; choose a larger diameter")
    return made if made.volume() > 0 else made.mirror((0, 0, 1)).mirror((0, 0, 1))


def _divided(ring: Array, step: float) -> Array:
    """Return a ring with points on sides longer than a step; sides of one length have as many."""
    ends = np.roll(ring, -1, axis=0)
    count = np.maximum(1, np.ceil(np.linalg.norm(ends - ring, axis=1) / step - 1e-6)).astype(int)
    side = np.repeat(np.arange(len(ring)), count)
    share = (np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)) / count[side]
    return ring[side] + share[:, None] * (ends - ring)[side]


def _welded(parts: list[Array], triangles: Integers) -> tuple[Array, Integers]:
    """Return copies (V, 3) of a surface as one, whose vertices that are near are one."""
    points = np.concatenate(parts)
    every = np.concatenate([triangles + k * len(parts[0]) for k in range(len(parts))])
    pairs = KDTree(points).query_pairs(SAME, output_type="ndarray")
    number = np.arange(len(points))
    for _ in range(8):  # until chains of pairs are one
        np.minimum.at(number, pairs[:, 1], number[pairs[:, 0]])
        np.minimum.at(number, pairs[:, 0], number[pairs[:, 1]])
    kept, index = np.unique(number, return_inverse=True)
    return points[kept], index[every]


def _matching_mesh(ring: Array, step: float) -> Any:
    """Return triangles that have no point on the ring but its own, which may be divided more."""
    for _ in range(ROUNDS):
        mesh = triangulate(ring, step)
        if not len(mesh.sides):
            return mesh
        ring = _divided(
            ring, 0.51 * float(np.linalg.norm(np.roll(ring, -1, axis=0) - ring, axis=1).max())
        )
    raise OrbiflowError("the tile is too thin somewhere to become a ball")


def _relief(
    unfolding: Unfolding, motions: Array, radius: float, scale: float, depth: float
) -> Manifold:
    """Return a ball with a groove between its tiles, which stands on a small foot."""
    points, triangles = _ringed(shapely.Polygon(_divided(unfolding.ring, FINE / scale)), scale)
    off = scale * shapely.distance(shapely.points(points), shapely.LinearRing(unfolding.ring))
    share = np.clip(off / GROOVE, 0, 1)
    height = radius - depth * (1 - share * share * (3 - 2 * share))
    vectors = height[:, None] * unfolding.vectors(points)
    ball = _closed(*_welded([vectors @ motion.T for motion in motions], triangles))
    foot = (1 - FOOT) * (radius - depth)
    return ball.trim_by_plane((0, 0, 1), -foot).translate((0, 0, foot))


def _ringed(tile: shapely.Polygon, scale: float) -> tuple[Array, Integers]:
    """Return triangles (T, 3) of points (V, 2) that fill a tile, in rows along its edge."""
    corners, regions = list[Array](), [tile]
    for off in np.linspace(0, GROOVE, ROWS + 1)[1:]:
        inner = [
            orient(shapely.get_coordinates(part.exterior)[:-1], counter_clockwise=True)
            for part in polygons_in(tile.buffer(-off / scale))
        ]
        rings = [_divided(ring, FINE / scale) for ring in inner]
        if off == GROOVE:
            meshes = [_matching_mesh(ring, STEP / scale) for ring in rings]
            rings = [mesh.points[: mesh.size] for mesh in meshes]
            corners += [mesh.points[mesh.triangles] for mesh in meshes]
        fresh = [shapely.Polygon(ring) for ring in rings]
        for outer in regions:
            holes = [part.exterior for part in fresh if outer.contains(part.representative_point())]
            corners.append(_between(shapely.Polygon(outer.exterior, holes)))
        regions = fresh
    points, index = np.unique(np.concatenate(corners).reshape(-1, 2), axis=0, return_inverse=True)
    return points, index.reshape(-1, 3)


def _between(region: shapely.Polygon) -> Array:
    """Return triangles (T, 3, 2), counter-clockwise, between the points of a region's rings."""
    pieces: Any = shapely.get_parts(shapely.constrained_delaunay_triangles(region))
    corners = np.stack([shapely.get_coordinates(triangle)[:3] for triangle in pieces])
    sides = corners[:, 1:] - corners[:, :1]
    back = sides[:, 0, 0] * sides[:, 1, 1] < sides[:, 0, 1] * sides[:, 1, 0]
    corners[back] = corners[back][:, ::-1]
    return corners


def _openwork(
    unfolding: Unfolding, motions: Array, radius: float, scale: float, settings: SolidSettings
) -> Manifold:
    """Return a shell that has a band along the edges of its tiles alone."""
    tile = shapely.Polygon(_divided(unfolding.ring, STEP / scale))
    inner = tile.buffer(-settings.wall / 2 / scale)
    holes = [
        _divided(
            orient(shapely.get_coordinates(part.exterior)[:-1], counter_clockwise=False),
            STEP / scale,
        )
        for part in polygons_in(inner)
    ]
    if not holes:
        raise OrbiflowError(
            "no opening is left in the tiles; choose a larger {diameter} or a thinner {wall}"
        )
    outer = shapely.get_coordinates(tile.exterior)[:-1]
    band = shapely.Polygon(outer, holes)
    points = np.concatenate([outer, *holes])
    triangles: Integers = np.asarray(KDTree(points).query(_between(band))[1])
    count, vectors = len(points), unfolding.vectors(points)
    walls, first = list[Array](), len(outer)
    for hole in holes:
        ahead = np.arange(len(hole))
        a, b = first + ahead, first + np.roll(ahead, -1)
        walls += [np.column_stack([b, a, a + count]), np.column_stack([b, a + count, b + count])]
        first += len(hole)
    shell = np.concatenate([triangles, triangles[:, ::-1] + count, *walls])
    thick = np.concatenate([radius * vectors, (radius - settings.wall) * vectors])
    return _closed(*_welded([thick @ motion.T for motion in motions], shell)).translate(
        (0, 0, radius)
    )


def _piece(unfolding: Unfolding, radius: float, scale: float, settings: SolidSettings) -> Manifold:
    """Return one tile of a shell, its middle upwards, smaller by half of the clearance all around."""
    region = shapely.Polygon(unfolding.ring).buffer(-settings.clearance / 2 / scale)
    rings = sorted(polygons_in(region), key=lambda part: part.area)
    if not rings:
        raise OrbiflowError("nothing is left of a piece; choose a larger {diameter}")
    ring = orient(shapely.get_coordinates(rings[-1].exterior)[:-1], counter_clockwise=True)
    mesh = triangulate(_divided(ring, STEP / scale), max(STEP / scale, ring_length(ring) / 400))
    vectors, edge, count = unfolding.vectors(mesh.points), border(mesh.triangles), len(mesh.points)
    ahead = np.roll(edge, -1)
    walls = [
        np.column_stack([edge, edge + count, ahead]),
        np.column_stack([ahead, edge + count, ahead + count]),
    ]
    triangles = np.concatenate([mesh.triangles, mesh.triangles[:, ::-1] + count, *walls])
    turned = vectors @ facing(unfolding.middle).T
    made = _closed(np.concatenate([radius * turned, (radius - settings.wall) * turned]), triangles)
    if settings.magnet is not None:
        holes = _holes(unfolding, radius, scale, settings)
        made = _with_holes(made, holes)
    return made.translate((0, 0, -made.bounding_box()[2]))


def _holes(
    unfolding: Unfolding, radius: float, scale: float, settings: SolidSettings
) -> list[Manifold]:
    """Return the holes for magnets in the sides of a piece: those of two neighbours meet."""
    frame, holes = facing(unfolding.middle), list[Manifold]()
    deep = settings.magnet_depth + settings.clearance / 2
    shape = Manifold.cylinder(deep + STEP, (settings.magnet or 0.0) / 2, circular_segments=48)
    polygon = shapely.Polygon(unfolding.ring)
    for point in (joint for pair in joints(unfolding.tiling, unfolding.ring) for joint in pair):
        near = 1e-3 / scale
        inner: Any = polygon.buffer(-near).exterior
        inside = shapely.get_coordinates(inner.interpolate(inner.project(shapely.Point(*point))))
        here, there = unfolding.vectors(np.stack([point, inside[0]])) @ frame.T
        inwards = there - here - ((there - here) @ here) * here
        inwards /= np.linalg.norm(inwards)
        # from STEP beyond the edge inwards, about the middle of the wall
        turn = np.column_stack([np.cross(here, inwards), here, inwards])
        start = (radius - settings.wall / 2) * here - STEP * inwards
        holes.append(shape.transform(np.column_stack([turn, start])))
    return holes


def _with_holes(made: Manifold, holes: list[Manifold]) -> Manifold:
    for k, hole in enumerate(holes):
        if any((hole ^ other).volume() > 0 for other in holes[:k]):
            raise SettingError("magnets are in each other's way; choose a smaller {magnet}")
    for hole in holes:
        made = made - hole
    if made.genus() or len(made.decompose()) > 1:
        raise SettingError(
            "a hole for a magnet breaks through; choose a smaller {magnet}, or a larger {diameter}"
        )
    return made
