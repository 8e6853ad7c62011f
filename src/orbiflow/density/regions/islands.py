"""Islands and holes as small as a grid's cells, drawn with finer cells around seeds in them."""

# pyright: reportUnknownMemberType=false
# shapely's stubs leave the keyword arguments of its functions of arrays without types.

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray

from orbiflow.arrays import Array
from orbiflow.density.regions.contours import filled
from orbiflow.density.regions.grid import Function, LevelGrid, Seeds

PARTS = 12
"""Parts into which each side of a cell is cut."""

MAX_ROUNDS = 4
"""Rounds of following an island into neighbouring cells."""

MIN_WRONG_PARTS = 2
"""Parts of a cell's side on which the grid must be wrong for the neighbour to be drawn, too."""

BLOCK = 500
"""Cells evaluated at a time."""


def with_islands(
    shape: shapely.Geometry,
    grid: LevelGrid,
    level: float,
    seeds: Seeds,
    function: Function,
    budget: int,
) -> tuple[shapely.Geometry, int, int]:
    """Draw a shape again in those of a grid's cells that have seeds on its wrong side.

    Args:
        shape: The shape that was drawn on the grid.
        grid: The grid.
        level: The level of the shape's boundary.
        seeds: Points at which the function is known.
        function: The function.
        budget: Number of evaluations. Cells with the most seeds are first, and those beyond it are left
            as they are.

    Returns:
        The shape, the number of evaluations, and the number of cells left.
    """
    most = max(1, budget // (PARTS + 1) ** 2)
    cells = _wrong(shape, grid, level, seeds)
    left = max(0, len(cells) - most)
    done = np.zeros(np.array(grid.values.shape) - 1, dtype=bool)
    drawn: list[shapely.Geometry] = []
    for _ in range(MAX_ROUNDS):
        cells = cells[: most - len(drawn)]
        if not len(cells):
            break
        done[tuple(cells.T)] = True
        blocks = _evaluated(grid, cells, function)
        drawn += [
            _drawn(grid, cell, block, level, function)
            for cell, block in zip(cells, blocks, strict=True)
        ]
        cells = _beside(cells, blocks, level, done)
    if not drawn:
        return shape, 0, left
    boxes = shapely.union_all([_box(grid, cell) for cell in np.argwhere(done)])
    merged = shapely.union_all([shapely.difference(shape, boxes), *drawn])
    return merged, len(drawn) * (PARTS + 1) ** 2, left


def _wrong(
    shape: shapely.Geometry, grid: LevelGrid, level: float, seeds: Seeds
) -> NDArray[np.int64]:
    """Return cells (C, 2) with seeds on the wrong side, those with most first."""
    shapely.prepare(shape)
    inside = np.asarray(shapely.intersects_xy(shape, *seeds.points.T), bool)
    wrong = inside != (seeds.values >= level)
    most = np.array(grid.values.shape) - 2
    at = np.clip(np.floor((seeds.points[wrong] - grid.low) / grid.step).astype(int), 0, most)
    cells, counts = np.unique(at, axis=0, return_counts=True)
    return cells[np.argsort(-counts, kind="stable")]


def _evaluated(grid: LevelGrid, cells: NDArray[np.int64], function: Function) -> Array:
    """Return values (C, P + 1, P + 1) in cells (C, 2)."""
    t = np.arange(PARTS + 1) / PARTS
    inside = np.stack(np.meshgrid(t, t, indexing="ij"), axis=-1)
    found: list[Array] = []
    for start in range(0, len(cells), BLOCK):
        at = cells[start : start + BLOCK, None, None] + inside
        values = function((grid.low + at * grid.step).reshape(-1, 2))
        found.append(values.reshape(at.shape[:-1]))
    return np.concatenate(found)


def _drawn(
    grid: LevelGrid, cell: Array, block: Array, level: float, function: Function
) -> shapely.Geometry:
    low = grid.low + cell * grid.step
    return filled(block, low, grid.step / PARTS, level, function)[0]


def _beside(
    cells: NDArray[np.int64], blocks: Array, level: float, done: NDArray[np.bool_]
) -> NDArray[np.int64]:
    """Return neighbours of cells on whose common side the grid is wrong."""
    t = np.arange(PARTS + 1) / PARTS
    sides = (
        ((-1, 0), blocks[:, 0]),
        ((1, 0), blocks[:, -1]),
        ((0, -1), blocks[:, :, 0]),
        ((0, 1), blocks[:, :, -1]),
    )
    found: list[Array] = []
    for move, side in sides:
        drawn = side[:, :1] + t * (side[:, -1:] - side[:, :1])
        off = ((side >= level) != (drawn >= level)).sum(axis=1) >= MIN_WRONG_PARTS
        to = cells + move
        fits = (to >= 0).all(axis=1) & (to < done.shape).all(axis=1) & off
        found.append(to[fits][~done[tuple(to[fits].T)]])
    return np.unique(np.concatenate(found), axis=0)


def _box(grid: LevelGrid, cell: Array) -> shapely.Geometry:
    low: Array = grid.low + cell * grid.step
    xmin, ymin, xmax, ymax = (float(c) for c in (*low, *(low + grid.step)))
    return shapely.box(xmin, ymin, xmax, ymax)
