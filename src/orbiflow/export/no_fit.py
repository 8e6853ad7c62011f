"""Where a piece may not be, seen from another: lattices of pieces, and of pairs, from a raster.

The no-fit region of P and Q is the set of translations t for which P and Q + t overlap: on a raster, a
correlation. A lattice is as dense as its shortest vectors allow that lie outside of it.
"""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.signal import fftconvolve

from orbiflow.export.arrangement import Arrangement
from orbiflow.symmetry.isometry import Array

Mask = NDArray[np.bool_]

CELLS = 48
"""Raster cells along a piece."""

DIRECTIONS = 30
"""Of a lattice's first vector that are tried."""

PAIRS = 24
"""Places of the turned piece of a pair that are tried."""

KEPT = 3
"""Best lattices that are handed on, to be drawn tight exactly."""


def lattice_starts(ring: Array, gap: float) -> list[Arrangement]:
    """Dense lattices of the piece, roughly."""
    raster = _Raster(ring, gap)
    found = raster.lattices(raster.same, 1)
    still = np.eye(2)[None]
    return [Arrangement(lattice, still, np.zeros((1, 2))) for _, lattice in found[:KEPT]]


def pair_starts(ring: Array, gap: float) -> list[Arrangement]:
    """Dense lattices of pairs of the piece and the piece turned by 180 degrees, roughly."""
    raster = _Raster(ring, gap)
    found = []
    for place in raster.edge_of(raster.turned):
        # the pair's no-fit region: like with like, and unlike either way round
        there = _shifted(raster.turned, -place)
        pair = raster.same | there | there[::-1, ::-1]
        found += [(area, lattice, place) for area, lattice in raster.lattices(pair, 2)[:1]]
    found.sort(key=lambda item: item[0])
    turns = np.stack([np.eye(2), -np.eye(2)])
    center = raster.center
    return [
        # q = c - (p - c) + w in the raster's frame, whose origin is the piece's centre c
        Arrangement(lattice, turns, np.stack([np.zeros(2), 2 * center + place * raster.cell]))
        for _, lattice, place in found[:KEPT]
    ]


class _Raster:
    """The piece, its no-fit regions with itself and with itself turned, on square cells."""

    def __init__(self, ring: Array, gap: float) -> None:
        self.center = (ring.min(axis=0) + ring.max(axis=0)) / 2
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
        self.same = np.pad(fftconvolve(piece[::-1, ::-1], piece) > 0.5, pad)
        self.turned = np.pad(fftconvolve(piece, piece) > 0.5, pad)
        self.half = (len(self.same) - 1) // 2

    def edge_of(self, region: Mask) -> list[NDArray[np.int64]]:
        """Translations (2,) in cells just outside a region, in all directions."""
        found = []
        for angle in np.arange(PAIRS) * 2 * np.pi / PAIRS:
            found.append(self._first_outside(region, angle))
        return found

    def _first_outside(self, region: Mask, angle: float) -> NDArray[np.int64]:
        way = np.array([np.cos(angle), np.sin(angle)])
        steps = np.round(np.arange(1, self.half + 2)[:, None] * way).astype(int)
        free = np.logical_not(_looked_up(region, steps))
        return steps[int(np.argmax(free))]

    def lattices(self, region: Mask, pieces: int) -> list[tuple[float, Array]]:
        """(area, lattice) in mm of lattices whose vectors lie outside a region, densest first.

        Vectors further on may still lie in it; a cell smaller than so many `pieces` is no lattice.
        """
        half = (len(region) - 1) // 2
        axis = np.arange(-half, half + 1)
        grid = np.stack(np.meshgrid(axis, axis, indexing="ij"), axis=-1)
        found = []
        for angle in np.arange(DIRECTIONS) * np.pi / DIRECTIONS:
            first = self._first_outside(region, angle)
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
                found.append((float(area[place]) * self.cell**2, lattice))
        found.sort(key=lambda item: item[0])
        return found


def _looked_up(region: Mask, steps: NDArray[np.int64]) -> Mask:
    half = (np.array(region.shape) - 1) // 2
    index = steps + half
    known = np.asarray(((index >= 0) & (index < region.shape)).all(axis=1))
    index = np.where(known[:, None], index, 0)
    return known & region[index[:, 0], index[:, 1]]


def _shifted(region: Mask, step: NDArray[np.int64]) -> Mask:
    """The region moved by whole cells; what comes from beyond the raster is free."""
    moved = np.zeros_like(region)
    rows, columns = region.shape
    i, j = int(step[0]), int(step[1])
    if abs(i) < rows and abs(j) < columns:
        moved[max(i, 0) : rows + min(i, 0), max(j, 0) : columns + min(j, 0)] = region[
            max(-i, 0) : rows + min(-i, 0), max(-j, 0) : columns + min(-j, 0)
        ]
    return moved
