"""Polygons where values on a grid are at least a level, with vertices on the function itself."""

from __future__ import annotations

import numpy as np
import shapely
from skimage.measure import find_contours

from orbiflow.arrays import Array
from orbiflow.density.regions.grid import Function

TOLERANCE = 1e-3
"""Difference between the function at a vertex and the level that is good enough."""

MAX_STEPS = 8
"""Steps in which a vertex is found, at most."""

FAR_BELOW = 1e12


def filled(
    values: Array, low: Array, step: Array, level: float, function: Function
) -> tuple[shapely.Geometry, float]:
    """Return the area in which values on a grid are at least `level`, cut at the grid's border.

    Vertices lie on sides of cells, moved along them to where `function` is at the level.

    Args:
        values: Values (n + 1, m + 1) at the nodes.
        low: Lower corner of the grid.
        step: Sides of a cell.
        level: The level.
        function: The function.

    Returns:
        A polygon, several, or an empty one; and the root mean square of the difference between the
        function and the level at the vertices inside.
    """
    padded = np.pad(values, 1, constant_values=level - FAR_BELOW)
    rings = [ring - 1 for ring in find_contours(padded, level)]
    if not rings:
        return shapely.MultiPolygon(), 0.0
    sizes = np.cumsum([len(ring) for ring in rings])[:-1]
    at, off = _on_level(np.concatenate(rings), values, low, step, level, function)
    lines = [np.concatenate([ring[:-1], ring[:1]]) for ring in np.split(low + at * step, sizes)]
    closed = [shapely.LinearRing(line) for line in lines if len(np.unique(line, axis=0)) > 2]
    if not closed:
        return shapely.MultiPolygon(), off
    return shapely.make_valid(shapely.build_area(shapely.GeometryCollection(closed))), off


def _on_level(
    at: Array, values: Array, low: Array, step: Array, level: float, function: Function
) -> tuple[Array, float]:
    """Return vertices (V, 2), in cells, by false position between nodes (the Illinois algorithm)."""
    most = np.array(values.shape) - 1
    inside = ((at >= 0) & (at <= most)).all(axis=1)
    at = np.clip(at, 0, most)
    start, end = np.floor(at), np.ceil(at)
    inside &= (start != end).any(axis=1)  # else it lies on a node
    rows = np.flatnonzero(inside)
    if not len(rows):
        return at, 0.0
    a, b = start[rows], end[rows]
    fa, fb = (values[tuple(p.astype(int).T)] - level for p in (a, b))
    off = np.full(len(rows), np.inf)
    found = at[rows]
    todo, last = np.arange(len(rows)), np.zeros(len(rows))
    for _ in range(MAX_STEPS):
        width = fb[todo] - fa[todo]
        share = np.clip(-fa[todo] / np.where(width == 0, 1.0, width), 0.0, 1.0)
        here = a[todo] + share[:, None] * (b[todo] - a[todo])
        f = function(low + here * step) - level
        better = abs(f) < abs(off[todo])
        found[todo[better]], off[todo[better]] = here[better], f[better]
        same = (f >= 0) == (fa[todo] >= 0)
        # an end that stays twice counts half
        side = np.where(same, 1, -1)
        again = np.where(last[todo] == side, 0.5, 1.0)
        last[todo] = side
        left, right = todo[same], todo[~same]
        a[left], fa[left], fb[left] = here[same], f[same], fb[left] * again[same]
        b[right], fb[right], fa[right] = here[~same], f[~same], fa[right] * again[~same]
        todo = todo[abs(off[todo]) > TOLERANCE]
        if not len(todo):
            break
    at[rows] = found
    return at, float(np.sqrt(np.mean(off**2)))
