"""A raster of a tile that is painted once, and which of its samples lie in which region."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from orbiflow.arrays import Array, Integers
from orbiflow.drawing import Palette, rgb
from orbiflow.tiles.geometry import doubled_areas
from orbiflow.tiles.page import glass

NOWHERE = -1  # the label of samples that lie in no region

# Distance, in samples, by which rows of samples are moved down: rounding would otherwise decide about
# vertices that a symmetric placement puts exactly on a row
NUDGE = 3.1415926e-7


BLOCK = 2**15
"""Samples that are looked up at a time: what is computed for them stays in the processor's cache."""


class Runs(NamedTuple):
    """R runs of samples, each in one region, row by row and from left to right."""

    label: Integers  # the region (R,), or `NOWHERE`
    row: Integers  # the row (R,), counted from 0
    start: Integers  # the first column (R,)
    length: Integers  # the number (R,) of samples; those of a row add up to its width

    def spread(self, values: NDArray) -> NDArray:
        """Return one value for each sample (rows x width,) from one for each run."""
        return np.repeat(values, self.length, axis=0)


class Sides(NamedTuple):
    """Sides of regions, each with the region to its right, at larger x."""

    start: Array  # with `end`: (S, 2) in samples, y down: sample (i, j) lies at (j + 1/2, i + 1/2)
    end: Array
    label: Integers  # the region (S,)


def bilinear(colours: Array, places: Array) -> Array:
    """Return colours (height, width, k) at places (N, 2), linear between the centres of texels: (N, k).

    Texel (i, j) has its centre at (j + 1/2, i + 1/2). Beyond the outermost centres colours go on as
    they are there.
    """
    height, width, channels = colours.shape
    texels = colours.reshape(-1, channels)
    right, below = int(width > 1), width * int(height > 1)
    found = np.empty((len(places), channels), dtype=np.result_type(colours, places))
    for start in range(0, len(places), BLOCK):
        x, y = (places[start : start + BLOCK] - places.dtype.type(0.5)).T
        x, y = x.clip(0, width - 1), y.clip(0, height - 1)
        left = np.minimum(x.astype(np.int64), max(width - 2, 0))
        top = np.minimum(y.astype(np.int64), max(height - 2, 0))
        x, y = (x - left)[:, None], (y - top)[:, None]
        at = top * width + left
        # clipped, which nothing needs, is faster than checked
        upper = texels.take(at, axis=0, mode="clip")
        upper += x * (texels.take(at + right, axis=0, mode="clip") - upper)
        at += below
        lower = texels.take(at, axis=0, mode="clip")
        lower += x * (texels.take(at + right, axis=0, mode="clip") - lower)
        found[start : start + BLOCK] = upper + y * (lower - upper)
    return found


def ring_sides(rings: Array) -> Sides:
    """Return the sides of rings (M, N, 2) that have the inside to their right; ring m has label m."""
    ahead, entering = _entering(rings)
    return Sides(rings[entering], ahead[entering], np.nonzero(entering)[0])


