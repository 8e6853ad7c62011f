"""Where a function is at least a level: a grid that is fine there, and polygons with their islands."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from orbiflow.arrays import Array
from orbiflow.drawing import level_curves

Function = Callable[[Array], Array]
"""A function from points (N, 2) to values (N,)."""

Flags = NDArray[np.bool_]

MAX_ROUNDS = 200
"""Rounds of evaluating what lies beside a crossing, at most, for each size of cells."""


class Block(NamedTuple):
    """Values (n + 1, m + 1) at the nodes of even cells, their lowest corner and their sides (2,)."""

    values: Array
    low: Array
    step: Array

    def cells_of(self, points: Array) -> NDArray[np.int64]:
        """Return the cells (N, 2) that hold points (N, 2)."""
        most = np.array(self.values.shape) - 2
        return np.clip(np.floor((points - self.low) / self.step).astype(np.int64), 0, most)


def refined(
    function: Function,
    block: Block,
    levels: Array,
    seeds: tuple[Array, Array],
    doublings: int,
    budget: int,
) -> tuple[Block, int]:
    """Return a block whose cells are halved where a level is crossed, and how often it was evaluated.

    The function is evaluated at all nodes of the block; the cells are then halved, `doublings` times or
    until `budget` evaluations. Values are exact at both ends of every side of a cell whose ends are on
    different sides of one of the levels (T,); elsewhere they are interpolated from coarser cells.
    `seeds` are points (S, 2) at which the function is known, and its values (S,) there, so that islands
    between the nodes are found.
    """
    evaluated, spent = np.zeros(block.values.shape, dtype=bool), 0

    def evaluate(wanted: Flags) -> int:
        """Evaluate at wanted nodes that are not known, and return their number."""
        index = np.argwhere(wanted & ~evaluated)
        if len(index):
            block.values[tuple(index.T)] = function(block.low + index * block.step)
            evaluated[tuple(index.T)] = True
        return len(index)

    spent += evaluate(~evaluated)
    for _ in range(doublings):
        if spent >= budget:
            break
        wanted = _missed(block, levels, seeds)
        coarse, evaluated = evaluated, np.zeros(2 * np.array(evaluated.shape) - 1, dtype=bool)
        evaluated[::2, ::2] = coarse
        block = Block(_doubled(block.values), block.low, block.step / 2)
        more = evaluate(_corners(np.repeat(np.repeat(wanted, 2, axis=0), 2, axis=1)))
        for _ in range(MAX_ROUNDS):
            spent += more
            more = evaluate(_corners(_mixed(block.values, levels)))
            if not more:
                break
    return block, spent


def _missed(block: Block, levels: Array, seeds: tuple[Array, Array]) -> Flags:
    """Return the cells (n, m) with a seed on the other side of a level than all their nodes."""
    points, values = seeds
    i, j = block.cells_of(points).T
    missed = np.zeros(np.array(block.values.shape) - 1, dtype=bool)
    for level in levels:
        least, most = _extremes(block.values >= level)
        lost = np.where(values >= level, ~most[i, j], least[i, j])
        missed[i[lost], j[lost]] = True
    return missed


def _mixed(values: Array, levels: Array) -> Flags:
    """Return the cells (n, m) that cross a level."""
    sides = [_extremes(values >= level) for level in levels]
    return np.logical_or.reduce([most & ~least for least, most in sides])


def _extremes(above: Flags) -> tuple[Flags, Flags]:
    """Return whether all, and whether any, of a cell's four nodes are above a level."""
    four = (above[:-1, :-1], above[1:, :-1], above[:-1, 1:], above[1:, 1:])
    return np.logical_and.reduce(four), np.logical_or.reduce(four)


def _corners(cells: Flags) -> Flags:
    """Return the nodes of cells."""
    edged = np.pad(cells, 1)
    return edged[1:, 1:] | edged[1:, :-1] | edged[:-1, 1:] | edged[:-1, :-1]


def _doubled(values: Array) -> Array:
    """Return values interpolated on cells of half the size."""
    finer = np.empty(2 * np.array(values.shape) - 1)
    finer[::2, ::2] = values
    finer[1::2, ::2] = (values[1:] + values[:-1]) / 2
    finer[:, 1::2] = (finer[:, 2::2] + finer[:, :-2:2]) / 2
    return finer


CROWDED, DEPTH = 0.005, 4
"""The share of the seeds that must be on the wrong side in a cell for it to be divided again, and how
often: to a metre on the globe."""

PARTS = 12
"""Parts into which each side of a cell is cut."""


