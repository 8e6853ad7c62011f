"""The densest of some simple lattice arrangements of a piece, and how many of it a sheet holds.

Three kinds of start: the tile's own tiling spread apart, which is dense wherever the gap is small; a
lattice of pieces all one way up; and a lattice of pairs, one of each turned by 180 degrees. Each is
drawn tight and then bettered by small random changes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from orbiflow.export.arrangement import Arrangement, tightened
from orbiflow.export.no_fit import lattice_starts, pair_starts
from orbiflow.symmetry.isometry import Array
from orbiflow.tilings import Tile

TRIALS = 400
"""Random changes of each kind of start."""

KEPT = 4
"""Densest arrangements that are tried on a sheet."""

ANGLES = 36
"""Turns of an arrangement that are tried on a sheet."""


@dataclass(frozen=True, eq=False)
class Placed:
    """N pieces on a sheet: a point p of the piece goes to linear[n] p + offsets[n].

    - `aspects`: (N,) which piece of the arrangement's cell each is.
    """

    linear: Array
    offsets: Array
    aspects: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.linear)

    def rings(self, ring: Array) -> Array:
        """(N, M, 2) images of a ring."""
        return np.einsum("nij,mj->nmi", self.linear, ring) + self.offsets[:, None]

    def first(self, count: int) -> Placed:
        """The first `count`."""
        return Placed(self.linear[:count], self.offsets[:count], self.aspects[:count])


def dense_arrangements(tile: Tile, ring: Array, gap: float, *, seed: int = 0) -> list[Arrangement]:
    """Arrangements of pieces with the outline `ring`, at least `gap` apart; the densest first.

    Args:
        tile: in the same coordinates.
        ring: (M, 2) the line that is cut, in mm.
        gap: above 0, in mm.
        seed: of the small changes; the same seed gives the same arrangements.
    """
    rng = np.random.default_rng(seed)
    coarse = _simplified(ring, gap)
    group = tile.group
    own = Arrangement(group.lattice, group.linear_parts, group.translations)
    starts = [own, *lattice_starts(coarse, gap), *pair_starts(coarse, gap)]
    tight = sorted((tightened(start, coarse, gap) for start in starts), key=_area)
    clear = [found for found in tight if found.clear(ring, gap)]
    bettered = [_bettered(found, coarse, gap, rng) for found in clear[:3]]
    best = sorted((*bettered, *clear), key=_area)[:KEPT]
    # the coarse ring holds the fine one, so there is a little room left
    exact = (tightened(found, ring, gap) for found in best)
    return sorted((found for found in exact if found.clear(ring, gap)), key=_area)


def _area(arrangement: Arrangement) -> float:
    return arrangement.cell_area


def _simplified(ring: Array, gap: float) -> Array:
    """A ring with fewer vertices that holds the given one."""
    slack = max(0.05 * gap, 0.002 * float(np.ptp(ring, axis=0).max()))
    polygon = shapely.Polygon(ring).buffer(slack, join_style="mitre", mitre_limit=2)
    return shapely.get_coordinates(shapely.get_exterior_ring(polygon.simplify(0.8 * slack)))[:-1]


def _bettered(start: Arrangement, ring: Array, gap: float, rng: np.random.Generator) -> Arrangement:
    best, size = start, 0.04
    extent = float(np.ptp(ring, axis=0).max())
    for _ in range(TRIALS):
        stretch = np.eye(2) + size * rng.normal(size=(2, 2))
        moved = Arrangement(
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


def on_sheet(
    arrangements: Sequence[Arrangement], ring: Array, width: float, height: float
) -> Placed:
    """As many pieces as fit into a rectangle from the origin, in rows from the top.

    Whichever arrangement, turned and shifted as suits the rectangle best; the first where others are
    no better. A single piece goes in whichever way it fits.
    """
    best = Placed(np.zeros((0, 2, 2)), np.zeros((0, 2)), np.zeros(0, dtype=np.int64))
    turns = [(found, angle) for found in arrangements for angle in _angles(found, ring)]
    for arrangement, angle in turns:
        turned = arrangement.turned(angle)
        rings = np.einsum("aij,mj->ami", turned.linear, ring) + turned.offsets[:, None]
        low, high = rings.min(axis=1), rings.max(axis=1)
        for shift in _shifts(low):
            placed = _within(turned, low + shift, high + shift, shift, width, height)
            if len(placed) > len(best):
                best = placed
    return best


def _angles(arrangement: Arrangement, ring: Array) -> list[float]:
    box = shapely.get_coordinates(shapely.oriented_envelope(shapely.MultiPoint(ring)))
    sides = [*arrangement.lattice.T, box[1] - box[0]]
    along = [-np.arctan2(y, x) + turn for x, y in sides for turn in (0, np.pi / 2)]
    even = np.arange(ANGLES) * np.pi / ANGLES
    return sorted({round(float(a % np.pi), 9) for a in (*along, *even)})


def _shifts(low: Array) -> list[Array]:
    """Those that bring one piece to the left edge and one to the top."""
    # a hair inside
    return [np.array([1e-6 - x, 1e-6 - y]) for x in low[:, 0] for y in low[:, 1]]


def _within(
    turned: Arrangement, low: Array, high: Array, shift: Array, width: float, height: float
) -> Placed:
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
    return Placed(turned.linear[aspects], offsets, aspects)
