"""A tile's outline among its copies: who is beyond each piece of it, and which points it has."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import shapely

from orbiflow.arrays import Array, Integers
from orbiflow.symmetry import symmetry_elements
from orbiflow.tiles.geometry import complex_points, orient
from orbiflow.tiles.tilings import Tiling, copies_meeting
from orbiflow.tiles.worlds.pattern import Pattern

NEAR = 1e-6  # of lattice vectors, or of the tile's size: places that are one
BEYOND = 1e-4  # how far beyond its edge a tile's neighbour is looked for, in its size
ON_EDGE = 0.37  # of a straight piece of the edge, where no centre is


def ring_of(tiling: Tiling) -> Array:
    """Return a tile's outline (N, 2), counter-clockwise; of several figures, their union."""
    polygons = [shapely.Polygon(prototile.polygon) for prototile in tiling.prototiles]
    if len(polygons) == 1:
        return orient(tiling.prototiles[0].polygon, counter_clockwise=True)
    union: Any = shapely.union_all(polygons, grid_size=1e-9 * float(np.sqrt(tiling.tile_area)))
    return orient(shapely.get_coordinates(union.exterior)[:-1], counter_clockwise=True)


def with_centres(ring: Array, pattern: Pattern, spacing: float, near: float) -> Array:
    """Return an outline (N, 2) with the pattern's centres that lie on it among its points."""
    fine = shapely.get_coordinates(shapely.segmentize(shapely.LinearRing(ring), spacing))
    points = complex_points(fine)
    away = pattern.to_centres(points)
    centres = (points[:, None] - away)[np.abs(away) < spacing]
    return with_points(ring, np.column_stack([centres.real, centres.imag]), near)


def with_points(ring: Array, points: Array, near: float) -> Array:
    """Return an outline (N, 2) with those points (K, 2) that are nearer to it among its own.

    The nearest vertex is moved there if it is so near: near a cone, what is off by a millionth is off
    by a thousandth in the image.
    """
    away = np.linalg.norm(ring[:, None] - np.reshape(points, (1, -1, 2)), axis=2)
    ring = ring.copy()
    for j in np.flatnonzero(away.min(axis=0) < near):
        ring[away[:, j].argmin()] = points[j]
    line, added = shapely.LinearRing(ring), list[tuple[float, Array]]()
    for point in points:
        others = np.array([*ring, *(vertex for _, vertex in added)])
        apart = float(np.linalg.norm(others - point, axis=1).min())
        if line.distance(shapely.Point(*point)) < near < apart:
            added.append((line.project(shapely.Point(*point)), point))
    added.sort(key=lambda entry: entry[0])
    lengths = np.cumsum(np.append(0.0, np.linalg.norm(np.diff(ring, axis=0), axis=1)))
    places = np.searchsorted(lengths, [length for length, _ in added])
    return np.insert(ring, places, np.reshape([vertex for _, vertex in added], (-1, 2)), axis=0)


def _sides(tiling: Tiling, ring: Array) -> tuple[list[Any], Integers, Array]:
    """Return the copies around a tile, which of them (N,) is beyond each piece of its edge, -1 for none
    that was found, and a point (N, 2) of each piece."""
    size = float(np.sqrt(tiling.tile_area))
    step = np.roll(ring, -1, axis=0) - ring
    normals = np.column_stack([step[:, 1], -step[:, 0]]) / np.linalg.norm(step, axis=1)[:, None]
    edge = ring + ON_EDGE * step
    beyond = edge + BEYOND * size * normals
    low, high = ring.min(axis=0) - size, ring.max(axis=0) + size
    copies = copies_meeting(tiling, (*low.tolist(), *high.tolist()))
    polygon, sides = shapely.Polygon(ring), np.full(len(ring), -1)
    isometries = [copies.isometry(int(k)) for k in np.flatnonzero(copies.prototiles == 0)]
    for number, isometry in enumerate(isometries):
        sides[shapely.contains_xy(polygon, *isometry.inverse()(beyond).T)] = number
    return isometries, sides, edge


def contacts(tiling: Tiling, ring: Array) -> list[tuple[Any, Array]]:
    """Return each copy along a tile's edge, and points (n, 2) of the edge that both share."""
    isometries, sides, edge = _sides(tiling, ring)
    return [(isometries[k], edge[sides == k]) for k in np.unique(sides[sides >= 0])]


def joints(tiling: Tiling, ring: Array) -> list[tuple[Array, Array]]:
    """Return pairs of points (2,) of a tile's edge, one for each edge, that meet where two copies do.

    They are in the middle of the longest run of an edge between two copies; where a half-turn takes the
    edge to itself, in the middles of its halves.
    """
    isometries, sides, edge = _sides(tiling, ring)
    weights = np.linalg.norm(np.roll(ring, -1, axis=0) - ring, axis=1)
    starts = np.flatnonzero(sides != np.roll(sides, 1))
    runs = [np.arange(a, b) % len(ring) for a, b in pairwise([*starts, starts[0] + len(ring)])]
    longest = dict[int, Integers]()
    for run in sorted(runs, key=lambda pieces: weights[pieces].sum()):
        longest[int(sides[run[0]])] = run
    pairs, size = list[tuple[Array, Array]](), float(np.sqrt(tiling.tile_area))
    for k, run in longest.items():
        if k < 0:
            continue
        back = isometries[k].inverse()
        itself = bool(np.linalg.norm(edge[run] - back(edge[run])[::-1], axis=1).max() < 0.1 * size)
        along = np.cumsum(weights[run]) / weights[run].sum()
        point = edge[run[int(np.searchsorted(along, 0.25 if itself else 0.5))]]
        line = shapely.LineString(ring[np.append(run, run[-1] + 1) % len(ring)])
        distances = (line.distance(shapely.Point(*joint)) for pair in pairs for joint in pair)
        if min(distances, default=np.inf) > NEAR * size:  # an edge's image has its points already
            pairs.append((point, back(point)))
    return pairs


def cone_points(tiling: Tiling, ring: Array) -> tuple[Array, list[complex]]:
    """Return a lattice (2, 2), and points of a tile's outline, one of each orbit under it.

    In a group of translations these are the tile's vertices. With glides, they are points on the lines
    of these: their images are a lattice that reflections in the lines keep.
    """
    group = tiling.group
    if group.name == "p1":
        _, sides, _ = _sides(tiling, ring)
        shared = np.flatnonzero(sides >= 0)
        ends = shared[np.flatnonzero(np.diff(sides[shared], append=sides[shared[0]]))]
        lattice, points = group.lattice, ring[(ends + 1) % len(ring)]
    else:
        reach = float(np.linalg.norm(ring - tiling.center, axis=1).max())
        lines = symmetry_elements(group, tiling.center, reach).lines
        step = lines[0].shift * lines[0].line.direction
        lattice = np.column_stack([step, (-step[1], step[0])])
        lattice = lattice * [1.0, group.cell_volume / (2 * step @ step)]
        crossings = list[Array]()
        for mirror in lines:
            ends = mirror.line.point + 2 * reach * np.outer((-1, 1), mirror.line.direction)
            crossed: Any = shapely.LineString(ends).intersection(shapely.LinearRing(ring))
            crossings.append(shapely.get_coordinates(crossed))
        points = np.concatenate(crossings)
    kept = list[Array]()
    back = np.linalg.inv(lattice)
    for point in points:
        shares = (np.array(kept).reshape(-1, 2) - point) @ back.T
        if not (np.abs(shares - np.round(shares)) < NEAR).all(axis=1).any():
            kept.append(point)
    return lattice, [complex(*point) for point in kept]
