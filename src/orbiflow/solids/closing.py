"""The exact tile of a function: one cell of each orbit, where the function is largest, as a ball."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
import scipy.ndimage
import scipy.sparse
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from orbiflow.arrays import Array, Integers
from orbiflow.errors import OrbiflowError
from orbiflow.solids.complexes import Complex, cell_complex
from orbiflow.solids.growth import BallOfCells, CellBox
from orbiflow.solids.mesh import Mesh
from orbiflow.symmetry import CrystallographicGroup

Function = Callable[[Array], Array]
"""Takes points (n, 3) to values (n,); the larger, the more a point is inside."""

SURFACE_WEIGHT = 0.5
"""What a face of the boundary costs, in spacings of cells per unit of the function's slope."""

BLUR, FAITH, MOST_SPACINGS = 1.2, 0.03, 4.0
"""Radius, in spacings, over which a ball is blurred; what a spacing of the function counts beside it,
and up to how many."""

POLISHING_PASSES, FREEING_PASSES, WIDENINGS, CARVINGS = 6, 1, 1, 8
POINTS_AT_ONCE = 400_000
MARGIN = 0.15  # how far from a body its tile may reach, in sides of a cube of its volume
COARSE = 3  # blocks between those at which it is asked where a function is large
FINENESS = (1.0, 0.8)  # cells over those wanted: another grid may close where one does not
FEW_MISSING = 50  # orbits that a larger box would not let in


@dataclass(frozen=True, eq=False)
class CellTile:
    """A set of cells, at most one of each orbit of a complex, that is a ball.

    - `complex`: The complex.
    - `cells`: The cells (n, 4), in the order of their orbits.
    - `missing`: How many orbits have no cell: if any, the copies leave these cells uncovered.
    - `moved`: How many cells are not where the function is largest on their orbit.
    - `loss`: By how much the function is less than its largest on the orbits, on average, in spacings
      of cells.
    - `raw_pieces`: The pieces of the set of largest values, which the ball replaces.
    - `raw_strays`: How many cells of that set are not of its largest piece.
    """

    complex: Complex
    cells: Integers
    missing: int
    moved: int
    loss: float
    raw_pieces: int
    raw_strays: int

    @property
    def is_ball(self) -> bool:
        """Whether it is a fundamental domain, and so one piece without handles or cavities."""
        return self.missing == 0


def box_around(body: Mesh) -> tuple[Array, Array]:
    """Return the corners (3,) of the box in which the tile of a body of volume 1 is looked for."""
    low, high = body.bounds
    return low - MARGIN, high + MARGIN


def close_tile(
    function: Function, lower: ArrayLike, upper: ArrayLike, complex: Complex
) -> CellTile:
    """Return the ball of cells, one of each orbit, on which a function is almost largest.

    The cells where the function is largest on their orbits are its exact tile (design point 19). A
    ball grows in it from the cell whose loss would be most, always by the cell whose loss would be
    most and that keeps it a ball. So cuts come where little is lost. The other orbits' best cells that
    keep it a ball follow. A second ball grows in the blurred first one, without its crumbs and threads.
    Then cells move within their orbits where that makes the values larger or the boundary smaller.

    Args:
        function: What is wanted inside: minus the signed distance of a body in its place, say, perhaps
            times a weight of its own at each point.
        lower, upper: Corners (3,) of a box that contains all places where the function may be large
            enough. Orbits that are not in the box widen it.
        complex: The cells.
    """
    low, high, reach = np.asarray(lower, float), np.asarray(upper, float), MARGIN
    tile = _closed_in(function, low, high, complex, reach)
    for _ in range(WIDENINGS):
        if tile.is_ball or tile.missing <= FEW_MISSING:
            break
        # orbits may touch the ball only farther off
        more = 2 * reach * complex.spacing * complex.cells_per_tile ** (1 / 3)
        low, high, reach = low - more, high + more, 3 * reach
        again = _closed_in(function, low, high, complex, reach)
        tile = min(tile, again, key=lambda attempt: attempt.missing)
    return tile


