"""Dense lattice arrangements of a piece, and the sheets that are filled with them.

There are three kinds of start: the tile's own tiling spread apart, which is dense where the gap is
small; a lattice of pieces all one way up; and a lattice of pairs, one of each turned by 180
degrees. Each is made as tight as the gap allows, then improved by small random changes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from operator import attrgetter
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from orbiflow.arrays import Array
from orbiflow.tiles.page import Uses
from orbiflow.tiles.tilings import Tiling


@dataclass(frozen=True, eq=False)
class Nesting:
    """An arrangement of pieces, A of them in each cell of a lattice."""

    lattice: Array  # the basis vectors in mm, as columns (2, 2)
    linear: Array  # how each piece of a cell is turned or mirrored (A, 2, 2)
    offsets: Array  # where each piece is (A, 2): a point p of the piece goes to linear p + offset

    def scaled(self, stretch: Array, middle: Array) -> Nesting:
        """Return the arrangement with the pieces' middles moved by the linear map `stretch` (2, 2)."""
        centers = self.linear @ middle + self.offsets
        return Nesting(
            stretch @ self.lattice, self.linear, self.offsets + centers @ (stretch - np.eye(2)).T
        )

    def turned(self, angle: float) -> Nesting:
        """Return the arrangement turned about the origin by an angle in radians."""
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        return Nesting(turn @ self.lattice, turn @ self.linear, self.offsets @ turn.T)

    @cached_property
    def cell_area(self) -> float:
        """The area of the sheet that one piece takes."""
        return float(abs(np.linalg.det(self.lattice))) / len(self.linear)

    def clear(self, ring: Array, gap: float) -> bool:
        """Return whether no two pieces with the outline `ring` come closer than `gap`."""
        pieces = [
            shapely.Polygon(ring @ linear.T + offset)
            for linear, offset in zip(self.linear, self.offsets, strict=True)
        ]
        reach = float(np.linalg.norm(ring - _middle(ring), axis=1).max())
        centers = self.linear @ _middle(ring) + self.offsets
        # the integer coordinates of all lattice vectors that can bring two pieces together
        far = 2 * reach + gap + float(np.ptp(centers, axis=0).max()) * 1.5
        bound = np.ceil(far * np.linalg.norm(np.linalg.inv(self.lattice), axis=1)).astype(int)
        ranges = [np.arange(-b, b + 1) for b in np.minimum(bound, 40)]
        steps = np.stack(np.meshgrid(*ranges, indexing="ij"), axis=-1).reshape(-1, 2)
        shifts = steps @ self.lattice.T
        for first, piece in enumerate(pieces):
            shapely.prepare(piece)
            for second in range(first, len(pieces)):
                moved = centers[second] + shifts - centers[first]
                near = np.hypot(*moved.T) <= 2 * reach + gap
                if second == first:  # one of each pair of opposite shifts, and not the piece itself
                    near &= (steps[:, 0] > 0) | ((steps[:, 0] == 0) & (steps[:, 1] > 0))
                if near.any():
                    points = np.asarray(pieces[second].exterior.coords)
                    others = shapely.polygons(points + shifts[near][:, None, :])
                    if shapely.dwithin(piece, others, gap).any():
                        return False
        return True


MOST_SPREAD = 4.0  # how far apart pieces are moved at most, in their distances


def tightened(start: Nesting, ring: Array, gap: float) -> Nesting:
    """Move the pieces' middles evenly, apart or together, until the pieces are just clear."""
    middle = _middle(ring)

    def spread(factor: float) -> Nesting:
        return start.scaled(factor * np.eye(2), middle)

    low, high = 0.0, 1.0
    while not spread(high).clear(ring, gap):
        low, high = high, 1 + 2 * (high - 1) + 0.02
        if high > MOST_SPREAD:
            return spread(MOST_SPREAD)
    if low == 0.0:
        low = 0.9
        if spread(low).clear(ring, gap):
            return spread(low)
    while high - low > 5e-4:
        between = (low + high) / 2
        low, high = (low, between) if spread(between).clear(ring, gap) else (between, high)
    return spread(high)


def _middle(ring: Array) -> Array:
    return (ring.min(axis=0) + ring.max(axis=0)) / 2


Mask = NDArray[np.bool_]

CELLS = 48  # raster cells along a piece
DIRECTIONS = 30  # directions of a lattice's first vector that are tried
PAIRS = 24  # places of the turned piece of a pair that are tried
KEPT_LATTICES = 3  # number of best lattices that are then tightened exactly