def _entering(rings: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Return the ends of the sides of rings (..., N, 2), and which have the inside to their right."""
    ahead = np.roll(rings, -1, axis=-2)
    area = (rings[..., 0] * ahead[..., 1] - rings[..., 1] * ahead[..., 0]).sum(axis=-1)
    return ahead, (ahead[..., 1] - rings[..., 1]) * np.sign(area)[..., None] < 0


def polygon_sides(ring: Array) -> Sides:
    """Return the sides of one ring (N, 2): 0 where they enter it, `NOWHERE` where they leave it."""
    ahead, entering = _entering(ring)
    return Sides(ring, ahead, np.where(entering, 0, NOWHERE))


def region_sides(points: Array, triangles: Integers) -> Sides:
    """Return the sides of triangles (M, 3) that do not overlap, and of what lies around them."""
    inner = ring_sides(points[triangles])
    # a side of a single triangle is the border, and beyond it is nowhere
    pairs = np.concatenate([triangles[:, [k, (k + 1) % 3]] for k in range(3)])
    keys = np.sort(pairs, axis=1) @ np.array([len(points), 1])
    _, first, count = np.unique(keys, return_index=True, return_counts=True)
    border = pairs[first[count == 1]]
    own = np.tile(np.arange(len(triangles)), 3)[first[count == 1]]
    start, end = points[border[:, 0]], points[border[:, 1]]
    sense = np.sign(doubled_areas(points, triangles))
    leaving = (end - start)[:, 1] * sense[own] > 0
    return Sides(
        np.concatenate([inner.start, start[leaving]]),
        np.concatenate([inner.end, end[leaving]]),
        np.concatenate([inner.label, np.full(int(leaving.sum()), NOWHERE)]),
    )


def runs(sides: Sides, top: int, rows: int, width: int) -> Runs:
    """Return the runs of `rows` rows of `width` samples from row `top`, with rows counted from there.

    A sample belongs to the region entered at the last crossing to its left with a side. A side that
    two regions share enters one of them, so every sample of a partition is in exactly one region.

    >>> square = np.array([[[1.0, 0.0], [3.0, 0.0], [3.0, 2.0], [1.0, 2.0]]])
    >>> found = runs(ring_sides(np.concatenate([square - (2.0, 0.0), square])), 0, 2, 3)
    >>> found.label[found.length > 0].tolist(), found.length[found.length > 0].tolist()
    ([0, 1, 0, 1], [1, 2, 1, 2])
    """
    low = np.minimum(sides.start[:, 1], sides.end[:, 1])
    high = np.maximum(sides.start[:, 1], sides.end[:, 1])
    middle = 0.5 + NUDGE
    first = np.clip(np.ceil(low - middle).astype(np.int64), top, top + rows)
    last = np.clip(np.ceil(high - middle).astype(np.int64), top, top + rows)
    count = last - first
    own = np.repeat(np.arange(len(count)), count)
    row = np.arange(len(own)) - np.repeat(np.cumsum(count) - count, count) + first[own]
    start, end = sides.start[own], sides.end[own]
    share = (row + middle - start[:, 1]) / (end[:, 1] - start[:, 1])
    x = start[:, 0] + share * (end[:, 0] - start[:, 0])
    row -= top
    # every row begins nowhere
    row = np.concatenate([np.arange(rows), row])
    x = np.concatenate([np.full(rows, -np.inf), x])
    label = np.concatenate([np.full(rows, NOWHERE), sides.label[own]])
    order = np.lexsort((x, row))
    row, x, label = row[order], x[order], label[order]
    begin = np.ceil(np.clip(x, 0, width + 1) - 0.5).clip(0, width).astype(np.int64)
    stop = np.append(begin[1:], width)
    stop[np.append(row[1:] != row[:-1], True)] = width
    return Runs(label, row, begin, stop - begin)


def inside_ring(ring: Array, rows: int, width: int) -> NDArray[np.bool_]:
    """Return which samples (rows, width) lie in a ring (N, 2), in samples."""
    found = runs(polygon_sides(ring), 0, rows, width)
    return found.spread(found.label >= 0).reshape(rows, width)


MARGIN = 3  # width in texels of the margin around the tile
MOST_TEXELS = 20_000_000  # greatest number of texels in the rasters of all colours together
# The neighbours of a texel, those that share a side last, for the last one counts
_AROUND = ((-1, -1), (-1, 1), (1, -1), (1, 1), (-1, 0), (1, 0), (0, -1), (0, 1))


@dataclass(frozen=True, eq=False)
class Grid:
    """A grid of texels over a tile: texel (i, j) lies at corner + (j + 1/2, i + 1/2) / density."""

    corner: Array  # the corner (2,) in the tile's units
    density: float  # texels per unit
    width: int  # with `height`: the size in texels
    height: int

    @classmethod
    def over(cls, ring: Array, density: float, colours: int) -> Grid:
        """Return a grid over a ring (N, 2), no denser than `MOST_TEXELS` allow for so many colours."""
        size = np.ptp(ring, axis=0)
        most = float(np.sqrt(MOST_TEXELS / colours / size.prod()))
        density = min(density, most)
        width, height = np.ceil(size * density).astype(int) + 2 * MARGIN
        return cls(ring.min(axis=0) - MARGIN / density, density, int(width), int(height))

    def texels(self, points: Array) -> Array:
        """Return points (..., 2) of the tile's units in texels."""
        return (points - self.corner) * self.density

    def inside(self, ring: Array) -> NDArray[np.bool_]:
        """Return which texels (height, width) have their middle in the ring."""
        return inside_ring(self.texels(ring), self.height, self.width)


class Paint:
    """The painting of a tile in five channels (height, width, 5), from which colours are mixed.

    They are red, green and blue, 0 to 1, already times their share; then the shares of the tile's
    own colour and of its ink.
    """

    def __init__(self, grid: Grid) -> None:
        self.grid = grid
        self.values = np.zeros((grid.height, grid.width, 5), dtype=np.float32)
        self.values[..., 3] = 1.0

    def lay(self, rgb: Array, alpha: Array) -> None:
        """Lay colours over all: `rgb` (height, width, 3), already times `alpha` (height, width)."""
        self.values *= (1 - alpha)[..., None]
        self.values[..., :3] += rgb

    def ink(self, alpha: Array) -> None:
        """Lay ink over all, with this opacity (height, width)."""
        self.values *= (1 - alpha)[..., None]
        self.values[..., 4] += alpha

    def bleed(self, inside: NDArray[np.bool_]) -> None:
        """Copy colours from just inside to the texels around, which lookups blend in."""
        known = inside.copy()
        for _ in range(MARGIN - 1):
            wider = np.asarray(
                scipy.ndimage.binary_dilation(known, np.ones((3, 3), dtype=int)), dtype=bool
            )
            rows, columns = np.nonzero(wider & ~known)
            for down, right in _AROUND:
                there = rows + down, columns + right
                near = known[there]
                own = rows[near], columns[near]
                self.values[own] = self.values[there[0][near], there[1][near]]
            known[rows, columns] = True

    def coloured(self, palette: Palette, colours: int, tint: float = 0.0) -> Array:
        """Return the raster (colours, height, width, 3) in each colour of the palette, tinted by it."""
        rgb, own, ink = self.values[..., :3], self.values[..., 3:4], self.values[..., 4:]
        fills, inks = (
            [rgb_of(colour(k)).astype(np.float32) for k in range(colours)]
            for colour in (palette.fill, palette.ink)
        )
        return np.stack(
            [
                rgb * glass(palette.fill(k), tint).astype(np.float32) + own * f + ink * i
                for k, (f, i) in enumerate(zip(fills, inks, strict=True))
            ]
        )


def rgb_of(colour: str) -> Array:
    """Return the colour #rrggbb as three numbers (3,) from 0 to 1."""
    return np.array(rgb(colour)) / 255