def ball_of_cells(
    function: Function, bounds: tuple[Array, Array], group: CrystallographicGroup, detail: int
) -> CellTile | None:
    """Return a tile of about so many cells, or None if it is no ball on any of some grids."""
    closed = (
        close_tile(function, *bounds, cell_complex(group, round(share * detail)))
        for share in FINENESS
    )
    return next((tile for tile in closed if tile.is_ball), None)


def _closed_in(
    function: Function, lower: Array, upper: Array, complex: Complex, reach: float
) -> CellTile:
    """Return a ball of cells in a box, as `close_tile` does."""
    box, values = _evaluated(function, lower, upper, complex, reach)
    orbits, used = np.full(len(values), -1), np.flatnonzero(np.isfinite(values))
    orbits[used] = complex.orbit_of(box.cells(used))
    unit = _slope(values, orbits, box) * complex.spacing
    rough, best, pieces = _grown(box, orbits, values)
    wanted = _settled(box, orbits, values / unit, rough.members())
    del rough  # as large as the box
    ball, largest, _ = _grown(box, orbits, wanted)
    size = SURFACE_WEIGHT * FAITH
    for _ in range(FREEING_PASSES):
        if ball.is_complete:
            break
        _polish(ball, wanted, size)
        _free_orbits(ball, wanted, wanted[largest])
        _grow_the_rest(ball, wanted, wanted[largest])
    for _ in range(POLISHING_PASSES):
        if not _polish(ball, wanted, size):
            break
    members = ball.members()
    its_orbits = ball.orbit_of[members]
    lost = values[best[its_orbits]] - values[members]
    return CellTile(
        complex,
        box.cells(members),
        missing=complex.cells_per_tile - len(members),
        moved=int(np.sum(best[its_orbits] != members)),
        loss=float(lost.mean()) / unit,
        raw_pieces=len(pieces),
        raw_strays=int(pieces.sum() - pieces.max()),
    )


def _grown(box: CellBox, orbits: Integers, values: Array) -> tuple[BallOfCells, Integers, Integers]:
    """Return a ball that grows by the cells of largest values, first where a cell would lose most.

    Returns as well these cells, one for each orbit, and how many are in each of their pieces.
    """
    number = box.complex.cells_per_tile
    best, margins = _largest(values, orbits, number)
    piece = _pieces(box, best)
    sizes = np.bincount(piece)
    ball = BallOfCells(box, orbits, number)
    ball.attach(int(best[np.where(piece == sizes.argmax(), margins, -np.inf).argmax()]))
    ball.grow(best[np.argsort(-margins, kind="stable")])
    _grow_the_rest(ball, values, values[best])
    return ball, best, sizes