def raster_starts(ring: Array, gap: float) -> list[Nesting]:
    """Return dense lattices, to the raster's precision, of the piece and of pairs of opposite ones."""
    raster = _Raster(ring, gap)
    still, center = np.eye(2), raster.center
    single = [
        Nesting(lattice, still[None], np.zeros((1, 2)))
        for _, lattice in raster.lattices(raster.same, 1)[:KEPT_LATTICES]
    ]
    pairs = []
    for angle in np.arange(PAIRS) * 2 * np.pi / PAIRS:
        place = raster.first_outside(raster.turned, angle)
        # the pair's no-fit region: like with like, and unlike either way round
        there = _shifted(raster.turned, -place)
        pair = raster.same | there | there[::-1, ::-1]
        pairs += [(area, lattice, place) for area, lattice in raster.lattices(pair, 2)[:1]]
    pairs.sort(key=lambda item: item[0])
    turns = np.stack([still, -still])
    return single + [
        # q = c - (p - c) + w in the raster's frame, whose origin is the piece's centre c
        Nesting(lattice, turns, np.stack([np.zeros(2), 2 * center + place * raster.cell]))
        for _, lattice, place in pairs[:KEPT_LATTICES]
    ]


class _Raster:
    """The no-fit regions of a piece with itself and with itself turned, on square cells."""

    def __init__(self, ring: Array, gap: float) -> None:
        self.center = _middle(ring)
        extent = float(np.ptp(ring, axis=0).max()) + gap
        self.cell = extent / CELLS
        polygon = shapely.Polygon(ring - self.center).buffer(gap / 2)
        reach = CELLS // 2 + 1
        axis = np.arange(-reach, reach + 1) * self.cell
        mask = np.asarray(shapely.contains_xy(polygon, *np.meshgrid(axis, axis, indexing="ij")))
        piece = mask.astype(np.float64)
        self.covered = int(mask.sum())
        # the translation zero is in the middle; beyond twice the piece there is room for pairs
        pad = 2 * reach
        self.same = np.pad(_convolved(piece[::-1, ::-1], piece) > 0.5, pad)
        self.turned = np.pad(_convolved(piece, piece) > 0.5, pad)
        self.half = (len(self.same) - 1) // 2

    def first_outside(self, region: Mask, angle: float) -> NDArray[np.int64]:
        """Return the translation (2,) in cells just outside a region in a direction."""
        way = np.array([np.cos(angle), np.sin(angle)])
        steps = np.round(np.arange(1, self.half + 2)[:, None] * way).astype(int)
        index = steps + (np.array(region.shape) - 1) // 2
        inside = np.asarray(((index >= 0) & (index < region.shape)).all(axis=1))
        index = np.where(inside[:, None], index, 0)
        return steps[int(np.argmin(inside & region[index[:, 0], index[:, 1]]))]

    def lattices(self, region: Mask, pieces: int) -> list[tuple[float, Array]]:
        """Return area and lattice, in mm, with basis vectors outside a region, the densest first.

        Longer vectors may still lie in it. A cell smaller than so many `pieces` is left out.
        """
        half = (len(region) - 1) // 2
        axis = np.arange(-half, half + 1)
        grid = np.stack(np.meshgrid(axis, axis, indexing="ij"), axis=-1)
        lattices = []
        for angle in np.arange(DIRECTIONS) * np.pi / DIRECTIONS:
            first = self.first_outside(region, angle)
            blocked = np.zeros_like(region)
            most = 1 + int(2 * half / max(1.0, float(np.hypot(*first))))
            for k in range(-most, most + 1):
                blocked |= _shifted(region, k * first)
            area = np.abs(grid[..., 0] * first[1] - grid[..., 1] * first[0]).astype(float)
            area[blocked | (area < pieces * self.covered)] = np.inf
            place = np.unravel_index(int(area.argmin()), area.shape)
            if np.isfinite(area[place]):
                second = grid[place]
                lattice = np.stack([first, second], axis=1) * self.cell
                lattices.append((float(area[place]) * self.cell**2, lattice))
        lattices.sort(key=lambda item: item[0])
        return lattices


def _shifted(region: Mask, step: NDArray[np.int64]) -> Mask:
    """Return the region moved by whole cells; what comes from beyond the raster is free."""
    moved, steps = np.zeros_like(region), list(zip(step.tolist(), region.shape, strict=True))
    if all(abs(by) < size for by, size in steps):
        there = tuple(slice(max(by, 0), size + min(by, 0)) for by, size in steps)
        moved[there] = region[tuple(slice(max(-by, 0), size + min(-by, 0)) for by, size in steps)]
    return moved


TRIALS = 400  # random changes of each kind of start
KEPT = 4  # number of densest arrangements that are tried on a sheet
ANGLES = 36  # angles of an arrangement that are tried on a sheet


def dense_arrangements(tiling: Tiling, ring: Array, gap: float) -> list[Nesting]:
    """Return arrangements of pieces cut along `ring` (M, 2), `gap` apart, densest first."""
    group = tiling.group
    arrangement = group.lattice, group.linear_parts, group.translations
    shapes = tuple(part.shape for part in (*arrangement, ring))
    return list(_dense(shapes, tuple(part.tobytes() for part in (*arrangement, ring)), gap))


