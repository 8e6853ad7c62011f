"""What is as small as a grid's cells, drawn anew about seeds that lie in it."""

# pyright: reportUnknownMemberType=false
# shapely's stubs leave the keyword arguments of its functions of arrays without types.

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import cast

import numpy as np
import shapely
from numpy.typing import NDArray
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density.regions.contours import filled
from orbiflow.density.regions.grid import (
    Function,
    LevelGrid,
    Seeds,
)
from orbiflow.density.spaces import (
    RoundSpace,
    Space,
    to_latlon,
    to_vectors,
    whole_turn,
)
from orbiflow.errors import OrbiflowError

PARTS = 12
"""A cell is cut into, each way."""

ROUNDS = 4
"""Of following what a grid was too coarse for into the cells beside."""

OFF = 2
"""Parts of a cell's side on which the grid is wrong, for the cell beside to be looked at."""

BLOCK = 500
"""Cells evaluated at a time."""


def with_specks(
    shape: shapely.Geometry,
    grid: LevelGrid,
    level: float,
    seeds: Seeds,
    function: Function,
    budget: int,
) -> tuple[shapely.Geometry, int, int]:
    """A shape drawn on the grid, drawn anew in cells that have seeds on its wrong side.

    Args:
        budget: of evaluations; cells beyond it are left as they are, those of most seeds are first.

    Returns:
        The shape, the evaluations made, and the cells left.
    """
    most = max(1, budget // (PARTS + 1) ** 2)
    cells = _wrong(shape, grid, level, seeds)
    left = max(0, len(cells) - most)
    done = np.zeros(np.array(grid.values.shape) - 1, dtype=bool)
    drawn: list[shapely.Geometry] = []
    for _ in range(ROUNDS):
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
    """Cells (C, 2) with seeds on the wrong side, those with most first."""
    shapely.prepare(shape)
    meets = cast(NDArray[np.bool_], shapely.intersects_xy(shape, *seeds.points.T))
    wrong = meets != (seeds.values >= level)
    most = np.array(grid.values.shape) - 2
    at = np.clip(np.floor((seeds.points[wrong] - grid.low) / grid.step).astype(int), 0, most)
    cells, counts = np.unique(at, axis=0, return_counts=True)
    return cells[np.argsort(-counts, kind="stable")]


def _evaluated(grid: LevelGrid, cells: NDArray[np.int64], function: Function) -> Array:
    """(C, P + 1, P + 1) of cells (C, 2)."""
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
    """Cells beside those of `blocks`, of whose common side the grid is wrong."""
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
        off = ((side >= level) != (drawn >= level)).sum(axis=1) >= OFF
        to = cells + move
        fits = (to >= 0).all(axis=1) & (to < done.shape).all(axis=1) & off
        found.append(to[fits][~done[tuple(to[fits].T)]])
    return np.unique(np.concatenate(found), axis=0)


def _box(grid: LevelGrid, cell: Array) -> shapely.Geometry:
    low: Array = grid.low + cell * grid.step
    xmin, ymin, xmax, ymax = (float(c) for c in (*low, *(low + grid.step)))
    return shapely.box(xmin, ymin, xmax, ymax)


@dataclass(frozen=True, eq=False)
class Window:
    """A rectangle that holds each point of the space once, but for its edges.

    - `names`: of x and y. `low`, `high`: (2,) corners, in data units.
    - `cells`: (2,) of the coarsest grid.
    - `edges`: which of them are one, and so where regions are cut, in words.
    - `on_globe`: whether x, y are longitude and latitude.
    - `to_chart`, `from_chart`: points (N, 2) of the rectangle to chart points and back.
    """

    names: tuple[str, str]
    low: Array
    high: Array
    cells: tuple[int, int]
    edges: str
    on_globe: bool
    to_chart: Callable[[Array], Tensor]
    from_chart: Callable[[Tensor], Array]

    def area(self, shape: shapely.Geometry) -> float:
        """Natural area of a polygon or several: steradians on the globe, where sides are straight in
        longitude and latitude."""
        if not self.on_globe:
            return float(shapely.area(shape))
        return sum(_on_globe(part) for part in shapely.get_parts(shape))


def window_of(space: Space) -> Window:
    """
    Raises:
        OrbiflowError: for a space that is not of two dimensions.
    """
    if space.dim != 2:
        raise OrbiflowError(
            f"outlines are drawn in two dimensions, this {space.name} has {space.dim}: thresholds, "
            "sizes and which rows are inside are to be had all the same"
        )
    if isinstance(space, RoundSpace):
        return _round(space)
    return _flat(space)


def _round(space: RoundSpace) -> Window:
    def to_chart(points: Array) -> Tensor:
        return space.vectors_to_chart(to_vectors(points[:, ::-1]))

    def from_chart(points: Tensor) -> Array:
        data = space.from_chart(points)
        return (to_latlon(data) if data.shape[1] == 3 else data)[:, ::-1]

    half = len(space.features(to_chart(np.zeros((1, 2))))) > 1
    edges = "longitude -180 is longitude 180"
    if half:
        edges += "; on the equator, a point is that opposite; polygons are of northern ends"
    return Window(
        ("lon", "lat"),
        np.array([-180.0, 0.0 if half else -90.0]),
        np.array([180.0, 90.0]),
        (180, 45 if half else 90),
        edges,
        True,
        to_chart,
        from_chart,
    )


def _flat(space: Space) -> Window:
    period = whole_turn(str(space.unit))
    if space.is_torus:
        low = np.full(2, -period / 2)
        high, edges = -low, "opposite edges are one"
    else:
        low, high = np.array([0.0, -period / 4]), np.array([period / 2, 3 * period / 4])
        theta, phi = space.columns
        edges = f"{theta} 0 is {theta} {period / 2:g} with {phi} turned over; the others are one"
    return Window(
        (space.columns[0], space.columns[1]),
        low,
        high,
        (128, 128),
        edges,
        False,
        space.to_chart,
        space.from_chart,
    )


def _on_globe(polygon: shapely.Geometry) -> float:
    assert isinstance(polygon, shapely.Polygon)
    outside, *holes = [
        abs(_ring_area(np.asarray(r.coords))) for r in (polygon.exterior, *polygon.interiors)
    ]
    return outside - sum(holes)


def _ring_area(ring: Array) -> float:
    """Integral of sin(lat) dlon around a ring (n, 2): exact for straight sides."""
    lon, lat = np.radians(ring.T)
    half = np.diff(lat) / 2
    mean = np.sin(lat[:-1] + half) * np.sinc(half / np.pi)
    return float((mean * np.diff(lon)).sum())