def with_islands(
    shape: shapely.Geometry,
    block: Block,
    function: Function,
    seeds: tuple[Array, Array],
    level: float,
    budget: int,
    depth: int = DEPTH,
    least: float | None = None,
) -> tuple[shapely.Geometry, int, int]:
    """Draw a shape again in those of a block's cells that have seeds on its wrong side.

    Cells with the most seeds are first; those beyond the budget of evaluations are left as they are.
    Where `least` seeds, by default the share `CROWDED` of all, are on the wrong side of what is drawn
    in a cell, it is divided again, up to `depth` times. The numbers of evaluations and of cells left
    come after the shape.
    """
    points, values = seeds
    least, of = CROWDED * len(points) if least is None else least, block.cells_of(points)
    wrong = of[_on_wrong_side(shape, seeds, level)]
    cells, counts = np.unique(wrong, axis=0, return_counts=True)
    most = max(1, budget // (PARTS + 1) ** 2)
    left, cells = max(0, len(cells) - most), cells[np.argsort(-counts, kind="stable")][:most]
    if not len(cells):
        return shape, 0, left
    t, lows = np.arange(PARTS + 1) / PARTS, block.low + cells * block.step
    inside = np.stack(np.meshgrid(t, t, indexing="ij"), axis=-1) * block.step
    heights = function((lows[:, None, None] + inside).reshape(-1, 2))
    tables = heights.reshape(len(cells), PARTS + 1, PARTS + 1)
    finer = [Block(table, low, block.step / PARTS) for table, low in zip(tables, lows, strict=True)]
    drawn, _ = all_filled(finer, level, function)
    spent = len(heights)
    for k, (cell, inner) in enumerate(zip(cells, finer, strict=True)):
        inside_cell = (of == cell).all(axis=1)
        some = points[inside_cell], values[inside_cell]
        if depth and _on_wrong_side(drawn[k], some, level).sum() >= least:
            drawn[k], more, lost = with_islands(
                drawn[k], inner, function, some, level, budget - spent, depth - 1, least
            )
            spent, left = spent + more, left + lost
    corners = np.concatenate([lows, lows + block.step], axis=1).tolist()
    boxes: list[shapely.Geometry] = [shapely.box(*corner) for corner in corners]
    rest = shapely.difference(shape, shapely.union_all(boxes))
    return shapely.union_all([rest, *drawn]), spent, left


def _on_wrong_side(shape: shapely.Geometry, seeds: tuple[Array, Array], level: float) -> Flags:
    """Return which seeds (S,) are inside a shape and below a level, or outside and above."""
    points, values = seeds
    shapely.prepare(shape)
    inside = np.asarray(shapely.intersects_xy(shape, points[:, 0], points[:, 1]))
    return inside != (values >= level)


TOLERANCE = 1e-3
"""Difference between the function at a vertex and the level that is good enough."""

MAX_STEPS = 8
"""Steps in which a vertex is found, at most."""

FAR_BELOW = 1e12


def filled(block: Block, level: float, function: Function) -> tuple[shapely.Geometry, float]:
    """Return the area in which a block's values are at least `level`; see `all_filled`."""
    shapes, off = all_filled([block], level, function)
    return shapes[0], off


def all_filled(
    blocks: Sequence[Block], level: float, function: Function
) -> tuple[list[shapely.Geometry], float]:
    """Return for each block the area in which its values are at least `level`.

    It is cut at the block's border. Vertices lie on sides of cells, moved along them to where
    `function` is at the level; second comes the root mean square of the difference that is left inside.
    The vertices of all blocks move together, as a call of the function costs more than a point of it.
    """
    rings = [_rings(block.values, level) for block in blocks]
    pairs = zip(rings, blocks, strict=True)
    parts = [_sides(np.concatenate(ring), block) for ring, block in pairs if ring]
    if not parts:
        return [shapely.MultiPolygon() for _ in blocks], 0.0
    vertices, inside, a, b, fa, fb = (np.concatenate(column) for column in zip(*parts, strict=True))
    vertices[inside], off = _on_level(a, b, fa, fb, level, function)
    ends = np.cumsum([len(part[0]) for part in parts])[:-1]
    moved = iter(np.split(vertices, ends))
    return [_area(ring, next(moved)) if ring else shapely.MultiPolygon() for ring in rings], off


def _rings(values: Array, level: float) -> list[Array]:
    """Return closed lines (n, 2), in cells, at a level of values at nodes; they end at the border."""
    padded = np.pad(values, 1, constant_values=level - FAR_BELOW)
    return [ring - 1 for ring in level_curves(padded, level)]


def _area(rings: list[Array], vertices: Array) -> shapely.Geometry:
    """Return the area of rings, whose vertices (V, 2) are one after the other."""
    sizes = np.cumsum([len(ring) for ring in rings])[:-1]
    lines = [np.concatenate([ring[:-1], ring[:1]]) for ring in np.split(vertices, sizes)]
    closed = [shapely.LinearRing(line) for line in lines if len(np.unique(line, axis=0)) > 2]
    if not closed:
        return shapely.MultiPolygon()
    return shapely.make_valid(shapely.build_area(shapely.GeometryCollection(closed)))


def _sides(at: Array, block: Block) -> tuple[Array, Flags, Array, Array, Array, Array]:
    """Return a block's vertices (V, 2), which lie inside, and of these the sides of cells they lie on.

    Vertices are given in cells. Sides are two ends (R, 2) each, and the values (R,) there.
    """
    most = np.array(block.values.shape) - 1
    inside = ((at >= 0) & (at <= most)).all(axis=1)
    at = np.clip(at, 0, most)
    start, end = np.floor(at), np.ceil(at)
    inside &= (start != end).any(axis=1)  # else it lies on a node
    nodes = start[inside], end[inside]
    a, b = (block.low + node * block.step for node in nodes)
    fa, fb = (block.values[tuple(node.T.astype(int))] for node in nodes)
    return block.low + at * block.step, inside, a, b, fa, fb


def _on_level(
    a: Array, b: Array, fa: Array, fb: Array, level: float, function: Function
) -> tuple[Array, float]:
    """Return points (R, 2) between ends by false position (the Illinois algorithm), and how far off."""
    fa, fb = fa - level, fb - level
    if not len(a):
        return a, 0.0
    off, nearest = np.full(len(a), np.inf), a.copy()
    todo, last = np.arange(len(a)), np.zeros(len(a))
    for _ in range(MAX_STEPS):
        width = fb[todo] - fa[todo]
        share = np.clip(-fa[todo] / np.where(width == 0, 1.0, width), 0.0, 1.0)
        here = a[todo] + share[:, None] * (b[todo] - a[todo])
        f = function(here) - level
        better = abs(f) < abs(off[todo])
        nearest[todo[better]], off[todo[better]] = here[better], f[better]
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
    return nearest, float(np.sqrt(np.mean(off**2)))
