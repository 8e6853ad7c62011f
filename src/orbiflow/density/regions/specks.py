"""Islands and holes smaller than a grid's cells, about seeds that lie in them."""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray

from orbiflow.density.regions.contours import filled
from orbiflow.density.regions.grid import Function, LevelGrid
from orbiflow.symmetry.isometry import Array

PARTS = 12
"""A cell is cut into, each way."""

ROUNDS = 3
"""Of following islands into the cells beside them."""

BLOCK = 500
"""Cells evaluated at a time."""


def with_specks(
    shape: shapely.Geometry,
    grid: LevelGrid,
    level: float,
    number: int,
    function: Function,
    budget: int,
) -> tuple[shapely.Geometry, int, int]:
    """A shape drawn on the grid, with what its cells were too coarse for.

    Args:
        number: of the level among the grid's.
        budget: of evaluations; cells beyond it are left as they are.

    Returns:
        The shape, the evaluations made, and the cells left.
    """
    most = max(1, budget // (PARTS + 1) ** 2)
    seeds = grid.missed[:, :, number]
    cells = np.argwhere(seeds)
    cells = cells[np.argsort(-seeds[tuple(cells.T)], kind="stable")]  # the largest first
    left = max(0, len(cells) - most)
    cells = cells[:most]
    done = np.zeros(grid.missed.shape[:2], dtype=bool)
    above = grid.values >= level
    drawn: list[shapely.Geometry] = []
    for _ in range(ROUNDS):
        if not len(cells):
            break
        done[tuple(cells.T)] = True
        blocks = _evaluated(grid, cells, function)
        drawn += [
            _drawn(grid, cell, block, level, function)
            for cell, block in zip(cells, blocks, strict=True)
        ]
        cells = _beside(cells, blocks >= level, above, done)
        most -= len(drawn)
        cells = cells[: max(0, most)]
    boxes = [_box(grid, cell) for cell in np.argwhere(done) if above[tuple(cell)]]
    whole = shapely.difference(shape, shapely.union_all(boxes)) if boxes else shape
    merged = shapely.union_all([whole, *drawn])
    return merged, len(drawn) * (PARTS + 1) ** 2, left


def _evaluated(grid: LevelGrid, cells: NDArray[np.int64], function: Function) -> Array:
    """(C, P + 1, P + 1) of cells (C, 2)."""
    t = np.arange(PARTS + 1) / PARTS
    inside = np.stack(np.meshgrid(t, t, indexing="ij"), axis=-1)
    found = []
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
    cells: NDArray[np.int64], block: Array, above: NDArray[np.bool_], done: NDArray[np.bool_]
) -> NDArray[np.int64]:
    """Even cells into which what is in a block goes on."""
    n, m = done.shape
    sides = (
        ((-1, 0), block[:, 0]),
        ((1, 0), block[:, -1]),
        ((0, -1), block[:, :, 0]),
        ((0, 1), block[:, :, -1]),
    )
    found = []
    for move, side in sides:
        to = cells + move
        fits = (to >= 0).all(axis=1) & (to < (n, m)).all(axis=1)
        to, ends = to[fits], side[fits]
        i, j = to.T
        four = np.stack([above[i + a, j + b] for a in (0, 1) for b in (0, 1)])
        even = four.all(axis=0) | ~four.any(axis=0)
        goes_on = (ends != four[0][:, None]).any(axis=1)
        found.append(to[even & goes_on & ~done[i, j]])
    return np.unique(np.concatenate(found), axis=0)


def _box(grid: LevelGrid, cell: Array) -> shapely.Geometry:
    low = grid.low + cell * grid.step
    return shapely.box(*low, *(low + grid.step))