def _settled(box: CellBox, orbits: Integers, values: Array, members: Integers) -> Array:
    """Return values for which crumbs and threads of a ball of cells go to the copies around them.

    They are the share of the ball around each cell, and a little of the given values, in spacings.
    """
    spacing, inner = box.complex.spacing, np.flatnonzero(orbits >= 0)
    points = box.centers(members)
    low = points.min(axis=0) - 8 * spacing
    counts = np.ceil((points.max(axis=0) - low) / spacing).astype(int) + 9
    places = (points - low) / spacing
    corner = np.floor(places).astype(int)
    density = np.zeros(counts)
    for offset in np.ndindex(2, 2, 2):
        share = np.where(offset, places - corner, 1 - places + corner).prod(axis=1)
        np.add.at(density, tuple((corner + offset).T), share)
    density = scipy.ndimage.gaussian_filter(density, BLUR)
    settled = np.full(len(orbits), -np.inf)
    for part in np.array_split(inner, len(inner) // POINTS_AT_ONCE + 1):
        at = (box.centers(part) - low) / spacing
        around = scipy.ndimage.map_coordinates(density, at.T, order=1)
        settled[part] = around + FAITH * np.clip(values[part], -MOST_SPACINGS, MOST_SPACINGS)
    return settled


def _evaluated(
    function: Function, lower: Array, upper: Array, complex: Complex, reach: float
) -> tuple[CellBox, Array]:
    """Return a box of cells in which all orbits are, and the function's values at their centres.

    Cells that must not be used have the value -inf: those outside the corners, and those that are
    farther than `reach` from where the function is large.
    """
    low, high = lower, upper
    for _ in range(8):
        corners = np.stack(np.meshgrid(*np.stack([low, high], axis=1), indexing="ij"), -1)
        blocks = np.linalg.solve(complex.steps, corners.reshape(-1, 3).T).T
        start = np.floor(blocks.min(axis=0)).astype(np.int64) - 2
        box = CellBox(complex, start, np.ceil(blocks.max(axis=0)).astype(np.int64) + 2 - start)
        numbers = _near_large(box, function, low, high, reach)
        centers = complex.centers(box.cells(numbers))
        inside = np.all((centers >= low) & (centers <= high), axis=1)
        numbers, centers = numbers[inside], centers[inside]
        present = np.zeros(complex.cells_per_tile, bool)
        present[complex.orbit_of(box.cells(numbers))] = True
        if present.all():
            parts = np.array_split(centers, len(centers) // POINTS_AT_ONCE + 1)
            values = np.full(box.number_of_cells, -np.inf)
            values[numbers] = np.concatenate([function(part) for part in parts])
            if np.isnan(values).any():
                raise OrbiflowError("the function of the tile is not a number at some points")
            return box, values
        more = 0.15 * (high - low).max() + 2 * complex.spacing
        low, high, reach = low - more, high + more, 2 * reach
    raise OrbiflowError("the box is too small for a tile: choose its corners around the body")


def _near_large(
    box: CellBox, function: Function, lower: Array, upper: Array, reach: float
) -> Integers:
    """Return the numbers of inner cells near places where a function is larger than elsewhere.

    These places, some blocks apart, have the volume of the tile. A body with limbs fills little of its
    box, and to ask what is far from it would take most of the time and memory.
    """
    complex, inner = box.complex, box.size - 2
    number = -(-inner // COARSE)
    axes = [
        np.minimum(COARSE * np.arange(count) + COARSE // 2, most - 1)
        for count, most in zip(number, inner, strict=True)
    ]
    blocks = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3) + 1 + box.lower
    centers = complex.centers(np.column_stack([blocks, np.zeros(len(blocks), np.int64)]))
    inside = np.flatnonzero(np.all((centers >= lower) & (centers <= upper), axis=1))
    count = max(1, complex.cells_per_tile // (box.kinds * COARSE**3))
    largest = inside[np.argsort(-function(centers[inside]), kind="stable")[:count]]
    side = complex.spacing * complex.cells_per_tile ** (1 / 3)
    half_block = COARSE * float(np.linalg.norm(complex.steps, axis=0).sum()) / 2
    away = cKDTree(centers[largest]).query(centers, distance_upper_bound=reach * side + half_block)[
        0
    ]
    near = np.isfinite(away).reshape(number)
    for axis in range(3):
        near = near.repeat(COARSE, axis=axis)
    near = np.pad(near[: inner[0], : inner[1], : inner[2]], 1)
    return np.flatnonzero(np.repeat(near.ravel(), box.kinds))


def _largest(values: Array, orbits: Integers, number: int) -> tuple[Integers, Array]:
    """Return for each orbit the cell of largest value, and by how much it exceeds the second."""
    usable = np.flatnonzero(orbits >= 0)
    ordered = usable[np.argsort(values[usable], kind="stable")]
    best = np.empty(number, np.int64)
    best[orbits[ordered]] = ordered  # of several assignments the last holds
    second = np.full(number, -np.inf)
    rest = ordered[best[orbits[ordered]] != ordered]
    second[orbits[rest]] = values[rest]
    return best, values[best] - np.maximum(second, values.min(where=np.isfinite(values), initial=0))


def _pieces(box: CellBox, numbers: Integers) -> Integers:
    """Return for each of some cells the number of its connected piece."""
    place = np.full(box.number_of_cells, -1)
    place[numbers] = np.arange(len(numbers))
    behind = box.neighbors(numbers)
    other = np.where(behind >= 0, place[behind], -1)
    rows, columns = np.nonzero(other >= 0)
    size = len(numbers)
    links = (np.ones(len(rows)), (rows, other[rows, columns]))
    graph = scipy.sparse.coo_matrix(links, (size, size))
    return scipy.sparse.csgraph.connected_components(graph, directed=False)[1].astype(np.int64)


def _slope(values: Array, orbits: Integers, box: CellBox) -> float:
    """Return the function's usual change over a spacing, divided by it."""
    inner = np.flatnonzero(orbits >= 0)[:: max(1, len(orbits) // 20_000)]
    behind = box.neighbors(inner)[:, 0]
    changes = np.abs(values[behind] - values[inner])
    changes = changes[np.isfinite(changes)]
    return float(np.mean(changes)) / box.complex.spacing + 1e-300


def _grow_the_rest(
    ball: BallOfCells, values: Array, largest: Array, noise: Callable[[int], Array] | None = None
) -> None:
    """Attach cells of the orbits that are not in the ball, those that lose least first.

    `noise` returns so many numbers, which change the order.
    """
    open_orbits = np.array(ball.holder) < 0
    if open_orbits.any():
        orbits = ball.orbit_of
        cells = np.flatnonzero((orbits >= 0) & open_orbits[orbits])
        lost = largest[orbits[cells]] - values[cells]
        if noise is not None:
            lost = lost + noise(len(cells))
        ball.grow(cells[np.argsort(lost, kind="stable")])


def _free_orbits(ball: BallOfCells, values: Array, largest: Array) -> None:
    """Carve the ball around cells that cannot be attached and grow it again, if that lets them in."""
    rng = np.random.default_rng(0)
    orbits, spacing = ball.orbit_of, ball.box.complex.spacing
    for trial in range(CARVINGS):
        missing = np.flatnonzero(np.array(ball.holder) < 0)
        if not len(missing):
            return
        members = ball.members()
        touching = np.unique(ball.box.neighbors(members))
        touching = touching[(touching >= 0) & np.isin(orbits[touching], missing)]
        if not len(touching):
            return
        cell = int(rng.choice(touching))
        offsets = ball.box.centers(members) - ball.box.centers(np.array([cell]))
        near = np.linalg.norm(offsets, axis=1) < spacing * rng.uniform(1.5, 9.0)
        before = ball.holder.copy()
        ball.detach_all(rng.permutation(members[near]).tolist())
        if ball.can_attach(cell):
            ball.attach(cell)
        spread = spacing * rng.exponential() * np.abs(largest).mean()
        _grow_the_rest(ball, values, largest, partial(rng.normal, 0.0, spread))
        if ball.holder.count(-1) > len(missing) - (trial % 2 == 0):
            ball.restore(before)


def _polish(ball: BallOfCells, values: Array, size: float) -> int:
    """Move cells within their orbits for larger values or less boundary; return how many moved."""
    members = ball.members()
    behind = ball.box.neighbors(members).ravel()
    targets = np.unique(behind[behind >= 0])
    orbits = ball.orbit_of
    inside = np.frombuffer(ball.inside, np.uint8)
    targets = targets[(orbits[targets] >= 0) & (inside[targets] == 0)]
    sources = np.array(ball.holder)[orbits[targets]]
    targets, sources = targets[sources >= 0], sources[sources >= 0]
    gains = values[targets] - values[sources]
    gains += size * (ball.shared_areas(targets) - ball.shared_areas(sources))
    moved = 0
    for k in np.argsort(-gains, kind="stable")[: int(np.sum(gains > 0))].tolist():
        source, target = int(sources[k]), int(targets[k])
        if not ball.inside[source]:
            continue
        before = values[source] + size * _shared_area(ball, source)
        if not ball.move(source, target):
            continue
        if values[target] + size * _shared_area(ball, target) > before + 1e-9 * size:
            moved += 1
        else:
            ball.move(target, source)
    return moved


def _shared_area(ball: BallOfCells, cell: int) -> float:
    return float(ball.shared_areas(np.array([cell]))[0])