@lru_cache(maxsize=8)  # a preview asks again for each setting that changes
def _dense(shapes: tuple[Any, ...], parts: tuple[bytes, ...], gap: float) -> tuple[Nesting, ...]:
    *arrangement, ring = (
        np.frombuffer(part).reshape(shape) for part, shape in zip(parts, shapes, strict=True)
    )
    rng = np.random.default_rng(0)
    coarse = _simplified(ring, gap)
    starts = [Nesting(*arrangement), *raster_starts(coarse, gap)]
    tight = sorted((tightened(start, coarse, gap) for start in starts), key=attrgetter("cell_area"))
    clear = [nesting for nesting in tight if nesting.clear(ring, gap)]
    improved = [_improved(nesting, coarse, gap, rng) for nesting in clear[:3]]
    best = sorted((*improved, *clear), key=attrgetter("cell_area"))[:KEPT]
    # the coarse ring holds the fine one, so there is a little room left
    exact = (tightened(nesting, ring, gap) for nesting in best)
    kept = (nesting for nesting in exact if nesting.clear(ring, gap))
    return tuple(sorted(kept, key=attrgetter("cell_area")))


def _simplified(ring: Array, gap: float) -> Array:
    """Return a ring with fewer vertices that holds the given one."""
    slack = max(0.05 * gap, 0.002 * float(np.ptp(ring, axis=0).max()))
    polygon = shapely.Polygon(ring).buffer(slack, join_style="mitre", mitre_limit=2)
    return shapely.get_coordinates(shapely.get_exterior_ring(polygon.simplify(0.8 * slack)))[:-1]


def _improved(start: Nesting, ring: Array, gap: float, rng: np.random.Generator) -> Nesting:
    best, size = start, 0.04
    extent = float(np.ptp(ring, axis=0).max())
    for _ in range(TRIALS):
        stretch = np.eye(2) + size * rng.normal(size=(2, 2))
        moved = Nesting(
            stretch @ best.lattice,
            best.linear,
            best.offsets @ stretch.T + 0.3 * size * extent * rng.normal(size=best.offsets.shape),
        )
        # only what would be denser is worth a closer look
        moved = moved.scaled(
            np.sqrt(0.998 * best.cell_area / moved.cell_area) * np.eye(2), 0 * ring[0]
        )
        if moved.clear(ring, gap):
            best = tightened(moved, ring, gap)
        else:
            size = max(0.93 * size, 0.004)
    return best


def on_sheet(arrangements: Sequence[Nesting], ring: Array, width: float, height: float) -> Uses:
    """Fill a rectangle from the origin with as many pieces as fit, in rows from the top."""
    best = Uses("piece", np.eye(2)[None], np.zeros(0, dtype=np.int64), np.zeros((0, 2)))
    turns = [(nesting, angle) for nesting in arrangements for angle in _angles(nesting, ring)]
    for arrangement, angle in turns:
        turned = arrangement.turned(angle)
        rings = np.einsum("aij,mj->ami", turned.linear, ring) + turned.offsets[:, None]
        low, high = rings.min(axis=1), rings.max(axis=1)
        # one piece at the left edge and one at the top, a hair inside
        for shift in (np.array([1e-6 - x, 1e-6 - y]) for x in low[:, 0] for y in low[:, 1]):
            placed = _within(turned, low + shift, high + shift, shift, width, height)
            if len(placed) > len(best):
                best = placed
    return best


def _angles(arrangement: Nesting, ring: Array) -> list[float]:
    box = shapely.get_coordinates(shapely.oriented_envelope(shapely.MultiPoint(ring)))
    sides = [*arrangement.lattice.T, box[1] - box[0]]
    along = [-np.arctan2(y, x) + turn for x, y in sides for turn in (0, np.pi / 2)]
    even = np.arange(ANGLES) * np.pi / ANGLES
    return sorted({round(float(a % np.pi), 9) for a in (*along, *even)})


def _within(
    turned: Nesting, low: Array, high: Array, shift: Array, width: float, height: float
) -> Uses:
    inverse = np.linalg.inv(turned.lattice)
    corners = np.array([[x, y] for x in (0, width) for y in (0, height)])
    steps = (corners - low.mean(axis=0)) @ inverse.T
    margin = 2 + np.abs(inverse).sum() * float((high - low).max())
    ranges = [
        np.arange(np.floor(steps[:, k].min() - margin), np.ceil(steps[:, k].max() + margin) + 1)
        for k in (0, 1)
    ]
    grid = np.stack(np.meshgrid(*ranges, indexing="ij"), axis=-1).reshape(-1, 2)
    moves = grid @ turned.lattice.T
    least, most = low[:, None] + moves, high[:, None] + moves
    fits = (least >= 0).all(axis=2) & (most <= (width, height)).all(axis=2)
    aspects, numbers = np.nonzero(fits)
    order = np.lexsort((least[aspects, numbers, 0], np.round(least[aspects, numbers, 1], 3)))
    aspects, numbers = aspects[order], numbers[order]
    offsets = turned.offsets[aspects] + shift + moves[numbers]
    return Uses("piece", turned.linear, aspects, offsets)


def _convolved(a: Array, b: Array) -> Array:
    """Return the sums (2 n - 1, 2 n - 1) of the products of two grids (n, n) at all translations."""
    size = 2 * len(a) - 1
    # scipy.signal does this, and takes half a second to import
    sums: Array = np.fft.irfft2(
        np.fft.rfft2(a, (size, size)) * np.fft.rfft2(b, (size, size)), (size, size)
    )
    return sums
